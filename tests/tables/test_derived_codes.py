"""What is derived of a column is not derived of the numbers in it that stand for "not measured"."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.samples.test_missing_codes import T, motion, places
from tests.tables.reading import read_table


@pytest.mark.parametrize(("heading", "number"), [("lead_speed [m/s]", 0.0), ("headway [s]", 25.5)])
def test_a_lead_of_one_number_in_scattered_rows_is_none(
    heading: str, number: float, tmp_path: Path, seed: int
) -> None:
    """From the first row on: range rates of minus the own speed and gaps of 500 m are in no sample."""
    part = slice(1500)
    now = {role: x[part] for role, x in motion(seed).items()}
    lead, headway = now["speed"] + now["range_rate"], now["gap"] / now["speed"]
    other = ("gap [m]", now["gap"]) if heading.startswith("lead") else ("range_rate [m/s]", now["range_rate"])
    given = np.where(places(seed, 10)[part], number, lead if heading.startswith("lead") else headway)
    columns = [T[part], now["speed"], now["pedal"], other[1], given]
    lines = [f"time [s],speed [m/s],pedal [%],{other[0]},{heading}"]
    lines += [",".join(f"{x:.4f}" for x in row) for row in zip(*columns, strict=True)]
    path = tmp_path / "drive.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    trace = read_table(path)
    for role in ("gap", "range_rate"):
        error = trace.signals[f"{role}_reported"] - np.interp(trace.t, T[part], now[role])
        assert np.nanmax(np.abs(error)) < 0.5
    assert trace.learn.mean() > 0.4
