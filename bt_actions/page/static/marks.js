// What stands in the timeline beside bars: the ruler, squeezed gaps, what is not recorded, failures, and servers out of
// sight.

import { el } from "./dom.js";
import { status_glyph } from "./glyphs.js";
import { clock, secs } from "./words.js";
import { px } from "./phases.js";

const NICE = [0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1800];

export class Marks {
  constructor(app, span, lanes, ruler, rows) {
    Object.assign(this, { app, span, lanes, ruler, rows, key: "" });
  }

  paint() {
    const { app, span, lanes } = this,
      { run } = app,
      { gaps } = span.scale;
    const now = `${span.key}|${gaps.at(-1)?.to.toFixed(1)}|${run.missing.length}|${run.attempts.length}|${run.decided}`;
    if (this.key === now) return;
    this.key = now;
    for (const old of lanes.querySelectorAll(".tick, .flag, .squeeze, .leap, .missing")) old.remove();
    this.ticks();
    for (const gap of gaps) this.squeezed(gap);
    for (const gap of run.missing) {
      const left = Math.max(span.left, span.x_of(gap.from)),
        width = Math.max(2, span.x_of(gap.to) - span.x_of(gap.from));
      lanes.append(
        el("div", {
          class: "missing",
          style: `left:${px(left)};width:${px(width)};height:${span.tall - 24}px`,
          title: "Not recorded",
        }),
      );
    }
    let before = -9;
    for (const a of run.attempts) {
      if (!a.decided || a.oc === "SUCCEEDED" || a.oc === "CANCELED") continue;
      const x = span.x_of(a.decided);
      if (x < span.left || x > span.right || Math.abs(x - before) < 2) continue; // as good as at the same place
      before = x;
      this.flag(a, x);
    }
  }

  ticks() {
    const { span } = this,
      step = NICE.find((one) => (one / (span.to - span.from)) * span.width > 74) || 3600;
    let before = -99;
    for (let t = Math.ceil(span.begins / step) * step; t <= span.ends; t += step) {
      const x = span.x_of(t),
        is_in = (gap) => (t > gap.from && t < gap.to) || Math.abs(x + 16 - span.x_of(gap.from)) < 44;
      if (x - before < 58 || x > span.right - 34 || span.scale.gaps.some(is_in)) continue;
      before = x;
      this.ruler.append(
        el("span", { class: "tick", style: `left:${px(x)}`, text: step < 1 ? clock(t) : clock(t).slice(0, -2) }),
      );
    }
  }

  squeezed(gap) {
    const { span } = this,
      x = span.x_of((gap.from + gap.to) / 2),
      wide = 26;
    if (x < span.left || x > span.right) return;
    this.lanes.append(
      el("div", { class: "squeeze", style: `left:${px(x - wide / 2)};width:${wide}px;height:${span.tall - 24}px` }),
    );
    this.ruler.append(
      el("span", {
        class: "leap",
        style: `left:${px(x)}`,
        text: secs(gap.to - gap.from),
        title: "Squeezed: no goal was under way",
      }),
    );
  }

  flag(a, x) {
    const { app } = this,
      told = `${app.run.nodes[a.n].name}: ${a.oc} at ${clock(a.decided)}`;
    const press = (event) => {
      event.stopPropagation();
      app.seek(a.decided);
      app.select(a.n, { reveal: true, attempt: a.i });
    };
    this.rows.get("!").row.append(
      el(
        "button",
        {
          class: "flag",
          tabindex: "-1",
          style: `left:${px(x)}`,
          title: told,
          "aria-label": told,
          onclick: press,
        },
        status_glyph(a.backoff ? "backoff" : "failure"),
      ),
    );
  }

  // Whether a server is in sight, and when it was not.
  presence(name, lane) {
    const { app, span } = this,
      up = app.s.up.get(name)?.up,
      look = up ? "success" : app.s.up.has(name) ? "failure" : "idle";
    if (lane.up !== look) {
      lane.up = look;
      lane.label.firstChild.replaceWith(status_glyph(look));
      lane.label.title = `${name}: ${{ success: "in sight", failure: "not in sight", idle: "not seen yet" }[look]}`;
      lane.label.setAttribute("role", "img");
      lane.label.setAttribute("aria-label", lane.label.title);
    }
    const seen = app.run.presence.get(name) || [],
      gaps = [];
    seen.forEach((one, k) => {
      if (one.to !== Infinity) gaps.push([one.to, seen[k + 1]?.from ?? app.head]);
    });
    if (!gaps.length && !lane.gone.length) return;
    while (lane.gone.length < gaps.length) {
      lane.gone.push(el("div", { class: "gone", title: `${name}: not in sight` }));
      lane.label.after(lane.gone.at(-1));
    }
    lane.gone.forEach((made, k) => {
      made.hidden = !gaps[k];
      if (!gaps[k]) return;
      const [a, b] = gaps[k].map((t) => span.x_of(t)),
        next = app.run.attempts.find((one) => one.server === name && one.start >= gaps[k][0] - 0.01);
      made.textContent = Math.min(b, next ? span.x_of(next.start) : b) - a > 74 ? "not in sight" : "";
      made.style.left = px(a);
      made.style.width = px(Math.max(2, b - a));
    });
  }
}
