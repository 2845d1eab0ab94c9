// The strip below the header: what runs and what it waits for, or why the run failed.

import { el } from "./dom.js";
import { status_glyph, kind_glyph } from "./glyphs.js";
import { clock, secs, plain, STATE, place } from "./words.js";
import { phase_at, branch_of, waiting_for, cause_of, because } from "./doing.js";

const text = (node, value) => {
  if (node.textContent !== value) node.textContent = value;
};
const place_of = (node, whole) =>
  el(
    "code",
    {},
    el("span", { text: node.line ? (whole ? node.file : node.file.split("/").pop()) : node.kind }),
    node.line ? el("b", { text: `:${node.line}` }) : null,
  );

export function create_strip(app) {
  const why = document.getElementById("why");
  let built = "",
    refs = [],
    picked = null;
  const pick = (at) => {
    picked = at;
    built = "";
    app.touch();
  };

  function update() {
    const gap = app.run.gap_at(app.t);
    if (gap)
      return said(
        "Then",
        "",
        `Nothing is recorded from ${clock(gap.from)} to ${clock(gap.to)}; what is shown is how it stood before`,
      );
    const { run, s } = app,
      { causes, stopped, passed } = run.failures(s),
      over = s.finished && !causes.length ? s.finished.status : "";
    const known = causes.length ? [...causes, ...[...passed].reverse()] : stopped.length ? stopped : passed;
    if (known.length && (picked !== null || causes.length || stopped.length)) return chain(known, causes, stopped);
    if (over && s.finished.error) return said("Why", "failure", s.finished.error);
    const running = s.status[0] === "running" || s.lasting !== null;
    doing(running, known, over);
  }

  function said(word, tone, words) {
    const key = word + words;
    if (built === key) return;
    built = key;
    why.dataset.tone = tone;
    why.replaceChildren(
      el("div", { class: "label" }, el("span", { text: word })),
      el("div", { class: "leaf" }, el("span"), el("b", { text: words, title: words })),
    );
  }

  // What runs: up to three leaves, and goals that are drained.
  function doing(running, known, over) {
    const { run, s, link } = app,
      leaves = running ? run.leaves(s) : [];
    const draining = run.attempts
      .slice(-12)
      .filter((a) => a.start <= s.t && s.status[a.n] !== "running" && phase_at(a, s.t)?.st === "cancel" && !run.over);
    const views = [
      ...leaves.map((n) => [n, run.view(n, s)]),
      ...draining.map((a) => [
        a.n,
        {
          st: "cancel",
          attempt: a,
          drains: true,
          limit: run.nodes[a.n].timeouts?.cancel ?? null,
          used: s.t - phase_at(a, s.t).from,
          rule: "timeout.cancel",
        },
      ]),
    ];
    const when = !running
      ? over === "SUCCESS"
        ? "Done"
        : over
          ? "Stopped"
          : "Not begun"
      : !app.at_head
        ? "Then"
        : link.conn === "live"
          ? "Now"
          : "Last seen";
    const key = `${when}|${known.length}|${views
      .slice(0, 3)
      .map(([n, v]) => n + v.st + (v.drains ? "d" : ""))
      .join()}|${views.length}|${over}`;
    if (built !== key) {
      built = key;
      why.dataset.tone = running ? "running" : over === "SUCCESS" ? "success" : "";
      refs = views.slice(0, 3).map(([n, view]) => {
        const node = run.nodes[n],
          button = el("button", { class: "leaf", onclick: () => app.select(n, { reveal: true }) });
        const branch = branch_of(run, n, s),
          what = el("span"),
          left = el("span", { class: "left" }),
          meter = el("span", { class: "meter", "data-look": STATE[view.st][1] }, el("i"));
        button.append(
          status_glyph(STATE[view.st][1]),
          el(
            "div",
            {},
            branch ? el("span", { class: "up", text: `${branch} ›` }) : null,
            el("b", { text: node.name }),
            kind_glyph(node),
          ),
          el("div", { class: "what" }, left, meter, what),
        );
        return { button, what, left, meter };
      });
      why.classList.toggle("many", refs.length > 2);
      const rest = views.length - refs.length,
        lost = s.lost ? ` ${s.lost} events are missing.` : "";
      const done = over === "SUCCESS" ? "The tree has succeeded" : over ? s.stop?.why || "The run was stopped" : "";
      why.replaceChildren(
        el(
          "div",
          { class: "label" },
          el("span", { text: when }),
          el("small", { text: running ? `${leaves.length} running` : "" }),
        ),
        ...(!running && done ? [el("div", { class: "leaf" }, el("span"), el("b", { text: done + lost }))] : []),
        ...refs.map((ref) => ref.button),
        ...(rest > 0
          ? [el("button", { class: "leaf", text: `and ${rest} more`, onclick: () => app.jump_running() })]
          : []),
        el("span", { class: "gap" }),
        ...(known.length
          ? [
              el(
                "div",
                { class: "step" },
                el("button", {
                  class: "danger wide",
                  title: "Why it failed, and who dealt with it",
                  onclick: () => pick(known.length - 1),
                  text: `${known.length === 1 ? "1 failure" : `${known.length} failures`}${running ? "" : ", dealt with"}`,
                }),
              ),
            ]
          : []),
      );
    }
    views.slice(0, 3).forEach(([n, view], k) => {
      const ref = refs[k],
        told = waiting_for(run.nodes[n], view, s),
        { limit } = view;
      text(ref.what, told);
      if (ref.button.title !== told) ref.button.title = told;
      const soon = limit !== null && limit - view.used < Math.min(2, limit * 0.25) && view.st !== "backoff";
      text(
        ref.left,
        view.st === "tick"
          ? `in its tick for ${secs(view.used)}`
          : limit === null
            ? `${secs(view.elapsed ?? view.used)}, no deadline`
            : `${secs(Math.max(0, limit - view.used))} left of ${plain(limit)}`,
      );
      for (const one of [ref.left, ref.meter]) one.classList.toggle("soon", soon);
      ref.meter.firstChild.style.transform = `scaleX(${limit ? Math.min(1, view.used / limit) : 0})`;
      ref.meter.style.visibility = limit ? "" : "hidden";
    });
  }

  // The root cause first, then who passed it on, or who went on in spite of it.
  function chain(known, causes, stopped) {
    const { run, s } = app,
      at = Math.min(picked ?? 0, known.length - 1),
      failure = known[at],
      links = run.chain(failure, s),
      is_cause = causes.includes(failure),
      is_stopped = stopped.includes(failure);
    const key = `chain${at}/${known.length}|${failure.number}|${failure.by}|${is_cause}|${run.info.exit_code}`;
    if (built === key) return;
    built = key;
    why.dataset.tone = is_stopped ? "" : "failure";
    const items = links.map((n, k) => {
      const node = run.nodes[n],
        button = el("button", {
          class: "cause",
          onclick: () => {
            app.select(n, { reveal: true, attempt: k ? undefined : failure.attempt });
            if (!k) app.seek(failure.t);
          },
        });
      const title = el("b");
      let words;
      if (!k) {
        const [outcome, reason] = is_stopped ? ["stopped", s.stop?.why || ""] : cause_of(run, failure),
          branch = branch_of(run, n, s);
        title.append(
          status_glyph(is_stopped ? "stopped" : "failure"),
          el("span", { text: `${branch ? `${branch} › ` : ""}${node.name}: ${outcome}` }),
        );
        words = reason;
        button.title = `At ${clock(failure.t)}: ${reason} (${place(node)})`;
        app.tell(`${node.name}: ${outcome}. ${button.title}`);
      } else {
        const dealt = n === failure.by;
        words = dealt ? "went on" : is_stopped ? "" : because(node);
        title.append(
          status_glyph(dealt ? "running" : is_stopped ? "stopped" : "failure"),
          el("span", { text: node.name }),
        );
        button.title = `${node.name} (${node.kind}): ${words} (${place(node)})`;
      }
      button.append(title, el("small", {}, el("span", { text: words }), place_of(node, !k)));
      return button;
    });
    const exit = run.info.exit_code,
      sub = is_cause
        ? exit === undefined
          ? "it failed"
          : `exit code ${exit}`
        : is_stopped
          ? "while it ran"
          : failure.by === null
            ? "so far"
            : "dealt with";
    const many = known.length > 1;
    why.replaceChildren(
      el("div", { class: "label" }, el("span", { text: is_stopped ? "Stopped" : "Why" }), el("small", { text: sub })),
      el("div", { class: "chain" }, items),
      el(
        "div",
        { class: "step" },
        many
          ? el("button", {
              text: "‹",
              "aria-label": "Failure before",
              onclick: () => pick((at + known.length - 1) % known.length),
            })
          : null,
        many ? el("span", { class: "num", text: `${at + 1} of ${known.length}` }) : null,
        many
          ? el("button", { text: "›", "aria-label": "Next failure", onclick: () => pick((at + 1) % known.length) })
          : null,
        causes.length || stopped.length
          ? null
          : el("button", { class: "wide", text: "Back to now", onclick: () => pick(null) }),
      ),
    );
  }

  return {
    update,
    reset() {
      built = "";
      picked = null;
    },
  };
}
