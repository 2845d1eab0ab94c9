// The bars of the timeline: of each attempt with its phases, and of each wait. A bar that is over is painted again when
// the scale or the selection changes, and not otherwise.

import { el } from "./dom.js";
import { status_glyph } from "./glyphs.js";
import { clock, PHASE_WORD } from "./words.js";
import { Crowd } from "./crowd.js";
import { phases, px } from "./phases.js";

const DENSE = 120; // waits from which on those that overlap are one bar

export class Bars {
  constructor(app, span, rows) {
    Object.assign(this, {
      app,
      span,
      rows,
      bars: new Map(),
      crowd: new Crowd(app.run.waits),
      settled: 0,
      covered: new Map(),
    });
  }

  of(element) {
    return this.bars.get(element.dataset.id);
  }

  paint(is_same) {
    const { run } = this.app,
      is_dense = run.waits.length > DENSE;
    this.is_same = is_same &&= is_dense === this.is_dense;
    this.is_dense = is_dense;
    this.seen = new Set();
    if (!is_same) {
      this.settled = 0;
      this.covered = new Map();
    }
    if (is_dense) for (const one of this.crowd.now()) this.stretch(one);
    else for (const wait of run.waits) this.wait(wait);
    for (let k = this.settled; k < run.attempts.length; k++) {
      const is_over = this.attempt(run.attempts[k]);
      if (is_over && this.settled === k) this.settled++;
    }
    if (is_same) return;
    for (const id of this.bars.keys()) if (!this.seen.has(id)) this.drop(id);
  }

  drop(id) {
    this.bars.get(id)?.el.remove();
    this.bars.delete(id);
  }

  // The bar from one time to another in a row, with its ends in pixels; null where it is not in sight, or needs no paint.
  put(name, id, from, to) {
    const { span, rows, bars } = this;
    if (to < span.begins || from > span.ends) return null;
    this.seen.add(id);
    let bar = bars.get(id);
    if (this.is_same && bar?.still) return null;
    if (!bar) {
      bar = { el: el("button", { class: "bar", tabindex: "-1", "data-id": id }), was: "" };
      bars.set(id, bar);
      rows.get(name).row.append(bar.el);
    }
    bar.a = Math.max(span.left - 4, span.x_of(from));
    bar.b = Math.min(span.right + 14, span.x_of(to));
    return bar;
  }

  // Whether a bar has to be painted: something of what it depends on has changed.
  is_new(bar, key, n) {
    const picked = this.app.sel === n,
      now = `${px(bar.a)}|${px(bar.b)}|${key}|${picked}`;
    if (bar.was === now) return false;
    bar.was = now;
    bar.el.style.transform = `translateX(${px(bar.a)})`;
    bar.el.style.width = px(Math.max(3, bar.b - bar.a));
    bar.el.classList.toggle("picked", picked);
    return true;
  }

  wait(wait) {
    const { app } = this,
      open = wait.to === Infinity,
      { name } = app.run.nodes[wait.n],
      id = `w${wait.n}@${wait.from}`;
    if (wait.to - wait.from < 0.05) return this.drop(id);
    const bar = this.put("", id, wait.from, Math.min(wait.to, app.head));
    if (!bar || !this.is_new(bar, open, wait.n)) return;
    Object.assign(bar, { still: !open, n: wait.n, from: wait.from, to: wait.to });
    bar.el.setAttribute("aria-label", `${name}, waited from ${clock(wait.from)}`);
    bar.el.replaceChildren(el("span", { class: open ? "ph ph-wait" : "ph ph-wait done", style: "left:0;right:0" }));
    if (bar.b - bar.a > Math.min(48, name.length * 6 + 12)) bar.el.append(el("span", { class: "tx", text: name }));
  }

  stretch(one) {
    const until = one.until(),
      bar = this.put("", `m${one.from}`, one.from, Math.min(until, this.app.head));
    if (!bar || !this.is_new(bar, one.count, -1)) return;
    Object.assign(bar, { n: one.n, from: one.from, to: until });
    bar.el.replaceChildren(
      el("span", { class: "ph ph-wait", style: "left:0;right:0" }),
      el("span", { class: "tx", text: `${one.count} waits` }),
    );
  }

  // Returns whether nothing of it changes any more.
  attempt(a) {
    const { app, span } = this,
      { head } = app,
      open = a.done === Infinity,
      id = `g${a.g}`;
    const last = Math.max(open ? head : a.done, Math.min(a.backoff || 0, head)),
      still = !open && last < head - 0.01 && !(a.backoff > head);
    if (!this.rows.has(a.server) || this.is_hidden(a, id, last)) return still;
    const bar = this.put(a.server, id, a.start, last);
    if (!bar || !this.is_new(bar, `${open}${a.phases.length}${a.oc}`, a.n)) return still;
    this.covered.set(a.server, Math.max(this.covered.get(a.server) || 0, bar.b, bar.a + 3));
    Object.assign(bar, { still, n: a.n, from: a.start, to: last, attempt: a });
    const node = app.run.nodes[a.n],
      failed = !open && a.oc !== "SUCCEEDED";
    bar.el.setAttribute(
      "aria-label",
      `${node.name}, attempt ${a.a}, ${open ? PHASE_WORD[a.phases.at(-1).st] : (a.oc ?? "not recorded")}, from ${clock(a.start)}`,
    );
    bar.el.replaceChildren(
      ...phases(a, head, bar.a, bar.b, (t) => span.x_of(t), open ? null : a.done),
      ...this.name(bar, a, node, failed),
    );
    if (failed) {
      const style = `right:auto;transform:none;left:${px(span.x_of(a.done) - bar.a - 7)}`;
      bar.el.append(el("span", { class: "endm sq", style }, status_glyph(a.oc === "CANCELED" ? "stopped" : "failure")));
    }
    return still;
  }

  // Whether all of its pixels are those of bars before it: it would not be seen.
  is_hidden(a, id, last) {
    return (
      a.oc === "SUCCEEDED" &&
      this.app.sel !== a.n &&
      !this.bars.has(id) &&
      this.span.x_of(last) < this.covered.get(a.server)
    );
  }

  // The name stands where the goal executes, or where it waits; not at all where less than a few letters fit.
  name(bar, a, node, failed) {
    const { span } = this,
      { head } = this.app,
      until = (phase) => Math.min(phase.to, head);
    const longest = (x, y) => (until(y) - y.from > until(x) - x.from ? y : x);
    const told = a.phases.findLast((p) => p.st === "exec") || a.phases.reduce(longest);
    const from = Math.max(bar.a, span.x_of(told.from)),
      text = a.a > 1 ? `#${a.a} ${node.name}` : node.name;
    const wide = span.x_of(until(told)) - from - (failed && told.to === a.done ? 9 : 0);
    if (wide <= Math.min(40, text.length * 6 + 10)) return [];
    return [
      el("span", {
        class: told.st === "exec" ? "tx" : "tx chip",
        style: `left:${px(from - bar.a)};max-width:${px(wide)}`,
        text,
      }),
    ];
  }
}
