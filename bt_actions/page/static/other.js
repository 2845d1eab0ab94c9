// The page where there is no run to show.

import { el } from "./dom.js";

export function show_none(box, words, more) {
  const line = (text) => el("div", { class: "cmd" }, el("code", { text }));
  box.replaceChildren(
    el(
      "div",
      { class: "in" },
      el("h1", { text: words }),
      el("p", {
        text:
          more || "This page shows a run as soon as one is recorded on this computer. Nothing has to be loaded again.",
      }),
      el("h2", { text: "Begin one without robots" }),
      line("bt-actions run pick_and_place --sim --fault move_robot:2:abort"),
      el(
        "p",
        {},
        "Over SSH: ",
        el("code", { text: "ssh -L 8650:127.0.0.1:8650 ROBOT" }),
        ", and this address stays the same.",
      ),
    ),
  );
}
