"""A view as it is after so many seconds of a log, for pictures of it."""

from __future__ import annotations

from pathlib import Path

from canid.analysis.drive import drive_reader
from canid.io.logs import open_log
from canid.io.recording.recorder_stats import BusStats
from canid.signals.vehicle import read_vehicle
from canid.ui.cli.health_lines import bus
from canid.ui.views.terminal_view.state import HealthLine, View, update, with_status
from canid.values.window import Window

ROOT = Path(__file__).parents[2]
LOG = ROOT / "replay_logs" / "following_urban.blf"
VEHICLE = "generic"


def replayed(stop: float, log: Path = LOG, vehicle: str = VEHICLE, duration: float = 180.0) -> View:
    """The view of `canid replay` at `stop` s of the log."""
    car = read_vehicle(vehicle)
    view = View(f"canid replay · {log.name} · {car.name}", output=car.driver.output)
    frames = 0
    for _, chunk, out in drive_reader.run(open_log(log), car, within=Window(stop=stop), span=0.5):
        frames += len(chunk.t)
        for item in out:
            view = update(view, item)
    view = view._replace(lines=(HealthLine(f"{frames:,} frames"),))
    return with_status(view, {"t": stop, "duration": duration, "paused": False, "speed": 10.0})


def recorded(stop: float, **of: object) -> View:
    """The same as if it were a session on a bus that records."""
    view = replayed(stop)
    frames = int(view.lines[0].text.split()[0].replace(",", ""))
    lines = (
        HealthLine("recording"),
        bus(BusStats("socketcan can0", "open", frames, 0, 0, 0.12, "error_active"), 225.0),
        HealthLine("estimating   2 frames behind"),
    )
    numbers = {
        "state": "recording", "path": "drives/canid_2026-10-03_14-30-00.blf", "frames": frames, "written": frames,
        "bytes": 9 * frames, "lag": 0.02, "elapsed": stop, "buses": [{"name": "socketcan can0", "load": 0.12}],
    }  # fmt: skip
    session = View(
        "canid live · socketcan can0", view.t, view.output, view.sample, view.estimates, view.last_ok, view.headlined,
        view.trend, lines, view.events, view.monitor, view.signals,
    )  # fmt: skip
    return with_status(session, numbers | of)
