// The page: connection, drawing at a steady rate, and controls.
import { clock, known, readable } from "./numbers.js";
import { byId, drawDecoded, drawEstimators, drawEvents, drawHeadline, drawHealth, drawMonitor, drawNow, make, say } from "./panels.js";
import { OFFSET_S } from "./prediction.js";
import { drawEstimates, drawLead, drawOutput, load, readColors } from "./plots.js";
import { drawSignals, watchSignals } from "./signals.js";
import { Store } from "./store.js";

const RETRY_MS = [500, 1000, 2000, 5000];
// ms between two drawings of texts, of plots of the last minute, and of plots of the drive
const EVERY = { texts: 90, fast: 250, slow: 1000 };
const STEP_S = 10;
const LONG_STEP_S = 60;
const UNITS = { "m/s": { name: "m/s", factor: 1 }, "km/h": { name: "km/h", factor: 3.6 } };

const root = document.documentElement;
const store = new Store();
let socket = null;
let tries = 0;
let units = UNITS["m/s"];
let frozen = false;
let channel = null;
let plotting = false;
let seeking = false;
const drawn = { texts: -1, fast: -1, slow: -1 };

const remembered = (key) => { try { return localStorage.getItem(key); } catch { return null; } };
const remember = (key, text) => { try { localStorage.setItem(key, text); } catch { /* storage may be switched off */ } };

// --- connection ---

// The token of the printed address: kept for this tab and this port, and sent with the websocket alone. It stays neither in
// the address bar nor in the history, unless nothing can be kept.
function readToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  try {
    if (!given) return sessionStorage.getItem("canid-token");
    sessionStorage.setItem("canid-token", given);
    history.replaceState(null, "", location.pathname);
  } catch { /* storage may be switched off */ }
  return given;
}

const token = readToken();

function connect() {
  let opened = false;
  try {
    socket = new WebSocket(`ws://${location.host}/live`, ["canid", token || ""]);
  } catch { // no token, or none that can be one
    connection("refused");
    return;
  }
  socket.onopen = () => { opened = true; tries = 0; connection("open"); };
  socket.onmessage = (event) => {
    store.take(JSON.parse(event.data));
    root.dataset.received = String(Date.now());
    if (store.ended) connection("ended");
  };
  socket.onclose = async () => {
    if (store.ended) return;
    if (opened) connection("lost");
    else {
      // the server that gives its page but no websocket has refused it
      const there = await fetch("/", { method: "HEAD" }).then((answer) => answer.ok, () => false);
      connection(there ? "refused" : "lost");
    }
    setTimeout(connect, RETRY_MS[Math.min(tries, RETRY_MS.length - 1)]);
    tries += 1;
  };
}

function connection(state) {
  const body = document.body;
  if (body.dataset.connection === "ended") return;
  body.dataset.connection = state;
  if (state === "ended") body.dataset.ended = "";
  const banner = byId("banner");
  banner.hidden = state === "open";
  const words = { refused: "Not admitted: open the address that canid has printed, with all that stands behind its #.", lost: "Connection lost: these are the last numbers. Trying again …", ended: "The session has ended: these are its last numbers." };
  say(banner, words[state] || "");
}

function ask(request) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(request));
}

// --- drawing ---

const mode = () => store.start.mode || "";
const replay = () => (mode() === "replay" && store.status ? store.status.value : null);

function drawStart() {
  const { start } = store;
  document.body.dataset.mode = mode();
  say(byId("mode"), mode());
  say(byId("title"), start.title || "");
  say(byId("vehicle"), start.vehicle || "");
  document.title = `canid ${mode()} · ${start.title || ""}`;
  byId("marking").hidden = mode() === "replay";
  byId("playback").hidden = mode() !== "replay";
  byId("bar").hidden = !mode() || store.ended;
  say(byId("space-does"), mode() === "replay" ? "pause the replay, or go on" : "hold this picture, or go on; the session is not affected");
}

function drawTime() {
  const status = store.status && store.status.value;
  const t = mode() === "replay" ? status && status.t : store.sample ? store.sample.t : status && status.elapsed;
  say(byId("clock"), clock(t));
  const played = replay();
  if (!played) return;
  const seek = byId("seek");
  const whole = known(played.duration) ? played.duration : null;
  seek.disabled = whole === null;
  if (whole !== null) seek.max = String(whole);
  seek.min = String(store.start.start || 0);
  if (!seeking) seek.value = String(played.t);
  seek.setAttribute("aria-valuetext", `${clock(played.t)} of ${clock(whole)}`);
  say(byId("position"), `${clock(seeking ? Number(seek.value) : played.t)} / ${clock(whole)}`);
  const pause = byId("pause");
  say(pause, played.paused ? "Play" : "Pause");
  pause.setAttribute("aria-pressed", String(played.paused));
  const speed = known(played.speed) ? String(played.speed) : "max";
  document.querySelectorAll("[data-speed]").forEach((one) => one.setAttribute("aria-pressed", String(one.dataset.speed === speed)));
  const unusual = ["1", "10", "max"].includes(speed) ? "" : `${speed}×`;
  let state = played.ended ? "end of the log" : played.paused ? "paused" : unusual;
  if (known(played.seeking)) state = `running the log up to ${clock(played.seeking)}`;
  say(byId("playing"), played.says || state);
}

function drawChannels() {
  const { message } = store.shown();
  const any = message || [...store.latest.values()][0];
  if (!any) return;
  const names = Object.keys(any.value.channels);
  const box = byId("channels");
  if (box.dataset.names !== names.join(" ")) {
    box.dataset.names = names.join(" ");
    // the relative speed is what most of a driver's answer rests on
    channel = names.includes(channel) ? channel : names[names.length - 1];
    box.hidden = names.length < 2;
    box.replaceChildren(...names.map((name) => {
      const button = make("button", readable(name));
      button.type = "button";
      button.dataset.channel = name;
      button.addEventListener("click", () => { channel = name; drawn.slow = -1; pressed(); });
      return button;
    }));
    pressed();
  }
}

