// One stream for all tabs of this browser that show the same: a browser has six connections to a server at a time.
//
// Each tab opens a stream of its own, from the event behind the last one that it has. The tab that holds the lock of the
// address leads: it hands on what its stream tells, each message with the number of the event before. A tab that has that
// event takes the message, and closes its own stream; one that lacks some opens its own again, from where it is: so there
// is never a gap, nor does a tab need to know who leads. When the leader closes, its lock goes to another tab, which goes
// on from where it is. A tab that hears nothing for long, as where the leader stands still, opens its own stream, too.
//
// A tab that nobody sees takes no part: link.js and front.js close its stream. Tabs that show different runs have a
// stream each, MOST at a time: one connection is left for all else, without which the next page would never load. A tab
// that would have one more says so, and asks again. Where a browser has no Web Locks, each tab has its own stream.

const KINDS = ["events", "beat", "end", "reset", "broken", "now"];
const SILENT = 3000; // milliseconds; the server has something to tell each second
const MOST = 5;
const AGAIN = 1000; // milliseconds

export class Stream {
  // `number()` is that of the last event that this tab has, `from()` is how the address says it; `hear` takes the kind and
  // the data of a message, `lose` is called where the server is not to be had, `crowd` where MOST other streams are open.
  constructor(path, { number = () => 0, from = () => "", hear, lose, crowd }) {
    Object.assign(this, { path, number, from, hear, lose, crowd, leads: false, is_crowded: false, is_closed: false });
    if (!navigator.locks) return this.open();
    this.channel = new BroadcastChannel(path);
    this.channel.onmessage = ({ data }) => this.follow(data);
    this.over = new Promise((resolve) => (this.release = resolve));
    this.ask({ ifAvailable: true });
  }

  ask(options) {
    navigator.locks.request(this.path, options, async (lock) => {
      if (!lock) this.ask({});
      this.is_crowded = Boolean(lock) && (await navigator.locks.query()).held.length > MOST;
      if (this.is_closed) return;
      if (this.is_crowded) return this.wait();
      this.leads = Boolean(lock);
      this.ensure();
      return this.leads && this.over;
    });
  }

  wait() {
    this.source?.close();
    this.again = setTimeout(() => this.ask({ ifAvailable: true }), AGAIN);
    this.crowd();
  }

  open() {
    clearTimeout(this.silent);
    const source = (this.source = new EventSource(this.path + this.from()));
    for (const kind of KINDS)
      source.addEventListener(kind, ({ data }) => {
        if (this.leads) this.channel.postMessage({ kind, data, before: this.number() });
        this.hear(kind, data);
      });
    source.onerror = () => {
      this.lose();
      if (!this.is_closed) this.ensure_soon(); // a browser gives up where the answer is an error
    };
  }

  // What the leader tells. A beat closes this tab's own stream: all that there is has come.
  follow({ kind, data, before }) {
    clearTimeout(this.silent);
    if (this.number() < before) return this.ensure();
    if (kind !== "events") this.source?.close();
    this.ensure_soon();
    this.hear(kind, data);
  }

  ensure_soon() {
    clearTimeout(this.silent);
    this.silent = setTimeout(() => this.ensure(), SILENT);
  }

  ensure() {
    if ((this.source?.readyState ?? EventSource.CLOSED) === EventSource.CLOSED) this.open();
  }

  close() {
    this.is_closed = true;
    clearTimeout(this.silent);
    clearTimeout(this.again);
    this.source?.close();
    this.channel?.close();
    this.release?.();
  }
}
