// The stream of one run: keeps it open, goes on where it was, and says how well it is known that the run lives.
//
// `conn`: "live", "stale" (the stream is there, the run's heartbeat is not), "unrecorded" (the run goes on, and nothing
// of that is recorded), "lost" (no stream), "gone" (the run's process is), "replay" (the run is over). No time is made
// up: `head` goes on for at most AHEAD seconds behind a sign of life.

import { Stream } from "./stream.js";

const STALE = 2.5,
  AHEAD = 1.2,
  LONGEST = 15;

export class Link {
  constructor(run, told) {
    Object.assign(this, {
      run,
      told,
      conn: "lost",
      silence: 0,
      ended: false,
      tick: 0,
      damaged: 0,
      why: "",
      unrecorded: "",
      outcome: "",
      head: 0,
      signed: performance.now(),
      last_beat: null,
      tries: 0,
      next: 0,
      retry: 0,
    });
    this.open();
  }

  open() {
    this.close();
    this.next = 0;
    const { run } = this;
    this.stream = new Stream(`/run/${encodeURIComponent(run.key)}/events`, {
      number: () => run.number,
      from: () => `?after=${encodeURIComponent(`${run.key}:${run.number}`)}`,
      hear: (kind, data) => this[kind](JSON.parse(data)),
      lose: () => this.lose(),
      crowd: () => {
        this.is_open = false;
        this.look();
        this.told("lost");
      },
    });
  }

  // What the stream tells.
  events(batch) {
    this.tries = 0;
    if (!this.run.take(batch)) return this.reset(); // never shown with a gap
    this.sign(this.run.clock);
  }
  beat({ clock, tick, damaged, unrecorded }) {
    const { run } = this;
    this.tries = 0;
    this.is_open = true;
    Object.assign(this, { tick, damaged, unrecorded });
    if (clock !== null && clock !== this.last_beat && run.began) {
      this.last_beat = clock;
      this.sign(Math.max(run.clock, clock - run.began[2]));
    }
    this.look();
    this.told("settled");
  }
  end({ ended, ago, unrecorded, outcome }) {
    this.run.over = true;
    this.close();
    Object.assign(this, { ended, outcome, unrecorded: unrecorded || this.unrecorded });
    this.signed = performance.now() - ago * 1000;
    this.set(ended || this.unrecorded ? "replay" : "gone");
  }
  broken({ why }) {
    this.why = why;
    this.run.over = true;
    this.close();
    this.set("replay");
  }
  lose() {
    this.close();
    this.is_open = false;
    this.tries++;
    const wait = Math.min(LONGEST, 2 ** (this.tries - 1));
    this.next = performance.now() + wait * 1000;
    this.retry = setTimeout(() => this.open(), wait * 1000);
    this.look();
    this.told("lost");
  }

  reset() {
    this.close();
    this.told("reset");
  }
  close() {
    clearTimeout(this.retry);
    this.stream?.close();
  }
  // A page that is not seen keeps no stream; when it is seen again, what was missed comes first.
  hide(hidden) {
    if (this.run.over) return;
    this.close();
    this.is_open = false;
    if (!hidden) this.open();
    this.look();
  }

  // Something of the run was seen: its clock stood at t then.
  sign(t) {
    this.signed = performance.now();
    this.base = Math.max(t, this.head);
    this.is_open = true;
    this.look();
    this.told("news");
  }

  // Once a frame.
  look() {
    const { run } = this;
    this.silence = (performance.now() - this.signed) / 1000;
    if (run.over) {
      this.head = run.clock;
      return;
    }
    if (this.base !== undefined)
      this.head = Math.max(this.head, run.clock, this.base + Math.min(AHEAD, this.is_open ? this.silence : 0));
    this.set(!this.is_open ? "lost" : this.unrecorded ? "unrecorded" : this.silence > STALE ? "stale" : "live");
  }
  set(conn) {
    if (this.conn !== conn) {
      this.conn = conn;
      this.told("conn");
    }
  }
}
