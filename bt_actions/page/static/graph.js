// The drawn tree, with how each node stands as outline and badge. Laid out when something is folded, painted when
// something happens. Whoever sees no drawing has the outline, which says the same.

import { svg } from "./dom.js";
import { status_glyph } from "./glyphs.js";
import { STATE } from "./words.js";
import { is_old } from "./doing.js";
import { edge, lay_out, visible } from "./layout.js";
import { group_of, movable } from "./drawing.js";

export function create_graph(app) {
  const box = document.getElementById("graph"),
    root = box.querySelector("svg"),
    edges = root.querySelector("#edges"),
    shapes = root.querySelector("#shapes");
  const how = { down: false, is_open: (node) => !app.folded.has(node.id) };
  let parts = new Map(),
    scale = 0.86,
    size = [0, 0],
    fresh = true;

  function layout() {
    const { nodes, order } = app.run,
      drawn = visible(order, how.is_open);
    if (!drawn.length) return;
    size = lay_out(drawn, how);
    parts = new Map(
      drawn.map((node) => {
        const group = group_of(node, how),
          a = node.w / 2,
          b = node.h / 2,
          badge = svg("g", { transform: `translate(${-a - 4} ${-b - 3})` });
        group.dataset.n = node.id;
        group.prepend(
          svg("rect", { x: -a - 5, y: -b - 5, width: node.w + 10, height: node.h + 10, rx: 8, class: "halo" }),
        );
        group.append(badge);
        return [
          node.id,
          {
            group,
            badge,
            line: node.parent < 0 ? null : svg("path", { d: edge(nodes[node.parent], node, false) }),
            was: "",
          },
        ];
      }),
    );
    edges.replaceChildren(...[...parts.values()].map((part) => part.line).filter(Boolean));
    shapes.replaceChildren(...[...parts.values()].map((part) => part.group));
    resize();
    fresh = true;
  }

  function resize() {
    root.setAttribute("viewBox", `0 0 ${size[0]} ${size[1]}`);
    root.setAttribute("width", size[0] * scale);
    root.setAttribute("height", size[1] * scale);
  }
  function zoom(by, x = box.clientWidth / 2, y = box.clientHeight / 2) {
    const at = [(box.scrollLeft + x) / scale, (box.scrollTop + y) / scale];
    scale =
      by === "fit"
        ? Math.max(0.2, Math.min(1.2, (box.clientWidth - 8) / size[0], (box.clientHeight - 8) / size[1]))
        : Math.min(3, Math.max(0.2, scale * by));
    resize();
    box.scrollTo(at[0] * scale - x, at[1] * scale - y);
  }

  function update() {
    if (app.view !== "graph") return;
    const { s, run } = app;
    for (const [n, part] of parts) {
      const view = run.view(n, s),
        status = is_old(run, n, s) ? "idle" : s.status[n],
        [, look] = STATE[view.st],
        key = `${status}${look}${app.sel === n}`;
      if (part.was === key) continue;
      part.was = key;
      part.group.setAttribute("class", `node ${status}${app.sel === n ? " picked" : ""}`);
      part.badge.replaceChildren(
        ...(status === "idle"
          ? []
          : [svg("circle", { class: "disc", cx: 7, cy: 7, r: 10 }), status_glyph(look, { width: 14, height: 14 })]),
      );
      part.line?.setAttribute("class", status === "running" ? "live" : status === "failure" ? "bad" : "");
    }
    if (fresh) {
      fresh = false;
      show(app.sel);
    }
  }
  function show(n) {
    const node = app.run.nodes[n];
    if (node && parts.has(n))
      box.scrollTo(Math.max(0, node.x * scale - box.clientWidth * 0.62), node.y * scale - box.clientHeight / 2);
  }

  box.addEventListener("click", (event) => {
    const zoomed = event.target.closest("[data-zoom]"),
      group = event.target.closest(".node");
    if (zoomed) return zoom(zoomed.dataset.zoom === "fit" ? "fit" : +zoomed.dataset.zoom);
    if (!group) return;
    const n = +group.dataset.n,
      node = app.run.nodes[n];
    if (!event.target.closest(".fold")) return app.select(n);
    const before = [node.x * scale - box.scrollLeft, node.y * scale - box.scrollTop];
    if (!app.folded.delete(n)) app.folded.add(n);
    app.refolded();
    fresh = false;
    box.scrollTo(node.x * scale - before[0], node.y * scale - before[1]);
    app.touch();
  });
  movable(box, (by, x, y) => {
    const { left, top } = box.getBoundingClientRect();
    zoom(by, x - left, y - top);
  });
  return { update, layout, show };
}
