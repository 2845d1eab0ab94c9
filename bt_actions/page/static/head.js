// The top of the page: which run, how it stands, and the connection.

import { el } from "./dom.js";
import { status_glyph } from "./glyphs.js";
import { clock, span, CROWDED, STATE } from "./words.js";

const find = (id) => document.getElementById(id);
const text = (node, value) => {
  if (node.textContent !== value) node.textContent = value;
};
const LOOK = { SUCCESS: "success", FAILURE: "failure", INVALID: "stopped" };
export const look_of = (one) => (one.written && !one.status ? "running" : LOOK[one.status] || "stopped");
const WORD = { running: "Goes on", success: "Succeeded", failure: "Failed", stopped: "Stopped" };
export const word_of = (one) => (!one.status && !one.written ? "Never finished" : WORD[look_of(one)]);
const when = (wall) => new Date(wall * 1000).toLocaleString();

export function create_head(app) {
  // The switcher of runs.
  const runs = find("runs"),
    opener = find("switch");
  const shut = (focus) => {
    runs.hidden = true;
    opener.setAttribute("aria-expanded", "false");
    if (focus) opener.focus();
  };
  opener.addEventListener("click", async () => {
    if (!runs.hidden) return shut();
    const all = await app.fetch_runs();
    runs.replaceChildren(
      ...all.slice(0, 30).map((one) => {
        const option = el("button", {
          class: "opt",
          role: "option",
          "aria-selected": String(one.run_id === app.run.key),
          onclick: () => {
            shut(true);
            app.open(one.run_id);
          },
        });
        option.append(
          status_glyph(look_of(one)),
          el("b", { text: one.tree }),
          el("span", { class: "num soft", text: one.seconds === null ? "" : clock(one.seconds) }),
          el("span", {
            text: [word_of(one), when(one.began), one.run_id.slice(0, 8), one.cause].filter(Boolean).join("  ·  "),
          }),
        );
        return option;
      }),
    );
    const all_runs = () => {
      shut(true);
      location.hash = "#runs";
    };
    if (!app.is_stored)
      runs.append(
        el(
          "button",
          { class: "opt", role: "option", "aria-selected": "false", onclick: all_runs },
          el("span"),
          el("b", { text: "All runs" }),
        ),
      );
    runs.hidden = false;
    opener.setAttribute("aria-expanded", "true");
    (runs.querySelector("[aria-selected=true]") || runs.firstChild)?.focus();
  });
  runs.addEventListener("keydown", (event) => {
    const options = [...runs.querySelectorAll(".opt")],
      at = options.indexOf(document.activeElement);
    if (event.key === "Escape") shut(true);
    if (event.key === "ArrowDown") options[Math.min(at + 1, options.length - 1)].focus();
    if (event.key === "ArrowUp") options[Math.max(at - 1, 0)].focus();
    if (event.key.startsWith("Arrow")) event.preventDefault();
    event.stopPropagation();
  });
  document.addEventListener("pointerdown", (event) => {
    if (!runs.hidden && !event.target.closest(".switch")) shut();
  });

  // The status of the run at the time that is shown, as far as that is known.
  function standing() {
    const { run, s, link } = app,
      over = run.over && app.at_head;
    if (run.gap_at(app.t)) return ["Not recorded", "stopped"];
    if (s.finished?.error && !s.stop) return STATE.failure;
    if (s.finished)
      return { SUCCESS: STATE.success, FAILURE: STATE.failure, INVALID: ["Stopped", "stopped"] }[s.finished.status];
    if (app.at_head && link.unrecorded) return ["Not recorded", "stopped"];
    if (over && !link.ended && !link.goes_on) return ["Never finished", "stopped"];
    if (s.paused) return ["Paused", "waiting"];
    if (s.stop) return ["Stopping", "cancel"];
    if (app.at_head && link.conn === "lost") return ["Was running", "running"];
    return STATE[s.status[0] || "idle"];
  }

  function update() {
    const { run, link } = app,
      { info } = run,
      small = app.narrow.matches;
    text(find("tree-name"), info.tree || "…");
    const { host, node, domain, simulation } = info.where || {},
      place = find("tree-where");
    text(
      place,
      info.wall
        ? [simulation && "simulated", host, when(info.wall), `run ${info.id.slice(0, 8)}`].filter(Boolean).join("  ·  ")
        : "",
    );
    place.title = [simulation, node, domain && `domain ${domain}`, info.id].filter(Boolean).join(", ");
    const [word, look] = standing(),
      pill = find("status"),
      key = word + look;
    if (pill.dataset.k !== key) {
      pill.dataset.k = key;
      pill.className = `pill tone-${look}`;
      pill.replaceChildren(status_glyph(look), el("span", { text: word }));
      document.title = find("title").textContent = `${word}: ${info.tree}`;
    }
    text(find("elapsed"), clock(app.t));
    const conn = find("conn"),
      ago = Math.floor(link.silence),
      lost = `Lost ${small ? "" : "for "}${span(link.silence)}`,
      of = small ? "" : "for ",
      { conn: now } = link;
    if (conn.dataset.conn !== now) {
      conn.dataset.conn = now;
      conn.replaceChildren(el("i"), el("span"));
      document.body.dataset.conn = now;
    }
    text(
      conn.lastChild,
      { live: "Live", stale: `Stale ${of}${ago} s`, unrecorded: "Not recorded", lost, gone: lost, replay: "Replay" }[
        now
      ],
    );
    conn.title = {
      live: "Events come",
      stale: "Nothing has come from the run, not even a heartbeat",
      unrecorded: "The run goes on, and what happens is not recorded",
      lost: "The connection is gone; what is shown is what was last known",
      gone: "The process of the run was killed; what is shown is what was last known",
      replay: "Nothing more comes; this is the record",
    }[now];
    banner(now, ago);
  }

  function banner(now, ago) {
    const { run, link } = app,
      box = find("banner");
    const killed = now === "gone",
      broken = link.why ? "lost" : "";
    const tone =
      broken ||
      (killed || link.unrecorded || link.goes_on
        ? "stale"
        : now === "stale" || now === "lost"
          ? now
          : link.damaged
            ? "stale"
            : "");
    const is_new = box.dataset.k !== tone + now;
    if (is_new) {
      box.dataset.k = tone + now;
      box.className = tone;
      box.replaceChildren(
        ...(tone ? [el("span", { class: "num" })] : []),
        ...(now === "lost" ? [el("button", { text: "Try now", onclick: () => link.open() })] : []),
      );
    }
    if (!tone) return;
    const last = `As of ${clock(run.clock)}`,
      next = Math.max(0, Math.ceil((link.next - performance.now()) / 1000));
    const hurt = link.damaged
      ? ` ${link.damaged} of its records ${link.damaged === 1 ? "is" : "are"} damaged: something may be missing.`
      : "";
    const words = broken
      ? `The recording cannot be read: ${link.why}`
      : link.goes_on
        ? `Written while the run went on, at ${clock(run.clock)}.${hurt}`
        : link.unrecorded
          ? `Not recorded since ${link.unrecorded}. ${link.outcome ? `The run ended later: ${link.outcome}.` : `${last}.`}`
          : killed
            ? `The recording ends at ${clock(run.clock)}, ${when(run.info.wall + run.clock)}: its process was killed, and what ran then may still run.${hurt}`
            : hurt && !["stale", "lost"].includes(now)
              ? `The recording:${hurt}`
              : link.stream?.is_crowded
                ? `${last}. ${CROWDED.join(". ")}`
                : now === "lost"
                  ? `${last}; ${next ? `next try in ${next} s` : "trying"}. What is missed is filled in.`
                  : link.tick > 2
                    ? `${last}: the tick of the tree lasts for ${Math.floor(link.tick + ago)} s.`
                    : `${last}: nothing has come since, not even a heartbeat.`;
    text(box.firstChild, words);
    if (is_new) app.tell(words); // once: the seconds of a countdown are not said
    box.title = words;
  }
  return { update };
}
