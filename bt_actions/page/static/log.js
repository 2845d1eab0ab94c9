// The log: what `log:` nodes say, what becomes of each goal, and what happened to the run itself.

import { el } from "./dom.js";
import { status_glyph } from "./glyphs.js";
import { clock } from "./words.js";
import { upper } from "./state.js";

const HIGH = 24;
export function create_log(app) {
  const box = document.getElementById("log"),
    pool = [];
  let top = 0,
    room = 300,
    show = "all",
    query = "",
    lines = [],
    key = "",
    follows = true,
    seen = 0,
    expected = -9;
  const input = el("input", {
    type: "search",
    placeholder: "Find in the log",
    "aria-label": "Find in the log",
    oninput: () => {
      query = input.value.trim().toLowerCase();
      key = "";
      app.touch();
    },
  });
  const kinds = el(
    "div",
    { class: "group", role: "group", "aria-label": "Which lines" },
    [
      ["all", "All"],
      ["warn", "Warnings"],
      ["goal", "Goals"],
    ].map(([id, word]) =>
      el("button", {
        text: word,
        "aria-pressed": String(id === show),
        onclick: (event) => {
          show = id;
          key = "";
          for (const one of kinds.children) one.setAttribute("aria-pressed", one === event.currentTarget);
          app.touch();
        },
      }),
    ),
  );
  const rows = el("div", { id: "log-rows", role: "log", "aria-live": "off" }),
    scroll = el("div", { id: "log-scroll", tabindex: "0", "aria-label": "Log" }, rows),
    more = el("button", {
      class: "more",
      hidden: true,
      onclick: () => {
        follows = true;
        app.touch();
      },
    });
  box.append(el("div", { class: "head" }, input, kinds), el("div", { class: "box" }, scroll, more));
  new ResizeObserver(() => {
    room = scroll.clientHeight;
    app.touch();
  }).observe(scroll);
  const high = () => (app.narrow.matches ? 44 : HIGH);

  scroll.addEventListener(
    "scroll",
    () => {
      top = scroll.scrollTop;
      if (Math.abs(top - expected) > 2) {
        const was = follows;
        expected = -9;
        follows = top + room >= lines.length * high() - 24;
        if (was && !follows) seen = lines.length;
      }
      app.touch();
    },
    { passive: true },
  );

  function update() {
    const { run, t } = app,
      n = upper(run.lines, t, (line) => line.t),
      count = String(n),
      told = document.getElementById("count-log");
    if (told.textContent !== count) told.textContent = count;
    if (app.hidden("log")) return;
    const now = `${n}|${show}|${query}`,
      tall = high();
    if (now !== key) {
      key = now;
      lines = run.lines
        .slice(0, n)
        .filter(
          (line) =>
            (show === "all" || (show === "goal" ? line.lv === "goal" : line.lv === "warn" || line.lv === "error")) &&
            (!query || `${line.src} ${line.x}`.toLowerCase().includes(query)),
        );
      rows.style.height = `${lines.length * tall}px`;
      for (const one of pool) one.line = null;
    }
    if (follows) {
      const to = Math.max(0, lines.length * tall - room);
      if (Math.abs(top - to) > 1) {
        expected = to;
        scroll.scrollTop = to;
        top = to;
      }
    }
    const fresh = lines.length - seen;
    more.hidden = follows || fresh <= 0 || !app.at_head;
    if (!more.hidden) more.textContent = `${fresh} new ↓`;
    const from = Math.max(0, Math.floor(top / tall) - 4),
      to = Math.min(lines.length, from + Math.ceil(room / tall) + 8);
    while (pool.length < to - from) {
      const one = {
        el: el(
          "button",
          { class: "line" },
          el("time"),
          el("i"),
          el("span", { class: "src" }),
          el("span", { class: "x" }),
        ),
        line: null,
      };
      one.el.addEventListener("click", () => {
        if (!one.line) return;
        app.seek(one.line.t);
        if (one.line.n !== undefined) app.select(one.line.n, { reveal: true });
      });
      pool.push(one);
      rows.append(one.el);
    }
    pool.forEach((one, k) => {
      const line = lines[from + k];
      one.el.hidden = k >= to - from;
      if (one.el.hidden) return;
      one.el.style.transform = `translateY(${(from + k) * tall}px)`;
      if (one.line !== line || one.q !== query) {
        one.line = line;
        one.q = query;
        const [time, icon, src, x] = one.el.children;
        one.el.dataset.lv = line.lv;
        time.textContent = clock(line.t);
        icon.replaceWith(
          status_glyph({ error: "failure", warn: "backoff", goal: "running", info: "idle" }[line.lv] || "idle"),
        );
        if (line.lv === "goal") {
          const look = line.x.startsWith("SUCC")
            ? "success"
            : /^(ABORTED|UNEXP|REJ|SERVER_|RESULT_)/.test(line.x)
              ? "failure"
              : line.x.startsWith("cancel") || line.x.startsWith("CANC")
                ? "cancel"
                : "running";
          one.el.children[1].replaceWith(status_glyph(look));
        }
        src.textContent = line.src;
        const at = query ? line.x.toLowerCase().indexOf(query) : -1;
        if (at < 0) x.textContent = line.x;
        else
          x.replaceChildren(
            line.x.slice(0, at),
            el("mark", { text: line.x.slice(at, at + query.length) }),
            line.x.slice(at + query.length),
          );
        one.el.title = `${line.src}: ${line.x}`;
      }
      one.el.classList.toggle("now", !app.at_head && from + k === lines.length - 1);
    });
  }
  return {
    update,
    reset() {
      key = "";
      lines = [];
    },
  };
}
