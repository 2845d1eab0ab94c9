// How a run stands at one time, folded from its events as bt_actions/story/state.py folds them; a test holds
// both together. No DOM, no clock. A state is copied for leaps, so whatever it holds is replaced, never changed.

const LOOK = { RUNNING: "running", SUCCESS: "success", FAILURE: "failure", INVALID: "stopped" };
const KEPT = 100; // failures that were dealt with; older ones are counted
const MAPS = ["pending", "due", "round", "backoff", "vars", "up", "attempt"];

export class State {
  constructor(size = 0) {
    Object.assign(this, {
      i: 0,
      t: 0,
      number: 0,
      status: Array.from({ length: size }, () => "idle"),
      message: Array.from({ length: size }, () => ""),
      from: new Float64Array(size),
      to: new Float64Array(size),
      told: new Float64Array(size), // the number of the latest event of a node
      ended: new Float64Array(size), // and of that with which its visit before the latest ended
      running: new Set(),
      dealt: [],
      dealt_in_all: 0,
      lasting: null,
      stop: null,
      stopped: [],
      finished: null,
      over: null,
      paused: false,
      lost: 0,
    });
    for (const name of MAPS) this[name] = new Map();
  }

  copy() {
    const made = Object.assign(Object.create(State.prototype), this);
    for (const name of ["status", "message", "from", "to", "told", "ended"]) made[name] = this[name].slice();
    for (const name of MAPS) made[name] = new Map(this[name]);
    made.running = new Set(this.running);
    made.leaves_at = -1;
    return made;
  }

  // Nodes may come while the run goes on.
  room(size) {
    for (let n = this.status.length; n < size; n++) {
      this.status.push("idle");
      this.message.push("");
    }
    for (const name of ["from", "to", "told", "ended"]) {
      if (this[name].length >= size) continue;
      const larger = new Float64Array(size);
      larger.set(this[name]);
      this[name] = larger;
    }
  }

  observe(e, nodes) {
    this.number = e.at[0];
    FOLD[e.kind]?.(this, e, nodes);
  }
}

const FOLD = {
  NodeChanged(s, e, nodes) {
    const { n } = e;
    if (n === undefined) return;
    const before = s.status[n],
      node = nodes[n];
    if (before !== "running") {
      // another visit
      s.ended[n] = s.told[n];
      deal_with(s, s.pending.get(n), node.parent, nodes);
      s.pending.delete(n);
      s.from[n] = e.t;
    }
    s.status[n] = LOOK[e.status !== "RUNNING" && left_out(e.message) ? "INVALID" : e.status];
    s.message[n] = e.message;
    s.to[n] = e.t;
    s.told[n] = e.at[0];
    if (e.due_in === null || e.status !== "RUNNING") s.due.delete(n);
    else s.due.set(n, { from: e.t, until: e.t + e.due_in });
    if (e.status === "RUNNING") s.running.add(n);
    else {
      s.running.delete(n);
      s.backoff.delete(n);
    }
    if (s.status[n] === "failure") failed(s, n, e, nodes);
    else if (e.status !== "RUNNING") for (const kid of node.ever) settle(s, kid.id, n, nodes);
  },
  GoalChanged(s, e) {
    if (e.a === undefined) return;
    if (e.is_latest) s.attempt.set(e.n, e.a);
    if (e.state !== "DONE") s.backoff.delete(e.n);
  },
  AttemptEnded(s, e) {
    if (e.n !== undefined && e.again_in !== null) s.backoff.set(e.n, { from: e.t, until: e.t + e.again_in });
  },
  RoundBegan(s, e) {
    if (e.n !== undefined) s.round.set(e.n, e);
  },
  VariableWritten(s, e) {
    s.vars.set(e.name, e);
  },
  ServerSeen(s, e) {
    s.up.set(e.server, { up: e.in_sight, t: e.t });
  },
  TickLasts(s, e, nodes) {
    s.lasting = e.is_over || e.n === undefined ? null : { n: e.n, from: e.t - e.seconds };
    if (s.stop && s.lasting) stop(s, e, nodes);
  },
  NodesAdded(s, e, nodes) {
    s.room(nodes.length);
  },
  NodesRemoved(s, e) {
    for (const n of e.slots) {
      s.status[n] = "idle";
      s.running.delete(n);
      s.pending.delete(n);
      s.due.delete(n);
    }
  },
  RunBegan(s, e, nodes) {
    s.room(nodes.length);
    for (const given of e.given || []) s.vars.set(given.name, given);
  },
  StopWanted(s, e, nodes) {
    if (!s.stop) {
      s.stop = e;
      stop(s, e, nodes);
    }
  },
  Paused(s, e) {
    s.paused = e.paused;
  },
  EventsLost(s, e) {
    s.lost += e.count;
  },
  TreeFinished(s, e) {
    s.finished = e;
  },
  RunEnded(s, e) {
    s.over = e;
  },
  // Where the events that led to a state are missing from the recording, the state is all that is known.
  StateKnown(s, e, nodes) {
    const { i, t, lost } = s;
    Object.assign(s, new State(nodes.length), { i, t, lost });
    for (const inner of e.events) FOLD[inner.kind]?.(s, inner, nodes);
    for (const [n, told, ended] of e.visits) {
      s.told[n] = told;
      s.ended[n] = ended;
    }
    s.number = e.at[0];
    s.pending = new Map(e.pending.map(([n, failures]) => [n, failures]));
    s.dealt = e.dealt;
  },
};

