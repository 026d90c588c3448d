// Sets the theme before the first picture, so that nothing flashes. No module: it runs at once.
"use strict";
(() => {
  let chosen = null;
  try { chosen = localStorage.getItem("canid-theme"); } catch { /* storage may be switched off */ }
  if (chosen === "dark" || chosen === "light") document.documentElement.dataset.theme = chosen;
})();
