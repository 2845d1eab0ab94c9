// The timeline: a lane for each action server, a bar for each attempt, its phases as patterns; and the cursor.
// Time runs through `scale`, which squeezes gaps. The right end of the picture grows in steps, never by the frame.

import { el } from "./dom.js";
import { status_glyph } from "./glyphs.js";
import { clock, secs, PHASE_WORD } from "./words.js";

const NICE = [0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 1800], STEP = 15;
const px = (value) => `${value.toFixed(1)}px`;

export function create_timeline(app) {
  const lanes = document.getElementById("lanes"), tip = el("div", { id: "tip", hidden: true });
  document.body.append(tip);
  let scale, range = null, width = 0, left = 0, bars = new Map(), rows = new Map(), ruler, cursor, flag_key = "", past, unseen, tall = 0, stamp = "";
  const measure = () => { left = parseFloat(getComputedStyle(lanes).getPropertyValue("--label")) || 0; width = lanes.clientWidth - left - 16; tall = lanes.scrollHeight; stamp = flag_key = ""; app.touch(); };
  new ResizeObserver(measure).observe(lanes);

  function build() {
    bars = new Map();
    merged = [];
    counted = 0;
    rows = new Map();
    ruler = el("div", { id: "ruler" }, el("div", { class: "corner", text: "Action server" }));
    cursor = el("div", { id: "cursor" }, el("b"));
    past = el("div", { class: "past" });
    unseen = el("div", { class: "unseen", hidden: true });
    const make = (name, words) => { const label = el("div", { class: "label" }, el("i"), el("span", { text: words, title: words })), row = el("div", { class: "lane" }, label); rows.set(name, { row, label, up: null, gone: [] }); return row; };
    const fails = make("!", "failures, retries");
    fails.classList.add("flags");
    lanes.replaceChildren(ruler, fails, make("", "waits (no server)"), ...app.run.servers.slice(0, 40).map((name) => make(name, name)), past, unseen, cursor);
    rows.get("").label.firstChild.replaceWith(status_glyph("waiting"));
    rows.get("!").label.firstChild.replaceWith(status_glyph("failure"));
    stamp = flag_key = "";
    measure();
  }

  const x_of = (t) => left + (scale.to(t) - range[0]) / (range[1] - range[0]) * width;
  const t_of = (x) => scale.back(range[0] + (x - left) / width * (range[1] - range[0]));

  function frame() {
    const { run, head } = app;
    scale = run.scale(head, app.squeeze);
    const all = scale.to(head), end = run.over ? all * 1.012 : Math.max(STEP, Math.ceil((all + STEP * 0.12) / STEP) * STEP);
    if (!app.zoomed) range = [0, end];
    else {
      const span = Math.min(end, app.zoomed), at = scale.to(app.t);
      let from = range ? range[0] : 0;
      if (app.at_head && at > from + span * 0.94) from = at - span * 0.8;
      if (at < from || at > from + span) from = at - span / 2;
      from = Math.max(0, Math.min(from, Math.max(0, end - span)));
      range = [from, from + span];
    }
  }

  function update() {
    if (width <= 0) return;
    frame();
    const now = `${range}|${width}|${left}|${app.sel}|${scale.gaps.map((gap) => gap.from)}`, same = now === stamp;
    stamp = now;
    const { run, t, head } = app;
    const in_sight = (from, to) => scale.to(to) >= range[0] && scale.to(from) <= range[1];
    const seen = new Set();
    const put = (name, id, from, to, paint) => {
      if (!in_sight(from, to)) return;
      seen.add(id);
      let bar = bars.get(id);
      if (same && bar?.still) return;     // it is over, and nothing has moved
      if (!bar) { bar = { el: el("button", { class: "bar", tabindex: "-1", "data-id": id }), was: "" }; bars.set(id, bar); rows.get(name).row.append(bar.el); }
      const a = Math.max(left - 4, x_of(from)), b = Math.min(left + width + 14, x_of(to)), place = `${px(a)}|${px(b)}`;
      paint(bar, a, b, place);
    };
    const dense = run.waits.length > 120;
    if (dense) crowd(head, put);
    else for (const wait of run.waits) {
      if (wait.to - wait.from < 0.05 && wait.to !== Infinity) continue;
      put("", `w${wait.n}@${wait.from}`, wait.from, Math.min(wait.to, head), (bar, a, b, place) => {
        const k = `${place}${wait.to === Infinity}${app.sel === wait.n}`;
        if (bar.was === k) return;
        bar.was = k;
        bar.el.style.transform = `translateX(${px(a)})`;
        bar.el.style.width = px(Math.max(3, b - a));
        bar.el.classList.toggle("picked", app.sel === wait.n);
        bar.el.setAttribute("aria-label", `${run.nodes[wait.n].name}, waited from ${clock(wait.from)}`);
        bar.el.replaceChildren(el("span", { class: wait.to === Infinity ? "ph ph-wait" : "ph ph-wait done", style: "left:0;right:0" }), ...(b - a > Math.min(48, run.nodes[wait.n].name.length * 6 + 12) ? [el("span", { class: "tx", text: run.nodes[wait.n].name })] : []));
        bar.still = wait.to !== Infinity; bar.n = wait.n; bar.from = wait.from; bar.to = wait.to; bar.wait = wait;
      });
    }
    for (const a of run.attempts) {
      const last = Math.max(a.done === Infinity ? head : a.done, Math.min(a.backoff || 0, head));
      if (!rows.has(a.server)) continue;
      put(a.server, `g${a.g}`, a.start, last, (bar, from, to, place) => {
        const open = a.done === Infinity, picked = app.sel === a.n, k = `${place}${open}${a.phases.length}${a.oc}${picked}`;
        if (bar.was === k) return;
        bar.was = k;
        Object.assign(bar, { still: !open && last < head - 0.01 && !(a.backoff > head), n: a.n, from: a.start, to: last, attempt: a });
        bar.el.style.transform = `translateX(${px(from)})`;
        bar.el.style.width = px(Math.max(3, to - from));
        bar.el.classList.toggle("picked", picked);
        bar.el.setAttribute("aria-label", `${run.nodes[a.n].name}, attempt ${a.a}, ${open ? PHASE_WORD[a.phases.at(-1).st] : a.oc}, from ${clock(a.start)}`);
        bar.el.replaceChildren(...phases(a, head, from, to, x_of, open ? null : a.done));
        // The name stands where the goal executes, or where it waits; not at all where less than a few letters fit.
        const told = a.phases.findLast((p) => p.st === "exec") || a.phases.reduce((x, y) => (Math.min(y.to, head) - y.from > Math.min(x.to, head) - x.from ? y : x));
        const tx = Math.max(from, x_of(told.from)), wide = x_of(Math.min(told.to, head)) - tx - (!open && a.oc !== "SUCCEEDED" && told.to === a.done ? 9 : 0), name = a.a > 1 ? `#${a.a} ${run.nodes[a.n].name}` : run.nodes[a.n].name;
        if (wide > Math.min(40, name.length * 6 + 10)) bar.el.append(el("span", { class: told.st === "exec" ? "tx" : "tx chip", style: `left:${px(tx - from)};max-width:${px(wide)}`, text: name }));
        if (!open && a.oc !== "SUCCEEDED") { const mark = el("span", { class: "endm sq" }, status_glyph(a.oc === "CANCELED" ? "stopped" : "failure")); mark.style.right = "auto"; mark.style.left = px(x_of(a.done) - from - 7); mark.style.transform = "none"; bar.el.append(mark); }
      });
    }
    for (const [id, bar] of bars) if (!seen.has(id)) { bar.el.remove(); bars.delete(id); }
    for (const [name, lane] of rows) if (name.length > 1) presence(name, lane);
    marks();
    const x = x_of(Math.min(t, head)), at = app.at_head && !run.over && app.link.conn === "live" ? "now" : clock(t);
    cursor.style.transform = `translateX(${px(Math.max(left, Math.min(left + width + 14, x)))})`;
    cursor.hidden = x < left - 1 || x > left + width + 15;
    cursor.style.height = px(tall);
    const lean = Math.max(-100, Math.min(0, -50 - Math.max(0, x + 30 - (left + width + 14)) * 1.7));
    cursor.firstChild.style.transform = `translateX(${lean.toFixed(0)}%)`;
    if (cursor.firstChild.textContent !== at) cursor.firstChild.textContent = at;
    past.style.left = px(x); past.style.right = "0"; past.style.height = px(tall - 24);
    past.hidden = app.at_head;
    unseen.hidden = app.link.conn !== "lost" && app.link.conn !== "stale";
    unseen.style.left = px(x_of(head)); unseen.style.right = "0"; unseen.style.height = px(tall - 24);
  }

  // Many waits at once: one bar for each stretch in which any was, with how many there were.
  let merged = [], counted = 0;
  function crowd(head, put) {
    const { run } = app;
    for (; counted < run.waits.length; counted++) {
      const wait = run.waits[counted], last = merged.at(-1);
      if (last && wait.from <= last.until()) { last.count++; last.waits.push(wait); if (last.waits.length > 64) last.waits = last.waits.filter((one) => one.to === Infinity).concat(wait); }
      else merged.push({ from: wait.from, count: 1, waits: [wait], seen: 0, until() { let to = this.seen; for (const one of this.waits) to = Math.max(to, one.to); if (to !== Infinity) this.seen = to; return to; } });
    }
    for (const one of merged) {
      const to = Math.min(one.until(), head);
      put("", `m${one.from}`, one.from, to, (bar, a, b, place) => {
        const k = `${place}${one.count}`;
        if (bar.was === k) return;
        bar.was = k;
        Object.assign(bar, { n: one.waits.at(-1).n, from: one.from, to });
        bar.el.style.transform = `translateX(${px(a)})`;
        bar.el.style.width = px(Math.max(3, b - a));
        if (!bar.el.firstChild) bar.el.append(el("span", { class: "ph ph-wait", style: "left:0;right:0" }), el("span", { class: "tx" }));
        bar.el.lastChild.textContent = `${one.count} waits`;
      });
    }
  }

  function presence(name, lane) {
    const up = app.s.up.get(name)?.up, look = up ? "success" : app.s.up.has(name) ? "failure" : "idle";
    if (lane.up !== look) { lane.up = look; lane.label.firstChild.replaceWith(status_glyph(look)); lane.label.title = up ? `${name}: in sight` : `${name}: not in sight`; }
    const gaps = [], seen = app.run.presence.get(name) || [];
    seen.forEach((one, k) => { if (one.to !== Infinity) gaps.push([one.to, seen[k + 1]?.from ?? app.head]); });
    while (lane.gone.length < gaps.length) { const made = el("div", { class: "gone", text: "not in sight" }); lane.gone.push(made); lane.label.after(made); }
    lane.gone.forEach((made, k) => { made.hidden = !gaps[k]; if (!gaps[k]) return; const a = x_of(gaps[k][0]), b = x_of(gaps[k][1]); const next = app.run.attempts.find((one) => one.server === name && one.start >= gaps[k][0] - 0.01); made.textContent = Math.min(b, next ? x_of(next.start) : b) - a > 74 ? "not in sight" : ""; made.title = `${name}: not in sight`; made.style.left = px(a); made.style.width = px(Math.max(2, b - a)); });
  }

  function marks() {
    const { run } = app, span = range[1] - range[0], step = NICE.find((one) => one / span * width > 74) || 3600;
    const now = `${range.map((one) => one.toFixed(2))}${width}${left}${step}${scale.gaps.length}${scale.gaps.at(-1)?.to.toFixed(1)}${run.missing.length}|${run.attempts.length}${run.attempts.filter((a) => a.decided).length}${tall}`;
    if (flag_key === now) return;
    flag_key = now;
    for (const old of lanes.querySelectorAll(".tick, .flag, .squeeze, .leap, .missing")) old.remove();
    const end = scale.back(range[1]);
    let before = -99;
    for (let t = Math.ceil(scale.back(range[0]) / step) * step; t <= end; t += step) {
      if (scale.gaps.some((gap) => (t > gap.from && t < gap.to) || Math.abs(x_of(t) + 16 - x_of(gap.from)) < 44)) continue;
      const x = x_of(t);
      if (x - before < 58 || x > left + width - 34) continue;
      before = x;
      ruler.append(el("span", { class: "tick", style: `left:${px(x)}`, text: step < 1 ? clock(t) : clock(t).slice(0, -2) }));
    }
    for (const gap of scale.gaps) {
      const x = x_of((gap.from + gap.to) / 2), wide = 26;
      if (x < left || x > left + width) continue;
      lanes.append(el("div", { class: "squeeze", style: `left:${px(x - wide / 2)};width:${wide}px;height:${tall - 24}px` }));
      ruler.append(el("span", { class: "leap", style: `left:${px(x)}`, text: `${secs(gap.to - gap.from)}`, title: "Squeezed: no goal was under way" }));
    }
    for (const gap of run.missing) lanes.append(el("div", { class: "missing", style: `left:${px(Math.max(left, x_of(gap.from)))};width:${px(Math.max(2, x_of(gap.to) - x_of(gap.from)))};height:${tall - 24}px`, title: "Not recorded" }));
    for (const a of run.attempts) {
      if (!a.decided || a.oc === "SUCCEEDED" || a.oc === "CANCELED") continue;
      const x = x_of(a.decided);
      if (x < left || x > left + width) continue;
      const flag = el("button", { class: "flag", tabindex: "-1", style: `left:${px(x)}`, title: `${clock(a.decided)} ${run.nodes[a.n].name}: ${a.oc}`, "aria-label": `${a.oc} at ${clock(a.decided)}`, onclick: (event) => { event.stopPropagation(); app.seek(a.decided); app.select(a.n, { reveal: true, attempt: a.i }); } });
      flag.append(status_glyph(a.backoff ? "backoff" : "failure"));
      rows.get("!").row.append(flag);
    }
  }

  // Pointer: a press on the ground or the ruler sets the time; a press on a bar picks the attempt.
  let grip = false;
  const scrub = (event) => { const x = event.clientX - lanes.getBoundingClientRect().left; if (x >= left - 6) app.seek(Math.max(0, Math.min(app.head, t_of(x))), { snap: x > x_of(app.head) - 3 }); };
  lanes.addEventListener("pointerdown", (event) => {
    if (event.button || event.target.closest(".flag, .label")) return;
    const bar = event.target.closest(".bar");
    if (bar) { const one = bars.get(bar.dataset.id); app.select(one.n, { reveal: true, attempt: one.attempt?.i }); if (event.pointerType === "touch") return; }
    grip = true;
    lanes.setPointerCapture(event.pointerId);
    if (!bar || !app.at_head) scrub(event); else grip = "maybe";
    tip.hidden = true;
  });
  lanes.addEventListener("pointermove", (event) => {
    if (grip === "maybe" && Math.abs(event.movementX) > 1) grip = true;
    if (grip === true) return scrub(event);
    const bar = event.target.closest?.(".bar"), one = bar && bars.get(bar.dataset.id);
    tip.hidden = !one || event.pointerType === "touch";
    if (!one) return;
    const node = app.run.nodes[one.n], a = one.attempt;
    tip.replaceChildren(el("b", { text: a ? `${node.name}, attempt ${a.a} of ${node.retry.attempts}` : node.name }),
      ...(a ? [a.phases.filter((p) => p.to - p.from > 0.02 || p.to === Infinity).map((p) => `${PHASE_WORD[p.st]} ${secs(Math.min(p.to, app.head) - p.from)}`).join(", ") + (a.done < Infinity ? `; ${a.oc}` : "") + (a.backoff ? `, then backoff ${secs(a.backoff - a.done)}` : "")] : [`waited ${secs(Math.min(one.to, app.head) - one.from)}`]));
    tip.style.left = `${Math.min(event.clientX + 12, innerWidth - tip.offsetWidth - 8)}px`;
    tip.style.top = `${event.clientY - tip.offsetHeight - 10}px`;
  });
  for (const name of ["pointerup", "pointercancel"]) lanes.addEventListener(name, () => { grip = false; });
  lanes.addEventListener("pointerleave", () => { tip.hidden = true; });
  lanes.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!by) return;
    event.preventDefault(); event.stopPropagation();
    app.seek(Math.max(0, Math.min(app.head, app.t + by * (event.shiftKey ? 5 : 0.5))));
  });
  lanes.addEventListener("wheel", (event) => { if (event.ctrlKey) { event.preventDefault(); zoom(Math.exp(event.deltaY / 300)); } }, { passive: false });
  function zoom(by) {
    const span = range[1] - range[0];
    app.zoomed = by === 0 ? null : Math.max(4, span * by);
    if (app.zoomed) { const at = scale.to(app.t); range = [at - (at - range[0]) * by, 0]; if (app.zoomed >= scale.to(app.head) * 1.05) app.zoomed = null; }
    app.touch();
  }
  return { update, build, zoom };
}

// The phases of an attempt as boxes from x0 on; also used in the details.
export function phases(a, head, x0, x1, x_of, done) {
  const out = [], tone = done === null ? "" : a.oc === "SUCCEEDED" ? " o-success" : a.oc === "CANCELED" ? " o-stopped" : " o-failure";
  for (const phase of a.phases) {
    if (phase.from > head) continue;
    const from = Math.max(x0, x_of(phase.from)), to = Math.min(x1, x_of(Math.min(phase.to, head)));
    if (to - from < 0.4 && phase.st === "server") continue;
    out.push(el("span", { class: `ph ph-${phase.st}${phase.st === "exec" ? tone : ""}`, style: `left:${px(from - x0)};width:${px(Math.max(1.5, to - from))}` }));
  }
  if (a.backoff && a.done < head) { const from = x_of(a.done), to = x_of(Math.min(a.backoff, head)); out.push(el("span", { class: "ph ph-backoff", style: `left:${px(from - x0)};width:${px(Math.max(1, to - from))}` })); }
  return out;
}
