"""Run as `python -m canid.analysis.export.mf4_child FILE`: writes the tables that come over standard input as an ASAM .mf4.

A process of its own because asammdf is slow to import and needs much memory. Messages: `(start in ns or None, comment)`,
then `(name, comment, t, [(name, unit, comment, values), ...])` for each table, then None. The answer is `WRITTEN`,
`NO_ASAMMDF` or the reason why the file cannot be written.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

from canid.values.processes.serve import connect

WRITTEN, NO_ASAMMDF = "", "asammdf is missing"


def main(path: str) -> int:
    """Write `path`, which exists, and answer."""
    parent = connect()
    parent.answer(_written(path, parent.messages()))
    return 0


def _written(path: str, messages: Iterator[Any]) -> str:
    try:
        import asammdf
        import numpy as np
    except ImportError:
        return NO_ASAMMDF
    try:
        start_ns, comment = next(messages)
        file = asammdf.MDF(version="4.10")
        file.header.start_time = datetime.fromtimestamp((start_ns or 0) / 1e9, UTC)
        file.header.abs_time = start_ns or 0  # with all its nanoseconds
        file.header.comment = comment
        while (table := next(messages)) is not None:
            name, of_table, t, columns = table
            signals = [
                asammdf.Signal(
                    samples=_samples(values, np),
                    timestamps=t,
                    name=column,
                    unit=unit,
                    comment=says,
                    encoding="utf-8" if values.dtype == object else None,
                )
                for column, unit, says, values in columns
            ]
            if len(t) and signals:
                file.append(signals, acq_name=name, comment=of_table, common_timebase=True)
        file.save(path, overwrite=True, compression=1)
        file.close()
    except Exception as error:  # asammdf raises errors of any kind
        why = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
        return " ".join(str(why).split())[:200] or type(error).__name__
    return WRITTEN


def _samples(values: Any, np: Any) -> Any:
    if values.dtype != object:
        return values
    encoded = [(text or "").encode("utf-8", "backslashreplace") for text in values.tolist()]
    return np.array(encoded, dtype=f"S{max(map(len, encoded), default=1) or 1}")


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1]))
