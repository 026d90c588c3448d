"""SUMO's floating car data as written, --fcd-output in XML: the vehicles of each time step as rows of a table.

https://sumo.dlr.de/docs/Simulation/Output/FCDOutput.html. An element stands in one line: without a parser of XML nothing is
expanded, and a damaged line costs no other.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from canid.analysis.tables.source import BLOCK_ROWS, SAMPLE_ROWS, Block, number
from canid.io.logs.reader_state import ReadState
from canid.io.logs.text_lines import Line, LineCount, lines
from canid.values.errors import DamagedLogError, LogError

_ROOT = "<fcd-export"
_COMMENT, _STEP_BEGIN = re.compile("<!--"), re.compile("<timestep")
_STEP = re.compile(r'<timestep\s+time="(?P<time>[^"]*)"')
_VEHICLE = re.compile(r'<vehicle(?P<attributes>(?:\s+[\w:.-]+="[^"]*")+)\s*/?>')
_ATTRIBUTE = re.compile(r'([\w:.-]+)="([^"]*)"')
# lines of a whole file that hold no vehicle: ends, comments, the header, persons and containers
_OTHER = re.compile(r"</|<!--|<\?xml|<fcd-export|<(?:person|container)\b.*>|-->|[^<]*$")
OTHERS = "lines without a vehicle"
# of a comment, which has the options of the simulation
_MAX_HEAD_LINES = 20_000


class XmlSource:
    """A file of SUMO's floating car data, plain or gzipped."""

    notes: Sequence[str] = ()

    def __init__(self, path: Path):
        """Find the attributes. Raises LogError where it is no such file."""
        self.name = str(path)
        self.rows = 0
        self.count = LineCount()
        self.progress = 0.0
        self._path = path
        head = list(islice((line.text for line in lines(path, ReadState(), LineCount())), _MAX_HEAD_LINES))
        if not any(_ROOT in text for text in head):
            raise LogError(f"{path}: of XML only SUMO's --fcd-output is read (<fcd-export>)")
        rows = list(islice(self._rows(LineCount()), SAMPLE_ROWS))
        names = dict.fromkeys(name for _, row in rows for name in row)
        if not names:
            raise DamagedLogError(f"{path} holds no vehicle that can be read")
        self.headings: Sequence[str] = tuple(names)
        self._sample = [[row.get(name, "") for _, row in rows] for name in names]

    def sample(self) -> list[list[str]]:
        """The texts of the first rows, a list per attribute."""
        return self._sample

    def blocks(self, numbers: Sequence[int], texts: Sequence[int]) -> Iterator[Block]:
        """Read these columns, by their places. Raises LogError where the file cannot be read."""
        self.count, self.progress = LineCount(), 0.0
        rows = self._rows(self.count)
        while part := list(islice(rows, BLOCK_ROWS)):
            values = [[number(row.get(self.headings[k], "")) for k in numbers] for _, row in part]
            words = [[row.get(self.headings[k], "").strip() for _, row in part] for k in texts]
            which = np.array([line for line, _ in part], np.int64)
            yield Block(np.array(values, float).reshape(len(part), len(numbers)), words, which)

    def _rows(self, count: LineCount) -> Iterator[tuple[int, dict[str, str]]]:
        """The number of the line, and the attributes, of each vehicle; counts all lines."""
        state = ReadState(size=self._path.stat().st_size)
        time = ""
        comment = False
        try:
            for line in lines(self._path, state, count):
                self.progress = min(1.0, state.done / max(state.size, 1))
                text = line.text.strip()
                if not text.isascii():
                    text = text.encode("latin-1").decode("utf-8", "replace")
                if comment or _COMMENT.match(text):
                    comment = "-->" not in text
                    count.others[OTHERS] += 1
                    continue
                if (step := _STEP.search(text)) is not None:
                    time = step["time"]
                vehicles = [dict(_ATTRIBUTE.findall(each["attributes"])) for each in _VEHICLE.finditer(text)]
                if len(vehicles) < text.count("<vehicle ") or not (vehicles or step or _OTHER.match(text)):
                    time = "" if _STEP_BEGIN.match(text) else time
                    count.miss(Line("", line.number, line.whole, line.begin, line.end), "it is damaged")
                    continue
                count.others[OTHERS] += not vehicles
                count.read += bool(vehicles)
                for row in vehicles:
                    plain = {name: html.unescape(x) if "&" in x else x for name, x in row.items()}
                    yield line.number, {"time": time, **plain}
        except OSError as error:
            raise LogError(f"cannot read {self._path}: {error.strerror or error}") from None
