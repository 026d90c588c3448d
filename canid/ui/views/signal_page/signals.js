// Signals over time: a list with search, panels on one time axis, zoom, and the values at the cursor.
// plotly takes some of its texts for markup: no text from a file is given to it.
"use strict";
(async () => {
  const PANEL = 132, GAP = 32, TOP = 28, BOTTOM = 34, LEFT = 58, RIGHT = 12; // px
  const PAPER_WIDTH = 680, PAPER_HEIGHT = 900, LEAST_PANEL = 50, LEAST_ON_SCREEN = 72, NARROW = 700; // px: what @page leaves of A4 below the head
  const LINES = 6; // colors of the style sheet
  const VALUE_WIDTH = 9; // characters of a number at the cursor, without its unit
  const ASK_MS = 120; // between two questions to the server, which takes 20 a second
  const byId = (id) => document.getElementById(id);
  const plot = byId("plot");
  const element = (name, className, text) => {
    const made = document.createElement(name);
    if (className) made.className = className;
    if (text !== undefined) made.textContent = text;
    return made;
  };
  const problem = (text) => { byId("problem").textContent = text; byId("problem").hidden = !text; };

  // --- where lines come from: the file itself, or a server ---

  const inFile = (data) => ({
    listing: async () => data,
    exact: false,
    pieces: async (ks) => ks.map((k) => data.pieces[k]),
    readings: async (ks, t) => ks.map((k) => {
      const { t: times, value } = data.pieces[k];
      let low = 0, high = times.length;
      while (low < high) {
        const middle = (low + high) >> 1;
        if (times[middle] <= t) low = middle + 1; else high = middle;
      }
      return low && value[low - 1] !== null ? value[low - 1] : null;
    }),
  });

  const ofServer = () => {
    const given = new URLSearchParams(location.hash.slice(1)).get("token");
    let token = given;
    try { // kept for this tab and this port, as on the live page
      if (given) {
        sessionStorage.setItem("canid-token", given);
        history.replaceState(null, "", location.pathname);
      } else token = sessionStorage.getItem("canid-token");
    } catch { /* storage may be switched off */ }
    const waiting = new Map();
    let count = 0;
    const lost = () => problem("No connection to canid look: start it again, and open the address that it prints.");
    let socket;
    try {
      socket = new WebSocket(`ws://${location.host}/signals`, ["canid", token || ""]);
    } catch { // no token, or none that can be one
      lost();
      return { listing: () => new Promise(() => {}) };
    }
    const opened = new Promise((done) => { socket.onopen = done; });
    socket.onclose = lost;
    socket.onmessage = (event) => {
      const { id, answer } = JSON.parse(event.data);
      waiting.get(id)?.(answer);
      waiting.delete(id);
    };
    const ask = async (question) => {
      await opened;
      count += 1;
      const id = count;
      socket.send(JSON.stringify({ id, ...question }));
      return new Promise((done) => { waiting.set(id, done); });
    };
    return {
      listing: () => ask({ do: "listing" }),
      exact: true,
      pieces: (lines, begin, end, points) => ask({ do: "pieces", lines, begin, end, points }),
      readings: (lines, t) => ask({ do: "readings", lines, t }),
    };
  };

  // plotly makes <style> elements, which the server's policy permits with the nonce of its answer
  const loadPlotly = () => {
    const meta = document.querySelector("meta[name=plotly]");
    if (!meta) return Promise.resolve();
    const make = document.createElement.bind(document);
    document.createElement = (name, options) => {
      const made = make(name, options);
      if (String(name).toLowerCase() === "style") made.nonce = meta.nonce;
      return made;
    };
    return new Promise((done, failed) => {
      const script = make("script");
      Object.assign(script, { src: meta.content, onload: done, onerror: failed });
      document.head.append(script);
    });
  };

  const embedded = byId("data");
  const source = embedded ? inFile(JSON.parse(embedded.textContent)) : ofServer();
  const [listing] = await Promise.all([source.listing(), loadPlotly()]);
  const lines = listing.groups.flatMap((group) => group.lines);
  const whole = [listing.start, listing.stop > listing.start ? listing.stop : listing.start + 1];
  let range = [...whole];
  let panels = listing.shown.map((k) => [k]); // lines of each axis
  let target = -1; // panel that the next line goes to; -1: one of its own
  let drawn = new Map(); // line -> piece
  let pointed = null; // s, of the cursor

  // --- numbers ---

  const colors = () => {
    const style = getComputedStyle(document.documentElement);
    return (name) => style.getPropertyValue(`--${name}`).trim();
  };
  const clock = (t) => `${t.toFixed(range[1] - range[0] > 100 ? 2 : 4)} s`;
  const text = (line, value) => {
    if (value === null || value === undefined) return "–";
    const meaning = line.meanings[String(value)];
    return meaning || `${Number(value.toPrecision(6))} ${line.unit}`.trim();
  };
  const isState = (line) => Object.keys(line.meanings).length > 0;

  // --- the list ---

  const list = byId("list");
  const show = (k) => {
    if (target >= 0 && target < panels.length) panels[target].push(k);
    else panels.push([k]);
  };
  const hide = (k) => {
    const kept = panels[target];
    panels.filter((of) => of.includes(k)).forEach((of) => of.splice(of.indexOf(k), 1));
    panels = panels.filter((of) => of.length);
    target = panels.indexOf(kept);
  };
  const isShown = (k) => panels.some((of) => of.includes(k));
  const draggable = (node, k) => {
    node.draggable = true;
    node.addEventListener("dragstart", (event) => event.dataTransfer.setData("text/plain", `line ${k}`));
  };
  for (const group of listing.groups) {
    const part = element("section");
    part.append(element("h2", "", group.title));
    for (const line of group.lines) {
      const button = element("button");
      button.type = "button";
      button.dataset.k = line.k;
      button.append(element("span", "", line.name.split(".").pop()), element("span", "unit", line.unit));
      button.title = line.name;
      button.addEventListener("click", () => { (isShown(line.k) ? hide : show)(line.k); update(); });
      draggable(button, line.k);
      part.append(button);
    }
    list.append(part);
  }
  const none = element("p", "none", "No signal has such a name.");
  const search = () => {
    const words = byId("search").value.toLowerCase().split(/\s+/).filter(Boolean);
    let found = 0;
    list.querySelectorAll("section").forEach((part) => {
      const title = part.firstChild.textContent.toLowerCase();
      let here = 0;
      part.querySelectorAll("button").forEach((button) => {
        const fits = words.every((word) => `${title} ${button.title.toLowerCase()}`.includes(word));
        button.hidden = !fits;
        button.style.display = fits ? "" : "none";
        here += fits;
      });
      part.style.display = here ? "" : "none";
      found += here;
    });
    none.remove();
    if (!found) list.append(none);
  };
  byId("search").addEventListener("input", search);

  // --- drawing ---

  // on paper all panels stand on one page
  const onPaper = () => document.documentElement.classList.contains("paper");
  // on a screen as many as are readable: the axis of time is below them
  const room = () => (onPaper() ? PAPER_HEIGHT : innerHeight - plot.getBoundingClientRect().top - scrollY);
  const fitting = () => (room() - TOP - BOTTOM + GAP) / Math.max(panels.length, 1) - GAP;
  // a phone scrolls
  const least = () => (onPaper() ? LEAST_PANEL : innerWidth < NARROW ? PANEL : LEAST_ON_SCREEN);
  const height = () => Math.floor(Math.max(Math.min(PANEL, fitting()), least()));
  const top = (panel) => TOP + panel * (height() + GAP);
  const layout = (color) => {
    const n = Math.max(panels.length, 1);
    const each = height();
    const inner = n * each + (n - 1) * GAP;
    const axis = { gridcolor: color("grid"), zeroline: false, linecolor: color("rule"), showline: true };
    const made = {
      width: onPaper() ? PAPER_WIDTH : plot.clientWidth, height: TOP + inner + BOTTOM, margin: { l: LEFT, r: RIGHT, t: TOP, b: BOTTOM },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: color("ink"), size: 12 },
      showlegend: false, hovermode: false, dragmode: innerWidth < NARROW ? "pan" : "zoom",
      xaxis: { ...axis, range: [...range], anchor: "free", position: 0, ticksuffix: " s", nticks: plot.clientWidth < 500 ? 5 : 12 },
      shapes: listing.marks.map((mark) => ({
        type: "line", x0: mark.t, x1: mark.t, yref: "paper", y0: 0, y1: 1, line: { color: color("bad"), dash: "dot", width: 1 },
      })),
      annotations: listing.marks.map((mark, k) => ({
        x: mark.t, yref: "paper", y: 0, yanchor: "bottom", text: String(k + 1), showarrow: false, font: { color: color("bad"), size: 11 },
      })),
    };
    panels.forEach((of, k) => {
      const bottom = (inner - k * (each + GAP) - each) / inner;
      const states = of.every((one) => isState(lines[one]));
      made[`yaxis${k ? k + 1 : ""}`] = {
        ...axis, domain: [Math.max(bottom, 0), bottom + each / inner], fixedrange: true, nticks: 5,
        ...(states && of.length === 1 ? ticks(lines[of[0]]) : {}),
      };
    });
    return made;
  };
  // a state's numbers, where they are few; its words are at the cursor: they may be markup
  const ticks = (line) => {
    const values = Object.keys(line.meanings).map(Number);
    return values.length <= 6 ? { tickvals: values } : { showticklabels: false };
  };

  const traces = (color) => panels.flatMap((of, k) => of.map((one, place) => ({
    x: drawn.get(one).t, y: drawn.get(one).value, type: "scatter", mode: "lines", xaxis: "x", yaxis: `y${k ? k + 1 : ""}`,
    line: { color: color(`line${place % LINES}`), width: 1.3, shape: isState(lines[one]) ? "hv" : "linear" }, connectgaps: false,
  })));

  const draw = () => {
    const color = colors();
    return Plotly.react(plot, traces(color), layout(color), { displayModeBar: false, doubleClick: false, scrollZoom: false });
  };

  let legended = ""; // what the legends show: a button that is pressed is not replaced for nothing
  const legends = () => {
    byId("span").textContent = `${range[0].toFixed(2)} to ${range[1].toFixed(2)} s`;
    const color = colors();
    const asked = JSON.stringify([panels, target, color("line0"), height(), innerWidth < NARROW]);
    if (asked === legended) return;
    legended = asked;
    const place = byId("legends");
    place.replaceChildren(...panels.map((of, k) => {
      const box = element("div", "legend");
      Object.assign(box.style, { top: `${top(k) - 25}px`, left: `${LEFT}px`, right: `${RIGHT}px` });
      // first: a long value makes its chip wider
      const add = element("button", "add", "+");
      add.type = "button";
      add.title = "The next signals share this axis";
      add.setAttribute("aria-label", add.title);
      add.setAttribute("aria-pressed", String(k === target));
      add.addEventListener("click", () => { target = k === target ? -1 : k; legends(); });
      box.append(add);
      of.forEach((one, at) => {
        const chip = element("span", "chip");
        chip.dataset.k = one;
        const swatch = element("i");
        swatch.style.background = color(`line${at % LINES}`);
        const close = element("button", "", "×");
        close.type = "button";
        close.setAttribute("aria-label", `Remove ${lines[one].name}`);
        close.addEventListener("click", () => { hide(one); update(); });
        // as wide as a number will be: a button must not move away from the pointer
        const value = element("span", "value", lines[one].unit);
        value.style.minWidth = `${lines[one].unit.length + VALUE_WIDTH}ch`;
        // on a phone without its message, which the list has: a name of two lines would cover the curve
        const name = element("span", "name", innerWidth < NARROW ? lines[one].name.split(".").pop() : lines[one].name);
        name.title = lines[one].name;
        chip.append(swatch, name, value, close);
        draggable(chip, one);
        box.append(chip);
      });
      return box;
    }));
    list.querySelectorAll("button").forEach((button) => button.setAttribute("aria-pressed", String(isShown(Number(button.dataset.k)))));
  };

  // --- asking: one question at a time, the latest of those that wait ---

  const oneAtATime = (work) => {
    let busy = false, again = false;
    return async () => {
      if (busy) { again = true; return; }
      busy = true;
      do {
        again = false;
        await work();
        await new Promise((next) => { setTimeout(next, source.exact ? ASK_MS : 0); });
      } while (again);
      busy = false;
    };
  };
  const update = oneAtATime(async () => {
    const asked = panels.flat();
    const points = 2 * Math.max(plot.clientWidth - LEFT - RIGHT, 200);
    const pieces = await source.pieces(asked, range[0], range[1], points);
    drawn = new Map(asked.map((k, at) => [k, pieces[at]]));
    // what was added meanwhile comes with the next answer
    panels.flat().forEach((k) => { if (!drawn.has(k)) drawn.set(k, { t: [], value: [], whole: true }); });
    legends();
    values();
    await draw();
    document.documentElement.dataset.drawn = String(Number(document.documentElement.dataset.drawn || 0) + 1);
  });
  const values = oneAtATime(async () => {
    const asked = panels.flat();
    const t = pointed;
    byId("cursor").textContent = t === null ? "" : clock(t);
    const found = t === null ? [] : await source.readings(asked, t);
    const near = source.exact ? "" : "≈ ";
    byId("legends").querySelectorAll(".chip").forEach((chip) => {
      const k = Number(chip.dataset.k);
      const at = asked.indexOf(k);
      const thin = !drawn.get(k)?.whole && !isState(lines[k]);
      chip.querySelector(".value").textContent = t === null || at < 0 ? lines[k].unit : (thin ? near : "") + text(lines[k], found[at]);
    });
  });

  const zoom = (begin, end) => {
    const [low, high] = [Math.max(Math.min(begin, end), whole[0]), Math.min(Math.max(begin, end), whole[1])];
    range = high - low > 1e-5 ? [low, high] : [...whole];
    update();
  };

  // --- hands ---

  const panelAt = (event) => {
    const y = event.clientY - plot.getBoundingClientRect().top;
    const k = Math.floor(y / (height() + GAP));
    return k >= 0 && k < panels.length ? k : -1;
  };
  const point = (event) => {
    const box = plot.getBoundingClientRect();
    const share = (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT);
    pointed = share >= 0 && share <= 1 ? range[0] + share * (range[1] - range[0]) : null;
    const line = byId("line");
    line.hidden = pointed === null;
    Object.assign(line.style, { left: `${event.clientX - box.left}px`, height: `${box.height - BOTTOM}px` });
    values();
  };
  byId("panels").addEventListener("mousemove", point);
  byId("panels").addEventListener("click", point);
  byId("panels").addEventListener("mouseleave", () => { pointed = null; byId("line").hidden = true; values(); });
  plot.addEventListener("wheel", (event) => {
    if (!event.ctrlKey || pointed === null) return; // the wheel alone scrolls the page
    event.preventDefault();
    const by = event.deltaY > 0 ? 1.4 : 1 / 1.4;
    zoom(pointed - (pointed - range[0]) * by, pointed + (range[1] - pointed) * by);
  }, { passive: false });
  const over = (k) => byId("legends").querySelectorAll(".legend").forEach((box, at) => box.classList.toggle("over", at === k));
  const view = document.querySelector(".view");
  view.addEventListener("dragover", (event) => { event.preventDefault(); over(panelAt(event)); });
  view.addEventListener("dragleave", () => over(-1));
  view.addEventListener("drop", (event) => {
    event.preventDefault();
    over(-1);
    const dragged = event.dataTransfer.getData("text/plain").match(/^line (\d+)$/);
    if (!dragged) return;
    const onto = panels[panelAt(event)];
    const k = Number(dragged[1]);
    if (onto && onto.includes(k)) return;
    hide(k);
    if (onto && panels.includes(onto)) onto.push(k);
    else panels.push([k]);
    update();
  });
  byId("whole").addEventListener("click", () => zoom(...whole));

  byId("title").textContent = listing.title;
  document.title = `${listing.title}: signals`;
  byId("marks").append(...listing.marks.map((mark) => element("li", "", `${mark.t.toFixed(2)} s: ${mark.says || "mark"}`)));
  await update();
  plot.on("plotly_relayout", (changed) => {
    const begin = changed["xaxis.range[0]"], end = changed["xaxis.range[1]"];
    if (begin !== undefined && (begin !== range[0] || end !== range[1])) zoom(begin, end);
  });
  plot.on("plotly_doubleclick", () => zoom(...whole));
  let resized = 0;
  addEventListener("resize", () => { clearTimeout(resized); resized = setTimeout(update, 150); });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", update);
  // on paper always in light colors; what is drawn stays
  const printed = (is) => { document.documentElement.classList.toggle("paper", is); legends(); draw(); };
  addEventListener("beforeprint", () => printed(true));
  addEventListener("afterprint", () => printed(false));
})();
