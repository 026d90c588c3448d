"""The table of all signals of a session: for those who ask, with the values of the recording's last frames."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path
from typing import Any

import can
import cantools
import pytest

from canid.analysis.session.session import SessionSettings
from canid.io.buses.bus_opener import open_buses
from canid.io.buses.send import onto
from canid.io.logs import open_log
from canid.ui.cli import live_session
from canid.ui.views.terminal_view.state import View
from canid.values.types import Frame
from tests.web.conftest import ROOT, Page, client

# s; bounds what hangs, no more
PATIENCE_S = 120.0
VEHICLE, DBC = ROOT / "dbc/generic.toml", ROOT / "dbc/generic.dbc"


class Client(threading.Thread):
    """A client that reads until the session ends; `asks`: for the table, as the page does while it is open."""

    def __init__(self, page: Page, *, asks: bool) -> None:
        super().__init__()
        self.page, self.asks = page, asks
        self.tables: list[dict[str, Any]] = []
        self.end = False

    def run(self) -> None:
        with client(self.page) as socket:
            asked = 0.0
            while not self.end:
                if self.asks and time.monotonic() - asked > 1.0:
                    asked = time.monotonic()
                    socket.send('{"do": "signals"}')
                try:
                    message = json.loads(socket.recv(timeout=0.2))
                except TimeoutError:
                    continue
                if message["kind"] == "table":
                    self.tables.append(message)
                self.end = any(one["kind"] == "end" for one in message.get("messages", ()))


def drawn(rng: Any, seconds: float) -> list[Frame]:
    """The messages of the DBC file at their rates, with random bytes; some are of no message."""
    of = cantools.database.load_file(DBC).messages
    frames = []
    for message in of:
        for k in range(int(seconds / 0.05)):
            data = bytearray(rng.bytes(message.length))
            if message.is_multiplexed():
                data[0] = k % 3
            frames.append(Frame(0.05 * k, 0, message.frame_id, bytes(data)))
    frames += [Frame(0.1 * k, 0, 0x7E0, b"") for k in range(int(seconds / 0.1))]
    return sorted(frames, key=lambda frame: frame.t)


def of_cantools(log: Path) -> dict[str, float | str]:
    database = cantools.database.load_file(DBC)
    known = {message.frame_id: message for message in database.messages}
    last: dict[str, float | str] = {}
    for frame in can.LogReader(log):
        if frame.arbitration_id in known:
            message = known[frame.arbitration_id]
            for name, value in message.decode(frame.data).items():
                last[f"{message.name}.{name}"] = value if isinstance(value, float | int) else str(value)
    return last


@pytest.mark.slow("a session in real time")
def test_a_session_shows_all_signals_to_those_who_ask_and_loses_no_frame(
    fresh: Page, tmp_path: Path, seed: int
) -> None:
    import numpy as np

    frames = drawn(np.random.default_rng(seed), 4.0)
    config = {"interface": "virtual", "channel": str(tmp_path)}
    asking, silent = Client(fresh, asks=True), Client(fresh, asks=False)
    buses = open_buses([config])
    sender = threading.Thread(target=onto, args=(config, frames, 1.0))
    end = time.monotonic() + PATIENCE_S

    def stop() -> bool:
        """When a table has come of all that was sent: the age of the last frame grows."""
        ages = [row[4] for row in asking.tables[-1]["rows"]] if asking.tables else []
        return (not sender.is_alive() and min(ages, default=0.0) > 0.5) or time.monotonic() > end

    for thread in (asking, silent, sender):
        thread.start()
    settings = SessionSettings(VEHICLE, tmp_path / "drive.blf", tables=True)
    code, _ = live_session.watch(
        buses,
        settings,
        View("test"),
        stop=stop,
        controls=fresh.controls,
        others=[fresh.live],
        pages=[fresh.live],
    )
    asking.join(PATIENCE_S)
    silent.join(PATIENCE_S)
    assert code == 0
    assert time.monotonic() < end
    assert [(f.id, f.data) for f in open_log(tmp_path / "drive.blf")] == [(f.id, f.data) for f in frames]
    assert silent.tables == []
    shown = {name: (text, rate) for _, name, text, rate, _ in asking.tables[-1]["rows"]}
    expected = of_cantools(tmp_path / "drive.blf")
    assert shown.keys() == expected.keys()
    assert len(expected) > 20
    for name, value in expected.items():
        text, rate = shown[name]
        if isinstance(value, str):
            assert text == value
        else:
            assert float(text.split()[0]) == pytest.approx(value, rel=1e-9), name
        assert 1.0 < rate < 1000.0


@pytest.mark.slow("a session in real time")
def test_nothing_is_decoded_for_nobody(fresh: Page, tmp_path: Path) -> None:
    """Without a page that shows the table none is made, whatever the settings permit."""
    config = {"interface": "virtual", "channel": str(tmp_path)}
    buses = open_buses([config])
    sender = threading.Thread(
        target=onto, args=(config, [Frame(0.01 * k, 0, 0x110, bytes(8)) for k in range(200)], 1.0)
    )
    sender.start()
    seen: list[object] = []
    fresh.live.table = seen.append  # type: ignore[method-assign]
    settings = SessionSettings(VEHICLE, duration=4.0, tables=True)
    live_session.watch(
        buses, settings, View("test"), stop=lambda: False, controls=fresh.controls, pages=[fresh.live]
    )
    sender.join()
    assert seen == []
