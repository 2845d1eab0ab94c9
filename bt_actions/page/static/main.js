// The page: one clock, one selection, one time that all panes show. Panes read `app` and never write to each other.
// Everything is painted in one frame, when something has changed, and not otherwise.
//
// Address: #runs, or #run=ID &t= &node= &tab= &pane= &view=

import { Run } from "./store.js";
import { Link } from "./link.js";
import { Stored, stored } from "./stored.js";
import { create_head } from "./head.js";
import { create_strip } from "./strip.js";
import { create_tree } from "./tree.js";
import { create_graph } from "./graph.js";
import { create_timeline } from "./timeline.js";
import { create_transport } from "./transport.js";
import { create_details } from "./details.js";
import { create_values } from "./values.js";
import { create_log } from "./log.js";
import { show_none } from "./other.js";
import { Front } from "./front.js";
import { toast, dress, splitters } from "./dress.js";
import { listen } from "./keys.js";
import { ways } from "./ways.js";
import { CROWDED } from "./words.js";

const wide = matchMedia("(min-width: 1680px)"),
  narrow = matchMedia("(max-width: 700px), (max-height: 560px)"); // as in style.css
const find = (id) => document.getElementById(id);
const PAINT = 32; // milliseconds between two paintings, at least
const MORE = 300_000; // events that come to a page before it begins anew with what is recorded by then, which is bounded

// What is known of a run before anything of it has come.
const NEW = { s: null, t: 0, head: 0, at_head: true, playing: false, settled: false, grown: 0, zoomed: null };

const app = {
  ...NEW,
  run: new Run(),
  link: null,
  is_stored: Boolean(stored),
  speed: 1,
  sel: 0,
  pane: "tree",
  tab: "details",
  view: "outline",
  follow: true,
  squeeze: true,
  folded: new Set(),
  narrow,
  more: MORE,
  first: 0,
  touch() {
    dirty = true;
  },
  remember() {
    clearTimeout(writing);
    writing = setTimeout(() => history.replaceState(null, "", `#${params_now()}`), 250);
  },
  hidden(id) {
    return wide.matches ? false : narrow.matches ? app.pane !== id : app.tab !== id;
  },
  tell(words) {
    find("said").textContent = words; // by a screen reader
  },
  say(words) {
    app.tell(words);
    toast(words);
  },
  select(n, { reveal = false, attempt } = {}) {
    if (!app.run.nodes[n] || app.run.nodes[n].gone) return;
    app.sel = n;
    panes.details.pick(n, attempt);
    if (reveal) {
      app.let_go();
      if (app.view === "outline") panes.tree.show(n);
      else {
        app.open_above(n);
        panes.graph.show(n);
      }
      if (app.pane === "tree" && narrow.matches && document.activeElement?.closest("#why, #log, #values"))
        app.go_pane("tree");
    }
    app.remember();
    dirty = true;
  },
  seek(t, { snap = false } = {}) {
    if (snap || t >= app.head - 1e-4) return app.go_live();
    app.t = Math.max(0, t);
    app.at_head = false;
    app.remember();
    dirty = true;
  },
  go_live() {
    app.t = app.head;
    app.at_head = true;
    app.playing = false;
    panes.tree.rewind();
    app.remember();
    dirty = true;
  },
  let_go() {
    if (app.follow) app.set_follow(false);
  },
  set_follow(on) {
    app.follow = on;
    find("follow").setAttribute("aria-pressed", on);
  },
  async fetch_runs() {
    if (stored) return stored.map((one) => one.run);
    try {
      const answer = await fetch("/runs");
      app.is_refused = answer.status === 401;
      return (await answer.json()).runs;
    } catch {
      return [];
    }
  },
  open(id, params = new URLSearchParams()) {
    front?.close();
    front = null;
    app.link?.close();
    Object.assign(app, NEW, { run: new Run(id), folded: new Set(), wanted: params, shown: false });
    const { run } = app;
    app.link = new (stored ? Stored : Link)(run, (what) => told(run, what));
  },
};
let dirty = true,
  last = performance.now(),
  painted = 0,
  front = null;
const panes = {
  head: create_head(app),
  strip: create_strip(app),
  tree: create_tree(app),
  graph: create_graph(app),
  timeline: create_timeline(app),
  details: create_details(app),
  values: create_values(app),
  log: create_log(app),
  transport: create_transport(app),
};
Object.assign(app, ways(app, panes));
window.page = app; // for tests, and for the curious

// What the link tells: news, conn, reset, and settled when all that is recorded so far has come.
function told(run, what) {
  if (run !== app.run) return;
  dirty = true;
  if (app.settled && document.hidden) panes.head.update(); // no frame comes to a hidden tab, but its title is read
  if (what === "reset" || (app.settled && run.events.length > app.first + app.more))
    return app.open(run.key, params_now());
  if (!app.settled && run.began && (what === "settled" || run.over)) settle();
  else if (!app.settled && run.over) none(app.link.why || "This recording holds no run");
  else if (!app.settled && what === "lost")
    none(...(app.link.stream.is_crowded ? CROWDED : ["This run is not to be had"]));
}

