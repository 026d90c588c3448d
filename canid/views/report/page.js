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
