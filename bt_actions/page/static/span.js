// Which part of a run the timeline shows, and where each time of that stands. The run's scale squeezes gaps. The right end
// grows in steps, never by the frame.

const STEP = 15;

export class Span {
  constructor() {
    Object.assign(this, { scale: null, from: 0, to: STEP, width: 0, left: 0, tall: 0, begins: 0, ends: 0 });
  }

  get right() {
    return this.left + this.width;
  }
  x_of(t) {
    return this.left + ((this.scale.to(t) - this.from) / (this.to - this.from)) * this.width;
  }
  t_of(x) {
    return this.scale.back(this.from + ((x - this.left) / this.width) * (this.to - this.from));
  }

  fit(app) {
    const { run, head } = app;
    this.scale = run.scale(head, app.squeeze);
    const all = this.scale.to(head);
    const end = run.over ? all * 1.012 : Math.max(STEP, Math.ceil((all + STEP * 0.12) / STEP) * STEP);
    const seconds = app.zoomed ? Math.min(end, app.zoomed) : end;
    if (app.zoomed) {
      const at = this.scale.to(app.t);
      if (app.at_head && at > this.from + seconds * 0.94) this.from = at - seconds * 0.8;
      if (at < this.from || at > this.from + seconds) this.from = at - seconds / 2;
      this.from = Math.max(0, Math.min(this.from, end - seconds));
    } else this.from = 0;
    this.to = this.from + seconds;
    this.begins = this.scale.back(this.from);
    this.ends = this.scale.back(this.to);
  }

  // `by` is a factor, and 0 shows all.
  zoom(app, by) {
    const seconds = (this.to - this.from) * by,
      at = this.scale.to(app.t);
    app.zoomed = by === 0 || seconds >= this.scale.to(app.head) * 1.05 ? null : Math.max(4, seconds);
    if (app.zoomed) this.from = at - (at - this.from) * by;
    app.touch();
  }

  // What the place of everything depends on.
  get key() {
    return `${this.from}|${this.to}|${this.width}|${this.left}|${this.tall}|${this.scale.gaps.map((gap) => gap.from)}`;
  }
}
