// What is known of a run, and what was true at any time of it. No DOM, no clock.
//
// `push` takes events as bt_actions/events/wire.py writes them, in order. `at(t)` gives the state at t: it goes
// on from where it was, or from the snapshot before t, so that a step forward costs as much as the events in it.

import { State, leaves, upper } from "./state.js";
import { view } from "./doing.js";
import { TAKE } from "./taking.js";

const LONG = 4; // a gap of more seconds without a goal is drawn as so many

export class Run {
  constructor(key = "") {
    Object.assign(this, {
      key, // by which the server knows the run
      info: { id: "", tree: "", inputs: {} },
      files: {},
      nodes: [],
      of_id: new Map(),
      order: [],
      servers: [],
      began: null,
      events: [],
      number: 0,
      early: [],
      missing: [],
      over: false,
      clock: 0,
      attempts: [],
      decided: 0,
      of_goal: new Map(),
      of_node: new Map(),
      waits: [], // of leaves without a server: { n, from, to }
      open_waits: new Map(),
      history: new Map(),
      lines: [],
      presence: new Map(),
      steps: [], // times that are worth a stop: not feedback
      snapshots: new Map(),
      state: new State(),
      grown: 0,
    });
  }

  get every() {
    return Math.max(256, this.nodes.length);
  } // events between two snapshots

  // A batch from the stream: numbers `from` to `to`. False where it does not follow what is here.
  take({ from, to, events }) {
    if (from > this.number + 1) return false;
    for (const e of events) if (e.at[0] > this.number) this.push(e);
    this.number = Math.max(this.number, to);
    return true;
  }

  push(e) {
    if (e.kind !== "EventsLost") this.number = e.at[0]; // which has the number of what follows
    if (!this.began) {
      const began = e.kind === "RunBegan" ? e : e.events?.find((one) => one.kind === "RunBegan");
      if (!began) return void this.early.push(e);
      this.began = began.at;
      this.enter(began);
      for (const early of this.early) this.add(early);
    }
    this.add(e);
  }

  add(e) {
    this.resolve(e);
    if (e.kind !== "EventsLost") this.clock = Math.max(this.clock, e.t);
    if (!["FeedbackCame", "VariableWritten"].includes(e.kind) && this.steps.at(-1) !== e.t) this.steps.push(e.t);
    TAKE[e.kind]?.call(this, e);
    this.events.push(e);
  }

  // Times in seconds since the beginning; nodes and servers by their place here.
  resolve(e) {
    e.t = Math.max(0, e.at[1] - this.began[1]);
    if (typeof e.node === "number" && !this.nodes[this.of_id.get(e.node)]?.gone) e.n = this.of_id.get(e.node);
    if (e.kind === "NodesAdded") this.grow(e.nodes);
    if (e.kind === "NodesRemoved") {
      e.slots = e.nodes.map((id) => this.of_id.get(id)).filter((n) => n !== undefined && !this.nodes[n].gone);
      this.shrink(e.slots);
    }
    if (e.kind !== "StateKnown") return;
    e.events.forEach((inner) => this.resolve(inner));
    const there = new Set(e.nodes),
      slot = (id) => this.of_id.get(id);
    this.shrink(this.nodes.filter((node) => !node.gone && !there.has(node.number)).map((node) => node.id));
    const known = (all) =>
      all
        .filter((one) => slot(one.node) !== undefined)
        .map((one) => ({
          n: slot(one.node),
          t: Math.max(0, one.at[1] - this.began[1]),
          number: one.at[0],
          message: one.message,
          by: slot(one.by) ?? null,
        }));
    e.pending = Object.entries(e.pending).map(([id, all]) => [slot(+id), known(all)]);
    e.dealt = known(e.dealt);
    e.visits = e.visits.map(([id, told, ended]) => [slot(id), told, ended]);
    this.missing.push({ from: this.clock, to: e.t });
  }

  enter(e) {
    Object.assign(this.info, {
      id: e.run_id,
      tree: e.tree,
      inputs: e.inputs,
      wall: e.at[2],
      versions: e.versions,
      where: e.where || {},
      request: e.request,
    });
    Object.assign(this.files, e.sources);
    this.grow(e.nodes);
  }

