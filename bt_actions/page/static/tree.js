// The tree as an outline. Only the rows in sight exist; they are kept and painted again, never made anew,
// so that focus, hover and a screen reader's place survive whatever happens in the run.

import { el } from "./dom.js";
import { status_glyph } from "./glyphs.js";
import { visible } from "./layout.js";
import { make_row, paint, settle } from "./rows.js";
import { create_search } from "./search.js";

const find = (id) => document.getElementById(id);
const SPARE = 6;

export function create_tree(app) {
  const scroll = find("tree-scroll"),
    rows = find("tree-rows"),
    pool = [],
    searching = create_search(app);
  let list = [],
    index = new Map(),
    ours = 0,
    last_follow = null,
    focus_row = false;
  const row_height = () => parseFloat(getComputedStyle(document.documentElement).getPropertyValue("--row"));
  let high = row_height(),
    top = 0,
    tall = 400,
    moved = 0;
  new ResizeObserver(() => {
    tall = scroll.clientHeight;
    high = row_height();
    app.touch();
  }).observe(scroll);

  function layout() {
    list = visible(app.run.order, (node) => !app.folded.has(node.id));
    index = new Map(list.map((node, at) => [node.id, at]));
    high = row_height();
    rows.style.height = `${list.length * high}px`;
    pool.forEach((row) => {
      row.node = null;
    });
  }

  function update() {
    const running = app.run.leaves(app.s).length,
      { causes, stopped, passed } = app.run.failures(app.s),
      failed = causes.length + stopped.length + passed.length;
    label(find("go-running"), "running", "Running now", running);
    label(find("go-failure"), "failure", "First failure", failed);
    if (app.view !== "outline") return crumbs(app.sel);
    if (app.follow && app.at_head && document.activeElement?.closest?.("#tree-rows") === null) keep_in_sight();
    const from = Math.max(0, Math.floor(top / high) - SPARE),
      to = Math.min(list.length, Math.ceil((top + tall) / high) + SPARE);
    const wanted = list.slice(from, to),
      free = [],
      by_node = new Map(),
      at_sel = index.get(app.sel);
    const entry = at_sel >= from && at_sel < to ? app.sel : list[Math.min(to - 1, Math.ceil(top / high))]?.id;
    while (pool.length < wanted.length) pool.push(make_row(rows));
    for (const one of pool) {
      const at = one.node ? index.get(one.node.id) : undefined;
      if (at !== undefined && at >= from && at < to) by_node.set(one.node.id, one);
      else free.push(one);
    }
    wanted.forEach((node, k) => {
      let one = by_node.get(node.id);
      if (!one) {
        one = free.pop();
        settle(app, one, node, (from + k) * high);
        one.row.hidden = false;
      }
      paint(app, one, entry, searching.hits);
    });
    // The rows are in the document in any order; a screen reader has them in that of the tree.
    const owned = wanted.map((node) => `row-${node.id}`).join(" ");
    if (owned !== rows.getAttribute("aria-owns")) rows.setAttribute("aria-owns", owned);
    for (const one of free) {
      one.row.hidden = true;
      one.node = null;
      one.row.removeAttribute("id");
    }
    crumbs(list[Math.min(list.length - 1, Math.ceil(top / high))]?.parent);
    if (focus_row) {
      focus_row = false;
      const active = document.activeElement; // the reader may have gone elsewhere by now
      if (active === document.body || rows.contains(active)) find(`row-${app.sel}`)?.focus({ preventScroll: true });
    }
  }
  // The path down to a node.
  function crumbs(n) {
    const path = [];
    for (let up = app.run.nodes[n]; up; up = app.run.nodes[up.parent]) path.unshift(up.name);
    const told =
      path.join("  ›  ") ||
      (app.run.order.length === 1 ? "1 node" : `${app.run.order.length.toLocaleString("en")} nodes`);
    if (find("crumbs").textContent !== told) find("crumbs").textContent = told;
  }
  function label(button, look, word, count) {
    const key = `${word}${count}`;
    if (button.dataset.k === key) return;
    button.dataset.k = key;
    button.disabled = !count;
    button.replaceChildren(
      status_glyph(count ? look : "idle"),
      el("span", { class: "w", text: word }),
      el("span", { class: "num soft", text: count }),
    );
    button.setAttribute("aria-label", `${word}: ${count}`);
  }

  function keep_in_sight() {
    const { run, s } = app;
    // It stays with what it has as long as that runs, and moves at most once a second: following must not flicker.
    if (last_follow !== null && s.status[last_follow] === "running" && run.leaves(s).includes(last_follow)) return;
    if (performance.now() - moved < 1000) return;
    let target = run.leaves(s).includes(app.sel) ? app.sel : null;
    if (target === null)
      for (const n of run.leaves(s)) if (target === null || s.from[n] > s.from[target] + 1e-6) target = n;
    if (target === null) return;
    last_follow = target;
    moved = performance.now();
    show(target, 3);
  }
  function show(n, room = 2) {
    for (let up = app.run.nodes[n].parent, changed = false; ; up = app.run.nodes[up].parent) {
      if (up < 0) {
        if (changed) layout();
        break;
      }
      if (app.folded.delete(up)) changed = true;
    }
    top = scroll.scrollTop;
    tall = scroll.clientHeight || tall;
    const at = index.get(n) * high;
    let to = top;
    if (at < top + room * high) to = at - Math.min(room + 2, 5) * high;
    else if (at > top + tall - (room + 1) * high) to = at - tall + (room + 3) * high;
    if (Math.abs(to - top) > 1) {
      ours = performance.now();
      scroll.scrollTop = Math.max(0, Math.round(to / high) * high);
      top = scroll.scrollTop;
    }
  }

  function toggle(node, open = app.folded.has(node.id)) {
    if (!node.children.length) return;
    if (open) app.folded.delete(node.id);
    else app.folded.add(node.id);
    layout();
    app.refolded();
  }

  scroll.addEventListener(
    "scroll",
    () => {
      top = scroll.scrollTop;
      if (performance.now() - ours > 250) app.let_go();
      app.touch();
    },
    { passive: true },
  );
  rows.addEventListener("click", (event) => {
    const row = event.target.closest(".row"),
      node = row && app.run.nodes[+row.id.slice(4)];
    if (!node) return;
    if (event.target.closest(".knob")) toggle(node);
    else {
      app.select(node.id);
      focus_row = true;
      app.touch();
    }
  });
  rows.addEventListener("dblclick", (event) => {
    const row = event.target.closest(".row");
    if (row && !event.target.closest(".knob")) toggle(app.run.nodes[+row.id.slice(4)]);
  });
  rows.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const at = index.get(app.sel),
      node = app.run.nodes[app.sel],
      page = Math.max(1, Math.floor(scroll.clientHeight / high) - 2);
    if (at === undefined) return;
    const go = (to) => {
      const next = list[Math.max(0, Math.min(list.length - 1, to))];
      app.select(next.id);
      show(next.id, 1);
      focus_row = true;
    };
    const open = node.children.length && !app.folded.has(node.id);
    const keys = {
      ArrowDown: () => go(at + 1),
      ArrowUp: () => go(at - 1),
      PageDown: () => go(at + page),
      PageUp: () => go(at - page),
      Home: () => go(0),
      End: () => go(list.length - 1),
      ArrowRight: () => {
        if (open) go(at + 1);
        else {
          toggle(node, true);
          focus_row = true;
        }
      },
      ArrowLeft: () => {
        if (open) {
          toggle(node, false);
          focus_row = true;
        } else if (node.parent >= 0) go(index.get(node.parent));
      },
      Enter: () => {
        toggle(node);
        focus_row = true;
      },
    };
    if (!(event.key in keys)) return;
    event.preventDefault();
    event.stopPropagation();
    app.let_go();
    keys[event.key]();
    app.touch();
  });

  return {
    update,
    layout,
    show,
    reset: searching.search,
    rewind() {
      last_follow = null;
      moved = 0;
    },
  };
}
