// Unpacks plotly.js (RFC 1951 in base64) and runs it before the page has loaded: a page printed at once has its figures.
"use strict";
(() => {
  const packed = document.getElementById("plotly");
  const input = Uint8Array.from(atob(packed.textContent), (c) => c.charCodeAt(0));
  const out = new Uint8Array(Number(packed.dataset.bytes));
  let at = 0, held = 0, count = 0, end = 0; // next byte of the input; bits held, and how many; next byte of the output
  const fill = (n) => { for (; count < n; count += 8) held |= input[at++] << count; };
  const drop = (n) => { held >>>= n; count -= n; };
  const bits = (n) => { fill(n); const value = held & ((1 << n) - 1); drop(n); return value; };

  // every 15 bits that may come -> 16 · symbol + length of its code
  const codes = (lengths) => {
    const table = new Uint16Array(1 << 15), used = new Uint16Array(16), next = new Uint16Array(16);
    lengths.forEach((length) => { if (length) used[length] += 1; });
    for (let length = 1; length < 15; length += 1) next[length + 1] = (next[length] + used[length]) << 1;
    lengths.forEach((length, symbol) => {
      if (!length) return;
      let reversed = 0;
      for (let k = 0, code = next[length]; k < length; k += 1, code >>= 1) reversed = (reversed << 1) | (code & 1);
      next[length] += 1;
      for (; reversed < 1 << 15; reversed += 1 << length) table[reversed] = (symbol << 4) | length;
    });
    return table;
  };
  const symbol = (table) => { fill(15); const found = table[held & 0x7fff]; drop(found & 15); return found >> 4; };
  const ORDER = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
  const dynamic = () => {
    const [literals, distances, sizes] = [bits(5) + 257, bits(5) + 1, bits(4) + 4], own = Array(19).fill(0), lengths = [];
    for (let k = 0; k < sizes; k += 1) own[ORDER[k]] = bits(3);
    const table = codes(own);
    while (lengths.length < literals + distances) {
      const one = symbol(table);
      const [value, times] = one < 16 ? [one, 1] : one === 16 ? [lengths.at(-1), 3 + bits(2)] : [0, one === 17 ? 3 + bits(3) : 11 + bits(7)];
      for (let k = 0; k < times; k += 1) lengths.push(value);
    }
    return [codes(lengths.slice(0, literals)), codes(lengths.slice(literals))];
  };
  const fixed = () => {
    const length = (k) => (k < 144 ? 8 : k < 256 ? 9 : k < 280 ? 7 : 8);
    return [codes(Array.from({ length: 288 }, (_, k) => length(k))), codes(Array(30).fill(5))];
  };
  // additional bits of a length or distance, `each` codes of a size; and where its values begin
  const copied = (k, each) => {
    const more = Math.max((k >> each) - 1, 0);
    return (k < 2 << each ? k : ((1 << each) + (k & ((1 << each) - 1))) << more) + bits(more);
  };
  const block = (kind) => {
    if (kind === 0) {
      drop(count & 7);
      const size = bits(16);
      bits(16);
      for (let k = 0; k < size; k += 1) out[end++] = bits(8);
      return;
    }
    const [literals, distances] = kind === 2 ? dynamic() : fixed();
    for (let one = symbol(literals); one !== 256; one = symbol(literals)) {
      if (one < 256) { out[end++] = one; continue; }
      const size = one === 285 ? 258 : 3 + copied(one - 257, 2);
      const back = 1 + copied(symbol(distances), 1);
      for (let k = 0; k < size; k += 1, end += 1) out[end] = out[end - back];
    }
  };
  for (let last = 0; !last;) { last = bits(1); block(bits(2)); }
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(out);
  document.head.append(script);
})();
