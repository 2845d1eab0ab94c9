// Variables: value, age, writer, and the last values that each had.

import { el, svg } from "./dom.js";
import { clock, short, written } from "./words.js";
import { upper } from "./state.js";

export function create_values(app) {
  const box = document.getElementById("values"),
    rows = new Map();
  let filter = "",
    shape = "";
  const input = el("input", {
    type: "search",
    placeholder: "Filter variables",
    "aria-label": "Filter variables",
    style: "flex:1;min-width:0",
    oninput: () => {
      filter = input.value.trim().toLowerCase();
      shape = "";
      app.touch();
    },
  });
  const list = el("div");
  box.append(el("div", { class: "head" }, input), list);

  function update() {
    const { run, s, t } = app,
      keys = [...run.history.keys()].filter(
        (key) => run.history.get(key)[0].t <= t && key.toLowerCase().includes(filter),
      );
    const scopes = new Map();
    for (const key of keys) {
      const { scope } = run.history.get(key)[0];
      if (!scopes.has(scope)) scopes.set(scope, []);
      scopes.get(scope).push(key);
    }
    const count = String(s.vars.size);
    const told = document.getElementById("count-values");
    if (told.textContent !== count) told.textContent = count;
    if (app.hidden("values")) return;
    const now = keys.join("|");
    if (now !== shape) {
      shape = now;
      list.replaceChildren(...[...scopes].flatMap(([scope, all]) => [el("h2", { text: scope }), ...all.map(row)]));
    }
    for (const key of keys) paint(key, rows.get(key), s, t);
  }

  function row(key) {
    if (rows.has(key)) return rows.get(key).el;
    const name = key.slice(key.lastIndexOf("/") + 1),
      one = {
        v: el("span", { class: "v" }),
        when: el("span", { class: "when" }),
        by: el("span", { class: "by" }),
        hist: el("div", { class: "hist" }),
        was: "",
      };
    one.el = el(
      "div",
      { class: "var" },
      el("span", { class: "k", text: name, title: name }),
      one.v,
      one.when,
      one.by,
      one.hist,
    );
    rows.set(key, one);
    return one.el;
  }

  function paint(key, one, s, t) {
    const value = s.vars.get(key),
      all = app.run.history.get(key),
      n = upper(all, t, (e) => e.t);
    if (!value) return;
    const ago = t - value.t,
      when =
        value.t < 0.01
          ? "at start"
          : ago < 100
            ? `${ago < 10 ? ago.toFixed(1) : Math.floor(ago)} s ago`
            : clock(value.t);
    if (one.when.textContent !== when) one.when.textContent = when;
    one.el.classList.toggle("fresh", ago < 3 && value.n !== undefined);
    const now = `${n}|${value.at[0]}`;
    if (one.was === now) return;
    one.was = now;
    one.v.textContent = one.v.title = written(value.value);
    one.when.title = `Written at ${clock(value.t)}`;
    const node = app.run.nodes[value.n];
    one.by.replaceChildren(
      node
        ? el("button", {
            class: "link",
            style: "justify-self:start;max-width:100%",
            text: node.name,
            onclick: () => app.select(value.n, { reveal: true }),
          })
        : el("span", { text: value.by || "not known" }),
      el("span", { text: node ? value.by : "" }),
    );
    one.hist.hidden = n < 2;
    if (n < 2) return;
    const shown = all.slice(Math.max(0, n - 4), n),
      numbers = all.slice(0, n).filter((e) => typeof e.value === "number");
    const kids = [];
    if (numbers.length > 1) {
      const low = Math.min(...numbers.map((e) => e.value)),
        high = Math.max(...numbers.map((e) => e.value)),
        from = numbers[0].t,
        until = numbers.at(-1).t + 1;
      const y = (v) => 17 - ((v - low) / (high - low || 1)) * 14,
        x = (at) => ((at - from) / (until - from)) * 82 + 1;
      let d = `M${x(from)} ${y(numbers[0].value)}`;
      for (const e of numbers.slice(1)) d += `H${x(e.t).toFixed(1)}V${y(e.value).toFixed(1)}`;
      kids.push(svg("svg", { viewBox: "0 0 84 20", "aria-hidden": "true" }, svg("path", { d: `${d}H83` })));
    }
    kids.push(
      ...shown.map((e, k) =>
        el("button", {
          title: `${clock(e.t)}: go there`,
          "aria-current": String(k === shown.length - 1),
          text: short(e.value),
          onclick: () => app.seek(e.t),
        }),
      ),
      el("span", { class: "num", text: `${n} writes` }),
    );
    one.hist.replaceChildren(...kids);
  }
  return {
    update,
    reset() {
      rows.clear();
      shape = "";
      list.replaceChildren();
    },
  };
}
