// Where each node, shape and edge of a drawn tree goes. Draws nothing. No recursion: a tree may be thousands deep.
//
// `down`: whether the tree grows down, or to the right. `is_open(node)`: whether the children of a node are shown.

import { label, look } from "./looks.js";

export const NAME = 13; // font sizes
export const UNDER = 10.5;
export const LINE = 1.25; // line height
const BETWEEN = 14,
  LEVELS = 42,
  MARGIN = 40; // gaps between nodes, between levels, around all

// What is shown of nodes that stand in reading order, a parent before its children.
export function visible(nodes, is_open) {
  const shown = [];
  for (let at = 0; at < nodes.length;) {
    const node = nodes[at];
    shown.push(node);
    at += is_open(node) ? 1 : 1 + node.below;
  }
  return shown;
}

const brush = document.createElement("canvas").getContext("2d");

function measure(node) {
  if (node.w) return;
  const family = getComputedStyle(document.body).fontFamily;
  const width = (lines, size) => {
    brush.font = `${size}px ${family}`;
    return Math.max(0, ...lines.map((line) => brush.measureText(line).width));
  };
  Object.assign(node, label(node), { shape: look(node).shape, slant: 0 });
  const w = Math.max(width(node.lines, NAME), width(node.under, UNDER), 24);
  const h = (node.lines.length * NAME + node.under.length * UNDER) * LINE;
  node.text_h = h;
  node.w = w + 24;
  node.h = h + 12;
  if (node.shape === "ellipse") {
    node.w = w * 1.16 + 28;
    node.h = h * 1.3 + 10;
  }
  if (node.shape === "parallelogram") {
    node.slant = node.h * 0.6;
    node.w = w + 30 + node.slant;
  }
}

// A node stands in the middle of the room that its children need side by side, but no farther than about half a screen
// from the first of them: a large tree begins where its root is. Returns the width and height of all.
export function lay_out(shown, { down, is_open }) {
  const across = down ? (node) => node.w : (node) => node.h,
    along = down ? (node) => node.h : (node) => node.w;
  const near = down ? 700 : 300,
    levels = [];
  for (const node of shown) {
    measure(node);
    levels[node.depth] = Math.max(levels[node.depth] || 0, along(node));
  }
  for (let at = shown.length - 1; at >= 0; at--) {
    const node = shown[at];
    node.inner = is_open(node) ? node.children.reduce((sum, child) => sum + child.room, 0) : 0;
    node.room = Math.max(across(node) + BETWEEN, node.inner);
  }
  const starts = [MARGIN];
  levels.forEach((size, depth) => starts.push(starts[depth] + size + LEVELS));
  for (const node of shown) {
    if (node.parent < 0) node.from = MARGIN;
    const middle = node.from + Math.min(node.room / 2, near),
      level = starts[node.depth] + levels[node.depth] / 2;
    [node.x, node.y] = down ? [middle, level] : [starts[node.depth] + node.w / 2, middle];
    let from = node.from + (node.room - node.inner) / 2;
    if (node.inner)
      for (const child of node.children) {
        child.from = from;
        from += child.room;
      }
  }
  const length = starts[levels.length] - LEVELS + MARGIN,
    breadth = shown[0].room + 2 * MARGIN;
  return down ? [breadth, length] : [length, breadth];
}

// The line of an edge; and of a shape, which has its middle at 0, 0.

export function edge(parent, child, down) {
  if (down) {
    const from = parent.y + parent.h / 2 + 8,
      to = child.y - child.h / 2,
      mid = (from + to) / 2;
    return `M${parent.x} ${from}C${parent.x} ${mid} ${child.x} ${mid} ${child.x} ${to}`;
  }
  const from = parent.x + (parent.w - parent.slant) / 2,
    to = child.x - child.w / 2,
    bend = to - LEVELS / 2;
  return `M${from} ${parent.y}H${to - LEVELS / 1.5}C${bend} ${parent.y} ${bend} ${child.y} ${to} ${child.y}h${child.slant / 2}`;
}

export function outline(node) {
  const a = node.w / 2,
    b = node.h / 2;
  if (node.shape === "ellipse") return ["ellipse", { rx: a, ry: b }];
  if (node.shape === "box") return ["rect", { x: -a, y: -b, width: 2 * a, height: 2 * b }];
  const cut = node.shape === "octagon" ? b * 0.58 : node.slant;
  const corners =
    node.shape === "octagon"
      ? [
          [-a, b - cut],
          [-a, cut - b],
          [cut - a, -b],
          [a - cut, -b],
          [a, cut - b],
          [a, b - cut],
          [a - cut, b],
          [cut - a, b],
        ]
      : [
          [cut - a, -b],
          [a, -b],
          [a - cut, b],
          [-a, b],
        ];
  return ["polygon", { points: corners.join(" ") }];
}
