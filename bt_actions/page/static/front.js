// The front: a card for each run that goes on, or has ended while this page was open, and the list of recordings.
// Cards and rows are in the order of their names, and of time; each is made once, and repainted: focus stays.

import { el } from "./dom.js";
import { status_glyph } from "./glyphs.js";
import { look_of, word_of } from "./head.js";
import { Stream } from "./stream.js";
import { clock, CROWDED } from "./words.js";

const text = (node, value) => {
  if (node.textContent !== value) node.textContent = value;
};
const when = (wall) => new Date(wall * 1000).toLocaleString();
const place = ({ where }) => [where.simulation && "simulated", where.host, where.node].filter(Boolean).join("  ·  ");
const GLYPH = { lost: "stopped" };

export class Front {
  constructor(app, box) {
    Object.assign(this, { app, cards: new Map(), rows: new Map(), runs: [], over: "", since: null });
    this.title = el("h1", { text: "All runs" });
    this.lost = el("p", { role: "status" });
    this.grid = el("div", { class: "cards" });
    this.query = el("input", {
      type: "search",
      placeholder: "Tree, computer, id, reason",
      "aria-label": "Search the recordings",
      oninput: () => this.sift(),
    });
    const choice = (label, words) =>
      el(
        "select",
        { "aria-label": label, onchange: () => this.sift() },
        Object.entries(words).map(([value, word]) => el("option", { value, text: word })),
      );
    this.ends = choice("How they ended", {
      "": "However they ended",
      Failed: "Failed",
      Succeeded: "Succeeded",
      Stopped: "Stopped",
      "Never finished": "Never finished",
      "Goes on": "Go on",
    });
    this.world = choice("In which world", { "": "Everywhere", real: "In the world", sim: "In a simulation" });
    this.count = el("output", { class: "soft" });
    this.body = el("tbody");
    const head = ["", "Tree", "Began", "Took", "Where", "Why"].map((word) => el("th", { scope: "col", text: word }));
    head[0].append(el("span", { class: "off-screen", text: "How it ended" }));
    this.table = el("table", { class: "records" }, el("thead", {}, el("tr", {}, head)), this.body);
    box.replaceChildren(
      el(
        "div",
        { class: "in" },
        this.title,
        this.lost,
        this.grid,
        el("h2", { text: "Recordings" }),
        el("div", { class: "filters" }, this.query, this.ends, this.world, this.count),
        this.table,
      ),
    );
    this.open();
    this.list();
  }

  open() {
    const lose = () => {
      this.since ??= new Date().toLocaleTimeString();
      text(this.lost, `The server is not to be had since ${this.since}: what is shown is how the runs stood then.`);
      this.grid.classList.add("old");
    };
    const crowd = () => {
      text(this.lost, CROWDED.join(". "));
      this.grid.classList.add("old");
    };
    this.stream = new Stream("/now", { hear: (_, data) => this.show(JSON.parse(data).runs), lose, crowd });
  }
  close() {
    this.stream.close();
  }
  hide(hidden) {
    this.close();
    if (!hidden) this.open();
  }

  show(runs) {
    const going = runs.filter((one) => !one.over).length,
      now = runs.map((one) => one.run_id + one.over).join();
    this.since = null;
    this.grid.classList.remove("old");
    text(this.lost, runs.length ? "" : "A run has a card here while it goes on, begun in whichever terminal.");
    text(this.title, going ? `${going} ${going === 1 ? "run goes" : "runs go"} on` : "No run goes on");
    document.title = this.title.textContent;
    const key_of = (one) => `${one.run_id} ${one.recorded}`,
      keys = new Set(runs.map(key_of));
    for (const [key, card] of this.cards)
      if (!keys.has(key)) {
        card.remove();
        this.cards.delete(key);
      }
    runs.forEach((one, at) => {
      if (!this.cards.has(key_of(one))) this.cards.set(key_of(one), make_card(one));
      const card = this.cards.get(key_of(one));
      if (this.grid.children[at] !== card) this.grid.insertBefore(card, this.grid.children[at] ?? null);
      paint_card(card, one);
    });
    if (this.over !== now) {
      this.over = now;
      this.list();
    }
  }