  grow(nodes) {
    for (const { id, parent, index, settings, place, action, ...rest } of nodes) {
      if (this.of_id.has(id)) continue;
      const up = parent === null ? undefined : this.nodes[this.of_id.get(parent)],
        [, file, line, col] = /^(.*?)(?::(\d+))?(?::(\d+))?$/.exec(place);
      const node = {
        ...rest,
        id: this.nodes.length,
        number: id,
        parent: up ? up.id : -1,
        depth: up ? up.depth + 1 : 0,
        children: [],
        ever: [],
        gone: false,
        file,
        line: +line || 0,
        col: +col || 0,
        type: action,
        timeouts: settings.timeouts || null,
        retry: { attempts: settings.attempts || 1 },
        expect: settings.expect,
        constants: settings.constants || {},
        settings,
        gates: ["only_if", "only_while"].filter((key) => settings[key]).map((key) => `${key} ${settings[key]}`),
      };
      node.words = `${node.name}\n${node.kind}\n${node.server}\n${node.type}\n${place}`.toLowerCase();
      this.of_id.set(id, node.id);
      this.nodes.push(node);
      if (!up) continue;
      const next = up.children[index ?? up.children.length];
      up.ever.splice(next ? up.ever.indexOf(next) : up.ever.length, 0, node);
      up.children.splice(index ?? up.children.length, 0, node);
    }
    this.arrange();
  }
  shrink(slots) {
    for (const n of slots) {
      const node = this.nodes[n],
        up = this.nodes[node.parent];
      node.gone = true;
      if (up) up.children.splice(up.children.indexOf(node), 1);
    }
    this.arrange();
  }
  // The tree as it is now: each node before its children.
  arrange() {
    this.order = [];
    const waiting = this.nodes.length ? [this.nodes[0]] : [];
    while (waiting.length) {
      const node = waiting.pop();
      node.place_in_tree = this.order.length;
      this.order.push(node);
      for (let k = node.children.length; k--;) waiting.push(node.children[k]);
    }
    for (let k = this.order.length; k--;)
      this.order[k].below = this.order[k].children.reduce((sum, kid) => sum + kid.below + 1, 0);
    this.servers = [...new Set(this.nodes.map((node) => node.server).filter(Boolean))].sort();
    this.grown++;
  }

  // The state at t. It is this.state, and belongs to the store: read it, do not keep it.
  at(t) {
    this.go(this.index_at(t));
    this.state.t = t;
    return this.state;
  }
  // The state behind so many events.
  go(count) {
    const { every } = this;
    if (count < this.state.i) {
      let best = null;
      for (const [i, kept] of this.snapshots) if (i <= count && (!best || i > best.i)) best = kept;
      this.state = best ? best.copy() : new State(this.nodes.length);
    }
    const s = this.state;
    s.room(this.nodes.length);
    while (s.i < count) {
      s.observe(this.events[s.i++], this.nodes);
      if (s.i % every === 0 && !this.snapshots.has(s.i)) this.snapshots.set(s.i, s.copy());
    }
    return s;
  }
  index_at(t) {
    return upper(this.events, t, (e) => e.t);
  }
  // The attempts of one visit of a node, as far as they had begun at t: of the latest, or of that of `like`.
  attempts_of(n, t, like) {
    const all = (this.of_node.get(n) || []).filter((a) => a.start <= t),
      visit = like && like.start <= t ? like.visit : all.at(-1)?.visit;
    return all.filter((a) => a.visit === visit);
  }
  gap_at(t) {
    return this.missing.find((gap) => gap.from < t && t < gap.to);
  }
  view(n, s) {
    return view(this, n, s);
  }

  leaves(s) {
    if (s.leaves_at !== s.i) {
      s.leaves_at = s.i;
      s.leaves = leaves(s, this.nodes);
    }
    return s.leaves;
  }

  // The failures that are known at s: those that made the tree fail, in its order; else what somebody deals with, or
  // has dealt with, the latest last.
  failures(s) {
    if (s.failures_at === s.i) return s.failures;
    s.failures_at = s.i;
    const root = s.status[0] === "failure" ? s.pending.get(0) || [] : [];
    const stopped = s.finished?.status === "INVALID" ? s.stopped : [];
    const open = root.length ? [] : [...s.pending.values()].flat();
    s.failures = {
      causes: [...root].sort((a, b) => this.nodes[a.n].place_in_tree - this.nodes[b.n].place_in_tree),
      stopped,
      passed: [...s.dealt, ...open].sort((a, b) => a.number - b.number),
    };
    return s.failures;
  }

  // Who passed a failure on: from its node up to the root, or to who went on in spite of it.
  chain(failure, s) {
    const out = [];
    for (let n = failure.n; n >= 0; n = this.nodes[n].parent) {
      out.push(n);
      if (n === failure.by) break;
      if (failure.by === null && n !== failure.n && s.status[n] === "running") break;
    }
    return out;
  }

  // The time scale. Stretches without any goal under way count as at most LONG seconds: d(len) = min(len, LONG)
  // grows with the gap and then stands still, so nothing jumps when a goal comes.
  scale(head, squeeze) {
    const gaps = [];
    if (squeeze) {
      let until = 0;
      const gap = (from, to) => {
        if (to - from > LONG) gaps.push({ from: from + LONG / 2, to: to - LONG / 2 });
      };
      for (const a of this.attempts) {
        gap(until, a.start);
        until = Math.max(until, Math.min(a.done, head));
      }
      gap(until, head);
    }
    // What is left out before the end of each gap.
    let out = 0;
    for (const gap of gaps) {
      gap.at = gap.from - out;
      out += gap.to - gap.from;
      gap.out = out;
    }
    const before = (value, key) => gaps[upper(gaps, value, key) - 1];
    const to = (t) => {
      const gap = before(t, (one) => one.from);
      return !gap ? t : t < gap.to ? gap.at : t - gap.out;
    };
    const back = (x) => {
      const gap = before(x, (one) => one.at);
      return !gap || x <= gap.at ? x + (gap ? gap.out - (gap.to - gap.from) : 0) : x + gap.out;
    };
    return { to, back, gaps };
  }
}
