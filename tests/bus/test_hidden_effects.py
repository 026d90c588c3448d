"""Hidden effects, end to end: a planted drive as frames on a bus, `canid record`, `canid diagnose`, and the name.

Simulator, cause, strength, noise and road are drawn in each run and printed. A clean drive on the same way gets no name.
"""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from canid.io.logs import open_log, write_log
from canid.models.simulation import frames as frames_of
from canid.models.simulation import simulate
from canid.values.types import Flag, Frame
from tests import seeds
from tests.hidden_effects.required_causes import PLANTS
from tests.plants import measurement

SIMULATORS = (*PLANTS, "canid")
NOISES = ("white", "ar1", "mix")
PROFILES = ("mixed", "urban")
# min; long enough for the strengths below, and short enough to be played
MINUTES = 4.0
# cause -> parameter and strengths between which it is drawn; all simulators have these
CAUSES = {
    "relative_speed_dead_zone": ("width", 1.0, 1.3),
    "looming_gain": ("exponent", 0.9, 1.2),
    "pedal_map": ("curvature", 0.65, 0.8),
    "range_rate_scale": ("share", 0.12, 0.2),
    "speed_scale": ("share", 0.03, 0.05),
}
# The virtual machine of vcan runs Python four times slower: there only what the sensing block names, a third of the work.
IN_VM = ("range_rate_scale", "speed_scale")
# Without a bus in between 19 of 19 drives of these strengths were named, at least 85 % (Clopper & Pearson 1934): six
# without a name in a row have a chance of 1e-5, in one of the five tests of a run 5e-5. Of 128 clean drives of 6 to 60 min
# one had a name (docs/evidence/diagnosis.md, and 12 of these): at most 3.7 %, and four in a row 2e-6.
DRIVES, CLEAN_DRIVES = 6, 4
# Factor of real time on buses whose frames the recorder stamps as they arrive: 24 s a drive.
SPEED = 10.0
BUSES = {
    "virtual": [],
    "udp_multicast": [pytest.mark.netns],
    "vcan": [pytest.mark.vcan],
}
ADDRESSES = {
    "udp_multicast": ("-i", "udp_multicast", "-c", "233.252.0.7", "--bus-kwargs", "hop_limit=0"),
    "vcan": ("-i", "socketcan", "-c", "vcan0", "--fd"),
}
# `virtual` is a bus within one process: a thread plays, without pauses, as soon as the recorder listens
WITH_PLAYER = """
import math, os, signal, sys, threading, time
from canid.io.buses.send import onto
from canid.ui.cli import main
from canid.io.logs import open_log

log, recording = sys.argv.pop(1), sys.argv[-1]

def play():
    while not os.path.exists(recording):
        time.sleep(0.01)
    onto({"interface": "virtual", "channel": "hidden"}, open_log(log), speed=math.inf)
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=play, daemon=True).start()
sys.exit(main())
"""


class Drive(NamedTuple):
    """A drive as drawn; no cause: clean."""

    simulator: str
    cause: str
    strength: float
    seed: int
    noise: str
    profile: str

    def write(self, log: Path) -> None:
        """Simulate it and write its frames as a log."""
        if self.simulator == "canid":
            hide = {self.cause: (self.strength,)} if self.cause else {}
            drive = simulate(MINUTES, self.seed, self.profile, self.noise, hide=hide)
            write_log(log, frames_of(drive, measurement.lean()), measurement.START_UTC)
            return
        effects = {self.cause: {CAUSES[self.cause][0]: self.strength}} if self.cause else {}
        planted = PLANTS[self.simulator](
            effects, seed=self.seed, minutes=MINUTES, noise=self.noise, profile=self.profile
        )
        measurement.write(planted, log)


def draw(seed: int, simulator: str, *, bus: str = "", clean: bool = False) -> Drive:
    """Draw a drive of a simulator."""
    rng = np.random.default_rng(seed)
    cause = str(rng.choice(IN_VM if bus == "vcan" else tuple(CAUSES)))
    _, low, high = CAUSES[cause]
    strength = round(rng.uniform(low, high), 3)
    noise, profile = str(rng.choice(NOISES)), str(rng.choice(PROFILES))
    return Drive(simulator, "" if clean else cause, strength, seed, noise, profile)


