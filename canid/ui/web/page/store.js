// What the server has sent: the latest of each kind, and rows to draw in bounded memory.

const RECENT_SAMPLES = 1200;
const RECENT_ESTIMATES = 600;
const MAX_OLDER = 1500;
const MAX_EVENTS = 200;
const PARAMETERS = ["K", "tau", "dead_time", "tau_plus_dead_time"];

// as canid/ui/web/history.py: recent rows whole, older ones at equal intervals
class Thinned {
  constructor(recent) {
    this.max = recent;
    this.recent = [];
    this.older = [];
    this.every = 0;
  }

  bucket(t) { return this.every ? Math.floor(t / this.every) : t; }

  add(row) {
    this.recent.push(row);
    if (this.recent.length <= 2 * this.max) return;
    for (const old of this.recent.splice(0, this.max)) {
      const last = this.older[this.older.length - 1];
      if (!last || this.bucket(old.t) !== this.bucket(last.t)) this.older.push(old);
    }
    while (this.older.length >= MAX_OLDER) {
      const span = this.older[this.older.length - 1].t - this.older[0].t;
      this.every = 2 * Math.max(this.every, span / (this.older.length - 1), 1e-9);
      let last = null;
      this.older = this.older.filter((row) => {
        const bucket = this.bucket(row.t);
        const keep = bucket !== last;
        if (keep) last = bucket;
        return keep;
      });
    }
  }

  rows() { return this.older.concat(this.recent); }
}

const triple = (iv) => [iv.value, iv.low, iv.high];

export class Store {
  constructor() {
    this.start = {};
    this.table = null; // of all signals; it outlives a seek, until the next one comes
    this.version = 0; // grows with every message: what was drawn may be out of date
    this.clear();
  }

  clear() {
    this.samples = new Thinned(RECENT_SAMPLES);
    this.estimates = new Map();
    this.latest = new Map(); // estimator -> message
    this.headline = null; // the latest headline, now or earlier
    this.sample = null;
    this.monitor = null;
    this.signals = null;
    this.health = null;
    this.status = null;
    this.events = [];
    this.ended = false;
  }

  take(message) {
    this.version += 1;
    const kind = message.kind;
    if (kind === "snapshot") this.takeSnapshot(message);
    else if (kind === "news") message.messages.forEach((one) => this.take(one));
    else if (kind === "reset") this.clear();
    else if (kind === "sample") this.takeSample(message, true);
    else if (kind === "estimate") this.takeEstimate(message, true);
    else if (kind === "event") this.events = [...this.events, message].slice(-MAX_EVENTS);
    else if (kind === "monitor") this.monitor = message;
    else if (kind === "signals") this.signals = message;
    else if (kind === "health") this.health = message;
    else if (kind === "table") this.table = message;
    else if (kind === "status") this.status = message;
    else if (kind === "end") this.ended = true;
  }

  takeSnapshot(message) {
    this.clear();
    this.start = message.start;
    message.samples.forEach((row) => this.samples.add(row));
    for (const [name, rows] of Object.entries(message.estimates)) rows.forEach((row) => this.rowsOf(name).add(row));
    this.events = message.events;
    this.headline = message.headline;
    for (const one of message.latest) {
      if (one.kind === "sample") this.takeSample(one, false);
      else if (one.kind === "estimate") this.takeEstimate(one, false);
      else this.take(one);
    }
  }

  rowsOf(estimator) {
    if (!this.estimates.has(estimator)) this.estimates.set(estimator, new Thinned(RECENT_ESTIMATES));
    return this.estimates.get(estimator);
  }

  takeSample(message, isNew) {
    this.sample = message;
    if (isNew) this.samples.add(message);
  }

  takeEstimate(message, isNew) {
    const value = message.value;
    this.latest.set(value.estimator, message);
    if (value.headline) this.headline = message;
    if (!isNew || value.t === null) return;
    const channels = {};
    for (const [name, ch] of Object.entries(value.channels)) {
      channels[name] = { status: ch.status };
      for (const what of PARAMETERS) channels[name][what] = triple(ch[what]);
    }
    this.rowsOf(value.estimator).add({ t: value.t, status: value.status, channels });
  }

  // the headline, and whether it is of now
  shown() {
    const now = [...this.latest.values()].filter((one) => one.value.headline);
    now.sort((a, b) => b.value.t - a.value.t);
    return now.length ? { message: now[0], current: true } : { message: this.headline, current: false };
  }
}
