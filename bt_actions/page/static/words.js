// How things are said: times, values, states, and the sentences made of them. No DOM.

export const clock = (t) => {
  const tenths = Math.max(0, Math.floor(t * 10 + 1e-6)),
    s = Math.floor(tenths / 10);
  const two = (n) => String(n).padStart(2, "0");
  const h = Math.floor(s / 3600);
  return `${h ? `${h}:` : ""}${two(Math.floor(s / 60) % 60)}:${two(s % 60)}.${tenths % 10}`;
};
export const secs = (s) =>
  s >= 120
    ? `${Math.floor(s / 60)} min ${Math.floor(s % 60)} s`
    : s < 0.0995
      ? `${Math.round(s * 1000)} ms`
      : `${s.toFixed(1)} s`;
export const span = (s) =>
  s < 120
    ? `${Math.floor(s)} s`
    : s < 7200
      ? `${Math.floor(s / 60)} min`
      : s < 172_800
        ? `${Math.floor(s / 3600)} h`
        : `${Math.floor(s / 86_400)} days`;
export const plain = (s) => (s === null || s === undefined ? "none" : `${+s.toFixed(2)} s`);
// Values, as bt_actions/events/wire.py writes them.
export const short = (value) =>
  typeof value === "number"
    ? Number.isInteger(value)
      ? String(value)
      : String(+value.toFixed(3))
    : typeof value === "string"
      ? value
      : written(value);
export function written(value) {
  if (typeof value === "string") return JSON.stringify(value);
  if (typeof value === "number") return short(value);
  if (value === null || typeof value !== "object") return String(value);
  if (Array.isArray(value)) return `[${value.map(written).join(", ")}]`;
  const [[tag, held] = []] = Object.entries(value);
  if (tag === "$float" || tag === "$int") return held;
  if (tag === "$bytes") return `bytes ${held}`;
  if (tag === "$cut") return `${written(held[0])} and ${held[1]} more`;
  return `{${(tag === "$map" ? held : Object.entries(value)).map(([key, item]) => `${key}: ${written(item)}`).join(", ")}}`;
}
export const fields_of = (message) =>
  message === null || typeof message !== "object" || Array.isArray(message)
    ? null
    : message.$cut
      ? fields_of(message.$cut[0])
      : message;

// What a node or attempt is doing: the word, and the look (a shape and a colour, glyphs.js).
export const STATE = {
  idle: ["Not started", "idle"],
  running: ["Running", "running"],
  success: ["Succeeded", "success"],
  failure: ["Failed", "failure"],
  stopped: ["Interrupted", "stopped"],
  queued: ["Queued", "waiting"],
  server: ["Waits for server", "waiting"],
  sent: ["Sent", "waiting"],
  exec: ["Executing", "running"],
  backoff: ["Backoff", "backoff"],
  cancel: ["Canceling", "cancel"],
  message: ["Waits for message", "waiting"],
  holds: ["Waits", "waiting"],
  tick: ["In its tick", "waiting"],
};
export const PHASE = {
  QUEUED: "queued",
  WAITING_FOR_SERVER: "server",
  SENDING: "sent",
  EXECUTING: "exec",
  CANCELING: "cancel",
};
export const PHASE_WORD = {
  queued: "queued",
  server: "waiting for server",
  sent: "sent",
  exec: "executing",
  backoff: "backoff",
  cancel: "canceling",
};
export const CROWDED = [
  "Five windows of this browser show other runs",
  "A browser has six connections to a server. This window goes on when one of the others is closed or hidden.",
];
export const DEADLINE = { queued: "queue", server: "server", sent: "accept", exec: "result", cancel: "cancel" };
export const kind_word = (node) => (node.kind === "action" ? node.type || node.kind : node.kind);
export const place = (node) => (node.line ? `${node.file}:${node.line}` : node.file || node.kind);

const END = {
  SUCCEEDED: "the server says it succeeded",
  ABORTED: "the server gave up",
  CANCELED: "it ended as canceled",
  NEVER_STARTED: "nothing was begun on the server",
  SERVER_GONE: "the server went away with it",
  UNKNOWN: "how it stands on the server is not known",
};
export const end_words = (end) => END[end] || "";

// What had been said of an attempt by t: its goal comes to an end first, and is judged by its leaf behind that.
export const said_by = (attempt, t) => attempt.said.findLast((one) => one.t <= t);

// One attempt as a sentence, as far as it had come at t.
export function story(attempt, node, t) {
  const parts = [],
    said = said_by(attempt, t),
    told = attempt.phases.filter((phase) => phase.from <= t);
  const took = (phase) => secs(Math.min(phase.to, t) - phase.from);
  for (const phase of told) {
    const over = phase.to <= t;
    if (phase.st === "queued")
      parts.push(over ? `queued for ${took(phase)}` : `queued for ${took(phase)}: ${node.server} is taken`);
    if (phase.st === "server" && (!over || phase.to - phase.from > 0.05))
      parts.push(
        over ? `waited ${took(phase)} for the server` : `no server on ${node.server} for ${took(phase)}, waiting`,
      );
    if (phase.st === "sent")
      parts.push(
        over
          ? said?.oc === "REJECTED"
            ? `rejected after ${took(phase)}`
            : `accepted after ${took(phase)}`
          : `sent ${took(phase)} ago, no answer yet`,
      );
    if (phase.st === "exec") parts.push(over ? `executed ${took(phase)}` : `executing for ${took(phase)}`);
    if (phase.st === "cancel")
      parts.push(over ? `canceled within ${took(phase)}` : `asked to cancel ${took(phase)} ago, its end is awaited`);
  }
  let text = parts.join(", ");
  if (attempt.done <= t) {
    if (!said) text += ". How it ended is not recorded";
    else if (said.oc === "SUCCEEDED") text += "; succeeded";
    else text += `. ${said.oc}: ${said.why.split(": interrupted")[0]}. On the server: ${end_words(attempt.end)}`;
  }
  return text.charAt(0).toUpperCase() + text.slice(1) + ".";
}
