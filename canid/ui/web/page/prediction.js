// The driver's output as the headline's parameters predict it: each measured input through K e^(-θ s) / (1 + τ s), and one
// constant offset, fitted to the last seconds in which the estimators learned. A simulation: no measured output enters it.
import { known } from "./numbers.js";

// s that the offset is fitted to, and how much of it must be there
export const OFFSET_S = 30;
const MIN_OFFSET_S = 3;
// s; a longer pause between two samples begins anew
const MAX_PAUSE_S = 1;
// time constants until the beginning is forgotten
const SETTLED = 3;

// [gain, lag, dead time] of each channel that is estimated; where only the sum of the delays is known, all of it is dead time
export function parameters(channels) {
  const found = {};
  for (const [name, ch] of Object.entries(channels)) {
    if (!known(ch.K.value)) continue;
    const separate = known(ch.tau.value) && known(ch.dead_time.value);
    const sum = known(ch.tau_plus_dead_time.value) ? ch.tau_plus_dead_time.value : 0;
    found[name] = separate ? [ch.K.value, ch.tau.value, ch.dead_time.value] : [ch.K.value, 0, sum];
  }
  return found;
}

// rows: {t, output, inputs: {name: x}, learn, segment}, in order; returns {values, offset}, null where there is none
export function predict(rows, found, floor = -Infinity) {
  const names = Object.keys(found);
  const response = new Array(rows.length).fill(null);
  if (!names.length) return { values: response, offset: null };
  const settling = Math.max(...names.map((name) => found[name][2] + SETTLED * found[name][1]));
  const usable = (row) => names.every((name) => known(row.inputs[name]));
  for (let begin = 0; begin < rows.length; begin += 1) {
    if (!usable(rows[begin])) continue;
    let end = begin + 1;
    while (end < rows.length && usable(rows[end]) && rows[end].segment === rows[begin].segment
      && rows[end].t - rows[end - 1].t <= MAX_PAUSE_S) end += 1;
    const part = rows.slice(begin, end);
    const sums = new Array(part.length).fill(0);
    for (const name of names) {
      const [gain, tau, deadTime] = found[name];
      const u = part.map((row) => row.inputs[name]);
      let at = 0;
      const delayed = part.map((row) => {
        const t = row.t - deadTime;
        if (t <= part[0].t) return u[0];
        while (at + 1 < part.length && part[at + 1].t <= t) at += 1;
        if (at + 1 >= part.length) return u[at];
        return u[at] + ((u[at + 1] - u[at]) * (t - part[at].t)) / (part[at + 1].t - part[at].t);
      });
      let x = delayed[0];
      part.forEach((row, k) => {
        if (k > 0) {
          // exact for an input that is constant over the step at its mean
          const keep = tau > 0 ? Math.exp(-(row.t - part[k - 1].t) / tau) : 0;
          x = tau > 0 ? keep * x + (1 - keep) * 0.5 * (delayed[k] + delayed[k - 1]) : delayed[k];
        }
        sums[k] += gain * x;
      });
    }
    part.forEach((row, k) => {
      if (row.t - part[0].t >= settling) response[begin + k] = sums[k];
    });
    begin = end - 1;
  }
  const offset = fittedOffset(rows, response);
  return { values: response.map((y) => (y === null || offset === null ? null : Math.max(y + offset, floor))), offset };
}

function fittedOffset(rows, response) {
  const learned = rows.map((row, k) => [row.t, row.output - response[k], row.learn && known(row.output) && response[k] !== null])
    .filter((one) => one[2]);
  if (!learned.length) return null;
  const since = learned[learned.length - 1][0] - OFFSET_S;
  const recent = learned.filter((one) => one[0] >= since);
  if (recent[recent.length - 1][0] - recent[0][0] < MIN_OFFSET_S) return null;
  return recent.reduce((sum, one) => sum + one[1], 0) / recent.length;
}
