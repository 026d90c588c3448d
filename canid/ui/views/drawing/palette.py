"""Colors: those of the pages' style sheet, and those that a notebook shows on white and on black alike."""

from __future__ import annotations

import re

from markupsafe import Markup

from canid.ui.views.document.templates import file_text

# the pages' own on white, whose contrast is above 3 on black as well, and greys in between for what is not;
# ink, background and rules are the notebook's own
NOTEBOOK = {
    "measured": "#8a919c", "after": "#0b62ad", "before": "#c2510c", "rival": "#5b8fc0", "bar": "#8a919c",
    "muted": "#8a919c", "good": "#1a6b33", "bad": "#b3261e", "low": "#2166ac", "high": "#b2182b",
    "worst": "rgba(240, 200, 40, 0.28)", "shade-mask": "rgba(128, 136, 148, 0.34)",
    "shade-unused": "rgba(128, 136, 148, 0.16)",
}  # fmt: skip


def light(style: Markup) -> Markup:
    """A style sheet with the pages' colors on white in the place of their names, for a file that stands alone.

    Example:
        >>> light(Markup("a { color: var(--ink); }"))
        Markup('a { color: #1b1f24; }')
    """
    root = file_text("document/page.css").partition("}")[0]
    colors = dict(re.findall(r"--([\w-]+): ([^;]+);", root))
    return Markup(re.sub(r"var\(--([\w-]+)\)", lambda name: colors[name[1]], style))