const failure = (s, n, e, message) => ({ n, t: e.t, number: e.at[0], message, by: null, attempt: s.attempt.get(n) });

// What runs, as the run is to end.
function stop(s, e, nodes) {
  s.stopped = leaves(s, nodes).map((n) => failure(s, n, e, s.message[n]));
}

// What a node says that has ended as if it were not there.
const left_out = (message) => /^left out(: |$)/.test(message || "");

function failed(s, n, e, nodes) {
  const passed = [];
  for (const kid of nodes[n].ever) {
    if (s.status[kid.id] === "failure" && !e.by_itself) {
      passed.push(...(s.pending.get(kid.id) || []));
      s.pending.delete(kid.id);
    } else settle(s, kid.id, n, nodes);
  }
  s.pending.set(n, passed.length ? passed : [failure(s, n, e, e.message)]);
}

// What failed at or below `n` did not make `by` fail.
function settle(s, n, by, nodes) {
  const held = s.pending.get(n);
  if (!held) return;
  deal_with(s, held, by, nodes);
  s.pending.delete(n);
}
function deal_with(s, failures, by, nodes) {
  if (!failures || by < 0 || nodes[by].kind === "invert") return; // to which it is no failure
  s.dealt = [...s.dealt, ...failures.map((one) => ({ ...one, by }))].slice(-KEPT);
  s.dealt_in_all += failures.length;
}

// Whether a node did anything in the latest visits, and rounds, of all that holds it.
export function is_begun(s, n, nodes) {
  for (let up = nodes[n].parent; up >= 0; up = nodes[up].parent)
    if (s.told[n] <= s.ended[up] || s.told[n] <= (s.round.get(up)?.at[0] ?? 0)) return false;
  return true;
}

export function upper(list, t, key) {
  let low = 0,
    high = list.length;
  while (low < high) {
    const mid = (low + high) >> 1;
    if (key(list[mid]) <= t) low = mid + 1;
    else high = mid;
  }
  return low;
}

// The deepest nodes that run, in the order of the tree; and a node in whose tick the tree is for long.
export function leaves(s, nodes) {
  const inside = s.lasting ? s.lasting.n : -1,
    holders = new Set();
  for (let up = nodes[inside]?.parent ?? -1; up >= 0; up = nodes[up].parent) holders.add(up);
  const out = [...s.running].filter(
    (n) => n === inside || (!holders.has(n) && !nodes[n].ever.some((kid) => s.status[kid.id] === "running")),
  );
  if (inside >= 0 && !s.running.has(inside)) out.push(inside);
  return out.sort((a, b) => nodes[a].place_in_tree - nodes[b].place_in_tree);
}
