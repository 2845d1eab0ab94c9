// How large a drawing is shown, and which part of it: one point stays where the reader looks at it.

export class Camera {
  constructor(view, picture) {
    Object.assign(this, { view, picture, scale: 1, size: [0, 0], offset: [0, 0] });
  }

  resize() {
    const [w, h] = this.size;
    this.picture.setAttribute("viewBox", `0 0 ${w} ${h}`);
    this.picture.setAttribute("width", w * this.scale);
    this.picture.setAttribute("height", h * this.scale);
  }

  // Changes the size, or folds, and keeps a point of the picture where it is.
  keeping(point, change) {
    const place = () => {
      const box = this.picture.getBoundingClientRect(),
        [x, y] = point();
      return [box.left + x * this.scale, box.top + y * this.scale];
    };
    const [x, y] = place();
    const moved = () => {
      const [new_x, new_y] = place();
      return [new_x - x, new_y - y];
    };
    change();
    this.view.scrollBy(...moved());
    const [left, top] = moved(); // what could not be scrolled
    this.shift(this.offset[0] - left, this.offset[1] - top);
  }

  shift(x, y) {
    this.offset = [Math.max(0, x), Math.max(0, y)];
    this.picture.style.margin = `${this.offset[1]}px 0 0 ${this.offset[0]}px`;
  }

  zoom(factor, x, y) {
    const box = this.picture.getBoundingClientRect(),
      frame = this.view.getBoundingClientRect();
    const at = [
      ((x ?? frame.left + frame.width / 2) - box.left) / this.scale,
      ((y ?? frame.top + frame.height / 2) - box.top) / this.scale,
    ];
    this.keeping(
      () => at,
      () => {
        this.scale = Math.min(4, Math.max(0.1, this.scale * factor));
        this.resize();
      },
    );
  }

  // Shows all of it, but not smaller than `least`, and `middle` in the middle.
  fit(least, [x, y]) {
    const { view, size } = this;
    this.scale = Math.max(least, Math.min(1.2, view.clientWidth / size[0], view.clientHeight / size[1]));
    this.resize();
    this.shift((view.clientWidth - size[0] * this.scale) / 2, (view.clientHeight - size[1] * this.scale) / 2);
    view.scrollTo(x * this.scale - view.clientWidth / 2, y * this.scale - view.clientHeight / 2);
  }
}
