// What the reader of a drawn tree sees and does: folding, searching, the card of the node that is pointed at or focused.
// Everything from the tree is set as text or as a number, never as markup. Loads and stores nothing.

import { svg } from "./dom.js";
import { edge, lay_out, visible } from "./layout.js";
import { group_of, movable } from "./drawing.js";
import { fill } from "./card.js";

const LINGER = 200;                               // ms that a card outlives the pointer
const find = (id) => document.getElementById(id);
const view = find("view"), picture = find("tree"), card = find("card");
const data = JSON.parse(find("data").textContent), { nodes, down } = data;
const how = { down, is_open: (node) => node.open };

// `nodes` are in reading order: a parent comes before its children.
nodes.forEach((node, index) => {
  const parent = nodes[node.parent];
  Object.assign(node, { index, depth: parent ? parent.depth + 1 : 0, children: [] });
  node.place_in = parent ? parent.children.push(node) : 1;
  node.words = [node.name, node.kind, node.server, node.type, node.place || ""].join("\n").toLowerCase();
});
for (let index = nodes.length - 1; index >= 0; index--) {
  const node = nodes[index];
  node.below = node.children.reduce((sum, child) => sum + child.below + 1, 0);
}

// The drawing.

let scale = 1, size = [0, 0], offset = [0, 0], drawn = [], current = nodes[0], hovered = null, shut = true, hits = [];

function draw() {
  drawn = visible(nodes, how.is_open);
  size = lay_out(drawn, how);
  find("edges").replaceChildren(...drawn.slice(1).map((node) => svg("path", { d: edge(nodes[node.parent], node, down) })));
  find("nodes").replaceChildren(...drawn.map((node) => {
    const group = group_of(node, how), attributes = {
      id: `n${node.index}`, role: "treeitem", tabindex: node === current ? 0 : -1,
      "aria-level": node.depth + 1, "aria-posinset": node.place_in,
      "aria-setsize": node.index ? nodes[node.parent].children.length : 1,
      "aria-label": [node.name, ...(node.under[0] === node.kind ? node.under : [node.kind, ...node.under])].join(", "),
    };
    if (node.children.length) attributes["aria-expanded"] = node.open;
    for (const [key, value] of Object.entries(attributes)) group.setAttribute(key, value);
    return group;
  }));
  resize();
  mark();
}

const element = (node) => find(`n${node.index}`);
const node_at = (target) => nodes[target.closest?.(".node")?.id.slice(1)];

function mark() {
  const shown = card.hidden ? null : hovered || current, hit = new Set(hits);
  drawn.forEach((node) => {
    element(node).classList.toggle("shown", node === shown);
    element(node).classList.toggle("hit", hit.has(node));
  });
}

function resize() {
  const [w, h] = size;
  picture.setAttribute("viewBox", `0 0 ${w} ${h}`);
  picture.setAttribute("width", w * scale);
  picture.setAttribute("height", h * scale);
}

// Change the size, or fold, and keep one point of the picture where the reader looks at it.

function keeping(point, change) {
  const place = () => {
    const box = picture.getBoundingClientRect(), [x, y] = point();
    return [box.left + x * scale, box.top + y * scale];
  };
  const [x, y] = place(), moved = () => { const [new_x, new_y] = place(); return [new_x - x, new_y - y]; };
  change();
  view.scrollBy(...moved());
  const [left, top] = moved();  // what could not be scrolled
  shift(offset[0] - left, offset[1] - top);
}

function shift(x, y) {
  offset = [Math.max(0, x), Math.max(0, y)];
  picture.style.margin = `${offset[1]}px 0 0 ${offset[0]}px`;
}

function zoom(factor, x, y) {
  const box = picture.getBoundingClientRect(), frame = view.getBoundingClientRect();
  const at = [
    ((x ?? frame.left + frame.width / 2) - box.left) / scale,
    ((y ?? frame.top + frame.height / 2) - box.top) / scale,
  ];
  keeping(() => at, () => { scale = Math.min(4, Math.max(0.1, scale * factor)); resize(); });
  show();
}

