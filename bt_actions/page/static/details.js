// Everything about the node that is selected, at the time that is shown. The page of a node is built anew only
// when its shape changes (another node, another attempt, another outcome); what ticks is set in place.

import { el, svg } from "./dom.js";
import { status_glyph, kind_glyph } from "./glyphs.js";
import { clock, secs, plain, written, short, fields_of, STATE, story, kind_word, place, end_words } from "./words.js";
import { upper } from "./state.js";
import { phase_at, because, waiting_for } from "./doing.js";
import { phases } from "./timeline.js";

const named = (value, names) => (names?.[value] ? `${value} ${names[value]}` : written(value));

export function create_details(app) {
  const box = document.getElementById("details");
  let wide_now = box.clientWidth || 400;
  new ResizeObserver(() => { wide_now = box.clientWidth; app.touch(); }).observe(box);
  let key = "", ticking = [], pick = null;

  function update() {
    if (app.hidden("details")) return;
    const { run, s, sel, t } = app, node = run.nodes[sel], view = run.view(sel, s), chosen = pick?.n === sel ? run.attempts[pick.a] : null, tries = run.attempts_of(sel, t, chosen);
    const at = tries.includes(chosen) ? chosen : tries.at(-1);
    const now = `${sel}|${view.st}|${at?.g}|${tries.map((a) => `${a.done <= t}${phase_at(a, t)?.st}`).join()}`;
    if (now !== key) {
      const same = key.split("|")[0] === String(sel), top = box.scrollTop;
      key = now;
      build(node, view, tries, at);
      box.scrollTop = same ? top : 0;
    }
    for (const tick of ticking) tick(s, t);
  }

  const live = (target, tell) => { let was; ticking.push((s, t) => { const now = tell(s, t); if (now !== was) { was = now; target.textContent = now; } }); return target; };

  function build(node, view, tries, at) {
    ticking = [];
    const { run } = app, [word, look] = STATE[view.st], pill = el("span", { class: `pill tone-${look}` });
    pill.append(status_glyph(look), el("span", { text: word }));
    const path = [];
    for (let up = run.nodes[node.parent]; up; up = run.nodes[up.parent]) path.unshift(up);
    const crumbs = path.flatMap((up, k) => [...(k ? [" › "] : []), el("button", { class: "link", text: up.name, onclick: () => app.select(up.id, { reveal: true }) })]);
    const parts = [
      el("h2", {}, kind_glyph(node), el("span", { text: node.name }), pill),
      el("p", { class: "path" }, crumbs.length ? crumbs : "the root"),
      live(el("div", { class: "say", "data-look": view.st === "failure" ? "failure" : look }), (s, t) => say(node, run.view(node.id, s), at, s, t)),
    ];
    if (tries.length) parts.push(...attempts(node, tries, at));
    if (at) parts.push(...messages(node, at));
    parts.push(el("h3", {}, "YAML", el("small", {}, el("code", { text: `${place(node)}${node.col ? `:${node.col}` : ""}` }))), source(node));
    if (node.timeouts) parts.push(...policies(node, at));
    if (node.children.length) parts.push(...children(node));
    box.replaceChildren(...parts);
  }

  function say(node, view, at, s, t) {
    if (view.st === "idle") return "It has not begun.";
    if (at) return `${node.retry.attempts > 1 ? `Attempt ${at.a} of ${node.retry.attempts}. ` : ""}${story(at, node, t)}${view.st === "backoff" && at === view.attempt ? ` Tried again in ${secs(view.ends - t)}.` : ""}`;
    if (view.st === "failure") return node.children.length ? `It failed after ${secs(view.elapsed)}: ${because(node)}.` : s.message[node.id] || `It failed, as it always does: ${node.kind}.`;
    if (view.st === "running") { const kids = node.children.filter((kid) => s.status[kid.id] === "running"); return `It has run for ${secs(view.elapsed)}, and waits for ${kids.map((kid) => kid.name).join(" and ") || "its child"}.`; }
    if (view.st === "stopped") return "It was interrupted, and did not end by itself.";
    if (view.st === "success") return `It succeeded after ${secs(view.elapsed)}.`;
    return `${waiting_for(node, view, s)} For ${secs(view.elapsed)} now.`;
  }

  function attempts(node, tries, at) {
    const t = app.t, first = tries[0].start, body = tries.map((a) => {
      const over = a.done <= t, look = !over ? STATE[phase_at(a, t)?.st || "running"][1] : a.oc === "SUCCEEDED" ? "success" : a.oc === "CANCELED" ? "stopped" : "failure";
      const outcome = el("span", { class: "oc" });
      outcome.append(status_glyph(look));
      outcome.append(over ? a.oc : STATE[phase_at(a, t)?.st || "running"][0]);
      const accepted = a.accepted <= t ? `+${secs(a.accepted - (a.phases.find((p) => p.st === "sent")?.from ?? a.start))}` : over ? "no" : "";
      const ran = live(el("td", { class: "num" }), (s, now) => (a.accepted <= now ? secs(Math.min(a.done, now) - a.accepted) : ""));
      return el("tr", { "aria-selected": String(a === at), tabindex: "0", onclick: () => { pick = { n: a.n, a: a.i }; key = ""; app.touch(); }, onkeydown: (event) => { if (event.key === "Enter") event.currentTarget.click(); } },
        el("td", { class: "num", text: a.a }), el("td", { class: "num", text: clock(a.start) }), el("td", { class: "num", text: accepted }), ran, el("td", {}, outcome), el("td", { text: over ? a.end : "", title: end_words(a.end) }));
    });
    const strip = el("div", { class: "phases", "aria-hidden": "true" });
    ticking.push((s, now) => {
      const wide = wide_now - 32, end = Math.max(first + 1, Math.max(...tries.map((a) => Math.max(Math.min(a.done, now), Math.min(a.backoff || 0, now)))));
      const x = (time) => (time - first) / (end - first) * wide, k = `${wide}${end}`;
      if (strip.dataset.k === k) return;
      strip.dataset.k = k;
      strip.replaceChildren(...tries.flatMap((a) => phases(a, now, 0, wide, x, a.done <= now ? a.done : null)));
    });
    return [el("h3", {}, tries.length === 1 ? "Attempt" : "Attempts", el("small", { text: `${tries.length} of ${node.retry.attempts} on ${node.server}` })), strip,
      el("table", { class: "tries" }, el("thead", {}, el("tr", {}, ["#", "Begun", "Accepted", "Ran", "Outcome", "End"].map((head) => el("th", { scope: "col", text: head })))), el("tbody", {}, body))];
  }

  function messages(node, at) {
    const fields = (title, values, none, id) => el("div", {}, el("h3", {}, title, el("small", { text: `${kind_word(node)}.${title}` }), id ? el("small", {}, el("code", { text: id })) : null), fields_of(values) ? el("table", {}, el("tbody", {}, Object.entries(fields_of(values)).map(([field, value]) => el("tr", {}, el("th", { scope: "row", text: field }), el("td", { class: "mono", text: named(value, node.constants[title.toLowerCase()]?.[field]) }))))) : el("p", { class: "none-yet", style: "margin:0", text: none }));
    const over = at.done <= app.t, out = [el("div", { class: "two" }, fields("Goal", at.goal, "not sent", at.g), fields("Result", over ? at.result : null, over ? "none came, or none is recorded" : "not there yet"))];
    if (node.expect && over) out.push(el("p", { style: "margin:6px 0 0" }, "Expected: ", el("code", { text: node.expect }), at.verdict?.expect ? ` did not hold: ${Object.entries(at.verdict.seen).map(([name, value]) => `${name} is ${written(value)}`).join(", ")}` : ""));
    const first = fields_of(at.fb[0]?.feedback), numeric = first ? Object.keys(first).filter((field) => typeof first[field] === "number" && !node.constants.feedback?.[field]).slice(0, 6) : [];
    const count = el("small", { class: "num" });
    out.push(el("h3", {}, "Feedback", live(count, (s, t) => { const n = upper(at.fb, t, (e) => e.t); return n ? `${n} messages, the last ${at.done <= t ? `at ${clock(at.fb[n - 1].t)}` : `${secs(t - at.fb[n - 1].t)} ago`}` : "none yet"; })));
    for (const field of numeric) out.push(spark(at, field));
    return out;
  }

  function spark(at, field) {
    const path = svg("path", { class: "l" }), quiet = svg("path", { class: "quiet" }), now = el("span", { class: "now num" }), hi = el("span", { class: "hi num" }), lo = el("span", { class: "lo num" });
    const box = el("div", { class: "spark", role: "img", "aria-label": `${field} over the attempt` }, svg("svg", { viewBox: "0 0 100 40", preserveAspectRatio: "none" }, quiet, path), now, hi, lo);
    let was = "";
    ticking.push((s, t) => {
      const n = upper(at.fb, t, (e) => e.t), k = `${n}|${at.done <= t ? "" : t.toFixed(1)}`;
      if (k === was || !n) return;
      was = k;
      const value = (e) => fields_of(e.feedback)?.[field], shown = at.fb.slice(0, n).filter((e) => typeof value(e) === "number"), values = shown.map(value), low = Math.min(...values), high = Math.max(...values), until = Math.min(at.done, t), from = Math.min(at.accepted, shown[0]?.t ?? 0);
      if (!shown.length) return;
      const x = (time) => ((time - from) / Math.max(1, until - from) * 92 + 1).toFixed(2), y = (value) => (35 - (value - low) / (high - low || 1) * 22).toFixed(2);
      path.setAttribute("d", "M" + shown.map((e) => `${x(e.t)} ${y(value(e))}`).join("L"));
      quiet.setAttribute("d", until - shown.at(-1).t > 0.6 ? `M${x(shown.at(-1).t)} ${y(values.at(-1))}H${x(until)}` : "");
      now.textContent = `${field} ${short(values.at(-1))}`;
      hi.textContent = short(high); lo.textContent = short(low);
    });
    return box;
  }

  function policies(node, at) {
    const rows = ["queue", "server", "accept", "result", "feedback", "cancel"].map((rule) => {
      const limit = node.timeouts[rule], phase = { queue: "queued", server: "server", accept: "sent", result: "exec", cancel: "cancel" }[rule], cell = el("span", { class: "num" }), meter = el("span", { class: "meter" }, el("i"));
      if (at && typeof limit === "number") ticking.push((s, t) => {
        let used = 0;
        for (const p of at.phases) if (p.st === phase && p.from <= t) used = Math.min(p.to, t) - p.from;
        if (rule === "feedback") { const times = [at.accepted, ...at.fb.filter((e) => e.t <= t).map((e) => e.t), at.accepted <= t ? Math.min(at.done, t) : at.accepted]; for (let k = 1; k < times.length; k++) used = Math.max(used, times[k] - times[k - 1]); if (!(used > 0)) used = 0; }
        const told = used ? secs(used) : "";
        if (cell.textContent !== told) cell.textContent = told;
        meter.classList.toggle("none", !used);
        meter.dataset.look = used >= limit - 0.01 ? "failure" : "running";
        meter.firstChild.style.transform = `scaleX(${Math.min(1, used / limit)})`;
      }); else meter.classList.add("none");
      return el("tr", {}, el("th", { scope: "row", text: `timeout.${rule}` }), el("td", { class: "num", text: plain(limit) }), el("td", {}, el("span", { class: "used" }, cell, meter)));
    });
    const { attempts } = node.retry;
    return [el("h3", {}, "Policies", el("small", { text: at ? "and how much of them this attempt used" : "" })), el("table", {}, el("tbody", {}, rows,
      el("tr", {}, el("th", { scope: "row", text: "retry" }), el("td", { colspan: 2, text: attempts > 1 ? `${attempts} attempts` : "one attempt" }))))];
  }

  function children(node) {
    return [el("h3", {}, "Children", el("small", { text: String(node.children.length) })), el("table", {}, el("tbody", {}, node.children.map((kid) => {
      const cell = el("span", { class: "oc", style: "display:flex;gap:6px;align-items:center" });
      ticking.push((s) => { const { st } = app.run.view(kid.id, s); if (cell.dataset.k !== st) { cell.dataset.k = st; cell.replaceChildren(status_glyph(STATE[st][1]), el("span", { text: STATE[st][0] })); } });
      return el("tr", {}, el("td", {}, el("button", { class: "link", text: kid.name, onclick: () => app.select(kid.id, { reveal: true }) })), el("td", {}, cell));
    })))];
  }

  // The source around the node, with the line that made it; colours say key, value, comment.
  function source(node) {
    const text = app.run.files[node.file];
    if (!text || !node.line) return el("p", { class: "none-yet", text: node.line ? "This file is not recorded." : "This node was made in Python." });
    const lines = text.split("\n"), from = Math.max(1, node.line - 2), to = Math.min(lines.length, node.line + 8);
    const made = el("pre", { class: "yaml", tabindex: "0", "aria-label": `${place(node)}` });
    for (let k = from; k <= to; k++) made.append(el("div", { class: k === node.line ? "at" : "" }, el("span", { text: k }), colour(lines[k - 1] || "")));
    return made;
  }
  function colour(line) {
    const out = el("span"), at = line.search(/(^|\s)#/), code = at < 0 ? line : line.slice(0, at), rest = at < 0 ? "" : line.slice(at);
    const found = code.match(/^(\s*(?:- )?)([\w]+)(:)(.*)$/);
    if (found) out.append(found[1], el("span", { class: "ky", text: found[2] }), found[3], ...found[4].split(/(\$\w[\w.]*)/).map((part) => (part.startsWith("$") ? el("span", { class: "va", text: part }) : part)));
    else out.append(code);
    if (rest) out.append(el("span", { class: "cm", text: rest }));
    return out;
  }

  return { update, reset() { key = ""; }, pick(n, a) { pick = a === undefined ? null : { n, a }; } };
}
