"""Error and remote frames are counted, and in no list of ids: their ids are classes of errors, or another's request."""

from __future__ import annotations

from pathlib import Path

import can
import numpy as np
import pytest

from canid.analysis.contents.log_survey import survey
from canid.analysis.drive.vehicle_check import check, contents
from canid.io.logs import open_log
from canid.signals.vehicle import read_vehicle
from canid.ui.cli import main
from canid.values.frame_columns import columns_of
from canid.values.types import Columns, Flag, Frame
from tests.fixtures.measured_logs import files, needs_measured

DATA, ERRORS = 120, 132
WRITERS = {"asc": can.ASCWriter, "blf": can.BLFWriter, "log": can.CanutilsLogWriter}
DBC = """VERSION ""
BU_: X
BO_ 136 M: 8 X
 SG_ Pedal : 0|16@1+ (0.01,0) [0|100] "%" X
 SG_ Speed : 16|16@1+ (0.01,0) [0|100] "m/s" X
 SG_ Gap : 32|16@1+ (0.01,0) [0|300] "m" X
 SG_ Rate : 48|16@1- (0.005,0) [-100|100] "m/s" X
"""
CAR = """name = "p"
dbc = ["e.dbc"]
[signals]
pedal = "M.Pedal"
speed = "M.Speed"
gap = "M.Gap"
range_rate = "M.Rate"
"""


def messages() -> list[can.Message]:
    """Data frames 0x88 every 0.1 s; between them error frames, of class 0x88 and of class 4."""
    out = []
    for k in range(DATA):
        pedal = round(2000 + 500 * np.sin(k / 7)).to_bytes(2, "little")
        out.append(can.Message(0.1 * k, 0x88, is_extended_id=False, data=pedal + bytes(6)))
        for at in (0.03, 0.05) if k % 10 == 0 else (0.03,):
            class_ = 0x88 if at == 0.03 else 4
            out.append(
                can.Message(0.1 * k + at, class_, is_extended_id=False, is_error_frame=True, data=bytes(8))
            )
    return out


@pytest.mark.parametrize("suffix", WRITERS)
def test_every_list_of_ids_has_data_frames_alone(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of each format `check` with and without a vehicle file and `look` list 0x88 with its data frames, and count errors."""
    log, dbc, car = tmp_path / f"e.{suffix}", tmp_path / "e.dbc", tmp_path / "e.toml"
    with WRITERS[suffix](log) as writer:  # type: ignore[abstract]
        for message in messages():
            writer.on_message_received(message)
    dbc.write_text(DBC)
    car.write_text(CAR)

    counted = contents(open_log(log).columns())
    assert counted.frames == {(0, 0x88, 8): DATA}
    assert counted.apart == {"error": ERRORS}

    checked = check(open_log(log).columns(), read_vehicle(car))
    assert checked.ids == {(0, 0x88): DATA}
    assert checked.frames == DATA + ERRORS
    assert checked.apart == {"error": ERRORS}
    assert checked.unmapped == ()

    seen = survey(open_log(log))
    assert [(message.id, message.frames) for message in seen.messages] == [(0x88, DATA)]
    assert [bus.errors for bus in seen.buses] == [ERRORS]

    main(["check", str(log)])
    assert "252 frames, 1 ids, 11.9 s, 132 error frames apart from the ids" in capsys.readouterr().out


def test_remote_frames_are_apart_too() -> None:
    """A remote frame asks for the data of an id; an error frame that has the remote bit set is an error frame."""
    frames = [
        Frame(0.0, 0, 0x88, b"ab"),
        Frame(0.1, 0, 0x88, b"", int(Flag.REMOTE), 8),
        Frame(0.2, 0, 0x88, b"", int(Flag.ERROR | Flag.REMOTE), 8),
    ]
    assert contents([columns_of(frames)]) == contents([columns_of([frame]) for frame in frames])
    counted = contents([columns_of(frames)])
    assert counted.frames == {(0, 0x88, 2): 1}
    assert counted.apart == {"error": 1, "remote": 1}


def test_error_frames_alone_have_no_id() -> None:
    """A log of nothing else has a duration and no id."""
    chunk: Columns = columns_of([Frame(0.1 * k, 0, 0x88, b"", int(Flag.ERROR), 8) for k in range(5)])
    counted = contents([chunk])
    assert counted.frames == {}
    assert counted.apart == {"error": 5}
    assert counted.duration == pytest.approx(0.4)


@needs_measured
def test_measured_error_frames_are_apart() -> None:
    """1,200 data frames 0x88 next to 1,200 error frames."""
    for log in files("reports/48-error-ids/e.asc", "reports/48-error-ids/e.blf"):
        counted = contents(open_log(log).columns())
        assert counted.frames[0, 0x88, 8] == 1200
        assert counted.apart == {"error": 1200}
