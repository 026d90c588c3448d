"""Numbers in block digits of three rows, drawn from a font of 3x5 pixels."""

from __future__ import annotations

# five rows of pixels per character, top to bottom; seven segments
FONT = {
    "0": "### #.# #.# #.# ###", "1": "..# ..# ..# ..# ..#", "2": "### ..# ### #.. ###", "3": "### ..# ### ..# ###",
    "4": "#.# #.# ### ..# ..#", "5": "### #.. ### ..# ###", "6": "### #.. ### #.# ###", "7": "### ..# ..# ..# ..#",
    "8": "### #.# ### #.# ###", "9": "### #.# ### ..# ###", ".": ". . . . #", "-": "... ... ### ... ...",
    "–": "... ... ### ... ...", " ": "... ... ... ... ...",
}  # fmt: skip
# (upper pixel, lower pixel) -> the character that shows both
HALVES = {(False, False): " ", (True, False): "▀", (False, True): "▄", (True, True): "█"}
ROWS = 3


def large(text: str) -> tuple[str, ...]:
    """A number in three rows; characters that the font does not have are left out.

    Example:
        >>> for row in large("4.2"): print(row)
        █ █   ▀▀█
        ▀▀█   █▀▀
          ▀ ▀ ▀▀▀
    """
    glyphs = [FONT[c].split() for c in text if c in FONT]
    rows = []
    for row in range(ROWS):
        parts = []
        for glyph in glyphs:
            upper = glyph[2 * row]
            lower = glyph[2 * row + 1] if 2 * row + 1 < len(glyph) else "." * len(upper)
            parts.append("".join(HALVES[u == "#", d == "#"] for u, d in zip(upper, lower, strict=True)))
        rows.append(" ".join(parts))
    return tuple(rows)
