// Where in time the page stands, and what moves it: events, failures, play, live.

import { el } from "./dom.js";
import { icon } from "./glyphs.js";
import { clock } from "./words.js";
import { upper } from "./state.js";

const find = (id) => document.getElementById(id);
const set = (node, key, paint) => {
  if (node.dataset.key !== key) {
    node.dataset.key = key;
    paint();
  }
};

export function create_transport(app) {
  for (const [id, name] of Object.entries({
    "prev-fail": "prev_fail",
    "prev-event": "prev",
    "next-event": "next",
    "next-fail": "next_fail",
  }))
    find(id).replaceChildren(icon(name));

  function update() {
    const { run, link } = app,
      live = !run.over && link.conn === "live",
      play = find("play"),
      playing = app.playing || (app.at_head && live);
    set(play, playing ? "pause" : "play", () => {
      play.replaceChildren(icon(playing ? "pause" : "play"));
      play.setAttribute("aria-label", playing ? "Pause" : "Play");
    });
    const of = run.over || !app.at_head ? `of ${clock(app.head)}` : "";
    set(find("clock"), clock(app.t) + of, () =>
      find("clock").replaceChildren(`${clock(app.t)} `, el("small", { text: of })),
    );
    const go = find("go-live"),
      back = app.head - app.t;
    const words = run.over
      ? app.at_head
        ? "At the end"
        : "To the end"
      : app.at_head
        ? live
          ? "Following live"
          : "At the last event"
        : `${back < 60 ? `${back.toFixed(1)} s` : clock(back)} back: go live`;
    set(go, words, () => {
      go.textContent = words;
      go.classList.toggle("at", app.at_head);
    });
    const told = `event ${run.index_at(app.t)} of ${run.events.length}`;
    set(find("at-event"), told, () => {
      find("at-event").textContent = told;
    });
  }

  const next = (t) => app.run.steps[upper(app.run.steps, t + 1e-6, (one) => one)] ?? Infinity;
  function step(by) {
    const { steps } = app.run,
      at = by > 0 ? upper(steps, app.t + 1e-6, (one) => one) : upper(steps, app.t - 1e-6, (one) => one) - 1,
      t = steps[at];
    app.playing = false;
    if (t !== undefined && t <= app.head) app.seek(t);
    else if (by < 0) app.seek(0);
  }
  function fail(by) {
    const stops = app.run.attempts
      .filter((a) => a.decided && a.oc !== "SUCCEEDED" && a.oc !== "CANCELED" && a.decided <= app.head)
      .sort((a, b) => a.decided - b.decided);
    const one = by > 0 ? stops.find((a) => a.decided > app.t + 1e-6) : stops.findLast((a) => a.decided < app.t - 1e-6);
    app.playing = false;
    if (!one) return app.say(by > 0 ? "No later failure" : "No earlier failure");
    app.seek(one.decided);
    app.select(one.n, { reveal: true, attempt: one.i });
  }
  function play() {
    if (app.at_head && !app.run.over) {
      app.seek(app.head - 0.001);
      app.playing = false;
      app.say("Stopped here; the run goes on. L goes back to live.");
    } else {
      if (app.run.over && app.at_head) app.t = 0;
      app.playing = !app.playing;
      app.at_head = false;
    }
    app.touch();
  }
  return { update, next, step, fail, play };
}
