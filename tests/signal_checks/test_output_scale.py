"""The scale of a pedal is confirmed by what is stated or by a pedal at its stop; else its limits are said."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.drive.drive_reader import read_trace
from canid.signals.samples.trace_assembly import part
from canid.signals.signal_checks.output_scale import output_scale
from canid.signals.vehicle import read_vehicle
from canid.ui.cli import main
from canid.values.errors import ConfigError
from canid.values.types import NAN, FullScale, SignalFinding

SHIPPED = Path(__file__).parents[2] / "dbc"


def vehicle(tmp_path: Path, signal: str, entry: str) -> Path:
    """The generic vehicle, with another line for the pedal in its DBC and its vehicle file."""
    dbc = (SHIPPED / "generic.dbc").read_text()
    before = next(line for line in dbc.splitlines() if " PedalPosition :" in line)
    (tmp_path / "car.dbc").write_text(dbc.replace(before, f" SG_ PedalPosition : 0|8@1+ {signal} RADAR"))
    text = (SHIPPED / "generic.toml").read_text().replace("generic.dbc", "car.dbc")
    path = tmp_path / "car.toml"
    path.write_text(text.replace('pedal = "ENGINE_DATA.PedalPosition"', f"pedal = {entry}"))
    return path


PLAIN = '"ENGINE_DATA.PedalPosition"'


@pytest.mark.parametrize(
    ("signal", "entry", "source", "highest"),
    [
        ('(0.4,0) [0|100] "%"', PLAIN, "its range in the database ends at 100 %", 102.0),
        ('(0.392157,0) [0|0] "%"', PLAIN, "its bits end at 100 % by the factor in the database", 100.0),
        ('(0.5,0) [0|0] "%"', PLAIN, "", 127.5),
        ('(1,0) [0|255] "%"', PLAIN, "", 255.0),
        (
            '(0.005,0) [0|1] ""',
            '{ signal = "ENGINE_DATA.PedalPosition", unit = "0..1" }',
            "its range in the database ends at 100 %",
            127.5,
        ),
        # a scale in the vehicle file is a claim; a reason in words confirms it
        (
            '(1,0) [0|255] ""',
            '{ signal = "ENGINE_DATA.PedalPosition", unit = "%", scale = 0.4 }',
            "",
            102.0,
        ),
        (
            '(1,0) [0|255] ""',
            '{ signal = "ENGINE_DATA.PedalPosition", unit = "%", scale = 0.4, full_scale = "kick-down" }',
            "the vehicle file states it: kick-down",
            102.0,
        ),
    ],
)
def test_the_vehicle_file_and_the_database_say_what_full_travel_is(
    tmp_path: Path, signal: str, entry: str, source: str, highest: float
) -> None:
    found = read_vehicle(vehicle(tmp_path, signal, entry)).driver.full_scale
    assert found is not None
    assert found.source == source
    assert found.highest == pytest.approx(highest, rel=1e-3)


def test_only_a_pedal_has_a_full_scale(tmp_path: Path) -> None:
    path = vehicle(tmp_path, '(0.4,0) [0|100] "%"', PLAIN)
    text = path.read_text()
    line = next(each for each in text.splitlines() if each.startswith("gap"))
    signal = line.split('"')[1]
    path.write_text(text.replace(line, f'gap = {{ signal = "{signal}", full_scale = "seen" }}'))
    with pytest.raises(ConfigError, match=r"signals\.gap\.full_scale: is for the pedal only"):
        read_vehicle(path)


def test_a_pedal_at_its_stop_confirms_its_scale() -> None:
    drive = np.array([0.0] * 50 + [30.0] * 50 + [99.2] * 8 + [20.0] * 50)
    found = output_scale(drive, 0.1, FullScale("", 127.5))
    assert found is not None
    assert found.confirmed
    assert found.source == "it stood at 99.2 % for 0.8 s, as at its stop"


@pytest.mark.parametrize(
    "drive",
    [
        [0.0, 30.0, 99.2, 20.0],  # passed, not held
        [0.0] + [61.0] * 50,  # held elsewhere
        [0.0] + [140.0] * 50,  # beyond full travel
        [NAN] * 50,
    ],
)
def test_what_is_no_stop_leaves_the_scale_open(drive: list[float]) -> None:
    found = output_scale(np.array(drive), 0.1, FullScale("", 255.0))
    assert found is not None
    assert not found.confirmed
    assert "not confirmed" in found.says


def test_a_finding_on_the_scale_stands_against_what_is_stated() -> None:
    wrong = SignalFinding(
        "pedal_scale", ("pedal",), 0.0, 1.0, "the pedal is pressed by up to 200 %", "", True
    )
    found = output_scale(np.zeros(50), 0.1, FullScale("its range in the database ends at 100 %"), [wrong])
    assert found is not None
    assert not found.confirmed


def test_the_limits_of_an_open_scale_bound_k() -> None:
    found = output_scale(np.array([0.0, 50.0]), 0.1, FullScale("", 200.0))
    assert found is not None
    assert (found.value, found.low, found.high) == (100.0, 50.0, 200.0)
    assert "the true K may be 0.5 to 2 times as much" in found.says


@pytest.mark.long("takes whole drives")
def test_a_drive_says_the_scale_with_its_result(tmp_path: Path) -> None:
    from canid.analysis.drive.drive_parameters import identify
    from canid.analysis.drive.identification_verdict import verdict

    log = Path(__file__).parents[2] / "replay_logs" / "following_urban.blf"
    # the same bytes and the same K, of which nothing says that 100 % is full travel
    for signal, sure in (('(0.4,0) [0|100] "%"', True), ('(0.4,0) [0|200] "%"', False)):
        trace = read_trace(log, vehicle(tmp_path, signal, PLAIN))
        found = identify(part(trace, slice(0, round(90.0 / trace.dt))), select_orders=False, sliding=False)
        assert found.output_scale is not None
        assert found.output_scale.confirmed is sure
        said = verdict(found, "pedal")
        assert said.identifiable
        assert ("not confirmed" in said.scale) is not sure


@pytest.mark.slow("a drive replayed and exported, by four commands")
@pytest.mark.parametrize("sure", [True, False])
def test_what_shows_k_marks_an_open_scale(
    tmp_path: Path, sure: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Replay's display, the exported table, the page of `identify`: as its text does; and the page says a known one."""
    monkeypatch.chdir(tmp_path)
    car = str(vehicle(tmp_path, f'(0.4,0) [0|{100 if sure else 200}] "%"', PLAIN))
    assert main(["replay", "following_urban.blf", "--vehicle", car, "--speed", "max", "--stop", "60"]) == 0
    out, err = capsys.readouterr()
    assert ("scale is not confirmed" in out + err) is not sure
    assert main(["export", "following_urban.blf", "--vehicle", car, "--to", "csv", "-o", "drive"]) == 0
    out, err = capsys.readouterr()
    assert ("scale is not confirmed" in out + err) is not sure
    table = (tmp_path / "drive.estimates.csv").read_text().splitlines()
    head = next(line for line in table if line.startswith("t [s],"))
    at = head.split(",").index("scale")
    rows = [line.split(",") for line in table[table.index(head) + 1 :]]
    assert {row[at] for row in rows} == {"confirmed" if sure else "not confirmed"}
    assert main(["identify", "following_urban.blf", "--vehicle", car, "--report", "drive.html"]) == 0
    page = re.sub(r"<[^>]*>", "", (tmp_path / "drive.html").read_text())
    said = "its range in the database ends at 100 %" if sure else "scale is not confirmed"
    assert said in page
