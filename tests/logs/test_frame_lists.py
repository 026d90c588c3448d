"""Lists of frames of no known program: the unit of times is what the header states, else what the frames show."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from canid.io.logs.log import open_log

HEADS = {"Time": None, "Timestamp": None, "Time (s)": 1.0, "Time [s]": 1.0}


@pytest.mark.parametrize("head", HEADS)
@pytest.mark.parametrize(("unit", "start"), [(1.0, 0.0), (1e3, 0.0), (1.0, 1_785_924_000.0)])
def test_times_of_a_list_of_frames(tmp_path: Path, head: str, unit: float, start: float, seed: int) -> None:
    """In s or ms, since 0 or 1970, ids of drawn periods from 5 ms to 2.5 s: the log lasts as long as it did."""
    rng = np.random.default_rng(seed)
    periods = np.append(rng.uniform(0.005, 0.1), rng.uniform(0.02, 2.5, int(rng.integers(0, 4))))
    stamps = sorted(
        (round(k * period, 6), 0x100 + n)
        for n, period in enumerate(periods)
        for k in range(round(20 / period))
    )
    lines = [f"{unit * (start + t):.6f},0x{id_:X},2,01 {n % 256:02X}" for n, (t, id_) in enumerate(stamps)]
    path = tmp_path / "x.csv"
    path.write_text("\n".join([f"{head},ID,DLC,Data", *lines, ""]))
    log = open_log(path)
    frames = list(log)
    stated = HEADS[head] is not None
    shown = unit if stated else 1.0
    assert [frame.id for frame in frames] == [id_ for _, id_ in stamps]
    assert frames[-1].t == pytest.approx(shown * (stamps[-1][0] - stamps[0][0]), abs=1e-3)
    assert any("times are read as ms" in says for says in log.remarks) == (unit == 1e3 and not stated)
    if start:
        assert log.start_utc == pytest.approx(start, abs=1e-3)
