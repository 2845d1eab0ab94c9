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
    ...node.tables
      .map((number) => tables[number])
      .map(([title, lines]) =>
        el(
          "table",
          {},
          el("caption", { text: title }),
          lines.map(([key, value, indent]) =>
            el(
              "tr",
              {},
              el("th", { scope: "row", text: key, style: `padding-left: ${indent * 12}px` }),
              el("td", { text: value }),
            ),
          ),
        ),
      ),
  );
}

// Beside a node, where there is room.
export function place(card, node) {
  const gap = 14,
    wide = document.documentElement.clientWidth,
    high = document.documentElement.clientHeight;
  const right = node.right + gap + card.offsetWidth < wide,
    left = node.left - gap - card.offsetWidth > 0;
  let x = node.right + gap,
    y = node.top;
  if (!right && left) x = node.left - gap - card.offsetWidth;
  if (!right && !left) {
    x = node.left;
    y = node.bottom + gap + card.offsetHeight < high ? node.bottom + gap : node.top - gap - card.offsetHeight;
  }
  card.style.left = `${Math.max(8, Math.min(x, wide - card.offsetWidth - 8))}px`;
  card.style.top = `${Math.max(8, Math.min(y, high - card.offsetHeight - 8))}px`;
}
