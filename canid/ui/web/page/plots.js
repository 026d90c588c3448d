// The plots. plotly takes some of its texts for markup: no text from a file, a bus or a person is given to it.
import { known } from "./numbers.js";
import { byId, say } from "./panels.js";
import { parameters, predict } from "./prediction.js";

// s of samples that are drawn, and that the prediction is computed of
export const WINDOW_S = 60;
const SYMBOLS = { K: "K", tau: "τ", dead_time: "θ", tau_plus_dead_time: "τ+θ" };
// which parameters may be drawn where a channel has this status
const QUOTED = {
  ok: ["K", "tau", "dead_time", "tau_plus_dead_time"], sum_only: ["K", "tau_plus_dead_time"], gain_only: ["K"],
};
const STYLED = new Set(["fopdt", "armax"]);
const CONFIG = { displayModeBar: false, responsive: false, doubleClick: "reset", scrollZoom: false };
const seen = new Set(); // ids of plots that are on the screen

let colors = {};
export function readColors() {
  const style = getComputedStyle(document.documentElement);
  colors = Object.fromEntries(["ink", "muted", "rule", "grid", "panel", "fopdt", "armax", "other", "measured", "predicted", "bad"]
    .map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

// plotly makes <style> elements, which the page's policy permits with the nonce of its answer
export function load(onSeen) {
  const meta = document.querySelector("meta[name=plotly]");
  const make = document.createElement.bind(document);
  document.createElement = (name, options) => {
    const element = make(name, options);
    if (String(name).toLowerCase() === "style") element.nonce = meta.nonce;
    return element;
  };
  const watcher = new IntersectionObserver((entries) => {
    for (const one of entries) {
      if (one.isIntersecting) seen.add(one.target.id);
      else seen.delete(one.target.id);
    }
    onSeen();
  });
  document.querySelectorAll(".plot").forEach((plot) => watcher.observe(plot));
  return new Promise((done, failed) => {
    const script = make("script");
    script.src = meta.content;
    script.onload = done;
    script.onerror = failed;
    document.head.append(script);
  });
}

const translucent = (color) => {
  const n = parseInt(color.slice(1), 16);
  return `rgba(${(n >> 16) & 255}, ${(n >> 8) & 255}, ${n & 255}, 0.18)`;
};
const ofEstimator = (name) => (STYLED.has(name) ? colors[name] : colors.other);

function draw(id, data, title, more = {}) {
  const plot = document.getElementById(id);
  const axis = { gridcolor: colors.grid, zeroline: false, linecolor: colors.rule, tickcolor: colors.rule, fixedrange: true };
  const { xaxis = {}, yaxis = {}, ...rest } = more;
  const layout = {
    width: plot.clientWidth, height: plot.clientHeight, margin: { l: 52, r: 10, t: 22, b: 30 },
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: colors.ink, size: 12 },
    showlegend: false, hovermode: "x", dragmode: false, uirevision: "kept",
    title: { text: title, font: { size: 12.5, color: colors.muted }, x: 0, xanchor: "left", y: 1, yanchor: "top", pad: { t: 3, l: 4 } },
    xaxis: { ...axis, ...xaxis }, yaxis: { ...axis, nticks: 5, ...yaxis }, ...rest,
  };
  window.Plotly.react(plot, data, layout, CONFIG);
}

const line = (x, y, color, name, more = {}) => ({
  x, y, name, mode: "lines", type: "scatter", line: { color, width: 2, ...(more.line || {}) }, connectgaps: false,
  hovertemplate: `%{y:.3~g}<extra>${name}</extra>`, ...more.trace,
});

// seconds before the last one
function windowed(store) {
  const rows = store.samples.recent;
  const last = rows.length ? rows[rows.length - 1].t : 0;
  return { last, rows: rows.filter((row) => row.t >= last - WINDOW_S) };
}

// Measured output, prediction and residual; returns what the note says.
export function drawOutput(store, outputName, unit) {
  const { last, rows } = windowed(store);
  const headline = store.shown().message;
  const found = headline ? parameters(headline.value.channels) : {};
  const { values, offset } = predict(rows, found, outputName === "pedal" ? 0 : -Infinity);
  const t = rows.map((row) => row.t - last);
  const xaxis = { range: [-WINDOW_S, 0], title: undefined, ticksuffix: " s" };
  const measured = rows.map((row) => row.output);
  if (seen.has("plot-output")) {
    draw("plot-output", [
      line(t, measured, colors.measured, "measured"),
      line(t, values, colors.predicted, "prediction", { line: { width: 2.5, dash: "4px,3px" } }),
    ], `${outputName}${unit ? `, ${unit}` : ""}`, {
      xaxis, showlegend: true, legend: { orientation: "h", x: 1, xanchor: "right", y: 1.0, yanchor: "bottom" },
    });
  }
  if (seen.has("plot-residual")) {
    const residual = rows.map((row, k) => (values[k] === null || !known(row.output) ? null : row.output - values[k]));
    draw("plot-residual", [line(t, residual, colors.measured, "residual", { line: { width: 1.5 } })],
      `residual: measured − prediction${unit ? `, ${unit}` : ""}`,
      { xaxis, yaxis: { zeroline: true, zerolinecolor: colors.muted, rangemode: "tozero" } });
  }
  return { offset, headline };
}

export function drawLead(store, speedFactor, speedUnit) {
  if (!seen.has("plot-lead")) return;
  const { last, rows } = windowed(store);
  const t = rows.map((row) => row.t - last);
  const of = (role, factor = 1) => rows.map((row) => (known(row.signals[role]) ? row.signals[role] * factor : null));
  // of the lane, or of the vehicle ahead
  const lane = rows.some((row) => "lateral_offset" in row.inputs);
  const has = (role) => !lane && rows.some((row) => role in row.signals);
  const xaxis = { range: [-WINDOW_S, 0], ticksuffix: " s" };
  const margin = { l: 40, r: 10, t: 22, b: 30 };
  if (has("gap")) draw("plot-lead", [line(t, of("gap"), colors.measured, "gap")], "gap, m", { xaxis, margin });
  else draw("plot-lead", [line(t, of("lateral_offset"), colors.measured, "lateral offset")], "lateral offset, m", { xaxis, margin });
  byId("plot-rate").hidden = !has("range_rate");
  if (has("range_rate")) {
    draw("plot-rate", [line(t, of("range_rate", speedFactor), colors.measured, "range rate")], `range rate, ${speedUnit}`, {
      xaxis, margin, yaxis: { zeroline: true, zerolinecolor: colors.muted, rangemode: "tozero" },
    });
  }
}

export function drawEstimates(store, channel, gainUnit) {
  const marks = store.events.filter((one) => one.event === "mark" && known(one.t));
  const all = [...store.estimates].map(([name, rows]) => [name, rows.rows()]).sort((a, b) => a[0].localeCompare(b[0]));
  const latest = Math.max(...all.map(([, rows]) => (rows.length ? rows[rows.length - 1].t : 0)), 1);
  // minutes where seconds would be four digits
  const [scale, suffix] = latest > 900 ? [60, " min"] : [1, " s"];
  // a parameter that no estimator could quote yet has no plot, but a word
  const drawable = (row, what) => row.status === "ok" && row.channels[channel] && (QUOTED[row.channels[channel].status] || []).includes(what);
  const absent = Object.keys(SYMBOLS).filter((what) => !all.some(([, rows]) => rows.some((row) => drawable(row, what))));
  say(byId("absent"), absent.length ? `not identifiable so far: ${absent.map((what) => SYMBOLS[what]).join(", ")}` : "");
  for (const what of Object.keys(SYMBOLS)) {
    const id = `plot-${what}`;
    byId(id).hidden = absent.includes(what);
    if (!seen.has(id) || absent.includes(what)) continue;
    const data = [];
    const lows = [];
    const highs = [];
    for (const [name, rows] of all) {
      const t = rows.map((row) => row.t / scale);
      const part = (k) => rows.map((row) => (drawable(row, what) ? row.channels[channel][what][k] : null));
      const [middle, low, high] = [part(0), part(1), part(2)];
      const color = ofEstimator(name);
      for (const band of bands(t, low, high)) {
        data.push({
          x: band.x, y: band.y, mode: "lines", type: "scatter", fill: "toself", fillcolor: translucent(color),
          line: { width: 0 }, hoverinfo: "skip",
        });
      }
      data.push(line(t, middle, color, STYLED.has(name) ? name : "other"));
      middle.forEach((x, k) => { if (x !== null) { lows.push(low[k]); highs.push(high[k]); } });
    }
    const unit = what === "K" ? gainUnit : "s";
    draw(id, data, `${SYMBOLS[what]}${unit ? `, ${unit}` : ""}`, {
      xaxis: { range: [0, latest / scale], ticksuffix: suffix },
      yaxis: { range: bulk(lows, highs), autorange: false },
      shapes: marks.map((one) => ({
        type: "line", x0: one.t / scale, x1: one.t / scale, y0: 0, y1: 1, yref: "paper", line: { color: colors.predicted, width: 1.5, dash: "dot" },
      })),
    });
  }
}

// outlines of the stretches in which there is an interval
function bands(t, low, high) {
  const found = [];
  for (let k = 0; k < t.length; k += 1) {
    if (!known(low[k]) || !known(high[k])) continue;
    let end = k;
    while (end + 1 < t.length && known(low[end + 1]) && known(high[end + 1])) end += 1;
    const x = t.slice(k, end + 1);
    found.push({ x: x.concat([...x].reverse()), y: high.slice(k, end + 1).concat(low.slice(k, end + 1).reverse()) });
    k = end;
  }
  return found;
}

// The range of most of the intervals: the first ones of a drive are so wide that nothing else could be read.
function bulk(lows, highs) {
  const sorted = (xs) => [...xs].filter(known).sort((a, b) => a - b);
  const [l, h] = [sorted(lows), sorted(highs)];
  const bottom = Math.min(l[Math.floor(0.05 * (l.length - 1))], l.length ? l[l.length - 1] : 0);
  const top = h[Math.floor(0.95 * (h.length - 1))];
  const room = 0.08 * (top - bottom || 1);
  return [bottom - room, top + room];
}
