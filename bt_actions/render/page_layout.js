// The tree of a page, what of it is unfolded, and where each node, shape and edge goes. Draws nothing:
// page.js, which follows in the same script, does. No recursion: a tree may be thousands deep.

const NAME = 13, UNDER = 10.5, LINE = 1.25;       // font sizes and line height, as in page.css
const BETWEEN = 14, LEVELS = 42, MARGIN = 40;     // gaps between nodes, between levels, around all
const data = JSON.parse(document.getElementById("data").textContent);
const nodes = data.nodes, down = data.down;
const NEAR = down ? 700 : 300;                    // how far a node may stand from where its room begins

// The tree. `nodes` are in reading order: a parent comes before its children.

nodes.forEach((node, index) => {
  const parent = nodes[node.parent];
  node.index = index;
  node.depth = parent ? parent.depth + 1 : 0;
  node.children = [];
  node.place_in = parent ? parent.children.push(node) : 1;
  node.words = [node.name, node.kind, ...node.under, node.place || ""].join("\n").toLowerCase();
});
for (let index = nodes.length - 1; index >= 0; index--) {
  const node = nodes[index];
  node.below = node.children.reduce((sum, child) => sum + child.below + 1, 0);
}
const fold_at = (depth) => nodes.forEach((node) => { node.open = node.depth < depth; });

function visible() {
  const shown = [];
  for (let index = 0; index < nodes.length; ) {
    const node = nodes[index];
    shown.push(node);
    index += node.open ? 1 : 1 + node.below;
  }
  return shown;
}

// The layout: a node stands in the middle of the room that its children need side by side, but no
// farther than about half a screen from the first of them: a large tree begins where its root is.

const brush = document.createElement("canvas").getContext("2d");
const family = getComputedStyle(document.body).fontFamily;

function measure(node) {
  if (node.w) return;
  const width = (lines, size) => {
    brush.font = `${size}px ${family}`;
    return Math.max(0, ...lines.map((line) => brush.measureText(line).width));
  };
  const w = Math.max(width(node.lines, NAME), width(node.under, UNDER), 24);
  const h = (node.lines.length * NAME + node.under.length * UNDER) * LINE;
  node.text_h = h;
  node.w = w + 24;
  node.h = h + 12;
  node.slant = 0;
  if (node.shape === "ellipse") { node.w = w * 1.16 + 28; node.h = h * 1.3 + 10; }
  if (node.shape === "parallelogram") { node.slant = node.h * 0.6; node.w = w + 30 + node.slant; }
}

function lay_out(shown) {
  const across = down ? (node) => node.w : (node) => node.h;
  const along = down ? (node) => node.h : (node) => node.w;
  const levels = [];
  shown.forEach((node) => {
    measure(node);
    levels[node.depth] = Math.max(levels[node.depth] || 0, along(node));
  });
  for (let at = shown.length - 1; at >= 0; at--) {
    const node = shown[at];
    node.inner = node.open ? node.children.reduce((sum, child) => sum + child.room, 0) : 0;
    node.room = Math.max(across(node) + BETWEEN, node.inner);
  }
  const starts = [MARGIN];
  levels.forEach((size, depth) => starts.push(starts[depth] + size + LEVELS));
  shown.forEach((node) => {
    if (!node.index) node.from = MARGIN;
    const middle = node.from + Math.min(node.room / 2, NEAR), level = starts[node.depth] + levels[node.depth] / 2;
    [node.x, node.y] = down ? [middle, level] : [starts[node.depth] + node.w / 2, middle];
    let from = node.from + (node.room - node.inner) / 2;
    if (node.open) node.children.forEach((child) => { child.from = from; from += child.room; });
  });
  const length = starts[levels.length] - LEVELS + MARGIN, breadth = nodes[0].room + 2 * MARGIN;
  return down ? [breadth, length] : [length, breadth];
}

// The lines of an edge and of a shape; a shape has its middle at 0, 0.

function edge(parent, child) {
  if (down) {
    const from = parent.y + parent.h / 2 + 8, to = child.y - child.h / 2, mid = (from + to) / 2;
    return `M${parent.x} ${from}C${parent.x} ${mid} ${child.x} ${mid} ${child.x} ${to}`;
  }
  const from = parent.x + (parent.w - parent.slant) / 2, to = child.x - child.w / 2, bend = to - LEVELS / 2;
  return `M${from} ${parent.y}H${to - LEVELS / 1.5}C${bend} ${parent.y} ${bend} ${child.y} ${to} ${child.y}h${child.slant / 2}`;
}

function outline(node) {
  const a = node.w / 2, b = node.h / 2;
  if (node.shape === "ellipse") return ["ellipse", { rx: a, ry: b }];
  if (node.shape === "box") return ["rect", { x: -a, y: -b, width: 2 * a, height: 2 * b }];
  const cut = node.shape === "octagon" ? b * 0.58 : node.slant;
  const corners = node.shape === "octagon"
    ? [[-a, b - cut], [-a, cut - b], [cut - a, -b], [a - cut, -b], [a, cut - b], [a, b - cut], [a - cut, b], [cut - a, b]]
    : [[cut - a, -b], [a, -b], [a - cut, b], [-a, b]];
  return ["polygon", { points: corners.join(" ") }];
}
