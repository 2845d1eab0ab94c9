// A row of the outline: made once, given to one node after the other, and painted where something has changed.

import { el, svg } from "./dom.js";
import { status_glyph, kind_glyph } from "./glyphs.js";
import { secs, plain, STATE, kind_word } from "./words.js";
import { is_old } from "./doing.js";

export function make_row(rows) {
  const name = el("div", { class: "name" }),
    state = el("div", { class: "state" }, el("i"), el("span")),
    number = el("span", { class: "n" }),
    meter = el("span", { class: "meter" }, el("i"));
  const tries = el("span", { class: "try" }),
    server = el("span", { class: "server" });
  const row = el(
    "div",
    { class: "row", role: "treeitem", tabindex: "-1" },
    name,
    state,
    el("div", { class: "due" }, number, meter),
    tries,
    server,
  );
  rows.append(row);
  return {
    row,
    name,
    state,
    word: state.lastChild,
    number,
    meter,
    fill: meter.firstChild,
    tries,
    server,
    node: null,
    was: {},
  };
}

// What never changes of a node: where it stands, its name, its server.
export function settle(app, one, node, y) {
  one.node = node;
  one.was = {};
  const { row } = one,
    parent = app.run.nodes[node.parent];
  row.id = `row-${node.id}`;
  row.style.transform = `translateY(${y}px)`;
  row.style.setProperty("--d", node.depth);
  row.setAttribute("aria-level", node.depth + 1);
  row.setAttribute("aria-setsize", parent ? parent.children.length : 1);
  row.setAttribute("aria-posinset", parent ? parent.children.indexOf(node) + 1 : 1);
  if (node.children.length) row.setAttribute("aria-expanded", !app.folded.has(node.id));
  else row.removeAttribute("aria-expanded");
  const knob = el(
    "span",
    { class: node.children.length ? "knob" : "knob none" },
    svg("svg", { viewBox: "0 0 10 10", "aria-hidden": "true" }, svg("path", { d: "M2 3.500l3 3 3-3" })),
  );
  const name = node.kind === "log" ? node.name.replace(/^log /, "") : node.name;
  one.name.replaceChildren(
    ...Array.from({ length: node.depth }, () => el("i", { class: "guide" })),
    knob,
    kind_glyph(node),
    el("span", { class: "nm", text: name, title: node.name }),
    el("span", { class: "kd", text: kind_word(node) }),
    ...(app.folded.has(node.id) ? [el("span", { class: "fold", text: `+${node.below}` })] : []),
  );
  one.server.textContent = node.server || "";
  one.server.title = node.server || "";
}

// `entry`: the node whose row the Tab key goes to; `hits`: the nodes that are searched for.
export function paint(app, one, entry, hits) {
  const { node, was, row } = one,
    { s, run } = app,
    view = run.view(node.id, s),
    live = s.status[node.id] === "running",
    old = is_old(run, node.id, s);
  const [word, look] = STATE[view.st];
  let said = word;
  if (view.st === "failure" && view.attempt?.decided <= app.t) said = view.attempt.oc;
  if (old) said += " before";
  if (was.st !== view.st || was.said !== said) {
    row.dataset.st = old ? "idle" : s.status[node.id];
    row.classList.toggle("live", live);
    row.classList.toggle("leafy", live && !node.children.length);
    one.state.firstChild.replaceWith(status_glyph(look));
    one.word.textContent = said;
    one.word.title = view.st === "failure" ? s.message[node.id] : said;
    one.meter.dataset.look = look;
  }
  const limit = view.limit,
    shown =
      view.st === "idle"
        ? ""
        : (live || view.st === "cancel") && limit
          ? `${view.used.toFixed(1)} of ${plain(limit)}`
          : `${view.elapsed.toFixed(1)} s`;
  if (was.shown !== shown) one.number.textContent = shown;
  const width = limit && view.st !== "idle" ? Math.min(1, view.used / limit) : -1;
  if (was.width !== width) {
    one.meter.classList.toggle("none", width < 0);
    one.fill.style.transform = `scaleX(${Math.max(0, width)})`;
    const soon = live && width > 0.75 && view.st !== "backoff";
    one.meter.classList.toggle("soon", soon);
    one.meter.title = limit ? `${secs(view.used)} of ${plain(limit)}, ${view.rule}` : "";
  }
  const tries = view.tries && node.retry.attempts > 1 ? `${view.tries}/${node.retry.attempts}` : "";
  if (was.tries !== tries) {
    one.tries.textContent = tries;
    one.tries.classList.toggle("more", view.tries > 1);
  }
  const picked = app.sel === node.id,
    hit = hits.has(node.id),
    tab = node.id === entry ? 0 : -1;
  if (was.picked !== picked) row.setAttribute("aria-selected", picked);
  if (was.tab !== tab) row.tabIndex = tab;
  if (was.hit !== hit) row.classList.toggle("hit", hit);
  if (was.label !== said)
    row.setAttribute("aria-label", `${node.name}, ${kind_word(node)}, ${said}${tries ? `, attempt ${tries}` : ""}`);
  Object.assign(was, { st: view.st, said, shown, width, tries, picked, tab, hit, label: said });
}
