"""Frames that are earlier than a log's first line: no verb leaves one out that nobody asked to leave out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canid.io.logs import open_log
from canid.ui.cli import main

DBC = """VERSION ""
BU_: A
BO_ 256 M1: 2 A
 SG_ S : 0|16@1+ (1,0) [0|0] "m/s" A
BO_ 512 M2: 2 A
 SG_ T : 0|16@1+ (1,0) [0|0] "m" A
"""


def log_text(seed: int, spread: float, suffix: str) -> str:
    """250 frames of two buses; 150 on bus 0, of which the earliest are up to `spread` s before the first line."""
    early = sorted([-spread, *np.random.default_rng(seed).uniform(-spread, 10.0, 149).round(6).tolist()])
    frames = [(0.0, 1, 0x200, 0)]
    frames += [(t, 0, 0x100, k) for k, t in enumerate(early)] + [
        (k * 0.1, 1, 0x200, k) for k in range(1, 100)
    ]
    if suffix == ".log":
        return "".join(f"({1.7e9 + t:.6f}) can{bus} {id_:03X}#{k:02X}00\n" for t, bus, id_, k in frames)
    head = "base hex  timestamps absolute\ninternal events logged\n"
    return head + "".join(
        f"{10 + t:11.6f} {bus + 1}  {id_:X}  Rx   d 2 {k:02X} 00\n" for t, bus, id_, k in frames
    )


@pytest.mark.parametrize("spread", [0.0003, 0.09, 5.0])
@pytest.mark.parametrize("suffix", [".log", ".asc"])
def test_every_verb_has_the_frames_before_the_first_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: int, suffix: str, spread: float
) -> None:
    """What the file has, `check`, `look`, `export`, `replay --onto` and `recover` have."""
    path, dbc = tmp_path / f"early{suffix}", tmp_path / "s.dbc"
    path.write_text(log_text(seed, spread, suffix))
    dbc.write_text(DBC)
    assert min(frame.t for frame in open_log(path)) < 0.0

    def ran(*words: str) -> Any:
        assert main([*words, "--json", str(tmp_path / "j.json")]) == 0
        capsys.readouterr()
        return json.loads((tmp_path / "j.json").read_text())

    assert ran("check", str(path))["frames"] == 250
    assert ran("look", str(path))["frames"] == 250
    for kind in ("csv", "mcap", "mat"):
        files = ran("export", str(path), "--dbc", str(dbc), "--to", kind, "-o", str(tmp_path / "out"))
        assert sorted(each["rows"] for one in files for each in one.get("tables", [one])) == [100, 150]
    sent = ran("replay", "--onto", str(path), "-i", "virtual", "-c", "early", "--speed", "max")
    assert (sent["sent"], sent["not_sent"]) == (250, 0)
    assert ran("recover", str(path), "-o", str(tmp_path / f"copy{suffix}"))["frames"] == 250
    assert len(list(open_log(tmp_path / f"copy{suffix}"))) == 250


def test_a_start_that_is_asked_for_leaves_out_what_is_earlier(tmp_path: Path, seed: int) -> None:
    """`--start 0` is the first line; without it there is no start."""
    path = tmp_path / "early.log"
    path.write_text(log_text(seed, 5.0, ".log"))
    assert main(["look", str(path), "--start", "0", "--json", str(tmp_path / "j.json")]) == 0
    shown = json.loads((tmp_path / "j.json").read_text())
    assert shown["frames"] == sum(frame.t >= 0.0 for frame in open_log(path)) < 250
