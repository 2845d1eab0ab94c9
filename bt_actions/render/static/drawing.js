// A drawn tree: its nodes and edges as SVG, and how a reader moves it. A page adds what more it knows of a node.

import { svg } from "./dom.js";
import { look } from "./looks.js";
import { LINE, NAME, UNDER, outline } from "./layout.js";

export function group_of(node, { down, is_open }) {
  const [name, attributes] = outline(node),
    group = svg("g", { class: "node", transform: `translate(${node.x} ${node.y})` });
  group.append(svg(name, { class: "shape", fill: look(node).fill, ...attributes }));
  let y = -node.text_h / 2;
  const write = (line, kind, height) => {
    group.append(svg("text", { class: kind, y: y + height }, line));
    y += height * LINE;
  };
  for (const line of node.lines) write(line, "name", NAME);
  for (const line of node.under) write(line, "under", UNDER);
  if (!node.children.length) return group;
  const told = is_open(node) ? "\u2212" : `+${node.below}`,
    half = Math.max(8, told.length * 3.2 + 4);
  const [x, at] = down ? [0, node.h / 2 + 8] : [(node.w - node.slant) / 2 + half, 0],
    [left, top] = down ? [-half - 4, -8] : [-half, -12];
  group.append(
    svg(
      "g",
      { class: "fold", "aria-hidden": "true", transform: `translate(${x} ${at})` },
      svg("rect", { class: "area", x: left, y: top, width: 2 * half + (down ? 8 : 4), height: 24 }),
      svg("rect", { class: "knob", x: -half, y: -8, width: 2 * half, height: 16, rx: 8 }),
      svg("text", { y: 3.5 }, told),
    ),
  );
  return group;
}

// A mouse that is pressed where no node is drags the drawing in its box, and Ctrl and the wheel zoom.
export function movable(box, zoom) {
  let grip = null;
  box.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "mouse" || event.button || event.target.closest(".node, button")) return;
    const { left, top } = box.getBoundingClientRect();
    if (event.clientX > left + box.clientWidth || event.clientY > top + box.clientHeight) return; // scroll bars
    grip = [event.clientX, event.clientY];
    box.classList.add("dragged");
    box.setPointerCapture(event.pointerId);
  });
  box.addEventListener("pointermove", (event) => {
    if (!grip) return;
    box.scrollBy(grip[0] - event.clientX, grip[1] - event.clientY);
    grip = [event.clientX, event.clientY];
  });
  for (const name of ["pointerup", "pointercancel"])
    box.addEventListener(name, () => {
      grip = null;
      box.classList.remove("dragged");
    });
  box.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      zoom(Math.exp(-event.deltaY / 300), event.clientX, event.clientY);
    },
    { passive: false },
  );
}
