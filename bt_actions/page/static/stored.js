// Runs that are in the page itself, as in a file of `bt-actions report`; the same to the page as link.js.

export const stored = JSON.parse(document.getElementById("stored")?.textContent ?? "null");

export class Stored {
  constructor(run, told) {
    const one = stored.find((each) => each.run.run_id === run.key);
    Object.assign(this, { conn: "replay", silence: 0, tick: 0, next: 0, ended: false, damaged: 0, why: "", head: 0 });
    run.over = true;
    if (one) {
      for (const e of one.events) run.push(e);
      Object.assign(this, { ended: one.ended, goes_on: one.run.written, damaged: one.damaged, head: run.clock });
      if (!this.ended && !this.goes_on)
        Object.assign(this, { conn: "gone", silence: Date.now() / 1000 - run.began[2] - run.clock });
    } else this.why = "This file holds no such run";
    setTimeout(() => told("settled"));
  }

  look() {}
  close() {}
}
