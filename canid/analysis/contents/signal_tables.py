"""Tables of all signals of a vehicle's DBC files, with their last values: made one at a time, when they are asked for."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from canid.analysis.contents.binding import DbcFile
from canid.analysis.contents.decoded_frames import Decoder
from canid.analysis.contents.last_values import LastValues
from canid.analysis.contents.log_survey import Wanted
from canid.signals.vehicle import Vehicle
from canid.signals.vehicle.database import Dbc
from canid.signals.vehicle.vehicle_buses import numbers_in
from canid.values.errors import one_line
from canid.values.signal_table import Row, SignalTable
from canid.values.types import Columns


class SignalTables:
    """Takes frames, and gives a table of them when it is asked for. Nothing raises: what fails ends the tables alone.

    Example:
        >>> from canid.io.logs import open_log
        >>> from canid.values.shipped_files import shipped
        >>> from canid.signals.vehicle.vehicle_file import with_databases
        >>> log = open_log(shipped().parent / "replay_logs" / "following_lost_lead.blf")
        >>> tables = SignalTables(*with_databases("generic"), log.buses)
        >>> for chunk in log.columns(): tables.take(chunk)
        >>> table = tables.table()
        >>> round(table.t, 2), [row.text for row in table.rows if row.name == "EGO_SPEED.VehicleSpeed"]
        (179.95, ['76.22 km/h'])
    """

    def __init__(self, vehicle: Vehicle, databases: Sequence[Dbc], numbers: Mapping[str, int]) -> None:
        """See `files_on`."""
        self._values = LastValues(Decoder(files_on(vehicle, databases, numbers), Wanted()))
        self.newest, self._came = 0.0, time.monotonic()  # s, of the newest frame, and when it came
        self._failure = ""

    def take(self, chunk: Columns) -> None:
        """Take the next frames; they wait."""
        if not len(chunk.t) or self._failure:
            return
        self.newest, self._came = float(chunk.t[-1]), time.monotonic()
        try:
            self._values.take([chunk])
        except Exception as error:  # of any kind, memory included
            self._failure = one_line(error)

    def table(self, now: float | None = None) -> SignalTable:
        """The signals as they are; `now`: s, on the frames' clock, which else goes on from the newest frame."""
        began = time.thread_time()
        rows: list[Row] = []
        now = self.newest + time.monotonic() - self._came if now is None else now
        try:
            rows = self._values.rows(now) if not self._failure else []
        except Exception as error:
            self._failure = one_line(error)
        return SignalTable(self.newest, rows, time.thread_time() - began, self._failure)


def files_on(vehicle: Vehicle, databases: Sequence[Dbc], numbers: Mapping[str, int]) -> list[DbcFile]:
    """The DBC files of a vehicle on the buses of a log or a session, by the rule of `vehicle_buses.on_buses`.

    Args:
        vehicle: as its file says it.
        databases: of it; both from `vehicle_file.with_databases`.
        numbers: interface -> bus.
    """
    new = numbers_in(numbers, vehicle, [dbc.bus for dbc in databases if dbc.bus is not None])
    return [
        DbcFile(dbc.file, None if dbc.bus is None else new.get(dbc.bus, dbc.bus), list(dbc.messages.values()))
        for dbc in databases
    ]
