// The panels. Names and sentences come from files, buses and people: they are set as text, never as markup.
import { clock, DASH, fixed, grouped, interval, known, limits, readable, value } from "./numbers.js";

const SYMBOLS = { K: "K", tau: "τ", dead_time: "θ", tau_plus_dead_time: "τ+θ" };
const NOTHING = { value: null, low: null, high: null };
// roles of the panel "Now": unit, and decimals
const SIGNALS = [["gap", "m", 1], ["headway", "s", 1], ["range_rate", "speed", 1], ["speed", "speed", 1], ["lateral_offset", "m", 2]];
const OF_LEAD = new Set(["gap", "headway", "range_rate"]);
const INPUT_UNITS = { headway_error: "s", range_rate: "m/s", lateral_offset: "m" };
// decimals of an output with this unit
const OUTPUT_DECIMALS = { "m/s²": 2 };

export const byId = (id) => document.getElementById(id);

export function make(tag, text = "", names = "") {
  const element = document.createElement(tag);
  if (text !== "") element.textContent = text;
  if (names) element.className = names;
  return element;
}

// only where it has changed: a screen reader says what changes
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function parameter(what, iv, unit, name, more = "") {
  const cell = make("div", "", `parameter ${more}`);
  cell.dataset.parameter = `${name}.${what}`;
  for (const end of ["value", "low", "high"]) if (known(iv[end])) cell.dataset[end] = String(iv[end]);
  cell.append(make("span", SYMBOLS[what], "symbol"), make("span", value(iv), "value"), make("span", limits(iv) || "not yet", "interval"));
  cell.append(make("span", unit, "unit"));
  return cell;
}

export function drawHeadline(store) {
  const { message, current } = store.shown();
  const newest = [...store.latest.values()].sort((a, b) => b.value.t - a.value.t || a.value.estimator.localeCompare(b.value.estimator));
  const about = current ? message : newest[0];
  if (!about) return;
  const status = byId("status");
  say(status, readable(about.value.status));
  status.dataset.status = about.value.status;
  const quality = [];
  if (message && known(message.value.fit_percent)) quality.push(`fit ${fixed(message.value.fit_percent, 0)} %`);
  if (message && known(message.value.used)) quality.push(`from ${fixed(message.value.used, 0)} s`);
  let who = current ? `headline: ${message.value.estimator.toUpperCase()} at ${clock(message.value.t)}` : "no headline now";
  if (!current && message) who = `no headline now; the last one: ${message.value.estimator.toUpperCase()} at ${clock(message.value.t)}`;
  say(byId("who"), [who, ...quality].join(" · "));
  say(byId("says"), about.value.says);
  const shown = message || newest[0];
  const big = byId("big");
  big.classList.toggle("old", !current);
  big.dataset.t = String(shown.value.t);
  big.dataset.estimator = shown.value.estimator;
  big.replaceChildren(...Object.entries(shown.value.channels).map(([name, ch]) => {
    const quoted = message ? ch.status : "not_identifiable";
    const box = make("div", "", "channel");
    const three = make("div", "", "three");
    const K = quoted === "not_identifiable" ? NOTHING : ch.K;
    three.append(parameter("K", K, shown.units[name] || "", name, K === NOTHING ? "none" : ""));
    if (quoted === "sum_only") three.append(parameter("tau_plus_dead_time", ch.tau_plus_dead_time, "s", name, "sum"));
    else {
      const [tau, dead] = quoted === "ok" ? [ch.tau, ch.dead_time] : [NOTHING, NOTHING];
      three.append(parameter("tau", tau, "s", name, quoted === "ok" ? "" : "none"), parameter("dead_time", dead, "s", name, quoted === "ok" ? "" : "none"));
    }
    box.append(make("h3", `answer to ${readable(name)}`), three);
    if (K !== NOTHING) box.append(...tentative(ch, quoted, name));
    return box;
  }));
  drawProgress(shown);
}

// what the data know of the delays that may not be quoted: median and 95 % interval, in small letters
function tentative(ch, quoted, name) {
  const which = { ok: [], sum_only: ["tau", "dead_time"], gain_only: ["tau_plus_dead_time", "tau", "dead_time"] }[quoted] || [];
  const parts = which.filter((what) => known(ch[what].value)).map((what) => `${SYMBOLS[what]} ${interval(ch[what])} s`);
  if (!parts.length) return [];
  const line = make("p", `${parts.join(", ")}: not to be quoted yet`, "tentative");
  line.dataset.tentative = name;
  return [line];
}

