"""Tables of all signals of a log that is played: the log is read along, in a thread, while a page shows them.

It is read a second time for that, without the pipeline: a seek, forwards or backwards, then needs nothing from the replay.
"""

from __future__ import annotations

import math
import threading
from pathlib import Path

import numpy as np

from canid.analysis.contents.signal_tables import SignalTables
from canid.io.logs import open_log
from canid.signals.vehicle.vehicle_file import with_databases
from canid.values.errors import one_line
from canid.values.frame_columns import rows
from canid.values.signal_table import SignalTable

# s between two tables
INTERVAL_S = 1.0


class LogTables:
    """Owns the thread. `at` and `take` never wait."""

    def __init__(self, log: Path, vehicle: str) -> None:
        """`vehicle`: path of its file. Nothing is read before the first table is asked for."""
        self._log, self._vehicle = log, vehicle
        self._changed = threading.Condition()
        self._t: float | None = None  # s, of the table that is asked for
        self._table: SignalTable | None = None
        self._closing = False
        self._thread: threading.Thread | None = None

    def at(self, t: float) -> None:
        """Ask for the signals at `t` s of the log; at infinity: at its end."""
        with self._changed:
            self._t = t
            self._changed.notify_all()
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="canid-log-tables", daemon=True)
                self._thread.start()

    def take(self) -> SignalTable | None:
        """The newest table, where it was not taken before."""
        table, self._table = self._table, None
        return table

    def close(self) -> None:
        """End the thread."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()

    def _run(self) -> None:
        try:
            self._make()
        except (
            Exception
        ) as error:  # of any kind, of the log's reader too: there is no table, and a replay all the same
            self._table = SignalTable(0.0, [], 0.0, one_line(error))

    def _make(self) -> None:
        vehicle, databases = with_databases(self._vehicle)
        log = open_log(self._log)
        log.know(vehicle.messages)
        tables, read = SignalTables(vehicle, databases, log.buses), -math.inf
        chunks, rest = log.columns(), None
        while (t := self._asked()) is not None:
            if t < read:
                tables = SignalTables(vehicle, databases, log.buses)
                chunks, rest = log.columns(), None
            read = t
            while not self._closing:
                chunk = next(chunks, None) if rest is None else rest
                if chunk is None:
                    break
                # frames of several buses may stand a little out of order: up to the first one that is later
                later = np.flatnonzero(chunk.t > t)
                n = int(later[0]) if len(later) else len(chunk.t)
                tables.take(rows(chunk, 0, n))
                rest = rows(chunk, n, len(chunk.t)) if len(later) else None
                if rest is not None:
                    break
            self._table = tables.table(min(t, tables.newest))

    def _asked(self) -> float | None:
        """The time of the next table, when it is due; None: the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._closing, INTERVAL_S)
            self._changed.wait_for(lambda: self._t is not None or self._closing)
            t, self._t = self._t, None
        return None if self._closing else t
