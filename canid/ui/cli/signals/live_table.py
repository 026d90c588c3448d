"""`decode --table`: the last value and the rate of each signal, redrawn on a terminal, printed once elsewhere."""

from __future__ import annotations

import math
import shutil
import sys
import time
from collections.abc import Sequence

from canid.ui.terminal import open_terminal
from canid.ui.terminal.ansi import ENTER, LEAVE, drawn
from canid.ui.terminal.keys import Keyboard
from canid.ui.terminal.progress import is_terminal
from canid.ui.terminal.spans import Span
from canid.values.signal_table import Row
from canid.values.terminal_text import terminal_text

# s between two pictures: the eye reads no faster
REDRAW_S = 0.25
# characters of a column of rows, and between two
COLUMN, BETWEEN = 62, 2
# characters of a name that are shown at least
LEAST_NAME = 8
# s without a value from which on its age is shown instead of a rate that is over
OLD_S = 2.0


def table(rows: Sequence[Row], columns: int, height: int | None = None) -> list[str]:
    """Rows in as many columns as fit; `height`: lines that there are, None: any number.

    Example:
        >>> row = Row(0, "ENGINE.Pedal", "12.5 %", 50.0, 0.01)
        >>> [" ".join(line.split()) for line in table([row, row._replace(age=4.0)], 60)]
        ['ENGINE.Pedal 12.5 % 50 1/s', 'ENGINE.Pedal 12.5 % 4 s ago']
    """
    side_by_side = max((columns + BETWEEN) // (COLUMN + BETWEEN), 1)
    width = min(COLUMN, columns) if side_by_side == 1 else COLUMN
    several = len({row.bus for row in rows}) > 1
    lines = [_line(row, width, several) for row in rows]
    room = len(lines) if height is None else max(height - 1, 1) * side_by_side
    shown = lines[:room]
    # down the first column, then the next
    high = max(-(-len(shown) // side_by_side), 1) if height is None else max(height - 1, 1)
    out = [(" " * BETWEEN).join(shown[k::high]).rstrip() for k in range(min(high, len(shown)))]
    if len(lines) > room:
        out.append(f"… {len(lines) - room} more: --signals, --id, --bus"[:columns])
    return out


def _line(row: Row, width: int, several: bool) -> str:
    last = (
        f"{row.age:.0f} s ago"
        if row.age >= OLD_S
        else f"{row.rate:.3g} 1/s"
        if math.isfinite(row.rate)
        else ""
    )
    value, name = terminal_text(row.text), terminal_text(f"{row.bus} {row.name}" if several else row.name)
    room = width - 13
    # of a name its end says most; what is cut shows that it is
    value = value if len(value) < room - LEAST_NAME else f"{value[: room - LEAST_NAME - 2]}…"
    for_name = room - len(value)
    name = name if len(name) < for_name else f"…{name[len(name) - for_name + 2 :]}"
    return f"{name:<{for_name}}{value}{last:>13}"


class LiveTable:
    """The table on standard output."""

    def __init__(self) -> None:
        """Take over the terminal, where standard output is one."""
        self.ended = False  # by the key q
        self._live = is_terminal(sys.stdout)
        self._drawn = 0.0
        if self._live:
            self._keyboard = Keyboard(self._key)
            open_terminal.opened(sys.stdout, self._keyboard)
            self._keyboard.start()
            open_terminal.write(sys.stdout, ENTER)

    @property
    def due(self) -> bool:
        """Whether it is time for a picture."""
        return time.monotonic() - self._drawn >= REDRAW_S

    def draw(self, rows: Sequence[Row], says: str) -> None:
        """Draw the table, the sentence `says` above it."""
        self._drawn = time.monotonic()
        if not self._live:
            return
        size = shutil.get_terminal_size()
        lines = [says, *table(rows, size.columns, size.lines - 1)]
        lines += [""] * (size.lines - len(lines))
        picture = [(Span(line[: size.columns]),) for line in lines[: size.lines]]
        open_terminal.draw(sys.stdout, drawn(picture, size.columns, color=False))

    def close(self, rows: Sequence[Row]) -> None:
        """Restore the terminal, and print the table as it is now."""
        if self._live:
            self._keyboard.close()
            open_terminal.write(sys.stdout, LEAVE)
            open_terminal.closed()
        self.printed(rows)

    @staticmethod
    def printed(rows: Sequence[Row]) -> None:
        """Print the table once."""
        columns = shutil.get_terminal_size().columns if is_terminal(sys.stdout) else COLUMN
        for line in table(rows, columns):
            print(line)

    def _key(self, key: str) -> None:
        self.ended = self.ended or key in ("q", "escape")