// how near each channel is to what may be quoted next: the share of the driving that it needs, as in the terminal view;
// information grows as 1 / sd^2
function drawProgress(message) {
  byId("progress").replaceChildren(...Object.entries(message.value.channels).filter(([, ch]) => ch.progress).map(([name, ch]) => {
    const { parameter: what, sd, needed, seconds } = ch.progress;
    const bar = make("div", "", "bar");
    const unit = what === "K" ? ` ${message.units[name] || ""}`.trimEnd() : "\u00a0s";
    const more = known(seconds) && seconds > 0 ? `; about ${span(seconds)} more of such driving` : "";
    bar.append(make("span", `next: ${SYMBOLS[what]} of ${readable(name)}, known to ±${fixed(sd, 2)}${unit}, needed ±${fixed(needed, 2)}${unit}${more}`));
    const share = document.createElement("progress");
    share.max = 1;
    share.value = known(sd) && sd > 0 ? Math.min((needed / sd) ** 2, 0.99) : 0;
    share.setAttribute("aria-label", `${SYMBOLS[what]} of ${readable(name)}`);
    bar.append(share);
    return bar;
  }));
}

function span(seconds) {
  if (seconds < 600) return `${Math.max(Math.round(seconds / 10) * 10, 10)} s`;
  return seconds < 7200 ? `${Math.round(seconds / 60)} min` : `${Math.round(seconds / 3600)} h`;
}

export function drawEstimators(store) {
  const rows = [];
  const shown = store.shown();
  for (const message of [...store.latest.values()].sort((a, b) => a.value.estimator.localeCompare(b.value.estimator))) {
    const { value: e } = message;
    const entries = Object.entries(e.channels);
    entries.forEach(([name, ch], k) => {
      const row = make("tr");
      if (k === 0) {
        const head = make("th");
        head.scope = "row";
        head.rowSpan = entries.length + 1;
        head.append(make("span", "", `swatch ${e.estimator}`), make("span", e.estimator.toUpperCase()), document.createElement("br"));
        head.append(make("span", readable(e.status), "quiet"));
        if (shown.current && shown.message.value.estimator === e.estimator) {
          head.append(document.createElement("br"), make("span", "▶ headline", "mark"));
        }
        row.append(head);
      }
      row.append(make("td", readable(name)));
      const all = ch.status === "ok";
      const of = { K: ch.status !== "not_identifiable", tau: all, dead_time: all, tau_plus_dead_time: all || ch.status === "sum_only" };
      const delays = make("td");
      for (const [what, quoted] of Object.entries(of)) {
        const text = !quoted ? DASH : what === "K" ? `${interval(ch.K)} ${message.units[name] || ""}`.trim() : interval(ch[what]);
        const cell = what === "K" ? make("td", text) : make("span", `${SYMBOLS[what]} ${text}`, "delay");
        cell.dataset.of = `${e.estimator}.${name}.${what}`;
        cell.dataset.t = String(e.t);
        if (quoted && known(ch[what].value)) cell.dataset.value = String(ch[what].value);
        if (what === "K") row.append(cell);
        else if (quoted) delays.append(cell);
      }
      if (!delays.childElementCount) delays.textContent = DASH;
      row.append(delays);
      rows.push(row);
    });
    const row = make("tr");
    const excitation = Object.entries(e.excitation).filter(([, x]) => known(x)).map(([name, x]) => `${readable(name)} ±${Number(x.toPrecision(2))}\u00a0${INPUT_UNITS[name] || ""}`.trim());
    const facts = [e.says, known(e.fit_percent) ? `fit ${fixed(e.fit_percent, 0)} %` : "", known(e.used) ? `from ${fixed(e.used, 0)} s` : "",
      excitation.length ? `excitation: ${excitation.join(", ")}` : ""];
    const words = make("td", facts.filter((one) => one).join(" · "), "words");
    words.colSpan = 3;
    row.append(words);
    rows.push(row);
  }
  byId("rows").replaceChildren(...rows);
}

function figure(name, text, unit, wrong = false) {
  const box = make("div", "", wrong ? "wrong" : "");
  const dd = make("dd", text);
  if (unit && text !== DASH) dd.append(make("small", ` ${unit}`));
  box.append(make("dt", name), dd);
  box.dataset.of = name;
  return box;
}

