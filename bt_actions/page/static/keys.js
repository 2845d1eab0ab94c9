// Buttons and keys: what each does is said in main.js and transport.js.

import { el } from "./dom.js";

const find = (id) => document.getElementById(id),
  TABS = ["details", "values", "log"];
const KEYS = [
  ["Play, pause", "Space"],
  ["Event before, next", ", ."],
  ["Failure before, next", "⇧N N"],
  ["Go live, or to the end", "L"],
  ["To what runs now", "G"],
  ["To the first failure", "F"],
  ["Follow what runs", "⇧F"],
  ["Find a node", "/"],
  ["Outline or drawing", "T"],
  ["Details", "D"],
  ["Variables", "V"],
  ["Log", "O"],
  ["Move in the tree", "↑ ↓ ← →"],
  ["Fold, unfold", "Enter"],
  ["Squeeze gaps", "Z"],
  ["This help", "?"],
];

export function listen(app, { transport, timeline, tree }) {
  const on = (id, act) =>
    find(id).addEventListener("click", () => {
      if (app.settled) act();
    });
  on("play", transport.play);
  on("prev-event", () => transport.step(-1));
  on("next-event", () => transport.step(1));
  on("prev-fail", () => transport.fail(-1));
  on("next-fail", () => transport.fail(1));
  on("go-live", app.go_live);
  find("speed").addEventListener("change", (event) => {
    app.speed = +event.target.value;
  });
  on("gaps", () => {
    app.squeeze = !app.squeeze;
    find("gaps").setAttribute("aria-pressed", app.squeeze);
    app.touch();
  });
  on("tl-in", () => timeline.zoom(0.6));
  on("tl-out", () => timeline.zoom(1.6));
  on("tl-fit", () => timeline.zoom(0));
  on("go-running", app.jump_running);
  on("go-failure", app.first_failure);
  on("follow", () => {
    app.set_follow(!app.follow);
    tree.rewind();
    app.touch();
  });
  on("fold", () => {
    app.fold_inactive();
    app.refolded();
    if (app.view === "outline") tree.show(app.sel);
  });
  on("unfold", () => {
    app.folded.clear();
    app.refolded();
    if (app.view === "outline") tree.show(app.sel);
  });
  on("as-outline", () => app.go_view("outline"));
  on("as-graph", () => app.go_view("graph"));
  for (const id of TABS) on(`tab-${id}`, () => app.go_tab(id));
  document.querySelector(".tabs").addEventListener("keydown", (event) => {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (by) {
      app.go_tab(TABS[(TABS.indexOf(app.tab) + by + 3) % 3]);
      find(`tab-${app.tab}`).focus();
    }
  });
  for (const button of document.querySelectorAll("#dock button"))
    button.addEventListener("click", () => app.go_pane(button.dataset.go));
  document.querySelector(".legend").append(
    ...[
      ["queued", "queued"],
      ["server", "no server"],
      ["sent", "sent"],
      ["exec", "executing"],
      ["backoff", "backoff"],
      ["cancel", "canceling"],
    ].map(([st, word]) => el("span", {}, el("i", {}, el("span", { class: `ph ph-${st}` })), word)),
  );

  function help() {
    const dialog = find("help");
    dialog.replaceChildren(
      el("h2", { id: "help-title", text: "Keyboard" }),
      el(
        "div",
        { class: "keys" },
        KEYS.map(([what, keys]) =>
          el(
            "div",
            {},
            el("span", { text: what }),
            el(
              "span",
              {},
              keys.split(" ").map((one) => el("kbd", { text: one })),
            ),
          ),
        ),
      ),
      el("div", { class: "acts" }, el("button", { text: "Close", onclick: () => dialog.close() })),
    );
    dialog.showModal();
  }
  find("help-open").addEventListener("click", help);
  find("help").addEventListener("click", (event) => {
    if (event.target === find("help")) find("help").close();
  });
  document.addEventListener("keydown", (event) => {
    if (
      event.ctrlKey ||
      event.metaKey ||
      event.altKey ||
      !app.settled ||
      document.querySelector("dialog[open]") ||
      event.target.closest("input, select, textarea")
    )
      return;
    const keys = {
      " ": transport.play,
      ",": () => transport.step(-1),
      ".": () => transport.step(1),
      n: () => transport.fail(1),
      N: () => transport.fail(-1),
      l: app.go_live,
      g: app.jump_running,
      f: app.first_failure,
      F: () => find("follow").click(),
      "/": () => {
        app.go_pane("tree");
        find("query").focus();
      },
      t: () => app.go_view(app.view === "outline" ? "graph" : "outline"),
      d: () => app.go_tab("details"),
      v: () => app.go_tab("values"),
      o: () => app.go_tab("log"),
      z: () => find("gaps").click(),
      "?": help,
    };
    if (!(event.key in keys) || (event.key === " " && event.target.closest("button, [role=tab], summary"))) return;
    event.preventDefault();
    keys[event.key]();
  });
}
