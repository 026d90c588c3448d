// The table of all signals of the DBC files: last value, rate and age, once a second while it is open.
import { byId, make, say } from "./panels.js";
import { clock, grouped, known } from "./numbers.js";

// as controls.SIGNALS_HOLD_S, with room for a request that comes late
const ASK_MS = 2000;
// rows that are drawn; the rest is found by the search
const MAX_DRAWN = 1000;
// s without a value from which on it is shown as old
const OLD_S = 2;

let drawnOf = null;

export const isOpen = () => byId("decoded-open").open && !document.hidden;

function age(seconds) {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  return seconds < 600 ? `${Math.round(seconds)} s` : clock(seconds);
}

// as in the other texts of the page: three digits
const rate = (x) => (known(x) ? `${Number(x.toPrecision(3))} 1/s` : "");

// all words of the search, in any order; upper and lower case are the same
function matching(rows, text) {
  const words = text.toLowerCase().split(/\s+/).filter((one) => one);
  return rows.filter(([, name, value]) => words.every((word) => `${name} ${value}`.toLowerCase().includes(word)));
}

// a long name is broken behind its message
function nameIn(cell, name) {
  if (cell.textContent === name) return;
  const dot = name.indexOf(".") + 1;
  cell.replaceChildren(name.slice(0, dot), make("wbr"), name.slice(dot));
}

// the cells stay, so that what is selected or read aloud does too
function fill(row, [bus, name, text, often, old], several) {
  const texts = several ? [String(bus), name, text, rate(often), age(old)] : [name, text, rate(often), age(old)];
  if (!row.childElementCount) {
    row.append(...texts.map((_, k) => make(k === Number(several) ? "th" : "td")));
    row.children[Number(several)].scope = "row";
  }
  texts.forEach((one, k) => (k === Number(several) ? nameIn(row.children[k], one) : say(row.children[k], one)));
  row.dataset.signal = name;
  row.classList.toggle("old", old >= OLD_S);
}

// anew only where there is a new table, or another search
export function drawSignals(store, anew = false) {
  if (!isOpen()) return;
  const { table } = store;
  if (!anew && table === drawnOf) return;
  drawnOf = table;
  const body = byId("signal-rows");
  const rows = table ? table.rows : [];
  const several = new Set(rows.map(([bus]) => bus)).size > 1;
  const found = matching(rows, byId("search").value);
  const shown = found.slice(0, MAX_DRAWN);
  if (body.dataset.several !== String(several)) {
    body.dataset.several = String(several);
    body.replaceChildren();
    byId("bus-head").hidden = !several;
  }
  while (body.childElementCount > shown.length) body.lastElementChild.remove();
  while (body.childElementCount < shown.length) body.append(make("tr"));
  shown.forEach((one, k) => fill(body.children[k], one, several));
  let words = "no frame of the DBC files yet";
  if (table && table.failure) words = `no signals: ${table.failure}`;
  else if (rows.length) {
    const more = found.length > shown.length ? `, the first ${grouped(shown.length)} are shown` : "";
    words = `${grouped(found.length)} of ${grouped(rows.length)} signals at ${clock(table.t)}${more}`;
  }
  const count = byId("signal-count");
  say(count, words);
  if (table) count.dataset.t = String(table.t);
}

// asks for the table as long as it is open
export function watchSignals(ask, redraw) {
  const now = () => { if (isOpen()) ask({ do: "signals" }); };
  setInterval(now, ASK_MS);
  byId("decoded-open").addEventListener("toggle", () => { now(); redraw(); });
  document.addEventListener("visibilitychange", now);
  byId("search").addEventListener("input", redraw);
}
