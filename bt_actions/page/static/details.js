// Everything about the node that is selected, at the time that is shown. The page of a node is built anew only
// when its shape changes (another node, another attempt, another outcome); what ticks is set in place.

import { el } from "./dom.js";
import { status_glyph, kind_glyph } from "./glyphs.js";
import { clock, secs, STATE, story, said_by, place, end_words } from "./words.js";
import { phase_at, because, waiting_for } from "./doing.js";
import { live, messages, policies } from "./goal.js";
import { phases } from "./phases.js";
import { source } from "./source.js";

export function create_details(app) {
  const box = document.getElementById("details");
  let wide_now = box.clientWidth || 400;
  new ResizeObserver(() => {
    wide_now = box.clientWidth;
    app.touch();
  }).observe(box);
  let key = "",
    ticking = [],
    pick = null;

  function update() {
    if (app.hidden("details")) return;
    const { run, s, sel, t } = app,
      node = run.nodes[sel],
      view = run.view(sel, s),
      chosen = pick?.n === sel ? run.attempts[pick.a] : null,
      tries = run.attempts_of(sel, t, chosen);
    const at = tries.includes(chosen) ? chosen : tries.at(-1);
    const now = `${sel}|${view.st}|${at?.g}|${tries.map((a) => `${a.done <= t}${phase_at(a, t)?.st}${said_by(a, t)?.oc}`).join()}|${at?.fb[0]?.t <= t}`;
    if (now !== key) {
      const same = key.split("|")[0] === String(sel),
        top = box.scrollTop;
      key = now;
      build(node, view, tries, at);
      box.scrollTop = same ? top : 0;
    }
    for (const tick of ticking) tick(s, t);
  }

  function build(node, view, tries, at) {
    ticking = [];
    const { run } = app,
      [word, look] = STATE[view.st],
      pill = el("span", { class: `pill tone-${look}` });
    pill.append(status_glyph(look), el("span", { text: word }));
    const path = [];
    for (let up = run.nodes[node.parent]; up; up = run.nodes[up.parent]) path.unshift(up);
    const crumbs = path.flatMap((up, k) => [
      ...(k ? [" › "] : []),
      el("button", { class: "link", text: up.name, onclick: () => app.select(up.id, { reveal: true }) }),
    ]);
    const parts = [
      el("h2", {}, kind_glyph(node), el("span", { text: node.name }), pill),
      el("p", { class: "path" }, crumbs.length ? crumbs : "the root"),
      live(ticking, el("div", { class: "say", "data-look": view.st === "failure" ? "failure" : look }), (s, t) =>
        say(node, run.view(node.id, s), at, s, t),
      ),
    ];
    if (tries.length) parts.push(...attempts(node, tries, at));
    if (at) parts.push(...messages(node, at, app.t, ticking));
    parts.push(
      el("h3", {}, "YAML", el("small", {}, el("code", { text: `${place(node)}${node.col ? `:${node.col}` : ""}` }))),
      source(run.files, node),
    );
    if (node.timeouts) parts.push(...policies(node, at, ticking));
    if (node.children.length) parts.push(...children(node));
    box.replaceChildren(...parts);
  }

  function say(node, view, at, s, t) {
    if (view.st === "idle") return "It has not begun.";
    if (at)
      return `${node.retry.attempts > 1 ? `Attempt ${at.a} of ${node.retry.attempts}. ` : ""}${story(at, node, t)}${view.st === "backoff" && at === view.attempt ? ` Tried again in ${secs(view.ends - t)}.` : ""}`;
    if (view.st === "failure")
      return node.children.length
        ? `It failed after ${secs(view.elapsed)}: ${because(node)}.`
        : s.message[node.id] || `It failed, as it always does: ${node.kind}.`;
    if (view.st === "running") {
      const kids = node.children.filter((kid) => s.status[kid.id] === "running");
      return `It has run for ${secs(view.elapsed)}, and waits for ${kids.map((kid) => kid.name).join(" and ") || "its child"}.`;
    }
    if (view.st === "stopped") return "It was interrupted, and did not end by itself.";
    if (view.st === "success") return `It succeeded after ${secs(view.elapsed)}.`;
    return `${waiting_for(node, view, s)} For ${secs(view.elapsed)} now.`;
  }

  function attempts(node, tries, at) {
    const t = app.t,
      first = tries[0].start,
      body = tries.map((a) => {
        const over = a.done <= t,
          oc = said_by(a, t)?.oc,
          look = !over
            ? STATE[phase_at(a, t)?.st || "running"][1]
            : oc === "SUCCEEDED"
              ? "success"
              : oc === "CANCELED" || !oc
                ? "stopped"
                : "failure";
        const outcome = el("span", { class: "oc" });
        outcome.append(status_glyph(look));
        outcome.append(over ? (oc ?? "not recorded") : STATE[phase_at(a, t)?.st || "running"][0]);
        const accepted =
          a.accepted <= t
            ? `+${secs(a.accepted - (a.phases.find((p) => p.st === "sent")?.from ?? a.start))}`
            : over
              ? "no"
              : "";
        const ran = live(ticking, el("td", { class: "num" }), (s, now) =>
          a.accepted <= now ? secs(Math.min(a.done, now) - a.accepted) : "",
        );
        return el(
          "tr",
          {
            "aria-selected": String(a === at),
            tabindex: "0",
            onclick: () => {
              pick = { n: a.n, a: a.i };
              key = "";
              app.touch();
            },
            onkeydown: (event) => {
              if (event.key === "Enter") event.currentTarget.click();
            },
          },
          el("td", { class: "num", text: a.a }),
          el("td", { class: "num", text: clock(a.start) }),
          el("td", { class: "num", text: accepted }),
          ran,
          el("td", {}, outcome),
          el("td", { text: over ? a.end : "", title: end_words(a.end) }),
        );
      });
    const strip = el("div", { class: "phases", "aria-hidden": "true" });
    ticking.push((s, now) => {
      const wide = wide_now - 32,
        end = Math.max(
          first + 1,
          Math.max(...tries.map((a) => Math.max(Math.min(a.done, now), Math.min(a.backoff || 0, now)))),
        );
      const x = (time) => ((time - first) / (end - first)) * wide,
        k = `${wide}${end}`;
      if (strip.dataset.k === k) return;
      strip.dataset.k = k;
      strip.replaceChildren(...tries.flatMap((a) => phases(a, now, 0, wide, x, a.done <= now ? a.done : null)));
    });
    return [
      el(
        "h3",
        {},
        tries.length === 1 ? "Attempt" : "Attempts",
        el("small", { text: `${tries.length} of ${node.retry.attempts} on ${node.server}` }),
      ),
      strip,
      el(
        "table",
        { class: "tries" },
        el(
          "thead",
          {},
          el(
            "tr",
            {},
            ["#", "Begun", "Accepted", "Ran", "Outcome", "End"].map((head) => el("th", { scope: "col", text: head })),
          ),
        ),
        el("tbody", {}, body),
      ),
    ];
  }

  function children(node) {
    return [
      el("h3", {}, "Children", el("small", { text: String(node.children.length) })),
      el(
        "table",
        {},
        el(
          "tbody",
          {},
          node.children.map((kid) => {
            const cell = el("span", { class: "oc", style: "display:flex;gap:6px;align-items:center" });
            ticking.push((s) => {
              const { st } = app.run.view(kid.id, s);
              if (cell.dataset.k !== st) {
                cell.dataset.k = st;
                cell.replaceChildren(status_glyph(STATE[st][1]), el("span", { text: STATE[st][0] }));
              }
            });
            return el(
              "tr",
              {},
              el(
                "td",
                {},
                el("button", { class: "link", text: kid.name, onclick: () => app.select(kid.id, { reveal: true }) }),
              ),
              el("td", {}, cell),
            );
          }),
        ),
      ),
    ];
  }

  return {
    update,
    reset() {
      key = "";
    },
    pick(n, a) {
      pick = a === undefined ? null : { n, a };
    },
  };
}
