// What a node does at one time, since when, until when and by which rule: bt_actions/story/doing.py says the same.

import { DEADLINE, secs, clock, said_by } from "./words.js";
import { upper, is_begun } from "./state.js";

export const phase_at = (a, t) => (a.done <= t ? null : a.phases.findLast((phase) => phase.from <= t) || null);
export const last_feedback = (a, t) => {
  const i = upper(a.fb, t, (e) => e.t);
  return i ? a.fb[i - 1] : null;
};

export function view(run, n, s) {
  const node = run.nodes[n],
    status = s.status[n],
    t = s.t;
  const seen = { st: status, from: s.from[n], elapsed: 0, limit: null, used: 0, rule: "", attempt: null, tries: 0 };
  if (s.lasting?.n === n) return { ...seen, st: "tick", elapsed: t - s.lasting.from, used: t - s.lasting.from };
  if (status === "idle") return seen;
  seen.elapsed = (status === "running" ? t : s.to[n]) - s.from[n];
  const a = run.attempts[s.attempt.get(n)];
  if (a) {
    seen.attempt = a;
    seen.tries = a.a;
  }
  const limits = node.timeouts || {};
  if (status === "stopped" && a && a.done > t) {
    // interrupted, and its goal not at its end yet
    const phase = phase_at(a, t);
    return { ...seen, st: "cancel", limit: limits.cancel ?? null, used: t - phase.from, rule: "timeout.cancel" };
  }
  if (status !== "running") {
    seen.limit = a ? (limits.result ?? null) : null;
    seen.used = a ? Math.min(a.done, t) - a.accepted : seen.elapsed;
    if (!(seen.used >= 0)) seen.used = 0;
    seen.rule = "timeout.result";
    return seen;
  }
  if (a) {
    const phase = phase_at(a, t),
      wait = s.backoff.get(n);
    if (!phase && wait)
      return {
        ...seen,
        st: "backoff",
        limit: wait.until - wait.from,
        used: t - wait.from,
        rule: "retry.backoff",
        ends: wait.until,
      };
    if (phase) {
      Object.assign(seen, {
        st: phase.st,
        limit: limits[DEADLINE[phase.st]] ?? null,
        used: t - phase.from,
        rule: `timeout.${DEADLINE[phase.st]}`,
      });
      if (phase.st === "exec" && typeof limits.feedback === "number") {
        const last = last_feedback(a, t),
          quiet = t - Math.max(last ? last.t : 0, phase.from);
        if (quiet > 1 && (seen.limit === null || limits.feedback - quiet < seen.limit - seen.used))
          Object.assign(seen, { limit: limits.feedback, used: quiet, rule: "timeout.feedback", silent: true });
      }
    }
  } else if (!node.children.length) {
    Object.assign(seen, { st: node.kind === "wait_for_message" ? "message" : "holds", used: seen.elapsed });
  }
  // Its own time, and for a leaf that of what holds it: the first that runs out counts.
  for (let up = n; up >= 0; up = node.children.length ? -1 : run.nodes[up].parent) {
    const due = s.due.get(up),
      left = due && due.until - t;
    if (!due || left <= 0 || (seen.limit !== null && seen.limit - seen.used <= left)) continue;
    Object.assign(seen, {
      limit: due.until - due.from,
      used: t - due.from,
      rule: up === n ? "its own time" : run.nodes[up].name,
    });
  }
  return seen;
}

// Whether how a node stands is from before what holds it has begun anew, as in an earlier round of a loop.
export const is_old = (run, n, s) => !["running", "idle"].includes(s.status[n]) && !is_begun(s, n, run.nodes);

// The nearest loop round or subtree above, to tell nodes of one name apart.
export function branch_of(run, n, s) {
  for (let up = run.nodes[run.nodes[n].parent]; up; up = run.nodes[up.parent]) {
    const round = s.round.get(up.id);
    if (round) return `${up.name} ${round.number + 1}${round.of ? ` of ${round.of}` : ""}`;
    if (up.kind === "subtree") return up.name;
  }
  return "";
}

export function waiting_for(node, view, s) {
  const a = view.attempt,
    said = a && said_by(a, s.t),
    of = a && node.retry.attempts > 1 ? `, attempt ${a.a} of ${node.retry.attempts}` : "",
    rule = view.rule ? ` · ${view.rule}` : "";
  if (view.drains) return `interrupted; the end of its goal ${a.g} is awaited${rule}`;
  switch (view.st) {
    case "tick":
      return "the tree waits for it: its tick has not returned";
    case "exec":
      return view.silent
        ? `no feedback from ${node.server} for ${secs(view.used)}${rule}`
        : `executes on ${node.server}${of}${rule}`;
    case "server":
      return `${s.up.get(node.server)?.up === false ? `${node.server} not in sight since ${clock(s.up.get(node.server).t)}` : `no server on ${node.server} yet`}${rule}`;
    case "queued":
      return `queued: ${node.server} has not ended the goal before${rule}`;
    case "sent":
      return `sent to ${node.server}, not answered yet${rule}`;
    case "backoff":
      return `until attempt ${a.a + 1} of ${node.retry.attempts}, after ${said.oc}${rule}`;
    case "cancel":
      return `${said ? `${said.oc}: ` : ""}canceled, its end is awaited${rule}`;
    case "running":
      return "between two children";
    default:
      return `${s.message[node.id] || node.kind}${rule || " · no deadline"}`;
  }
}

// Why a node failed: what it is called, and the reason in words.
export function cause_of(run, failure) {
  const a = run.attempts[failure.attempt],
    node = run.nodes[failure.n];
  if (a?.verdict?.expect && a.decided <= failure.t) {
    const seen = Object.entries(a.verdict.seen)
      .map(([name, value]) => `${name} is ${JSON.stringify(value)}`)
      .join(", ");
    return [a.oc, `${seen ? `${seen}; ` : ""}expected ${a.verdict.expect}`];
  }
  const at = failure.message.indexOf(": ");
  if (node.server && at > 0) return [failure.message.slice(0, at), failure.message.slice(at + 2)];
  return ["failed", failure.message || node.kind];
}
export function because(node) {
  if (node.kind === "sequence") return "a child failed";
  if (node.kind === "fallback") return `all ${node.children.length} failed`;
  if (node.kind.startsWith("parallel")) return "too many failed";
  if (node.kind === "subtree") return "its tree failed";
  return "its child failed";
}