export function drawNow(store, units) {
  const s = store.sample;
  if (s) {
    const lane = "lateral_offset" in s.inputs;
    const shown = SIGNALS.filter(([role]) => role in s.signals && !(lane && OF_LEAD.has(role))).map(([role, unit, places]) => {
      const speed = unit === "speed";
      const x = s.signals[role];
      return figure(readable(role), known(x) ? fixed(speed ? x * units.factor : x, places) : DASH, speed ? units.name : unit);
    });
    if (store.health && store.health.output) shown.push(figure(readable(store.health.output), fixed(s.output, OUTPUT_DECIMALS[store.health.unit] ?? 1), store.health.unit));
    byId("signals").replaceChildren(...shown);
    const gate = byId("gate");
    say(gate, s.gate || (s.learn ? "learning" : "settling: the estimators wait until earlier transients have decayed"));
    gate.dataset.learn = String(!s.gate && s.learn);
  }
  const stand = store.signals ? store.signals.value.signals.filter((one) => one.until === null) : [];
  const text = stand.map((one) => `${one.says}; ${one.remedy}`);
  const box = byId("findings");
  if (box.dataset.text !== text.join("\n")) {
    box.dataset.text = text.join("\n");
    box.replaceChildren(...text.map((one) => make("p", `✗ ${one}`, "finding")));
  }
}

// every role of the vehicle file that came, as it is now in the samples, in SI
export function drawDecoded(store) {
  if (!store.sample || !byId("decoded-open").open) return;
  const { signals } = store.sample;
  const units = store.start.units || {};
  byId("decoded-rows").replaceChildren(...Object.keys(signals).sort().map((role) => {
    const row = make("tr");
    const head = make("th", readable(role));
    head.scope = "row";
    row.dataset.role = role;
    const x = signals[role];
    row.append(head, make("td", known(x) ? String(Number(x.toPrecision(6))) : DASH), make("td", units[role] || ""));
    return row;
  }));
}

export function drawMonitor(store) {
  const monitor = byId("monitor");
  if (store.monitor) {
    say(monitor, `monitor: ${store.monitor.says}`);
    monitor.dataset.fits = String(store.monitor.value.screen.fits);
  } else say(monitor, "");
  const diagnosed = store.events.findLast((event) => event.event === "diagnosis");
  say(byId("diagnosis"), diagnosed ? diagnosed.says : "");
  const { message } = store.shown();
  const tested = [message, ...store.latest.values()].find((one) => one && one.value.residual_tests);
  const tests = tested && tested.value.residual_tests;
  const left = tests ? tests.left_over.map(readable) : [];
  say(byId("residual-tests"), !tests || !known(tests.statistic) ? "" : [
    `residuals of ${tested.value.estimator.toUpperCase()}: ${tests.white ? "white" : "not white"} (Ljung–Box ${fixed(tests.statistic, 0)}, bound ${fixed(tests.bound, 0)})`,
    left.length ? `response not all modelled: ${left.join(", ")}` : "no response left over",
  ].join(" · "));
}

export function drawHealth(store) {
  const status = store.status && store.status.value;
  if (status && "drops" in status) {
    const dropped = status.drops + status.drops_disk;
    const loads = status.buses.map((bus) => bus.load).filter(known);
    const shown = [
      figure("recording", status.path ? readable(status.state) : "no", "", !status.path || status.state.startsWith("failed")),
      figure("frames", grouped(status.frames), ""),
      figure("dropped", grouped(dropped), "", dropped > 0),
    ];
    if (loads.length) shown.push(figure("bus load", fixed(100 * Math.max(...loads), 0), "%"));
    if (status.path) shown.push(figure("file", ...(status.bytes < 999500 ? [fixed(status.bytes / 1e3, 0), "kB"] : [fixed(status.bytes / 1e6, 1), "MB"])));
    shown.push(figure("time", clock(status.elapsed), ""));
    byId("counts").replaceChildren(...shown);
    // on every size of screen without scrolling
    const lost = dropped > 0 || status.state.startsWith("failed");
    const words = status.path ? `● ${readable(status.state)}` : "not recording";
    const header = byId("recorder");
    say(header, `${words} · ${grouped(status.frames)} frames · ${grouped(dropped)} dropped`);
    header.classList.toggle("wrong", lost);
  } else if (status) byId("counts").replaceChildren(figure("frames", grouped(status.frames), ""));
  // of a replay the only line in order is the count of frames, which stands above
  const replay = status && !("drops" in status);
  const lines = store.health ? store.health.lines.filter((one) => one.wrong || !replay) : [];
  if (store.status && store.status.lost) lines.push({ text: `${grouped(store.status.lost)} messages did not reach this page`, wrong: true });
  byId("lines").replaceChildren(...lines.map((one) => make("li", one.text, one.wrong ? "wrong" : "")));
}

export function drawEvents(store) {
  byId("no-events").hidden = store.events.length > 0;
  byId("list").replaceChildren(...[...store.events].reverse().map((event) => {
    const item = make("li", "", event.event === "mark" ? "mark" : "");
    const words = document.createElement("bdi");
    words.textContent = event.says;
    item.append(make("time", clock(event.t)), words);
    return item;
  }));
}
