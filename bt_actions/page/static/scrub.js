// Pointer and keys of the timeline: a press on the ground or the ruler sets the time, a press on a bar picks its attempt.

import { el } from "./dom.js";
import { secs, PHASE_WORD } from "./words.js";

// `bar_of` gives what is known of a bar's element.
export function scrub(app, lanes, span, bar_of) {
  const tip = el("div", { id: "tip", hidden: true });
  let grip = "";
  document.body.append(tip);

  const within = (t) => Math.max(0, Math.min(app.head, t));
  const go = (event) => {
    const x = event.clientX - lanes.getBoundingClientRect().left;
    if (x >= span.left - 6) app.seek(within(span.t_of(x)), { snap: x > span.x_of(app.head) - 3 });
  };
  lanes.addEventListener("pointerdown", (event) => {
    if (event.button || event.target.closest(".flag, .label")) return;
    const bar = event.target.closest(".bar");
    if (bar) {
      const one = bar_of(bar);
      app.select(one.n, { reveal: true, attempt: one.attempt?.i });
      if (event.pointerType === "touch") return;
    }
    lanes.setPointerCapture(event.pointerId);
    tip.hidden = true;
    if (bar && app.at_head) grip = "pressed"; // and maybe dragged
    else {
      grip = "dragged";
      go(event);
    }
  });
  lanes.addEventListener("pointermove", (event) => {
    if (grip === "pressed" && Math.abs(event.movementX) > 1) grip = "dragged";
    if (grip === "dragged") return go(event);
    const bar = event.target.closest?.(".bar"),
      one = bar && bar_of(bar);
    tip.hidden = !one || event.pointerType === "touch";
    if (tip.hidden) return;
    tip.replaceChildren(...words(app, one));
    tip.style.left = `${Math.min(event.clientX + 12, innerWidth - tip.offsetWidth - 8)}px`;
    tip.style.top = `${event.clientY - tip.offsetHeight - 10}px`;
  });
  for (const name of ["pointerup", "pointercancel"])
    lanes.addEventListener(name, () => {
      grip = "";
    });
  lanes.addEventListener("pointerleave", () => {
    tip.hidden = true;
  });
  lanes.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    app.seek(within(app.t + by * (event.shiftKey ? 5 : 0.5)));
  });
}

function words(app, { n, attempt: a, from, to }) {
  const node = app.run.nodes[n],
    until = (t) => Math.min(t, app.head);
  if (!a) return [el("b", { text: node.name }), `waited ${secs(until(to) - from)}`];
  const told = a.phases
    .filter((p) => p.to - p.from > 0.02)
    .map((p) => `${PHASE_WORD[p.st]} ${secs(until(p.to) - p.from)}`);
  const ending = a.done < Infinity ? `; ${a.oc ?? "not recorded"}` : "",
    again = a.backoff ? `, then backoff ${secs(a.backoff - a.done)}` : "";
  return [
    el("b", { text: `${node.name}, attempt ${a.a} of ${node.retry.attempts}` }),
    `${told.join(", ")}${ending}${again}`,
  ];
}
