"""Signals of all messages on one raster: the last value is held for 5 s at most, NaN before the first and after that."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from canid.analysis.drive.signal_columns import decode
from canid.analysis.export.signal_tables import Received, fields_of, texts
from canid.analysis.export.table import Field, Table, Values, of_columns
from canid.values.errors import ConfigError

# s; a message that is sent on change is repeated once a second or so, and after five that are missed its sender is silent
MAX_HELD_S = 5.0
# rows of a raster: two hours at 1 kHz; with more the step was a slip of the pen
MAX_ROWS = 10_000_000


def raster_table(messages: Sequence[Received], step: float) -> Table:
    """Sample all signals every `step` s, from t = 0, or an earlier first frame of these messages, to the last one.

    Memory: 8 bytes for each row and signal.

    Raises:
        ConfigError: the raster is too fine.
    """
    last = max((float(message.frames.t[-1]) for message in messages), default=0.0)
    first = min((float(message.frames.t[0]) for message in messages), default=0.0)
    if (last - min(first, 0.0)) / step > MAX_ROWS:
        raise ConfigError(
            f"--raster {step:g}: gives more than {MAX_ROWS:,} rows of {last - min(first, 0.0):.0f} s; use a longer step"
        )
    # a little room: 0.3 is not three times 0.1 in floats
    begin = min(math.ceil(first / step - 1e-9), 0)
    t = np.round(np.arange(begin, math.floor(last / step + 1e-9) + 1) * step, 9)
    columns: list[tuple[Field, Values]] = []
    for message in messages:
        for signal in message.signals:
            held = np.full(len(t), np.nan)
            column = decode(message.message, signal, message.frames)
            if column is not None:
                known = np.isfinite(column.value)
                at = np.searchsorted(column.t[known], t, "right") - 1
                if known.any():
                    # a little room, as above
                    fresh = (at >= 0) & (t - column.t[known][at.clip(0)] <= MAX_HELD_S + 1e-9)
                    held = np.where(fresh, column.value[known][at.clip(0)], np.nan)
            fields = fields_of(signal, f"{message.name}.{signal.name}")
            says = f"last value, held for {MAX_HELD_S:g} s at most"
            columns.append((fields[0]._replace(comment=says), held))
            if len(fields) > 1:
                columns.append((fields[1], texts(signal, held)))
    return of_columns(
        "signals", "", t, columns, f"last values, held for {MAX_HELD_S:g} s at most, every {step:g} s"
    )
