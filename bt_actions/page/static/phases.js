// The phases of an attempt as boxes, in the timeline and in the details.

import { el } from "./dom.js";
import { said_by } from "./words.js";

export const px = (value) => `${value.toFixed(1)}px`;

// From x0 to x1; `x_of` gives the place of a time.
export function phases(a, head, x0, x1, x_of, done) {
  const out = [],
    oc = done === null ? null : said_by(a, head)?.oc,
    tone = !oc ? "" : oc === "SUCCEEDED" ? " o-success" : oc === "CANCELED" ? " o-stopped" : " o-failure";
  for (const phase of a.phases) {
    if (phase.from > head) continue;
    const from = Math.max(x0, x_of(phase.from)),
      to = Math.min(x1, x_of(Math.min(phase.to, head)));
    if (to - from < 0.4 && phase.st === "server") continue;
    out.push(
      el("span", {
        class: `ph ph-${phase.st}${phase.st === "exec" ? tone : ""}`,
        style: `left:${px(from - x0)};width:${px(Math.max(1.5, to - from))}`,
      }),
    );
  }
  if (a.backoff && a.done < head) {
    const from = x_of(a.done),
      to = x_of(Math.min(a.backoff, head));
    out.push(
      el("span", { class: "ph ph-backoff", style: `left:${px(from - x0)};width:${px(Math.max(1, to - from))}` }),
    );
  }
  return out;
}
