// The timeline: a lane for each action server with the bars of its attempts, marks, and the cursor.

import { el } from "./dom.js";
import { status_glyph } from "./glyphs.js";
import { clock } from "./words.js";
import { Bars } from "./bars.js";
import { Marks } from "./marks.js";
import { px } from "./phases.js";
import { scrub } from "./scrub.js";
import { Span } from "./span.js";

const LANES = 40; // servers that have one

export function create_timeline(app) {
  const lanes = document.getElementById("lanes"),
    span = new Span();
  let bars,
    marks,
    rows = new Map(),
    cursor,
    past,
    unseen,
    stamp = "";
  function measure() {
    span.left = parseFloat(getComputedStyle(lanes).getPropertyValue("--label")) || 0;
    span.width = lanes.clientWidth - span.left - 16;
    span.tall = lanes.scrollHeight;
    app.touch();
  }
  new ResizeObserver(measure).observe(lanes);

  function build() {
    rows = new Map();
    const ruler = el("div", { id: "ruler" }, el("div", { class: "corner", text: "Action server" }));
    cursor = el("div", { id: "cursor" }, el("b"));
    past = el("div", { class: "past" });
    unseen = el("div", { class: "unseen", hidden: true });
    const make = (name, words, look = "idle") => {
      const label = el("div", { class: "label" }, status_glyph(look), el("span", { text: words, title: words })),
        row = el("div", { class: "lane" }, label);
      rows.set(name, { row, label, up: null, gone: [] });
      return row;
    };
    const fails = make("!", "failures, retries", "failure");
    fails.classList.add("flags");
    const servers = app.run.servers.slice(0, LANES).map((name) => make(name, name));
    lanes.replaceChildren(ruler, fails, make("", "waits (no server)", "waiting"), ...servers, past, unseen, cursor);
    bars = new Bars(app, span, rows);
    marks = new Marks(app, span, lanes, ruler, rows);
    stamp = "";
    measure();
  }

  function update() {
    if (span.width <= 0) return;
    span.fit(app);
    const now = `${span.key}|${app.sel}`;
    bars.paint(now === stamp);
    stamp = now;
    for (const [name, lane] of rows) if (name.length > 1) marks.presence(name, lane);
    marks.paint();
    point();
  }

  // The cursor, what lies behind it, and what was not seen.
  function point() {
    const { run, t, head, link } = app,
      x = span.x_of(Math.min(t, head)),
      most = span.right + 14;
    const at = app.at_head && !run.over && link.conn === "live" ? "now" : clock(t),
      label = cursor.firstChild;
    cursor.style.transform = `translateX(${px(Math.max(span.left, Math.min(most, x)))})`;
    cursor.hidden = x < span.left - 1 || x > most + 1;
    cursor.style.height = px(span.tall);
    label.style.transform = `translateX(${Math.max(-100, Math.min(0, -50 - Math.max(0, x + 30 - most) * 1.7)).toFixed(0)}%)`;
    if (label.textContent !== at) label.textContent = at;
    past.hidden = app.at_head;
    unseen.hidden = link.conn !== "lost" && link.conn !== "stale";
    for (const [veil, from] of [
      [past, x],
      [unseen, span.x_of(head)],
    ])
      Object.assign(veil.style, { left: px(from), right: "0", height: px(span.tall - 24) });
  }

  const zoom = (by) => span.zoom(app, by);
  scrub(app, lanes, span, (element) => bars.of(element));
  lanes.addEventListener(
    "wheel",
    (event) => {
      if (event.ctrlKey) {
        event.preventDefault();
        zoom(Math.exp(event.deltaY / 300));
      }
    },
    { passive: false },
  );
  return { update, build, zoom };
}
