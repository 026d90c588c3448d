"""Every verb, as a user runs it on a real log of replay_logs."""

from __future__ import annotations

import argparse
import json
import os
import pty
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canid.io.logs import open_log
from canid.signals.vehicle import read_vehicle
from canid.ui.cli.verb import Verb
from canid.ui.cli.verbs import VERBS
from canid.values.errors import CHECK_FAILED, DONE
from canid.values.shipped_files import shipped
from tests.fixtures.measured_logs import MEASURED, needs_measured

Canid = Callable[..., Any]
ROOT = Path(__file__).parents[2]
URBAN = ROOT / "replay_logs/following_urban.blf"
INTERVAL = {"value", "low", "high"}
CHANNEL = {"K", "tau", "dead_time", "tau_plus_dead_time", "status"}
# s of the log: both estimators have begun by then, and it is read in a second
PART = ("--vehicle", "generic", "--stop", 40)


def is_estimate(line: dict[str, Any]) -> None:
    """The names of docs/json.md are there."""
    assert {"t", "estimator", "status", "says", "channels", "fit_percent", "excitation", "used"} <= set(line)
    assert line["estimator"] in ("armax", "fopdt")
    assert set(line["channels"]) == {"headway_error", "range_rate"}
    for channel in line["channels"].values():
        assert set(channel) >= CHANNEL
        for name in CHANNEL - {"status"}:
            assert set(channel[name]) == INTERVAL


@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: verb.name)
def test_every_option_is_explained(canid: Canid, verb: Verb) -> None:
    """`canid VERB --help` ends with 0, and no option or argument of it is without an explanation."""
    ran = canid(verb.name, "--help")
    assert (ran.code, ran.err) == (DONE, "")
    parser = argparse.ArgumentParser()
    verb.module().arguments(parser)
    parts = (
        [one for action in parser._actions for one in dict(action.choices or {}).values()]
        if verb.name == "study"
        else [parser]
    )
    for part in parts:
        actions = [action for action in part._actions if action.dest != "help"]
        assert actions
        assert [action.dest for action in actions if not action.help] == []
        # what `schema` prints is JSON
        assert verb.name == "schema" or any(action.dest == "json" for action in actions)


def test_help_lists_the_verbs(canid: Canid) -> None:
    """Every verb is in `canid --help`; without arguments the same text comes with exit 2."""
    ran = canid("--help")
    assert ran.code == DONE
    assert all(verb.name in ran.out and verb.help in ran.out for verb in VERBS)
    assert (canid().code, canid().out) == (2, ran.out)
    assert re.fullmatch(r"canid \d+\.\d+\.\d+\n", canid("--version").out)


# --- replay -----------------------------------------------------------------------------------------------


@pytest.mark.slow("whole commands, one after the other")
def test_replay_gives_estimates_as_lines(canid: Canid) -> None:
    """`--json -` puts JSON lines alone on standard output, every one with the promised names; twice the same."""
    ran = canid("replay", URBAN, *PART, "--json", "-")
    assert ran.code == DONE
    lines = [json.loads(line) for line in ran.out.splitlines()]
    assert len(lines) > 140  # two estimators, twice a second
    for line in lines:
        is_estimate(line)
    assert any(line["status"] == "ok" for line in lines)
    assert "Generic car-following vehicle" in ran.err  # the summary goes to standard error here
    assert canid("replay", URBAN, *PART, "--json", "-").out == ran.out


def test_replay_of_a_part(canid: Canid) -> None:
    """Between --start and --stop, with the log's own times."""
    ran = canid("replay", URBAN, "--vehicle", "generic", "--start", 20, "--stop", 25, "--json", "-")
    times = [json.loads(line)["t"] for line in ran.out.splitlines()]
    assert 20.0 <= min(times) < 21.0
    assert 23.0 < max(times) <= 25.0


