// Theme, sizes of panes, and the words that are shown for a moment.

import { el } from "./dom.js";
import { icon } from "./glyphs.js";
import { TABLE } from "./looks.js";

const find = (id) => document.getElementById(id),
  page = document.documentElement;
const kept = (name, value) => {
  try {
    if (value === undefined) return localStorage.getItem(name);
    localStorage.setItem(name, value);
  } catch {
    /* a page that may not keep things works all the same */
  }
  return null;
};

export function dress() {
  for (const [name, { fill }] of Object.entries(TABLE.looks)) page.style.setProperty(`--k-${name}`, fill);
  const system = matchMedia("(prefers-color-scheme: dark)"),
    button = find("theme");
  const look = (dark) => {
    page.dataset.theme = dark ? "dark" : "light";
    button.replaceChildren(icon(dark ? "sun" : "moon"));
    button.setAttribute("aria-label", dark ? "Light theme" : "Dark theme");
  };
  look(kept("bt-actions-theme") ? kept("bt-actions-theme") === "dark" : system.matches);
  system.addEventListener("change", () => {
    if (!kept("bt-actions-theme")) look(system.matches);
  });
  button.addEventListener("click", () => {
    const dark = page.dataset.theme !== "dark";
    kept("bt-actions-theme", dark ? "dark" : "light");
    look(dark);
  });
}

let fading = 0,
  box = null;
export function toast(words) {
  if (!box) {
    box = el("div", { class: "toast" });
    document.body.append(box);
  }
  box.textContent = words;
  box.hidden = false;
  clearTimeout(fading);
  fading = setTimeout(() => {
    box.hidden = true;
  }, 3200);
}

export function splitters(app, panes) {
  const splitter = (id, name, axis, least, most) => {
    const bar = find(id),
      pane = find(axis === "x" ? "side" : "time"),
      size = () => (axis === "x" ? pane.offsetWidth : pane.offsetHeight);
    const tell = (now) =>
      Object.entries({ valuemin: least, valuemax: most(), valuenow: now }).forEach(([what, value]) =>
        bar.setAttribute(`aria-${what}`, Math.round(value)),
      );
    const put = (wanted) => {
      const now = Math.max(least, Math.min(most(), wanted));
      page.style.setProperty(name, `${now}px`);
      tell(now);
      if (app.settled) panes.timeline.update();
      app.touch();
    };
    bar.addEventListener("pointerdown", (event) => {
      bar.setPointerCapture(event.pointerId);
      const at = (one) => (axis === "x" ? one.clientX : one.clientY),
        from = at(event),
        was = size();
      const move = (moved) => put(was - (at(moved) - from));
      bar.addEventListener("pointermove", move);
      bar.addEventListener("pointerup", () => bar.removeEventListener("pointermove", move), { once: true });
    });
    tell(parseFloat(getComputedStyle(page).getPropertyValue(name)) || least);
    bar.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: 24, ArrowUp: 24, ArrowRight: -24, ArrowDown: -24 }[event.key];
      if (by) {
        event.preventDefault();
        event.stopPropagation();
        put(size() + by);
      }
    });
  };
  splitter("split-side", "--side", "x", 320, () => innerWidth - 420);
  splitter("split-time", "--time", "y", 120, () => innerHeight - 320);
}
