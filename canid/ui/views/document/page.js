// Draws the figures, which are in the page as JSON, in the colors of the style sheet: light, dark or print.
"use strict";
(() => {
  const root = document.documentElement;
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const plots = [...document.querySelectorAll(".plot")];
  const PAPER_WIDTH = 700; // px: what @page leaves of A4 at 96 px per inch
  const PAPER_HEIGHT_SCALE = 0.8; // narrower figures may be lower: fewer gaps at the ends of pages
  const NARROW = 560; // px: below it a figure takes its layout for a phone
  const FOLDED = window.matchMedia("(max-width: 700px)").matches;
  const CONFIG = {
    displaylogo: false,
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
    toImageButtonOptions: { format: "svg" },
  };

  // "@name" becomes the color --name
  const painted = (value, color) => {
    if (typeof value === "string") return value[0] === "@" ? color(value.slice(1)) : value;
    if (Array.isArray(value)) {
      const plain = !value.some((x) => typeof x === "string" || (typeof x === "object" && x !== null));
      return plain ? value : value.map((x) => painted(x, color));
    }
    if (typeof value !== "object" || value === null) return value;
    return Object.fromEntries(Object.entries(value).map(([key, x]) => [key, painted(x, color)]));
  };

  const draw = (plot, width, scale = 1) => {
    const style = getComputedStyle(root);
    const figure = figures[plot.dataset.figure];
    const narrow = width < NARROW;
    // a finger scrolls the page over a figure, and does not zoom it
    const phone = narrow ? { dragmode: false, ...(figure.narrow ? figure.narrow.layout : {}) } : {};
    // on paper the panels are lower, not what stands around them
    const { t, b } = figure.layout.margin;
    const height = narrow && figure.narrow ? figure.narrow.height : t + b + scale * (figure.height - t - b);
    const color = (name) => style.getPropertyValue(`--${name}`).trim();
    const { data, layout } = painted({ data: figure.data, layout: { ...figure.layout, ...phone } }, color);
    // the reader's zoom is kept
    const whole = { ...layout, width, height, uirevision: "kept" };
    return Plotly.react(plot, data, whole, { ...CONFIG, displayModeBar: narrow ? false : "hover" });
  };
  // one cursor for all plots over time: a line in each, and a dot in plans, whose points know their time
  const overTime = (plot) => plot._fullLayout && figures[plot.dataset.figure].layout.meta === "time";
  const marks = (plot, count) => {
    const there = [...plot.querySelectorAll(".cursor")];
    while (there.length < count) {
      const made = document.createElement("i");
      made.className = "cursor";
      plot.append(made);
      there.push(made);
    }
    there.forEach((mark) => { mark.hidden = true; });
    return there;
  };
  const inLine = (plot, t) => {
    const { xaxis, _size } = plot._fullLayout;
    const x = xaxis.d2p(t);
    const [mark] = marks(plot, 1);
    mark.hidden = !(x >= 0 && x <= xaxis._length);
    Object.assign(mark.style, { left: `${_size.l + x}px`, top: `${_size.t}px`, height: `${_size.h}px` });
    mark.dataset.t = t.toFixed(1);
  };
  const inPlan = (plot, t) => {
    const tracks = plot._fullData.filter((one) => one.customdata);
    const dots = marks(plot, tracks.length);
    tracks.forEach((track, k) => {
      let at = track.customdata.findIndex((one) => one > t);
      if (at < 0) at = track.customdata.length - 1;
      const [x, y] = [plot._fullLayout[track.xaxis.replace("x", "xaxis")], plot._fullLayout[track.yaxis.replace("y", "yaxis")]];
      const near = Math.abs(track.customdata[at] - t) < 5;
      dots[k].hidden = !near;
      dots[k].classList.add("dot");
      Object.assign(dots[k].style, { left: `${x._offset + x.d2p(track.x[at])}px`, top: `${y._offset + y.d2p(track.y[at])}px` });
    });
  };
  const isPlan = (plot) => plot._fullData && plot._fullData.some((one) => one.customdata && one.hovertemplate);
  const point = (t) => plots.filter(shown).forEach((plot) => {
    if (overTime(plot)) {
      if (t === null) marks(plot, 1); else inLine(plot, t);
    } else if (isPlan(plot)) {
      if (t === null) marks(plot, 0); else inPlan(plot, t);
    }
  });
  let moved = 0;
  plots.forEach((plot) => {
    plot.addEventListener("mousemove", (event) => {
      if (!overTime(plot)) return;
      const { xaxis, _size } = plot._fullLayout;
      const x = event.clientX - plot.getBoundingClientRect().left - _size.l;
      cancelAnimationFrame(moved);
      moved = requestAnimationFrame(() => point(x >= 0 && x <= xaxis._length ? xaxis.p2d(x) : null));
    });
    plot.addEventListener("mouseleave", () => { cancelAnimationFrame(moved); point(null); });
  });
  // a figure in closed details is drawn when they open
  const shown = (plot) => !plot.closest("details:not([open])");
  const drawShown = () => Promise.all(plots.filter(shown).map((plot) => draw(plot, plot.clientWidth)));

  const details = [...document.querySelectorAll("details")];
  if (FOLDED) details.filter((d) => d.classList.contains("fold")).forEach((d) => { d.open = false; });
  details.forEach((d) => d.addEventListener("toggle", () => {
    if (!d.open || root.classList.contains("paper")) return;
    [...d.querySelectorAll(".plot")].forEach((plot) => draw(plot, plot.clientWidth));
  }));

  let closed = [];
  window.addEventListener("beforeprint", () => {
    root.classList.add("paper");
    if (!closed.length) closed = details.filter((d) => !d.open);
    closed.forEach((d) => { d.open = true; });
    plots.forEach((plot) => draw(plot, PAPER_WIDTH, PAPER_HEIGHT_SCALE));
  });
  window.addEventListener("afterprint", () => {
    root.classList.remove("paper");
    closed.forEach((d) => { d.open = false; });
    closed = [];
    drawShown();
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawShown);
  let waiting = 0;
  window.addEventListener("resize", () => {
    window.clearTimeout(waiting);
    waiting = window.setTimeout(drawShown, 150);
  });

  // one at a time, so that the page can be read and scrolled meanwhile
  (async () => {
    for (const plot of plots) {
      if (shown(plot)) await draw(plot, plot.clientWidth);
      await new Promise((next) => { window.setTimeout(next, 0); });
    }
    root.dataset.drawn = "all";
  })();
})();
