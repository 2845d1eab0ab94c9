// The goal of an attempt: its messages, its feedback plotted, its policies. What ticks is put into `ticking`, as functions
// of state and time.

import { el, svg } from "./dom.js";
import { clock, fields_of, kind_word, plain, secs, short, written } from "./words.js";
import { upper } from "./state.js";

const named = (value, names) => (names?.[value] ? `${value} ${names[value]}` : written(value));

// A text that is set when what it tells has changed.
export function live(ticking, target, tell) {
  let was;
  ticking.push((s, t) => {
    const now = tell(s, t);
    if (now !== was) {
      was = now;
      target.textContent = now;
    }
  });
  return target;
}

export function messages(node, at, t, ticking) {
  const fields = (title, values, none, id) =>
    el(
      "div",
      {},
      el(
        "h3",
        {},
        title,
        el("small", { text: `${kind_word(node)}.${title}` }),
        id ? el("small", {}, el("code", { text: id })) : null,
      ),
      fields_of(values)
        ? el(
            "table",
            {},
            el(
              "tbody",
              {},
              Object.entries(fields_of(values)).map(([field, value]) =>
                el(
                  "tr",
                  {},
                  el("th", { scope: "row", text: field }),
                  el("td", { class: "mono", text: named(value, node.constants[title.toLowerCase()]?.[field]) }),
                ),
              ),
            ),
          )
        : el("p", { class: "none-yet", style: "margin:0", text: values ? "hidden: it may hold a secret" : none }),
    );
  const over = at.done <= t,
    is_sent = at.phases.some((one) => one.st === "sent" && one.from <= t),
    out = [
      el(
        "div",
        { class: "two" },
        fields("Goal", at.goal, is_sent ? "not recorded" : "not sent", at.g),
        fields("Result", over ? at.result : null, over ? "none came, or none is recorded" : "not there yet"),
      ),
    ];
  if (node.expect && over)
    out.push(
      el(
        "p",
        { style: "margin:6px 0 0" },
        "Expected: ",
        el("code", { text: node.expect }),
        at.verdict?.expect && at.verdict.t <= t
          ? ` did not hold: ${Object.entries(at.verdict.seen)
              .map(([name, value]) => `${name} is ${written(value)}`)
              .join(", ")}`
          : "",
      ),
    );
  const first = fields_of(at.fb[0]?.feedback),
    numeric = first
      ? Object.keys(first)
          .filter((field) => typeof first[field] === "number" && !node.constants.feedback?.[field])
          .slice(0, 6)
      : [];
  const count = el("small", { class: "num" });
  out.push(
    el(
      "h3",
      {},
      "Feedback",
      live(ticking, count, (s, t) => {
        const n = upper(at.fb, t, (e) => e.t);
        return n
          ? `${n} messages, the last ${at.done <= t ? `at ${clock(at.fb[n - 1].t)}` : `${secs(t - at.fb[n - 1].t)} ago`}`
          : "none yet";
      }),
    ),
  );
  for (const field of numeric) out.push(spark(at, field, ticking));
  return out;
}

// A field of the feedback over the attempt; dashed where none has come for long.
function spark(at, field, ticking) {
  const path = svg("path", { class: "l" }),
    quiet = svg("path", { class: "quiet" }),
    now = el("span", { class: "now num" }),
    hi = el("span", { class: "hi num" }),
    lo = el("span", { class: "lo num" });
  const box = el(
    "div",
    { class: "spark", role: "img", "aria-label": `${field} over the attempt` },
    svg("svg", { viewBox: "0 0 100 40", preserveAspectRatio: "none" }, quiet, path),
    now,
    hi,
    lo,
  );
  let was = "";
  ticking.push((s, t) => {
    const n = upper(at.fb, t, (e) => e.t),
      k = `${n}|${at.done <= t ? "" : t.toFixed(1)}`;
    if (k === was || !n) return;
    was = k;
    const value = (e) => fields_of(e.feedback)?.[field],
      shown = at.fb.slice(0, n).filter((e) => typeof value(e) === "number"),
      values = shown.map(value),
      low = Math.min(...values),
      high = Math.max(...values),
      until = Math.min(at.done, t),
      from = Math.min(at.accepted, shown[0]?.t ?? 0);
    if (!shown.length) return;
    const x = (time) => (((time - from) / Math.max(1, until - from)) * 92 + 1).toFixed(2),
      y = (value) => (35 - ((value - low) / (high - low || 1)) * 22).toFixed(2);
    path.setAttribute("d", "M" + shown.map((e) => `${x(e.t)} ${y(value(e))}`).join("L"));
    quiet.setAttribute(
      "d",
      until - shown.at(-1).t > 0.6 ? `M${x(shown.at(-1).t)} ${y(values.at(-1))}H${x(until)}` : "",
    );
    now.textContent = `${field} ${short(values.at(-1))}`;
    hi.textContent = short(high);
    lo.textContent = short(low);
  });
  return box;
}

// The deadlines, and how much of each the attempt used.
export function policies(node, at, ticking) {
  const rows = ["queue", "server", "accept", "result", "feedback", "cancel"].map((rule) => {
    const limit = node.timeouts[rule],
      phase = { queue: "queued", server: "server", accept: "sent", result: "exec", cancel: "cancel" }[rule],
      cell = el("span", { class: "num" }),
      meter = el("span", { class: "meter" }, el("i"));
    if (at && typeof limit === "number")
      ticking.push((s, t) => {
        let used = 0;
        for (const p of at.phases) if (p.st === phase && p.from <= t) used = Math.min(p.to, t) - p.from;
        if (rule === "feedback") {
          const times = [
            at.accepted,
            ...at.fb.filter((e) => e.t <= t).map((e) => e.t),
            at.accepted <= t ? Math.min(at.done, t) : at.accepted,
          ];
          for (let k = 1; k < times.length; k++) used = Math.max(used, times[k] - times[k - 1]);
          if (!(used > 0)) used = 0;
        }
        const told = used ? secs(used) : "";
        if (cell.textContent !== told) cell.textContent = told;
        meter.classList.toggle("none", !used);
        meter.dataset.look = used >= limit - 0.01 ? "failure" : "running";
        meter.firstChild.style.transform = `scaleX(${Math.min(1, used / limit)})`;
      });
    else meter.classList.add("none");
    return el(
      "tr",
      {},
      el("th", { scope: "row", text: `timeout.${rule}` }),
      el("td", { class: "num", text: plain(limit) }),
      el("td", {}, el("span", { class: "used" }, cell, meter)),
    );
  });
  const { attempts } = node.retry;
  return [
    el("h3", {}, "Policies", el("small", { text: at ? "and how much of them this attempt used" : "" })),
    el(
      "table",
      {},
      el(
        "tbody",
        {},
        rows,
        el(
          "tr",
          {},
          el("th", { scope: "row", text: "retry" }),
          el("td", { colspan: 2, text: attempts > 1 ? `${attempts} attempts` : "one attempt" }),
        ),
      ),
    ),
  ];
}
