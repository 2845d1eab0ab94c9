// The card of a node: where it stands, its YAML, and what cards.py has told of it in tables.

import { el } from "./dom.js";

export function fill(card, node, nodes, tables) {
  const path = [];
  for (let above = node; above; above = nodes[above.parent]) path.unshift(above.name);
  card.scrollTop = 0;
  card.setAttribute("aria-label", `About ${node.name}`);
  card.replaceChildren(
    el("h2", { text: `${node.name} ` }, el("span", { class: "kind", text: node.server ? "action" : node.kind })),
    el("p", { text: (path.length > 12 ? [...path.slice(0, 4), "…", ...path.slice(-7)] : path).join(" / ") }),
    ...(node.place ? [el("p", {}, el("code", { text: node.place }))] : []),
    ...(node.yaml ? [el("pre", { text: node.yaml })] : []),
    ...node.tables.map((number) => tables[number]).map(([title, lines]) => el("table", {}, el("caption", { text: title }),
      lines.map(([key, value, indent]) => el("tr", {}, el("th", { scope: "row", text: key, style: `padding-left: ${indent * 12}px` }), el("td", { text: value }))))),
  );
}