def test_replay_keeps_its_pace(canid: Canid) -> None:
    """20 s at --speed 40 take half a second and give what --speed max gives."""
    words = ("replay", URBAN, "--vehicle", "generic", "--stop", 20, "--json", "-")
    fast = canid(*words, "--speed", "max")
    began = time.monotonic()
    paced = canid(*words, "--speed", 40)
    # it cannot be faster; a busy machine may be slower
    assert time.monotonic() - began > 0.45
    assert paced.out == fast.out


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_replay_cleanly(tmp_path: Path, number: int, code: int) -> None:
    """Interrupted: one message, the exit code of the signal, and complete JSON lines of the estimates so far."""
    output = tmp_path / "estimates.jsonl"
    words = [
        "-m",
        "canid",
        "replay",
        str(URBAN),
        "--vehicle",
        "generic",
        "--speed",
        "1",
        "--json",
        str(output),
    ]
    process = subprocess.Popen(
        [sys.executable, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert process.stdout is not None
    # the second estimator speaks once the first one's line is in the file
    for _ in range(2):
        assert "converging" in process.stdout.readline()
    process.send_signal(number)
    _, said = process.communicate(timeout=600)
    assert (process.returncode, said) == (code, "canid: interrupted\n")
    lines = output.read_text().splitlines()
    assert lines
    for line in lines:
        is_estimate(json.loads(line))


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("setting", ["", "NO_COLOR=1", "TERM=dumb", "TERM=xterm"])
def test_plain_lines_without_a_terminal(shell: Callable[[str], Any], setting: str) -> None:
    """A pipe gets lines of text without any control character, whatever the environment."""
    ran = shell(
        f"{setting + ' ' if setting else ''}canid replay {shlex.quote(str(URBAN))} --vehicle generic --stop 10"
    )
    assert ran.code == DONE
    assert not re.search(r"[\x00-\x09\x0b-\x1f]", ran.out + ran.err)
    assert re.search(r"^ +\d+\.\d s  ARMAX +converging", ran.out, re.MULTILINE)


def on_a_terminal(monkeypatch: pytest.MonkeyPatch, **environment: str) -> str:
    """The output of `canid replay` on a terminal."""
    environment |= {"COLUMNS": "100", "LINES": "40", "PYTHONPATH": str(ROOT)}
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    said = b""

    def read(fd: int) -> bytes:
        nonlocal said
        got = os.read(fd, 4096)
        said += got
        return b"\n"  # pytest's own output does not want it

    words = [sys.executable, "-m", "canid", "replay", str(URBAN), "--vehicle", "generic", "--stop", "3"]
    assert pty.spawn(words, read, lambda _: b"") == 0
    return said.decode()


@pytest.mark.slow("whole commands, one after the other")
def test_the_live_view_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal gets the live view, in color; with NO_COLOR without colors; a dumb one gets plain lines."""
    color = r"\x1b\[(?:\d+;)*3[0-7](?:;\d+)*m"
    shown = on_a_terminal(monkeypatch, TERM="xterm")
    assert "REPLAY" in shown
    assert re.search(color, shown)
    shown = on_a_terminal(monkeypatch, TERM="xterm", NO_COLOR="1")
    assert "REPLAY" in shown
    assert not re.search(color, shown)
    monkeypatch.delenv("NO_COLOR")
    assert "\x1b" not in on_a_terminal(monkeypatch, TERM="dumb")


# --- identify, check, init, simulate ----------------------------------------------------------------------


@pytest.mark.slow("whole commands, one after the other")
def test_identify(canid: Canid) -> None:
    """One object with the promised names, all numbers finite or null; a list for several logs; and a table."""
    ran = canid("identify", URBAN, *PART, "--json", "-")
    assert ran.code == DONE
    result = json.loads(ran.out)
    assert {"log", "vehicle", "duration", "driver_time", "windows", "whole", "armax"} <= set(result)
    assert result["vehicle"] == "Generic car-following vehicle"
    assert 38.0 < result["duration"] <= 40.0
    assert {"channels", "fit_percent"} <= set(result["whole"])
    for line in result["windows"]:
        is_estimate(line)
    assert {"A", "B", "C", "K", "poles", "whiteness"} <= set(result["armax"])
    assert set(result["armax"]["K"]["range_rate"]) == INTERVAL
    # the table goes to standard error while the JSON goes to standard output
    assert "range rate: K" in ran.err
    assert "ARMAX" in ran.err
    both = canid("identify", URBAN, URBAN, "--vehicle", "generic", "--stop", 5, "--json", "-")
    one, other = json.loads(both.out)
    assert one == other


@pytest.mark.long("verbs on whole logs")
def test_check(canid: Canid, log: Path) -> None:
    """Exit 0 where nothing is missing; each role with unit, source and numbers; ids alone without a vehicle file."""
    ran = canid("check", log, "--vehicle", "generic", "--json", "-")
    assert ran.code == DONE
    result = json.loads(ran.out)
    assert result["problems"] == []
    assert result["roles"]["speed"]["unit"] == "m/s"
    assert re.fullmatch(r"EGO_SPEED\.VehicleSpeed \(0x[0-9A-F]+\)", result["roles"]["speed"]["from"])
    ran = canid("check", log, "--vehicle", "generic")
    assert "✓ the vehicle file fits" in ran.out
    # units as on every page
    assert re.search(r"^accel +m/s² ", ran.out, re.M)
    ids = json.loads(canid("check", log, "--json", "-").out)
    assert ids["frames"] == result["frames"] == sum(each["frames"] for each in ids["ids"])
    assert canid("check", "--vehicle", "generic").code == DONE
    assert "socketcan" in canid("check").out


def test_check_of_the_wrong_vehicle_fails(canid: Canid, log: Path, tmp_path: Path) -> None:
    """A range rate with the wrong sign is found; exit 1, and the remedy is named."""
    text = (shipped() / "generic.toml").read_text()
    wrong = text.replace('"RADAR_LEAD.LeadRelSpeed"', '{ signal = "RADAR_LEAD.LeadRelSpeed", scale = -1 }')
    assert wrong != text
    shutil.copy(shipped() / "generic.dbc", tmp_path)
    (tmp_path / "car.toml").write_text(wrong)
    ran = canid("check", log, "--vehicle", tmp_path / "car.toml")
    assert ran.code == CHECK_FAILED
    assert "scale = -1" in ran.out


def test_init_proposes_the_generic_vehicle(canid: Canid, tmp_path: Path) -> None:
    """The proposal for the generic DBC works unchanged, from another folder, with the same estimates."""
    car = tmp_path / "deep" / "car.toml"
    car.parent.mkdir()
    ran = canid("init", shipped() / "generic.dbc", "-o", car, "--json", "-")
    assert ran.code == DONE
    assert json.loads(ran.out)["proposed"]["signals"]["pedal"] == "ENGINE_DATA.PedalPosition"
    words = ("--stop", 20, "--json", "-")
    ours = canid("replay", URBAN, "--vehicle", "generic", *words)
    theirs = canid("replay", URBAN, "--vehicle", car, *words)
    assert theirs.out == ours.out


@pytest.mark.slow("whole commands, one after the other")
@needs_measured
@pytest.mark.parametrize(
    ("files", "log", "by_hand", "slow"),
    [
        (
            ("openacc/car_following.dbc",),
            "openacc/human_h22_v3.blf",
            ROOT / "dbc/openacc.toml",
            "range rate is 0.10 s",
        ),
        (
            ("openlka/openlka.dbc",),
            "openlka/equinox_0_1-0.blf",
            MEASURED / "openlka/openlka.toml",
            "gap comes at 3.3 Hz, joined by lines",
        ),
        (("rav4/toyota_pt.dbc", "rav4/toyota_radar.dbc"), "rav4/rav4_highway.blf", None, "no such signal"),
    ],
)
def test_init_with_a_log_needs_no_edit(
    canid: Canid, tmp_path: Path, files: tuple[str, ...], log: str, by_hand: Path | None, slow: str
) -> None:
    """The proposal for a measured drive works as it is, with the signals that a person chose.

    What is slow or late in two of them is so in the recording (docs/signal_checks.md, measured logs).
    """
    car = tmp_path / "car.toml"
    ran = canid("init", *(MEASURED / file for file in files), "--log", MEASURED / log, "--yes", "-o", car)
    assert ran.code == DONE
    checked = canid("check", "--vehicle", car, MEASURED / log)
    # cruise control drives the whole minute of the Equinox, and most of that of the RAV4: the signals fit, and of the log
    # nothing may be quoted, which `identify` says too
    problems = [line for line in checked.out.replace("\n  ", " ").splitlines() if line.startswith("✗")]
    few = "8 s are usable for identification; too few"
    assert all(
        few in line or slow in line or ("nothing can be estimated" in line and "(cruise)" in line)
        for line in problems
    )
    assert checked.code == (CHECK_FAILED if problems else DONE)
    vehicle = read_vehicle(car)
    chosen = {role: (of.message, of.signal) for role, of in vehicle.roles.items()}
    if by_hand is not None:
        ours = tomllib.loads(by_hand.read_text())["signals"]
        assert {role: ".".join(of) for role, of in chosen.items()} == {
            role: of if isinstance(of, str) else of["signal"] for role, of in ours.items()
        }
        return
    assert vehicle.lead.tracks is not None
    assert {track.bus for track in vehicle.lead.tracks} == {1}
    assert chosen["brake"] == (
        "BRAKE_MODULE",
        "BRAKE_PRESSED",
    )  # another one is on while cruise control brakes
    assert chosen["speed"] == ("SPEED", "SPEED")
    assert vehicle.roles["accel"].how.factor < 0  # it grows when the car brakes
    assert vehicle.roles["pedal"].bus == 0


@pytest.mark.long("verbs on whole logs")
def test_simulate_is_reproducible(canid: Canid, tmp_path: Path) -> None:
    """The same seed gives the same bytes and truth, another seed other bytes; the truth is next to the log."""
    for name, seed in (("a", 7), ("b", 7), ("c", 8)):
        assert canid("simulate", tmp_path / f"{name}.blf", "--minutes", 0.2, "--seed", seed).code == DONE
    a, b, c = ((tmp_path / f"{name}.blf").read_bytes() for name in "abc")
    assert a == b != c
    truth = (tmp_path / "a.truth.json").read_text()
    assert truth == (tmp_path / "b.truth.json").read_text()
    assert {"K", "tau", "dead_time"} <= set(json.loads(truth)["channels"]["range_rate"])
    ran = canid("simulate", tmp_path / "d.asc", "--minutes", 0.2, "--seed", 7, "--json", "-")
    assert ran.out == truth
    assert canid("simulate", tmp_path / "long.asc", "--minutes", 2, "--seed", 7).code == DONE
    assert canid("check", tmp_path / "long.asc", "--vehicle", "generic").code == DONE
    checked = canid("check", tmp_path / "d.asc", "--vehicle", "generic")
    # every signal fits; of 12 s nothing may be quoted
    assert checked.code == CHECK_FAILED
    assert "10 s are usable for identification; too few" in checked.out


# --- demo -------------------------------------------------------------------------------------------------


@pytest.mark.slow("whole commands, one after the other")
def test_demo(canid: Canid, tmp_path: Path) -> None:
    """No hardware, no files: truth first, estimates next to it at the end, the recording is there; exit 0."""
    ran = canid("demo", "-o", tmp_path / "out", "--speed", 60, "--json", tmp_path / "demo.jsonl")
    assert ran.code == DONE, ran
    assert re.search(r"truth: range rate: K \d+\.\d\d, τ", ran.err)
    assert re.search(r"range rate +K +\d.*truth \d+\.\d\d: (inside|OUTSIDE)", ran.out)
    for line in (tmp_path / "demo.jsonl").read_text().splitlines():
        is_estimate(json.loads(line))
    assert canid("check", tmp_path / "out/demo.blf", "--vehicle", "generic").code == DONE
    # the hidden effect is found from what was recorded of the bus, which is what was simulated
    assert "CAUSE FOUND" in ran.out
    assert str(tmp_path / "out/hidden_recorded.blf") in ran.out
    sent, recorded = (
        [(frame.t, frame.id, frame.data) for frame in open_log(tmp_path / "out" / name)]
        for name in ("hidden.blf", "hidden_recorded.blf")
    )
    assert [row[1:] for row in recorded] == [row[1:] for row in sent]
    assert max(abs(one[0] - two[0]) for one, two in zip(recorded, sent, strict=True)) < 1e-6