function fit(least) {
  scale = Math.max(least, Math.min(1.2, view.clientWidth / size[0], view.clientHeight / size[1]));
  resize();
  shift((view.clientWidth - size[0] * scale) / 2, (view.clientHeight - size[1] * scale) / 2);
  const [root] = nodes;
  view.scrollTo(down ? root.x * scale - view.clientWidth / 2 : 0, down ? 0 : root.y * scale - view.clientHeight / 2);
}

function toggle(node, open = !node.open) {
  if (!node.children.length || node.open === open) return;
  node.open = open;
  keeping(() => [node.x, node.y], draw);
}

function reveal(node) {
  let above = nodes[node.parent];
  for (; above; above = nodes[above.parent]) above.open = true;
}

function go_to(node, focus = true) {
  current = node;
  if (!drawn.includes(node)) { reveal(node); draw(); }
  drawn.forEach((one) => element(one).setAttribute("tabindex", one === node ? 0 : -1));
  if (focus) element(node).focus({ preventScroll: true });
  const box = element(node).getBoundingClientRect(), frame = view.getBoundingClientRect(), room = 24;
  const way = (low, high, from, to) => (low < from + room ? low - from - room : high > to - room ? high - to + room : 0);
  view.scrollBy(way(box.left, box.right, frame.left, frame.right), way(box.top, box.bottom, frame.top, frame.bottom));
}

// Go to a node and show its card, which on a small screen takes room from the view: then once more.

function present(node, focus) {
  go_to(node, focus);
  hovered = null;
  shut = false;
  show();
  go_to(node, focus);
}

// The card.

let filled = null;
function show() {
  const node = hovered || (shut ? null : current);
  card.hidden = !node || !drawn.includes(node);
  if (!card.hidden) {
    if (filled !== node) fill(card, node, nodes, data.tables);
    filled = node;
    const box = element(node).querySelector(".shape").getBoundingClientRect(), gap = 14;
    const wide = document.documentElement.clientWidth, high = document.documentElement.clientHeight;
    const right = box.right + gap + card.offsetWidth < wide, left = box.left - gap - card.offsetWidth > 0;
    let x = box.right + gap, y = box.top;
    if (!right && left) x = box.left - gap - card.offsetWidth;
    if (!right && !left) {
      x = box.left;
      y = box.bottom + gap + card.offsetHeight < high ? box.bottom + gap : box.top - gap - card.offsetHeight;
    }
    card.style.left = `${Math.max(8, Math.min(x, wide - card.offsetWidth - 8))}px`;
    card.style.top = `${Math.max(8, Math.min(y, high - card.offsetHeight - 8))}px`;
  }
  mark();
}

let leaving = 0, pointer = "";
function hover(node) {
  clearTimeout(leaving);
  if (node && node !== hovered) { hovered = node; show(); }
  if (!node && hovered) leaving = setTimeout(() => { hovered = null; show(); }, LINGER);
}
document.addEventListener("pointermove", (event) => {
  const where = `${event.clientX} ${event.clientY}`;  // a scroll under a pointer at rest is no move
  if (event.pointerType === "touch" || where === pointer || view.classList.contains("dragged")) return;
  pointer = where;
  hover(card.contains(event.target) ? hovered : node_at(event.target));
});
document.documentElement.addEventListener("pointerleave", () => hover(null));

// Pointer: a click on a knob folds, on a node keeps its card, on the ground closes it; a drag moves.