  async list() {
    const runs = await this.app.fetch_runs(),
      ids = new Set(runs.map((one) => one.run_id));
    for (const [id, row] of this.rows)
      if (!ids.has(id)) {
        row.remove();
        this.rows.delete(id);
      }
    runs.forEach((one, at) => {
      const key = JSON.stringify([one.status, one.written]),
        old = this.rows.get(one.run_id);
      if (old?.dataset.key === key) return;
      const row = make_row(one);
      row.dataset.key = key;
      if (old) old.replaceWith(row);
      else this.body.insertBefore(row, this.body.children[at] ?? null);
      this.rows.set(one.run_id, row);
    });
    this.runs = runs;
    this.sift();
  }

  // Which rows are to be seen.
  sift() {
    const query = this.query.value.trim().toLowerCase();
    let shown = 0;
    for (const one of this.runs) {
      const words = [one.tree, one.run_id, one.cause, one.stopped_by, ...Object.values(one.where)]
          .join("\n")
          .toLowerCase(),
        is_sim = "simulation" in one.where;
      const meant =
        words.includes(query) &&
        (!this.ends.value || word_of(one) === this.ends.value) &&
        (!this.world.value || (this.world.value === "sim") === is_sim);
      this.rows.get(one.run_id).hidden = !meant;
      shown += meant;
    }
    text(this.count, shown === this.runs.length ? `${shown}` : `${shown} of ${this.runs.length}`);
  }
}

function make_card(one) {
  const refs = {
    glyph: el("span"),
    word: el("span", { class: "soft" }),
    lasts: el("span", { class: "num" }),
    say: el("div", { class: "say" }),
    foot: el("div", { class: "foot" }),
  };
  const card = el(
    one.recorded ? "a" : "div",
    { class: "card", ...(one.recorded ? { href: `#run=${one.run_id}` } : {}) },
    el("div", { class: "top" }, refs.glyph, el("b", { text: one.tree }), refs.lasts),
    el("div", { class: "sub", text: [place(one), `run ${one.run_id.slice(0, 8)}`].filter(Boolean).join("  ·  ") }),
    refs.word,
    refs.say,
    refs.foot,
  );
  card.refs = refs;
  return card;
}
function paint_card(card, one) {
  const { refs } = card,
    say = one.why.join("\n");
  if (card.dataset.look !== one.look) {
    card.dataset.look = one.look;
    refs.glyph.replaceChildren(status_glyph(GLYPH[one.look] || one.look));
  }
  text(refs.word, one.word);
  text(refs.lasts, one.recorded ? clock(one.seconds) : "");
  if (card.title !== say) card.title = say;
  text(refs.say, one.why.slice(0, 2).join("\n"));
  text(
    refs.foot,
    [
      one.running > 1 ? `${one.running} running` : "",
      one.dealt_with ? `${one.dealt_with} ${one.dealt_with === 1 ? "failure" : "failures"}, dealt with` : "",
    ]
      .filter(Boolean)
      .join("  ·  "),
  );
}
function make_row(one) {
  const look = look_of(one),
    why = one.cause || (one.unrecorded && `not recorded since ${one.unrecorded}`) || one.stopped_by;
  return el(
    "tr",
    { "data-look": look },
    el("td", {}, status_glyph(look), el("span", { class: "off-screen", text: word_of(one) })),
    el("td", {}, el("a", { href: `#run=${one.run_id}`, text: one.tree }), el("code", { text: one.run_id.slice(0, 8) })),
    el("td", { class: "num", text: when(one.began) }),
    el("td", { class: "num", text: one.seconds === null ? "" : clock(one.seconds) }),
    el("td", { text: place(one) }),
    el("td", { title: why, text: why }),
  );
}
