// What the reader of a drawn tree sees and does: folding, searching, the card of the node that is pointed at or focused.
// Everything from the tree is set as text or as a number, never as markup. Loads and stores nothing.

import { svg } from "./dom.js";
import { edge, lay_out, visible } from "./layout.js";
import { group_of, movable } from "./drawing.js";
import { Camera } from "./camera.js";
import { fill, place } from "./card.js";
import { create_search, create_theme } from "./bar.js";

const LINGER = 200; // ms that a card outlives the pointer
const find = (id) => document.getElementById(id);
const view = find("view"),
  picture = find("tree"),
  card = find("card");
const data = JSON.parse(find("data").textContent),
  { nodes, down } = data;
const camera = new Camera(view, picture);
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

let drawn = [],
  current = nodes[0],
  hovered = null,
  shut = true,
  hits = [];

function draw() {
  drawn = visible(nodes, how.is_open);
  camera.size = lay_out(drawn, how);
  find("edges").replaceChildren(
    ...drawn.slice(1).map((node) => svg("path", { d: edge(nodes[node.parent], node, down) })),
  );
  find("nodes").replaceChildren(
    ...drawn.map((node) => {
      const group = group_of(node, how),
        attributes = {
          id: `n${node.index}`,
          role: "treeitem",
          tabindex: node === current ? 0 : -1,
          "aria-level": node.depth + 1,
          "aria-posinset": node.place_in,
          "aria-setsize": node.index ? nodes[node.parent].children.length : 1,
          "aria-label": [node.name, ...(node.under[0] === node.kind ? node.under : [node.kind, ...node.under])].join(
            ", ",
          ),
        };
      if (node.children.length) attributes["aria-expanded"] = node.open;
      for (const [key, value] of Object.entries(attributes)) group.setAttribute(key, value);
      return group;
    }),
  );
  camera.resize();
  mark();
}

const element = (node) => find(`n${node.index}`);
const node_at = (target) => nodes[target.closest?.(".node")?.id.slice(1)];

function mark() {
  const shown = card.hidden ? null : hovered || current,
    hit = new Set(hits);
  drawn.forEach((node) => {
    element(node).classList.toggle("shown", node === shown);
    element(node).classList.toggle("hit", hit.has(node));
  });
}

function zoom(...how_far) {
  camera.zoom(...how_far);
  show();
}
function fit(least) {
  const [root] = nodes;
  camera.fit(least, down ? [root.x, 0] : [0, root.y]);
}

function toggle(node, open = !node.open) {
  if (!node.children.length || node.open === open) return;
  node.open = open;
  camera.keeping(() => [node.x, node.y], draw);
}

function reveal(node) {
  let above = nodes[node.parent];
  for (; above; above = nodes[above.parent]) above.open = true;
}

function go_to(node, focus = true) {
  current = node;
  if (!drawn.includes(node)) {
    reveal(node);
    draw();
  }
  drawn.forEach((one) => element(one).setAttribute("tabindex", one === node ? 0 : -1));
  if (focus) element(node).focus({ preventScroll: true });
  const box = element(node).getBoundingClientRect(),
    frame = view.getBoundingClientRect(),
    room = 24;
  const way = (low, high, from, to) =>
    low < from + room ? low - from - room : high > to - room ? high - to + room : 0;
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
    place(card, element(node).querySelector(".shape").getBoundingClientRect());
  }
  mark();
}

let leaving = 0,
  pointer = "";
function hover(node) {
  clearTimeout(leaving);
  if (node && node !== hovered) {
    hovered = node;
    show();
  }
  if (!node && hovered)
    leaving = setTimeout(() => {
      hovered = null;
      show();
    }, LINGER);
}
document.addEventListener("pointermove", (event) => {
  const where = `${event.clientX} ${event.clientY}`; // a scroll under a pointer at rest is no move
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
  if (node) go_to(node); // a card at the foot of a small screen has taken room from the view
});
view.addEventListener("dblclick", (event) => {
  const node = node_at(event.target);
  if (node && !event.target.closest(".fold")) {
    toggle(node);
    go_to(node);
    show();
  }
});
movable(view, zoom);
view.addEventListener(
  "scroll",
  () => {
    if (!card.hidden) show();
  },
  { passive: true },
);
window.addEventListener("resize", () => {
  // a phone that is turned, or opens its keyboard
  show();
  if (!shut) go_to(current, false);
});

// Keyboard, as the pattern for trees has it (WAI-ARIA).

picture.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const at = drawn.indexOf(current),
    { children, open, parent } = current;
  const keys = {
    ArrowDown: () => go_to(drawn[Math.min(at + 1, drawn.length - 1)]),
    ArrowUp: () => go_to(drawn[Math.max(at - 1, 0)]),
    ArrowRight: () => {
      if (children.length && open) go_to(children[0]);
      else {
        toggle(current, true);
        go_to(current);
      }
    },
    ArrowLeft: () => {
      if (children.length && open) {
        toggle(current, false);
        go_to(current);
      } else if (parent >= 0) go_to(nodes[parent]);
    },
    Home: () => go_to(drawn[0]),
    End: () => go_to(drawn.at(-1)),
    Enter: () => {
      toggle(current);
      go_to(current);
    },
    " ": () => {
      toggle(current);
      go_to(current);
    },
  };
  if (!(event.key in keys)) return;
  event.preventDefault();
  keys[event.key]();
  present(current);
});
view.addEventListener("focusin", (event) => {
  // on the SVG it would make that focusable
  const node = node_at(event.target);
  if (node && event.target.matches(":focus-visible")) {
    current = node;
    shut = false;
    show();
  }
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

create_search(
  nodes,
  (found) => {
    hits = found;
    mark();
  },
  (node) => present(node, false),
);
create_theme();

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

["bar", "view", "hint"].forEach((id) => {
  find(id).hidden = false;
});
refold(data.open);