view.addEventListener("click", (event) => {
  const node = node_at(event.target);
  if (node) {
    const folds = event.target.closest(".fold");
    if (folds) toggle(node);
    else shut = false;
    go_to(node);
  } else shut = true;
  hovered = null;
  show();
  if (node) go_to(node);  // a card at the foot of a small screen has taken room from the view
});
view.addEventListener("dblclick", (event) => {
  const node = node_at(event.target);
  if (node && !event.target.closest(".fold")) { toggle(node); go_to(node); show(); }
});
movable(view, zoom);
view.addEventListener("scroll", () => { if (!card.hidden) show(); }, { passive: true });
window.addEventListener("resize", () => {  // a phone that is turned, or opens its keyboard
  show();
  if (!shut) go_to(current, false);
});

// Keyboard, as the pattern for trees has it (WAI-ARIA).

picture.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const at = drawn.indexOf(current), { children, open, parent } = current;
  const keys = {
    ArrowDown: () => go_to(drawn[Math.min(at + 1, drawn.length - 1)]),
    ArrowUp: () => go_to(drawn[Math.max(at - 1, 0)]),
    ArrowRight: () => { if (children.length && open) go_to(children[0]); else { toggle(current, true); go_to(current); } },
    ArrowLeft: () => { if (children.length && open) { toggle(current, false); go_to(current); } else if (parent >= 0) go_to(nodes[parent]); },
    Home: () => go_to(drawn[0]),
    End: () => go_to(drawn.at(-1)),
    Enter: () => { toggle(current); go_to(current); },
    " ": () => { toggle(current); go_to(current); },
  };
  if (!(event.key in keys)) return;
  event.preventDefault();
  keys[event.key]();
  present(current);
});
view.addEventListener("focusin", (event) => {  // on the SVG it would make that focusable
  const node = node_at(event.target);
  if (node && event.target.matches(":focus-visible")) { current = node; shut = false; show(); }
});
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !card.hidden) {
    const inside = card.contains(document.activeElement);
    hovered = null;
    shut = true;
    show();
    if (inside) element(current).focus();
  }
  if (event.target.matches?.("input") || event.ctrlKey || event.metaKey || event.altKey) return;
  const keys = { "/": () => find("query").focus(), "+": () => zoom(1.25), "-": () => zoom(0.8), 0: () => fit(0.1) };
  if (!(event.key in keys)) return;
  event.preventDefault();
  keys[event.key]();
});

// The bar.

let next = -1;
function search() {
  const wanted = find("query").value.trim().toLowerCase();
  hits = wanted ? nodes.filter((node) => node.words.includes(wanted)) : [];
  next = -1;
  find("found").textContent = wanted ? `${hits.length} found` : "";
  mark();
}
find("query").addEventListener("input", search);
find("search").addEventListener("submit", (event) => event.preventDefault());
find("query").addEventListener("keydown", (event) => {
  if (event.key !== "Enter" || !hits.length) return;
  next = (next + (event.shiftKey ? -1 : 1) + hits.length) % hits.length;
  find("found").textContent = `${next + 1} of ${hits.length}`;
  present(hits[next], false);
});

function refold(depth) {
  for (const node of nodes) node.open = node.depth < depth;
  current = nodes[0];
  shut = true;
  draw();
  fit(0.7);
  show();
}
find("unfold").addEventListener("click", () => refold(data.unfold));
find("fold").addEventListener("click", () => refold(data.open < data.unfold ? data.open : 1));
find("smaller").addEventListener("click", () => zoom(0.8));
find("larger").addEventListener("click", () => zoom(1.25));
find("fit").addEventListener("click", () => fit(0.1));

const system = matchMedia("(prefers-color-scheme: dark)"), page = document.documentElement;
const is_dark = () => (page.dataset.theme ? page.dataset.theme === "dark" : system.matches);
const told = () => find("theme").setAttribute("aria-pressed", is_dark());
find("theme").addEventListener("click", () => { page.dataset.theme = is_dark() ? "light" : "dark"; told(); });
system.addEventListener("change", told);
told();

["bar", "view", "hint"].forEach((id) => { find(id).hidden = false; });
refold(data.open);
