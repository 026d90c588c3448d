"""Logs without a date that were appended: the further recording is set behind the first, once, in every dialect."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from canid.io.logs import open_log
from canid.signals.samples.session_clock import CUT_S

Rows = list[tuple[float, int, int, bytes]]


def drive(rng: random.Random, seconds: float, zero: float) -> Rows:
    """Periodic ids on two buses."""
    frames = []
    for bus, id_, period in ((0, 0x100, 0.01), (0, 0x200, 0.02), (1, 0x300, 0.05)):
        shift = rng.uniform(0, period)
        frames += [
            (round(zero + shift + k * period, 4), bus, id_, rng.randbytes(8))
            for k in range(int(seconds / period))
        ]
    return sorted(frames)


def asc(rows: Rows) -> str:
    lines = [
        f"   {t:.4f} {bus + 1}  {id_:X}             Rx   d 8 {data.hex(' ')}" for t, bus, id_, data in rows
    ]
    return "\n".join(["base hex  timestamps absolute", "no internal events logged", *lines]) + "\n"


def screen(rows: Rows) -> str:
    return "".join(
        f" ({t:010.6f})  can{bus}  {id_:03X}   [8]  {data.hex(' ').upper()}\n" for t, bus, id_, data in rows
    )


def gvret(rows: Rows) -> str:
    head = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
    return head + "".join(
        f"{round(t * 1e6)},{id_:08X},false,Rx,{bus},8,{data.hex(',').upper()},\n"
        for t, bus, id_, data in rows
    )


def table(rows: Rows) -> str:
    return "Time (s),Bus,ID (hex),Data\n" + "".join(
        f"{t:.4f},{bus},{id_:x},{data.hex()}\n" for t, bus, id_, data in rows
    )


DIALECTS = ((asc, ".asc"), (screen, ".log"), (gvret, ".csv"), (table, ".csv"))


@pytest.mark.long("many or long logs")
@pytest.mark.parametrize(("dialect", "suffix"), DIALECTS)
def test_an_appended_recording_is_set_behind_the_first(
    dialect: Callable[[Rows], str], suffix: str, tmp_path: Path, seed: int
) -> None:
    """None of its frames is lost or interleaved; it is said once, and which ids are asked for changes nothing."""
    rng = random.Random(seed)
    durations = rng.uniform(20, 45), rng.uniform(5, 57), rng.uniform(5, 57)
    parts = [drive(rng, seconds, rng.choice((0.0, 0.3))) for seconds in durations]
    path = tmp_path / f"drive{suffix}"
    path.write_text("".join(map(dialect, parts)))
    log = open_log(path)
    read = list(log)
    assert [(frame.bus, frame.id, frame.data) for frame in read] == [
        row[1:] for part in parts for row in part
    ]
    wanted, first = [], parts[0][0][0]
    end = first - CUT_S
    for part in parts:
        wanted += [end + CUT_S + row[0] - part[0][0] for row in part]
        end = wanted[-1]
    assert np.array([frame.t for frame in read]) == pytest.approx(np.array(wanted) - first, abs=1e-6)
    says = [text for text in log.remarks if "a further recording begins" in text]
    assert len(says) == 2
    few = np.concatenate([chunk.t for chunk in log.columns([0x300])])
    assert few.tolist() == [frame.t for frame in read if frame.id == 0x300]


@pytest.mark.parametrize("case", ["by bus", "one stamp", "wrap", "late buffer", "twice"])
def test_what_is_one_recording_stays_one(case: str, tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    rows = drive(rng, 100.0, 0.0)
    if case == "by bus":
        rows.sort(key=lambda row: row[1])
    elif case == "one stamp":
        k = rng.randrange(5000, 6000)
        rows[k] = (0.5, *rows[k][1:])
    elif case == "wrap":
        rows = [(round(t % 60.0, 4), *rest) for t, *rest in rows]
    elif case == "late buffer":
        rows.sort(key=lambda row: row[0] + 3.0 * (row[1] == 1 and row[0] < 50))
    text = asc(rows)
    path = tmp_path / "drive.asc"
    path.write_text(text + text.split("logged\n")[1] * (case == "twice"))
    log = open_log(path)
    read = [frame.t for frame in log]
    assert not any("further recording" in says for says in log.remarks)
    assert read == pytest.approx([t - rows[0][0] for t, *_ in rows], abs=1e-6)
