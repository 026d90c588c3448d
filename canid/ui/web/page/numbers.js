// Numbers as text: value, 95 % interval and unit, as canid/values/text/numbers.py writes them.
export const DASH = "–";
const MAX_DECIMALS = 6;
const known = (x) => typeof x === "number" && Number.isFinite(x);

// decimals that the width of an interval supports: two significant digits of its half
export function decimals(iv) {
  const width = iv.high - iv.low;
  if (!(known(iv.high) && known(iv.low) && width > 0)) return 2;
  return Math.min(Math.max(1 - Math.floor(Math.log10(width)), 0), MAX_DECIMALS);
}

export const fixed = (x, places) => (known(x) ? x.toFixed(places).replace(/^-(0(\.0+)?)$/, "$1") : DASH);

export function value(iv) {
  return fixed(iv.value, decimals(iv));
}

export function limits(iv) {
  if (!known(iv.value)) return "";
  const places = decimals(iv);
  return `[${fixed(iv.low, places)}, ${fixed(iv.high, places)}]`;
}

export function interval(iv) {
  return known(iv.value) ? `${value(iv)} ${limits(iv)}` : DASH;
}

// minutes and seconds
export function clock(t) {
  if (!known(t)) return DASH;
  const s = Math.max(t, 0);
  const rest = Math.floor((s % 60) * 10) / 10;
  return `${Math.floor(s / 60)}:${rest.toFixed(1).padStart(4, "0")}`;
}

export const readable = (name) => String(name).replaceAll("_", " ");
export const grouped = (n) => (known(n) ? n.toLocaleString("en-US", { maximumFractionDigits: 0 }) : DASH);
export { known };