function settle() {
  const { run, wanted } = app,
    number = +wanted.get("node");
  Object.assign(app, { settled: true, grown: run.grown, first: run.events.length });
  app.link.look();
  app.head = app.link.head;
  const t = parseFloat(wanted.get("t"));
  app.at_head = !(t >= 0 && t < app.head);
  app.t = app.at_head ? app.head : t;
  app.s = run.at(app.t);
  app.set_follow(!run.over && app.at_head);
  app.tab = wanted.get("tab") || app.tab;
  app.pane = wanted.get("pane") || app.pane;
  const { causes, stopped } = run.failures(app.s);
  app.sel = run.of_id.get(number) ?? causes[0]?.n ?? stopped[0]?.n ?? run.leaves(app.s).at(-1) ?? 0;
  find("other").hidden = true;
  document.body.dataset.state = "run";
  for (const pane of Object.values(panes)) pane.reset?.();
  panes.timeline.build();
  panes.tree.layout();
  app.go_pane(app.pane, false);
  app.go_tab(app.tab, false);
  app.go_view(wanted.get("view") === "graph" ? "graph" : "outline", false);
  requestAnimationFrame(() => {
    if (app.run !== run) return;
    panes.tree.show(app.sel, 4);
    dirty = true;
    painted = 0;
    requestAnimationFrame(() => (app.shown = app.run === run)); // behind `frame`: the panes know their sizes by now
  });
  app.remember();
}

// The clock. Where nothing comes from the run, nothing ticks: a page must not make up progress.
function frame(now) {
  requestAnimationFrame(frame);
  const dt = Math.min(0.25, (now - last) / 1000),
    { run, link } = app;
  last = now;
  if (!link) return;
  link.look();
  if (!app.settled) return;
  const head = link.ended ? link.head : Math.max(app.head, link.head);
  if (head !== app.head) {
    app.head = head;
    dirty = true;
  }
  if (app.at_head) app.t = app.head;
  if (link.conn !== "live" && link.conn !== "replay" && Math.floor(link.silence) !== app.silent) {
    app.silent = Math.floor(link.silence);
    dirty = true;
  }
  if (app.playing && !app.at_head) {
    app.t = Math.min(
      app.head,
      app.t + dt * app.speed * (app.squeeze && panes.transport.next(app.t) - app.t > 3 ? 8 : 1),
    );
    if (app.t >= app.head) {
      app.playing = false;
      app.at_head = true;
    }
    dirty = true;
  }
  if (!dirty || now - painted < PAINT) return;
  dirty = false;
  painted = now;
  if (app.grown !== run.grown) {
    app.grown = run.grown;
    if (run.nodes[app.sel].gone) app.sel = 0;
    panes.timeline.build();
    app.refolded();
  }
  app.s = run.at(app.t);
  for (const name of ["head", "strip", "tree", "graph", "timeline", "details", "values", "log", "transport"])
    panes[name].update();
}

// The address keeps what is looked at; it is replaced, so that Back leaves the page.
function params_now() {
  const params = new URLSearchParams({ run: app.run.key, node: app.run.nodes[app.sel]?.number ?? 1, tab: app.tab });
  if (!app.at_head) params.set("t", app.t.toFixed(3));
  if (app.view === "graph") params.set("view", "graph");
  if (narrow.matches) params.set("pane", app.pane);
  return params;
}
let writing = 0;

// The token of the address is changed for a cookie, and does not stay in the address.
async function enter() {
  const params = new URLSearchParams(location.hash.slice(1)),
    token = params.get("token");
  if (token) {
    params.delete("token");
    history.replaceState(null, "", `#${params}`);
    await fetch("/enter", { method: "POST", body: token }).catch(() => null); // nor are the runs to be had
  }
  const runs = await app.fetch_runs(),
    [newest] = runs,
    going = runs.filter((one) => one.written && !one.status);
  if (!stored && !app.is_refused && (params.has("runs") || (!params.has("run") && going.length > 1)))
    return show_front();
  if (!app.is_refused && params.has("run")) return app.open(params.get("run"), params);
  if (newest) return app.open(((!stored && going[0]) || newest).run_id, params);
  if (app.is_refused)
    none("This address lacks its end", "It ends in #token= and letters, as bt-actions view and run --view print it.");
  else none();
  setTimeout(enter, 1000);
}
// A card for each run, and the recordings.
function show_front() {
  clearTimeout(writing);
  app.link?.close();
  Object.assign(app, { link: null, settled: false });
  document.body.dataset.state = "front";
  find("tree-name").textContent = "All runs";
  find("tree-where").textContent = "";
  find("title").textContent = "All runs";
  find("other").hidden = false;
  front ??= new Front(app, find("other"));
}
function none(words = "No run yet", more) {
  document.body.dataset.state = "empty";
  find("tree-name").textContent = "Runs";
  document.title = find("title").textContent = words;
  find("other").hidden = false;
  show_none(find("other"), words, more);
}

dress(app);
splitters(app, panes);
listen(app, panes);
addEventListener("hashchange", enter);
// A browser has six connections to a server at a time: a tab that nobody sees keeps none.
document.addEventListener("visibilitychange", () => (front || app.link)?.hide?.(document.hidden));
addEventListener("resize", () => {
  if (app.settled) panes.tree.layout();
  dirty = true;
});
setInterval(() => app.fetch_runs(), 60_000); // the server of run --view ends when no page has asked for anything for long
enter();
requestAnimationFrame(frame);