def recorded(
    bus: str, log: Path, recording: Path, start: Callable[..., Any], listening: Callable[..., Any]
) -> Path:
    """Play a log onto a bus and record it with `canid record`; returns a log of the drive's own duration."""
    if bus == "virtual":
        record = start(
            sys.executable, "-c", WITH_PLAYER, log, "record", "-i", "virtual", "-c", "hidden", "-o", recording
        )
        assert record.end() == 130, record.says()
    else:
        record = listening("record", *ADDRESSES[bus], "-o", recording)
        sender = start(
            "nice",
            "-n",
            "-10",
            sys.executable,
            "-m",
            "canid",
            "replay",
            log,
            "--onto",
            *ADDRESSES[bus],
            "--speed",
            SPEED,
        )
        assert sender.end() == 0, sender.says()
        assert record.end(signal.SIGTERM) == 143, record.says()
    assert " 0 dropped" in record.printed(), record.printed()
    kept = [frame for frame in open_log(recording) if not frame.flags & Flag.ERROR]
    sent = list(open_log(log))
    assert [(frame.id, frame.data) for frame in kept] == [(frame.id, frame.data) for frame in sent]
    if bus == "virtual":
        return recording
    in_real_time = recording.with_name(f"in_real_time_{recording.name}")
    write_log(in_real_time, _in_real_time(kept, sent), measurement.START_UTC)
    return in_real_time


def _in_real_time(kept: list[Frame], sent: list[Frame]) -> list[Frame]:
    """The recording's stamps as if it had been played in real time.

    What the schedulers of two processes add to a stamp is as long at any speed of playing: it is not stretched.
    """
    begin, start = kept[0].t, sent[0].t
    delays = [mine.t - begin - (its.t - start) / SPEED for mine, its in zip(kept, sent, strict=True)]
    print(f"stamps: delays with a standard deviation of {1000 * np.std(delays):.1f} ms")
    t = np.maximum.accumulate([its.t + delay for its, delay in zip(sent, delays, strict=True)])
    return [frame._replace(t=float(now)) for frame, now in zip(kept, t, strict=True)]


Diagnosed = Callable[[str, Drive], dict[str, Any]]


@pytest.fixture
def diagnosed(
    tmp_path: Path, start: Callable[..., Any], listening: Callable[..., Any], canid: Callable[..., Any]
) -> Diagnosed:
    """The report of `canid diagnose` on a drive that went over a bus."""

    def run(bus: str, drive: Drive) -> dict[str, Any]:
        print(drive)
        name = f"{drive.simulator}_{drive.seed}.blf"
        drive.write(tmp_path / name)
        log = recorded(bus, tmp_path / name, tmp_path / f"recorded_{name}", start, listening)
        diagnose = canid("diagnose", log, "--vehicle", measurement.LEAN, "--json", "-")
        assert diagnose.end() == 0, diagnose.says()
        report = dict(json.loads(diagnose.printed()))
        print(report["says"])
        return report

    return run


def names(report: dict[str, Any]) -> set[str]:
    """What a report names, with what explains it as well; the remnant's law is no cause."""
    found = [one for one in report["findings"] if not one["surrogate"] and one["where"] != "remnant"]
    return {name for one in found for name in (one["effect"], *one["rivals"])}


def cases() -> list[Any]:
    """Every simulator on the virtual bus, and one drawn on each of the others; CANID_ALL_CASES=1: all on all."""
    out = []
    for bus, marks in BUSES.items():
        parts = 1 if bus == "virtual" else len(SIMULATORS)
        every = [(bus, simulator) for simulator in SIMULATORS]
        out += seeds.in_turn(every, parts, f"simulator on {bus}", marks)
    return out


@pytest.mark.slow("sessions on a bus in real time")
@pytest.mark.parametrize(("bus", "simulator"), cases())
# on nine of ten drives the cause is named
@seeds.by_chance(0.1**DRIVES)
def test_a_hidden_effect_is_named_from_a_recording(
    bus: str, simulator: str, seed: int, diagnosed: Diagnosed
) -> None:
    """On the first drive, or on one of `DRIVES` at most."""
    instead = []
    for k in range(DRIVES):
        drive = draw(seed + k, simulator, bus=bus)
        found = names(diagnosed(bus, drive))
        if drive.cause in found:
            return
        instead.append((drive, found))
    pytest.fail(f"not named; named instead: {instead}")


# one bus per run, as the kernel's is tested in a machine of its own
@pytest.mark.slow("sessions on a bus in real time")
@pytest.mark.parametrize("bus", [pytest.param(bus, marks=BUSES[bus]) for bus in ("virtual", "udp_multicast")])
# one of 144 clean drives had a name: at most 3.3 % have
@seeds.by_chance(0.033**CLEAN_DRIVES)
def test_a_clean_drive_gets_no_name_from_a_recording(bus: str, seed: int, diagnosed: Diagnosed) -> None:
    """On the first drive, or on one of `CLEAN_DRIVES` at most."""
    instead = []
    for k in range(CLEAN_DRIVES):
        drive = draw(seed + k, SIMULATORS[seed % len(SIMULATORS)], clean=True)
        report = diagnosed(bus, drive)
        # stamps that a busy machine has scattered are noticed: nothing can be named then, and nothing is shown
        if not names(report) and report["verdict"] != "not_enough_data":
            return
        instead.append((drive, report["verdict"], names(report)))
    pytest.fail(f"named on clean drives, or not to be judged: {instead}")
