// Draws the figures that stand in the page as JSON, in the colours of the style sheet: light, dark, or paper.
"use strict";
(() => {
  const root = document.documentElement;
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const plots = [...document.querySelectorAll(".plot")];
  const PAPER = 700; // px: what @page leaves of A4 at 96 px per inch
  const LOWER = 0.8; // on paper figures are narrower, and may be lower: fewer gaps at the ends of pages
  const CONFIG = {
    displaylogo: false,
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
    toImageButtonOptions: { format: "svg" },
  };

  // "@name" becomes the colour --name
  const painted = (value, colour) => {
    if (typeof value === "string") return value[0] === "@" ? colour(value.slice(1)) : value;
    if (Array.isArray(value)) {
      const plain = !value.some((x) => typeof x === "string" || (typeof x === "object" && x !== null));
      return plain ? value : value.map((x) => painted(x, colour));
    }
    if (typeof value !== "object" || value === null) return value;
    return Object.fromEntries(Object.entries(value).map(([key, x]) => [key, painted(x, colour)]));
  };

  const draw = (plot, width, scale = 1) => {
    const style = getComputedStyle(root);
    const { data, layout, height } = figures[plot.dataset.figure];
    const of = painted({ data, layout }, (name) => style.getPropertyValue(`--${name}`).trim());
    // what the reader has zoomed stays zoomed
    return Plotly.react(plot, of.data, { ...of.layout, width, height: scale * height, uirevision: "kept" }, CONFIG);
  };
  const drawAll = () => plots.forEach((plot) => draw(plot, plot.clientWidth));

  window.addEventListener("beforeprint", () => {
    root.classList.add("paper");
    plots.forEach((plot) => draw(plot, PAPER, LOWER));
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

  // one after another, so that the page can be read and scrolled meanwhile
  (async () => {
    for (const plot of plots) {
      await draw(plot, plot.clientWidth);
      await new Promise((next) => { window.setTimeout(next, 0); });
    }
    root.dataset.drawn = "all";
  })();
})();
