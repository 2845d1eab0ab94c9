// The shapes: what kind a node is, and how it stands. A status never rests on colour alone: each has an outline of its
// own, and its word beside it.

import { svg } from "./dom.js";
import { look } from "./looks.js";

const KIND = {
  octagon: "M4.5 1.5h9l3 3v5l-3 3h-9l-3-3v-5z",
  box: "M1.5 1.5h15v11h-15z",
  parallelogram: "M5.5 1.5h11l-4 11h-11z",
  ellipse: "M9 1.5c4.6 0 7.5 2.4 7.5 5.500s-2.900 5.500-7.500 5.500-7.500-2.400-7.500-5.500 2.900-5.500 7.500-5.500z",
};
const INSIDE = {
  octagon: "M7.600 5.400a1.600 1.600 0 1 1 2.200 1.500c-.6.3-.8.5-.8 1.100M9 10v.2",
  box: "M5.500 7h6M9.500 5l2 2-2 2",
  parallelogram: "M6 5.500h6M6 8.500h6",
};
export function kind_glyph(node) {
  const { shape, fill } = look(node);
  return svg(
    "svg",
    { viewBox: "0 0 18 14", class: "kind", "aria-hidden": "true" },
    svg("path", { d: KIND[shape], fill }),
    ...(INSIDE[shape] ? [svg("path", { d: INSIDE[shape], class: "in" })] : []),
  );
}

const line = (d) => ["path", { d, class: "line" }],
  cut = (d) => ["path", { d, class: "cut" }];
const LOOK = {
  idle: [["circle", { cx: 7, cy: 7, r: 3.2, class: "line" }]],
  running: [
    ["circle", { cx: 7, cy: 7, r: 6.2, class: "ring" }],
    ["path", { d: "M5.300 3.800v6.400l5-3.200z", class: "fill" }],
  ],
  waiting: [
    line(
      "M3 1.500h8M3 12.500h8M4 1.800c0 2.600 1.200 3.800 3 5.200-1.800 1.400-3 2.600-3 5.200M10 1.800c0 2.600-1.200 3.800-3 5.200 1.800 1.400 3 2.600 3 5.200",
    ),
  ],
  backoff: [line("M2.600 5.200a5 5 0 1 1-.5 3M2.200 2v3.400h3.400M7 4.300v3l2 1.200")],
  success: [["circle", { cx: 7, cy: 7, r: 6.5, class: "fill" }], cut("M4 7.200l2.200 2.200 3.900-4.400")],
  failure: [
    ["rect", { x: 0.8, y: 0.8, width: 12.4, height: 12.4, rx: 2, class: "fill" }],
    cut("M4.300 4.300l5.400 5.400M9.700 4.300l-5.400 5.400"),
  ],
  stopped: [["circle", { cx: 7, cy: 7, r: 5.7, class: "line" }], line("M3 11L11 3")],
  cancel: [line("M4.400.8h5.200l3.600 3.600v5.200l-3.600 3.600H4.400L.8 9.600V4.400z"), line("M4.400 7h5.200")],
};
export const status_glyph = (look, attributes = {}) =>
  svg(
    "svg",
    { viewBox: "0 0 14 14", class: `st st-${look}`, "aria-hidden": "true", ...attributes },
    ...LOOK[look].map(([name, of]) => svg(name, of)),
  );

const box = (x) => ["rect", { x, y: 3.5, width: 9, height: 9, rx: 1.5 }];
const ICON = {
  play: [["path", { d: "M4.500 2.500v11l9-5.500z" }]],
  pause: [["path", { d: "M4 2.500h3v11H4zM9.500 2.500h3v11h-3z" }]],
  prev: [["path", { d: "M3 3h2v10H3zM13 3v10L6 8z" }]],
  next: [["path", { d: "M11 3h2v10h-2zM3 3v10l7-5z" }]],
  prev_fail: [["path", { d: "M7 3v10L1 8z" }], box(9), ["path", { class: "cutout", d: "M11.500 6l4 4M15.500 6l-4 4" }]],
  next_fail: [["path", { d: "M13 3v10l6-5z" }], box(2), ["path", { class: "cutout", d: "M4.500 6l4 4M8.500 6l-4 4" }]],
  sun: [
    [
      "path",
      {
        class: "stroke",
        d: "M5 8a3 3 0 1 0 6 0a3 3 0 1 0-6 0M8 1v2M8 13v2M1 8h2M13 8h2M3 3l1.400 1.400M11.600 11.600L13 13M3 13l1.400-1.400M11.600 4.400L13 3",
      },
    ],
  ],
  moon: [["path", { class: "stroke", d: "M13.500 9.800A6 6 0 0 1 6.200 2.500a6 6 0 1 0 7.300 7.300z" }]],
};
export const icon = (name) =>
  svg(
    "svg",
    { viewBox: name.endsWith("fail") ? "0 0 20 16" : "0 0 16 16", "aria-hidden": "true" },
    ...ICON[name].map(([tag, of]) => svg(tag, of)),
  );
