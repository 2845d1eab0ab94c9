// The tree as an outline. Only the rows in sight exist; they are kept and painted again, never made anew,
// so that focus, hover and a screen reader's place survive whatever happens in the run.

import { el, svg } from "./dom.js";
import { status_glyph, kind_glyph } from "./glyphs.js";
import { secs, plain, STATE, kind_word } from "./words.js";
import { is_old } from "./doing.js";

const find = (id) => document.getElementById(id);
const SPARE = 6;

export function create_tree(app) {
  const scroll = find("tree-scroll"), rows = find("tree-rows"), pool = [];
  let list = [], index = new Map(), hits = [], hit_set = new Set(), hit_at = -1, ours = 0, last_follow = null, focus_row = false;
  const row_height = () => parseFloat(getComputedStyle(document.documentElement).getPropertyValue("--row"));
  let high = row_height(), top = 0, tall = 400, moved = 0;
  new ResizeObserver(() => { tall = scroll.clientHeight; high = row_height(); app.touch(); }).observe(scroll);

  function layout() {
    const { order } = app.run;
    list = [];
    for (let i = 0; i < order.length;) { list.push(order[i]); i += app.folded.has(order[i].id) ? 1 + order[i].below : 1; }
    index = new Map(list.map((node, at) => [node.id, at]));
    high = row_height();
    rows.style.height = `${list.length * high}px`;
    pool.forEach((row) => { row.node = null; });
  }

  function make() {
    const name = el("div", { class: "name" }), state = el("div", { class: "state" }, el("i"), el("span")), number = el("span", { class: "n" }), meter = el("span", { class: "meter" }, el("i"));
    const tries = el("span", { class: "try" }), server = el("span", { class: "server" });
    const row = el("div", { class: "row", role: "treeitem", tabindex: "-1" }, name, state, el("div", { class: "due" }, number, meter), tries, server);
    rows.append(row);
    return { row, name, state, word: state.lastChild, number, meter, fill: meter.firstChild, tries, server, node: null, was: {} };
  }

  // What never changes of a node: where it stands, its name, its server.
  function settle(one, node, at) {
    one.node = node;
    one.was = {};
    const { row } = one, parent = app.run.nodes[node.parent];
    row.id = `row-${node.id}`;
    row.style.transform = `translateY(${at * high}px)`;
    row.style.setProperty("--d", node.depth);
    row.setAttribute("aria-level", node.depth + 1);
    row.setAttribute("aria-setsize", parent ? parent.children.length : 1);
    row.setAttribute("aria-posinset", parent ? parent.children.indexOf(node) + 1 : 1);
    if (node.children.length) row.setAttribute("aria-expanded", !app.folded.has(node.id)); else row.removeAttribute("aria-expanded");
    const knob = el("span", { class: node.children.length ? "knob" : "knob none" }, svg("svg", { viewBox: "0 0 10 10", "aria-hidden": "true" }, svg("path", { d: "M2 3.500l3 3 3-3" })));
    const name = node.kind === "log" ? node.name.replace(/^log /, "") : node.name;
    one.name.replaceChildren(...Array.from({ length: node.depth }, () => el("i", { class: "guide" })), knob, kind_glyph(node),
      el("span", { class: "nm", text: name, title: node.name }), el("span", { class: "kd", text: kind_word(node) }), ...(app.folded.has(node.id) ? [el("span", { class: "fold", text: `+${node.below}` })] : []));
    one.server.textContent = node.server || "";
    one.server.title = node.server || "";
  }

  function paint(one) {
    const { node, was, row } = one, { s, run } = app, view = run.view(node.id, s), live = s.status[node.id] === "running", old = is_old(run, node.id, s);
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
    const limit = view.limit, shown = view.st === "idle" ? "" : (live || view.st === "cancel") && limit ? `${view.used.toFixed(1)} of ${plain(limit)}` : `${view.elapsed.toFixed(1)} s`;
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
    if (was.tries !== tries) { one.tries.textContent = tries; one.tries.classList.toggle("more", view.tries > 1); }
    const picked = app.sel === node.id, hit = hit_set.has(node.id);
    if (was.picked !== picked) { row.setAttribute("aria-selected", picked); row.tabIndex = picked ? 0 : -1; }
    if (was.hit !== hit) row.classList.toggle("hit", hit);
    if (was.label !== said) row.setAttribute("aria-label", `${node.name}, ${kind_word(node)}, ${said}${tries ? `, attempt ${tries}` : ""}`);
    Object.assign(was, { st: view.st, said, shown, width, tries, picked, hit, label: said });
  }

  function update() {
    const running = app.run.leaves(app.s).length, { causes, stopped, passed } = app.run.failures(app.s), failed = causes.length + stopped.length + passed.length;
    label(find("go-running"), "running", "Running now", running);
    label(find("go-failure"), "failure", "First failure", failed);
    if (app.view !== "outline") { const path = []; for (let up = app.run.nodes[app.sel]; up; up = app.run.nodes[up.parent]) path.unshift(up.name); find("crumbs").textContent = path.join("  ›  "); return; }
    if (app.follow && app.at_head && document.activeElement?.closest?.("#tree-rows") === null) keep_in_sight();
    const from = Math.max(0, Math.floor(top / high) - SPARE), to = Math.min(list.length, Math.ceil((top + tall) / high) + SPARE);
    const wanted = list.slice(from, to), free = [], by_node = new Map();
    while (pool.length < wanted.length) pool.push(make());
    for (const one of pool) { const at = one.node ? index.get(one.node.id) : undefined; if (at !== undefined && at >= from && at < to) by_node.set(one.node.id, one); else free.push(one); }
    wanted.forEach((node, k) => {
      let one = by_node.get(node.id);
      if (!one) { one = free.pop(); settle(one, node, from + k); one.row.hidden = false; }
      paint(one);
    });
    for (const one of free) { one.row.hidden = true; one.node = null; one.row.removeAttribute("id"); }
    const first = list[Math.min(list.length - 1, Math.ceil(top / high))], path = [];
    for (let up = app.run.nodes[first?.parent]; up; up = app.run.nodes[up.parent]) path.unshift(up.name);
    const crumbs = path.length ? path.join("  ›  ") : `${app.run.order.length.toLocaleString("en")} nodes`;
    if (find("crumbs").textContent !== crumbs) find("crumbs").textContent = crumbs;
    if (focus_row) { focus_row = false; find(`row-${app.sel}`)?.focus({ preventScroll: true }); }
  }
  function label(button, look, word, count) {
    const key = `${word}${count}`;
    if (button.dataset.k === key) return;
    button.dataset.k = key;
    button.disabled = !count;
    button.replaceChildren(status_glyph(count ? look : "idle"), el("span", { class: "w", text: word }), el("span", { class: "num soft", text: count }));
    button.setAttribute("aria-label", `${word}: ${count}`);
  }

  function keep_in_sight() {
    const { run, s } = app;
    // It stays with what it has as long as that runs, and moves at most once a second: following must not flicker.
    if (last_follow !== null && s.status[last_follow] === "running" && run.leaves(s).includes(last_follow)) return;
    if (performance.now() - moved < 1000) return;
    let target = run.leaves(s).includes(app.sel) ? app.sel : null;
    if (target === null) for (const n of run.leaves(s)) if (target === null || s.from[n] > s.from[target] + 1e-6) target = n;
    if (target === null) return;
    last_follow = target;
    moved = performance.now();
    show(target, 3);
  }
  function show(n, room = 2) {
    for (let up = app.run.nodes[n].parent, changed = false; ; up = app.run.nodes[up].parent) {
      if (up < 0) { if (changed) layout(); break; }
      if (app.folded.delete(up)) changed = true;
    }
    top = scroll.scrollTop; tall = scroll.clientHeight || tall;
    const at = index.get(n) * high;
    let to = top;
    if (at < top + room * high) to = at - Math.min(room + 2, 5) * high;
    else if (at > top + tall - (room + 1) * high) to = at - tall + (room + 3) * high;
    if (Math.abs(to - top) > 1) { ours = performance.now(); scroll.scrollTop = Math.max(0, Math.round(to / high) * high); top = scroll.scrollTop; }
  }

  function toggle(node, open = app.folded.has(node.id)) {
    if (!node.children.length) return;
    if (open) app.folded.delete(node.id); else app.folded.add(node.id);
    layout();
    app.refolded();
  }

  scroll.addEventListener("scroll", () => { top = scroll.scrollTop; if (performance.now() - ours > 250) app.let_go(); app.touch(); }, { passive: true });
  rows.addEventListener("click", (event) => {
    const row = event.target.closest(".row"), node = row && app.run.nodes[+row.id.slice(4)];
    if (!node) return;
    if (event.target.closest(".knob")) toggle(node); else { app.select(node.id); focus_row = true; app.touch(); }
  });
  rows.addEventListener("dblclick", (event) => { const row = event.target.closest(".row"); if (row && !event.target.closest(".knob")) toggle(app.run.nodes[+row.id.slice(4)]); });
  rows.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const at = index.get(app.sel), node = app.run.nodes[app.sel], page = Math.max(1, Math.floor(scroll.clientHeight / high) - 2);
    if (at === undefined) return;
    const go = (to) => { const next = list[Math.max(0, Math.min(list.length - 1, to))]; app.select(next.id); show(next.id, 1); focus_row = true; };
    const open = node.children.length && !app.folded.has(node.id);
    const keys = { ArrowDown: () => go(at + 1), ArrowUp: () => go(at - 1), PageDown: () => go(at + page), PageUp: () => go(at - page), Home: () => go(0), End: () => go(list.length - 1),
      ArrowRight: () => { if (open) go(at + 1); else { toggle(node, true); focus_row = true; } }, ArrowLeft: () => { if (open) { toggle(node, false); focus_row = true; } else if (node.parent >= 0) go(index.get(node.parent)); },
      Enter: () => { toggle(node); focus_row = true; } };
    if (!(event.key in keys)) return;
    event.preventDefault();
    event.stopPropagation();
    app.let_go();
    keys[event.key]();
    app.touch();
  });

  // Search.
  const query = find("query");
  function search() {
    const wanted = query.value.trim().toLowerCase();
    hits = wanted ? app.run.order.filter((node) => node.words.includes(wanted)) : [];
    hit_set = new Set(hits.map((node) => node.id));
    hit_at = -1;
    find("found").textContent = wanted ? String(hits.length) : "";
    app.touch();
  }
  query.addEventListener("input", search);
  find("find").addEventListener("submit", (event) => event.preventDefault());
  query.addEventListener("keydown", (event) => {
    if (event.key === "Escape") { query.value = ""; search(); query.blur(); }
    if (event.key !== "Enter" || !hits.length) return;
    hit_at = (hit_at + (event.shiftKey ? -1 : 1) + hits.length) % hits.length;
    find("found").textContent = `${hit_at + 1} of ${hits.length}`;
    app.let_go();
    app.select(hits[hit_at].id, { reveal: true });
  });

  return { update, layout, show, search, rewind() { last_follow = null; moved = 0; } };
}
