// Many waits at once: one stretch for all that overlap, with how many there were.

export class Crowd {
  constructor(waits) {
    Object.assign(this, { waits, counted: 0, stretches: [] });
  }

  // The stretches, with those that have come.
  now() {
    for (; this.counted < this.waits.length; this.counted++) {
      const wait = this.waits[this.counted],
        last = this.stretches.at(-1);
      if (!last || wait.from > last.until()) this.stretches.push(new Stretch(wait));
      else last.add(wait);
    }
    return this.stretches;
  }
}

class Stretch {
  constructor(wait) {
    Object.assign(this, { from: wait.from, n: wait.n, count: 1, open: [wait], over: 0 });
  }

  add(wait) {
    this.count++;
    this.n = wait.n;
    this.open.push(wait);
  }
  // When the last of them is over; Infinity while one goes on.
  until() {
    this.open = this.open.filter((one) => {
      if (one.to !== Infinity) this.over = Math.max(this.over, one.to);
      return one.to === Infinity;
    });
    return this.open.length ? Infinity : this.over;
  }
}
