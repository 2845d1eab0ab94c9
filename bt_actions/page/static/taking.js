// What each event adds to what is known over all of a run: attempts, waits, lines, who was in sight.
// Each function is called with the run as `this`.

import { PHASE } from "./words.js";

const OVER = { SUCCESS: true, FAILURE: true, INVALID: true };

export const TAKE = {
  RunBegan(e) {
    e.given = Object.entries(e.inputs).map(([name, value]) => ({
      kind: "VariableWritten",
      at: e.at,
      t: e.t,
      name,
      value,
      by: "input",
    }));
    for (const given of e.given) remember(this, given);
    say(this, e, "info", `${e.tree}: ${e.nodes.length} nodes`);
  },
  GoalChanged(e) {
    if (e.n === undefined) return;
    let a = this.attempts[this.of_goal.get(e.goal_id)];
    const is_late = !a && e.outcome && this.of_node.has(e.n); // of a visit that is forgotten
    if (!a) {
      a = {
        g: e.goal_id.slice(-8),
        id: e.goal_id,
        n: e.n,
        a: e.attempt,
        server: e.server,
        start: e.t,
        done: Infinity,
        accepted: Infinity,
        decided: 0,
        phases: [],
        fb: [],
        goal: null,
        result: null,
        oc: null,
        said: [],
        end: e.end,
        why: "",
        verdict: null,
        i: this.attempts.length,
        visit: 0,
      };
      this.of_goal.set(e.goal_id, a.i);
      this.attempts.push(a);
      if (!this.of_node.has(e.n)) this.of_node.set(e.n, []);
      a.visit = (this.of_node.get(e.n).at(-1)?.visit || 0) + (e.attempt <= 1 && !is_late);
      if (is_late) this.of_node.get(e.n).unshift(a);
      else this.of_node.get(e.n).push(a);
    }
    e.a = a.i;
    e.is_latest = this.of_node.get(e.n).at(-1) === a;
    const last = a.phases.at(-1),
      st = PHASE[e.state];
    if (a.state !== e.state) {
      a.state = e.state;
      if (last?.to === Infinity) last.to = e.t;
      if (st) a.phases.push({ st, from: e.t, to: Infinity });
      if (e.state === "EXECUTING") a.accepted = e.t;
      if (e.state === "DONE") a.done = e.t;
      const words = {
        SENDING: "sent",
        EXECUTING: "accepted",
        CANCELING: `canceling: ${e.reason}`,
        DONE: `${e.outcome}${e.reason ? `: ${e.reason}` : ""}`,
        QUEUED: "queued",
      }[e.state];
      if (words) say(this, e, "goal", `${words}  #${e.attempt} ${a.g}`);
    }
    if (e.goal !== null) a.goal = e.goal;
    if (e.result !== null) a.result = e.result;
    if (e.outcome && !a.verdict) decide(this, a, e);
    a.end = e.end;
    if (e.reason && !a.verdict) a.why = e.reason;
  },
  AttemptEnded(e) {
    const a = this.attempts[this.of_goal.get(e.goal_id)];
    if (!a) return;
    const again = e.again_in === null ? "" : `; tried again in ${e.again_in.toFixed(1)} s`;
    if (again || e.outcome !== a.oc)
      say(this, e, "goal", `${e.outcome}${e.reason ? `: ${e.reason}` : ""}${again}  #${e.attempt} ${a.g}`);
    decide(this, a, e);
    a.verdict = e;
    if (e.reason) a.why = e.reason;
    if (e.again_in !== null) a.backoff = e.t + e.again_in;
  },
  FeedbackCame(e) {
    this.attempts[this.of_goal.get(e.goal_id)]?.fb.push(e);
  },
  NodeChanged(e) {
    const node = this.nodes[e.n];
    if (!node || node.server || node.children.length) return;
    const wait = this.open_waits.get(e.n);
    if (e.status === "RUNNING" && !wait) {
      const made = { n: e.n, from: e.t, to: Infinity };
      this.waits.push(made);
      this.open_waits.set(e.n, made);
    }
    if (OVER[e.status] && wait) {
      wait.to = e.t;
      this.open_waits.delete(e.n);
    }
  },
  VariableWritten(e) {
    remember(this, e);
  },
  Logged(e) {
    say(this, e, e.level, e.text);
  },
  ServerSeen(e) {
    const seen = this.presence.get(e.server) || [];
    if (e.in_sight) seen.push({ from: e.t, to: Infinity });
    else if (seen.length) seen.at(-1).to = e.t;
    this.presence.set(e.server, seen);
  },
  TickLasts(e) {
    say(
      this,
      e,
      "warn",
      e.is_over
        ? `its tick is over, after ${e.seconds.toFixed(1)} s`
        : `its tick lasts, for ${e.seconds.toFixed(1)} s by now`,
    );
  },
  ClockJumped(e) {
    say(this, e, "warn", `the ${e.clock} clock jumped by ${e.seconds.toFixed(1)} s`);
  },
  Paused(e) {
    say(this, e, "info", e.paused ? "paused" : "resumed");
  },
  StopWanted(e) {
    say(this, e, "warn", e.why);
  },
  EventsLost(e) {
    say(this, e, "warn", `${e.count} events are not in the recording`);
  },
  TreeFinished(e) {
    say(
      this,
      e,
      e.status === "SUCCESS" ? "info" : "error",
      `the tree has ended: ${e.status === "INVALID" ? "stopped" : e.status}${e.error ? `: ${e.error}` : ""}`,
    );
  },
  RunEnded(e) {
    this.info.exit_code = e.exit_code;
    say(
      this,
      e,
      e.exit_code ? "error" : "info",
      `the run is over, exit code ${e.exit_code}${e.cause ? `: ${e.cause}` : ""}`,
    );
    if (e.world) say(this, e, "info", e.world);
    if (e.complaint || e.error) say(this, e, "error", e.complaint || e.error);
    for (const line of e.unaccounted) say(this, e, "error", `not accounted for: ${line}`);
  },
  StateKnown(e) {
    const gap = this.missing.at(-1),
      before = this.attempts.length;
    for (const wait of this.open_waits.values()) wait.to = gap.from;
    this.open_waits.clear();
    const open = this.attempts.filter((a) => a.done === Infinity);
    for (const inner of e.events)
      if (!["RunBegan", "NodesAdded"].includes(inner.kind)) TAKE[inner.kind]?.call(this, inner);
    const told = new Set(e.events.filter((one) => one.kind === "GoalChanged").map((one) => one.goal_id));
    for (const a of open)
      if (!told.has(a.id)) {
        a.done = gap.from;
        a.phases.at(-1).to = gap.from;
        a.lost = true;
      }
    const late = this.attempts.splice(before).sort((a, b) => a.start - b.start);
    for (const a of late) {
      a.i = this.attempts.length;
      this.of_goal.set(a.id, a.i);
      this.attempts.push(a);
    }
    for (const inner of e.events) if (inner.kind === "GoalChanged") inner.a = this.of_goal.get(inner.goal_id);
    this.lines.sort((a, b) => a.t - b.t);
    say(this, e, "warn", "events before this are not in the recording");
  },
};

function decide(run, a, e) {
  if (a.oc !== e.outcome) a.decided = e.t;
  a.oc = e.outcome;
  a.said.push({ t: e.t, oc: e.outcome, why: e.reason || a.why });
  run.decided++;
}
function remember(run, e) {
  const at = e.name.lastIndexOf("/");
  e.scope = at < 0 ? run.info.tree : e.name.slice(0, at);
  e.by ??= run.nodes[e.n]?.kind || "";
  if (!run.history.has(e.name)) run.history.set(e.name, []);
  run.history.get(e.name).push(e);
}
function say(run, e, level, text) {
  run.lines.push({ t: e.t, lv: level, src: run.nodes[e.n]?.name || run.info.tree, x: text, n: e.n });
}
