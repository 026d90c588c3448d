// Draws the figures, which are in the page as JSON, in the colors of the style sheet: light, dark or print.
"use strict";
(() => {
  const root = document.documentElement;
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const plots = [...document.querySelectorAll(".plot")];
  const PAPER_WIDTH = 700; // px: what @page leaves of A4 at 96 px per inch
  const PAPER_HEIGHT_SCALE = 0.8; // narrower figures may be lower: fewer gaps at the ends of pages
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
    const { data, layout, height } = figures[plot.dataset.figure];
    const of = painted({ data, layout }, (name) => style.getPropertyValue(`--${name}`).trim());
    // the reader's zoom is kept
    return Plotly.react(plot, of.data, { ...of.layout, width, height: scale * height, uirevision: "kept" }, CONFIG);
  };
  const drawAll = () => plots.forEach((plot) => draw(plot, plot.clientWidth));

  window.addEventListener("beforeprint", () => {
    root.classList.add("paper");
    plots.forEach((plot) => draw(plot, PAPER_WIDTH, PAPER_HEIGHT_SCALE));
  });
  window.addEventListener("afterprint", () => {
    root.classList.remove("paper");
    drawAll();
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
  let waiting = 0;
  window.addEventListener("resize", () => {
    window.clearTimeout(waiting);
    waiting = window.setTimeout(drawAll, 150);
  });

  // one at a time, so that the page can be read and scrolled meanwhile
  (async () => {
    for (const plot of plots) {
      await draw(plot, plot.clientWidth);
      await new Promise((next) => { window.setTimeout(next, 0); });
    }
    root.dataset.drawn = "all";
  })();
})();
