"""The page on the signals of a log: as one file with its data, or as the shell that a server gives them to."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from canid.analysis.contents.log_marks import LogMark
from canid.analysis.contents.signal_lines import Line, NamedLine
from canid.ui.views.document.templates import environment, file_text
from canid.ui.views.drawing.plotly_package import plotly_script
from canid.ui.views.signal_page import zoom
from canid.values.errors import ConfigError
from canid.values.findings import Provenance

# lines that are kept decoded: an hour at 100 Hz has 6 MB
MOST_KEPT = 48
# lines that the page begins with
FIRST_SHOWN = 3
# a name of something that protects a message: it says nothing of the drive
PROTECTS = ("counter", "checksum", "crc", "cnt")
# points of all lines of a file together, some 8 MB of text; and of one line, which a screen shows twice over
FILE_POINTS, LINE_POINTS = 500_000, 6_000


class SignalPage(NamedTuple):
    """What a page shows."""

    title: str  # of the log
    start: float  # s, of the first frame that is shown
    stop: float  # s, of the last one
    lines: Sequence[NamedLine]
    marks: Sequence[LogMark] = ()


class Decoded:
    """Lines by their number; those of late stay decoded."""

    def __init__(self, lines: Sequence[NamedLine]) -> None:
        """`lines` in the order of the page's list."""
        self.named = tuple(lines)
        self.line = lru_cache(maxsize=MOST_KEPT)(self._read)

    def _read(self, k: int) -> Line:
        return self.named[k].read()


def listing(page: SignalPage, decoded: Decoded) -> dict[str, Any]:
    """What the page shows before it asks for lines."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for k, line in enumerate(page.lines):
        meanings = {_key(value): text for value, text in line.meanings.items()}
        known = {"k": k, "name": line.name, "unit": line.unit, "meanings": meanings}
        groups.setdefault(line.group, []).append(known)
    return {
        "title": page.title,
        "start": page.start,
        "stop": page.stop,
        "groups": [{"title": title, "lines": lines} for title, lines in groups.items()],
        "marks": [mark._asdict() for mark in page.marks],
        "shown": _first_shown(decoded),
    }


def _key(value: float) -> str:
    """A number as a script's `String` writes it."""
    return str(int(value)) if value.is_integer() else repr(value)


def _first_shown(decoded: Decoded) -> list[int]:
    """The lines that say so; where none does, the first that move and are no counter."""
    out = [k for k, line in enumerate(decoded.named) if line.at_first]
    if out:
        return out
    for k, line in enumerate(decoded.named):
        if len(out) == FIRST_SHOWN:
            break
        if line.meanings or any(word in line.name.lower() for word in PROTECTS):
            continue
        value = decoded.line(k).value
        known = value[np.isfinite(value)]
        if known.size and known.min() < known.max():
            out.append(k)
    return out


def file(page: SignalPage, made_from: Provenance) -> str:
    """The page as one file; each line has the extremes of as many pieces as a page of some MB allows.

    Raises ConfigError where plotly, which draws it, is not installed.
    """
    plotly = plotly_script()
    if plotly is None:
        raise ConfigError("look --report: the page is drawn by plotly: pip install 'canid[report]'")
    decoded = Decoded(page.lines)
    points = min(LINE_POINTS, FILE_POINTS // max(len(page.lines), 1))
    pieces = [zoom.piece(decoded.line(k), -np.inf, np.inf, points)._asdict() for k in range(len(page.lines))]
    data = json.dumps({**listing(page, decoded), "pieces": pieces}, ensure_ascii=False, allow_nan=False)
    return (
        environment()
        .get_template("signal_page/file.html.j2")
        .render(
            p=made_from,
            style=file_text("document/page.css") + file_text("signal_page/signals.css"),
            data=Markup(data.replace("<", "\\u003c")),
            plotly=plotly,
            script=file_text("signal_page/signals.js"),
        )
    )
