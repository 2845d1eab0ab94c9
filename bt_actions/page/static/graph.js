// The drawn tree, as `bt-actions render` draws it to the right: the same shapes and fills, with how each node
// stands as outline and badge. Laid out when something is folded, painted when something happens.

import { svg, status_glyph, FILL } from "./glyphs.js";
import { STATE, kind_word } from "./words.js";
import { is_old } from "./doing.js";

const NAME = 13, UNDER = 10.5, LEVELS = 46, BETWEEN = 12, MARGIN = 28;
const FILLS = { action: "#bfd7ff", fallback: "#8ee3ea", sequence: "#ffc46b", parallel: "#ffe070", decorator: "#f4f4fc", leaf: "#d4d8dd" };

export function create_graph(app) {
  const box = document.getElementById("graph"), root = box.querySelector("svg"), edges = root.querySelector("#edges"), shapes = root.querySelector("#shapes");
  const brush = document.createElement("canvas").getContext("2d");
  let drawn = [], parts = new Map(), scale = 0.86, size = [0, 0], fresh = true;

  function measure(node) {
    if (node.w) return;
    const family = getComputedStyle(document.body).fontFamily, under = node.server ? [node.server.slice(1), kind_word(node)] : [node.kind];
    const width = (line, px) => { brush.font = `${px}px ${family}`; return brush.measureText(line).width; };
    node.label = node.name.length > 30 ? `${node.name.slice(0, 29)}…` : node.name;
    node.under = under;
    const w = Math.max(width(node.label, NAME), ...under.map((line) => width(line, UNDER))), h = NAME * 1.25 + under.length * UNDER * 1.3;
    node.text_h = h;
    node.w = node.shape === "ellipse" ? w * 1.14 + 30 : w + 28 + (node.shape === "parallelogram" ? 24 : 0);
    node.h = node.shape === "ellipse" ? h * 1.24 + 10 : h + 12;
  }

  function layout() {
    const { nodes, order } = app.run;
    drawn = [];
    for (let i = 0; i < order.length;) { drawn.push(order[i]); i += app.folded.has(order[i].id) ? 1 + order[i].below : 1; }
    if (!drawn.length) return;
    const levels = [];
    for (const node of drawn) { measure(node); levels[node.depth] = Math.max(levels[node.depth] || 0, node.w); }
    for (let k = drawn.length - 1; k >= 0; k--) {
      const node = drawn[k], open = node.children.length && !app.folded.has(node.id);
      node.inner = open ? node.children.reduce((sum, kid) => sum + kid.room, 0) : 0;
      node.room = Math.max(node.h + BETWEEN, node.inner);
    }
    const starts = [MARGIN];
    levels.forEach((wide, depth) => starts.push(starts[depth] + wide + LEVELS));
    for (const node of drawn) {
      if (node.parent < 0) node.y0 = MARGIN;
      node.x = starts[node.depth] + node.w / 2;
      node.y = node.y0 + node.room / 2;
      let y = node.y0 + (node.room - node.inner) / 2;
      if (node.inner) for (const kid of node.children) { kid.y0 = y; y += kid.room; }
    }
    size = [starts[levels.length] - LEVELS + MARGIN + 20, nodes[0].room + 2 * MARGIN];
    build();
    resize();
    fresh = true;
  }

  function build() {
    parts = new Map();
    const lines = [], groups = [];
    for (const node of drawn) {
      const group = svg("g", { transform: `translate(${node.x} ${node.y})`, class: "node", "data-n": node.id });
      const a = node.w / 2, b = node.h / 2, halo = { x: -a - 5, y: -b - 5, width: 2 * a + 10, height: 2 * b + 10, rx: 8, class: "halo" };
      group.append(svg("rect", halo), shape(node, a, b));
      let y = -node.text_h / 2 + NAME;
      const label = svg("text", { class: "nm", y });
      label.textContent = node.label;
      group.append(label);
      for (const line of node.under) { y += UNDER * 1.3; const under = svg("text", { class: "un", y }); under.textContent = line; group.append(under); }
      const badge = svg("g", { class: "badge", transform: `translate(${-a - 4} ${-b - 3})` });
      group.append(badge);
      if (node.children.length) {
        const told = app.folded.has(node.id) ? `+${node.below}` : "\u2212", half = Math.max(8, told.length * 3.2 + 4);
        const fold = svg("g", { class: "fold", transform: `translate(${a + half + 1} 0)` }, svg("rect", { class: "knob", x: -half, y: -8, width: 2 * half, height: 16, rx: 8 }));
        const words = svg("text", { y: 3.5 });
        words.textContent = told;
        fold.append(words);
        group.append(fold);
      }
      let line = null;
      if (node.parent >= 0) {
        const up = app.run.nodes[node.parent], x0 = up.x + up.w / 2 + 16, x1 = node.x - a, mid = x1 - LEVELS / 2;
        line = svg("path", { d: `M${x0} ${up.y}H${mid - 8}C${mid + 8} ${up.y} ${mid - 4} ${node.y} ${x1} ${node.y}` });
        lines.push(line);
      }
      parts.set(node.id, { group, badge, line, was: "" });
      groups.push(group);
    }
    edges.replaceChildren(...lines);
    shapes.replaceChildren(...groups);
  }

  function shape(node, a, b) {
    const fill = FILLS[FILL(node)];
    if (node.shape === "ellipse") return svg("ellipse", { rx: a, ry: b, fill, class: "shape" });
    if (node.shape === "box") return svg("rect", { x: -a, y: -b, width: 2 * a, height: 2 * b, fill, class: "shape" });
    const c = node.shape === "octagon" ? b * 0.55 : 14;
    const corners = node.shape === "octagon" ? [[-a, b - c], [-a, c - b], [c - a, -b], [a - c, -b], [a, c - b], [a, b - c], [a - c, b], [c - a, b]] : [[c - a, -b], [a, -b], [a - c, b], [-a, b]];
    return svg("polygon", { points: corners.join(" "), fill, class: "shape" });
  }

  function resize() { root.setAttribute("viewBox", `0 0 ${size[0]} ${size[1]}`); root.setAttribute("width", size[0] * scale); root.setAttribute("height", size[1] * scale); }
  function zoom(by) { const at = [(box.scrollLeft + box.clientWidth / 2) / scale, (box.scrollTop + box.clientHeight / 2) / scale]; scale = by === "fit" ? Math.max(0.2, Math.min(1.2, (box.clientWidth - 8) / size[0], (box.clientHeight - 8) / size[1])) : Math.min(3, Math.max(0.2, scale * by)); resize(); box.scrollTo(at[0] * scale - box.clientWidth / 2, at[1] * scale - box.clientHeight / 2); }

  function update() {
    if (app.view !== "graph") return;
    const { s, run } = app;
    for (const [n, part] of parts) {
      const view = run.view(n, s), status = is_old(run, n, s) ? "idle" : s.status[n], [word, look] = STATE[view.st], key = `${status}${look}${app.sel === n}`;
      if (part.was === key) continue;
      part.was = key;
      part.group.setAttribute("class", `node ${status}${app.sel === n ? " picked" : ""}`);
      part.badge.replaceChildren();
      if (status !== "idle") { part.badge.append(svg("circle", { class: "disc", cx: 7, cy: 7, r: 10 }), status_glyph(look, { width: 14, height: 14 })); }
      part.group.setAttribute("aria-label", `${run.nodes[n].name}, ${word}`);
      part.line?.setAttribute("class", status === "running" ? "live" : status === "failure" ? "bad" : "");
    }
    if (fresh) { fresh = false; show(app.sel); }
  }
  function show(n) { const node = app.run.nodes[n]; if (!node || !parts.has(n)) return; box.scrollTo(Math.max(0, node.x * scale - box.clientWidth * 0.62), node.y * scale - box.clientHeight / 2); }

  let grip = null;
  box.addEventListener("click", (event) => {
    const zoomed = event.target.closest("[data-zoom]");
    if (zoomed) return zoom(zoomed.dataset.zoom === "fit" ? "fit" : +zoomed.dataset.zoom);
    const group = event.target.closest(".node");
    if (!group) return;
    const n = +group.dataset.n, node = app.run.nodes[n];
    if (event.target.closest(".fold")) {
      const before = [node.x * scale - box.scrollLeft, node.y * scale - box.scrollTop];
      if (!app.folded.delete(n)) app.folded.add(n);
      app.refolded();
      fresh = false;
      box.scrollTo(node.x * scale - before[0], node.y * scale - before[1]);
      app.touch();
    } else app.select(n);
  });
  box.addEventListener("pointerdown", (event) => { if (event.pointerType === "mouse" && !event.target.closest(".node, button")) { grip = [event.clientX, event.clientY]; box.classList.add("dragged"); box.setPointerCapture(event.pointerId); } });
  box.addEventListener("pointermove", (event) => { if (grip) { box.scrollBy(grip[0] - event.clientX, grip[1] - event.clientY); grip = [event.clientX, event.clientY]; } });
  for (const name of ["pointerup", "pointercancel"]) box.addEventListener(name, () => { grip = null; box.classList.remove("dragged"); });
  box.addEventListener("wheel", (event) => { if (event.ctrlKey) { event.preventDefault(); zoom(Math.exp(-event.deltaY / 300)); } }, { passive: false });
  return { update, layout, show };
}