function pressed() {
  byId("channels").querySelectorAll("button").forEach((one) => one.setAttribute("aria-pressed", String(one.dataset.channel === channel)));
}

function drawTexts() {
  drawStart();
  drawTime();
  drawNow(store, units);
  drawDecoded(store);
  drawSignals(store);
  drawHeadline(store);
  drawEstimators(store);
  drawMonitor(store);
  drawHealth(store);
  drawEvents(store);
  drawChannels();
}

function drawFast() {
  const output = (store.health && store.health.output) || "output";
  const unit = (store.health && store.health.unit) || "";
  say(byId("output-name"), readable(output).replace(/^./, (c) => c.toUpperCase()));
  const { offset, headline } = drawOutput(store, readable(output), unit);
  drawLead(store, units.factor, units.name);
  say(byId("prediction-note"), offset === null ? "no prediction yet: it needs a headline estimate, and some seconds of learning"
    : `prediction: the measured inputs through K, τ, θ of the headline (${headline.value.estimator.toUpperCase()}, ${clock(headline.value.t)}), plus ${offset.toFixed(2)} ${unit}, fitted to the last ${OFFSET_S} s`);
}

function drawSlow() {
  const { message } = store.shown();
  const any = message || [...store.latest.values()][0];
  if (channel) drawEstimates(store, channel, (any && any.units[channel]) || "");
}

let busy = false;
function every(name, draw) {
  setInterval(() => {
    if (document.hidden || (frozen && mode() !== "replay") || drawn[name] === store.version || busy || !mode()) return;
    if (name !== "texts" && (!plotting || mode() === "record")) return;
    busy = true;
    drawn[name] = store.version;
    try { draw(); } finally { busy = false; }
  }, EVERY[name]);
}

function redraw() {
  readColors();
  Object.keys(drawn).forEach((name) => { drawn[name] = -1; });
}

// --- controls ---

const isDark = () => (root.dataset.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";

function switchTheme() {
  root.dataset.theme = isDark() ? "light" : "dark";
  remember("canid-theme", root.dataset.theme);
  redraw();
}

function setUnits(name) {
  units = UNITS[name] || units;
  say(byId("units"), units.name);
  remember("canid-units", units.name);
  redraw();
}

const switchUnits = () => setUnits(units.name === "m/s" ? "km/h" : "m/s");

function mark() {
  if (mode() === "replay") return;
  const field = byId("mark-text");
  ask({ do: "mark", text: field.value.slice(0, 200) });
  field.value = "";
  say(byId("marked"), "sent");
  setTimeout(() => say(byId("marked"), ""), 2000);
}

function pause() {
  const played = replay();
  if (played) ask({ do: "pause", paused: !played.paused });
  else {
    frozen = !frozen;
    byId("connection").textContent = frozen ? "picture held (space)" : "";
    if (!frozen) redraw();
  }
}

function seekBy(seconds) {
  const played = replay();
  if (!played) return;
  const from = known(played.seeking) ? played.seeking : played.t;
  ask({ do: "seek", t: Math.max(from + seconds, 0) });
}

function explain() {
  const dialog = byId("explain");
  if (dialog.open) dialog.close();
  else dialog.showModal();
}

function keys(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const inText = event.target.matches("input[type=text], input[type=search]");
  if (inText) {
    if (event.key === "Escape") event.target.blur();
    return;
  }
  const inButton = event.target.matches("button, input");
  const step = event.shiftKey ? LONG_STEP_S : STEP_S;
  const actions = {
    m: mark, d: () => ask({ do: "diagnose" }), u: switchUnits, t: switchTheme, "?": explain,
    " ": inButton ? null : pause,
    ArrowLeft: () => seekBy(-step), ArrowRight: () => seekBy(step),
  };
  const action = actions[event.key];
  if (!action || (byId("explain").open && event.key !== "?")) return;
  event.preventDefault();
  action();
}

function listen() {
  byId("units").addEventListener("click", switchUnits);
  byId("theme").addEventListener("click", switchTheme);
  watchSignals(ask, () => { drawn.texts = -1; drawSignals(store, true); });
  byId("help").addEventListener("click", explain);
  byId("pause").addEventListener("click", pause);
  byId("marking").addEventListener("submit", (event) => { event.preventDefault(); mark(); });
  document.querySelectorAll("[data-speed]").forEach((one) => one.addEventListener("click", () => {
    ask({ do: "speed", speed: one.dataset.speed === "max" ? "max" : Number(one.dataset.speed) });
  }));
  const seek = byId("seek");
  seek.addEventListener("input", () => { seeking = true; drawTime(); });
  seek.addEventListener("change", () => { seeking = false; ask({ do: "seek", t: Number(seek.value) }); });
  document.addEventListener("keydown", keys);
  // after a click with a pointer the keys are those of the page again: space pauses, and does not press the same button
  document.addEventListener("click", (event) => {
    const button = event.target.closest("button");
    if (button && event.detail > 0) button.blur();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  let waiting = 0;
  addEventListener("resize", () => { clearTimeout(waiting); waiting = setTimeout(redraw, 150); });
}

// the printed address of another session, opened in this tab
addEventListener("hashchange", () => location.reload());
setUnits(remembered("canid-units") || "m/s");
readColors();
listen();
connect();
every("texts", drawTexts);
every("fast", drawFast);
every("slow", drawSlow);
load(redraw).then(() => { plotting = true; root.dataset.plots = "ready"; });
