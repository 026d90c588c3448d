"""ASAM .mf4 in every dialect of docs/formats/mf4.md, against frames that are known before they are written."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from canid.io.logs import open_log
from canid.values.errors import ConfigError
from canid.values.frame_columns import frames_of
from canid.values.types import Flag
from tests.formats_oracle import mf4_files
from tests.formats_oracle.comparison import differences

asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed: pip install canid[mf4]")


@pytest.mark.slow("forty files, each opened by asammdf in a child process")
def test_each_dialect_gives_the_frames_that_were_written(tmp_path: Path, seed: int) -> None:
    """Ids, data, times, buses and flags of random valid and cut files; nothing is lost uncounted."""
    rng = random.Random(seed)
    for k in range(40):
        written = mf4_files.draw(rng)
        print(k, written.properties, len(written.frames), written.counts)
        assert differences(written, tmp_path / f"{k}.mf4") == []


@pytest.mark.slow("whole logs")
@pytest.mark.parametrize(
    ("name", "frames", "errors", "buses", "standard"),
    [
        ("plain", 50, 0, {0}, 25),
        ("noide", 50, 0, {0}, 25),
        ("err_scalar", 53, 3, {0}, 25),
        ("err_bytes", 53, 3, {0}, 25),
        ("two", 100, 0, {0, 1}, 50),
        ("empty_group", 50, 0, {1}, 25),
        ("cut20000", 347, 0, {0}, 347),
    ],
)
def test_reported_files(
    name: str, frames: int, errors: int, buses: set[int], standard: int, measured: Path
) -> None:
    """The reported files: all whole frames, their buses and ids; what is missing is counted."""
    log = open_log(measured / "reports" / "16-mf4" / f"{name}.mf4")
    got = [frame for chunk in log.columns() for frame in frames_of(chunk)]
    assert len(got) == frames
    assert sum(bool(frame.flags & Flag.ERROR) for frame in got) == errors
    assert {frame.bus for frame in got} == buses
    assert sum(not frame.flags & (Flag.EXTENDED | Flag.ERROR) for frame in got) == standard
    assert log.damaged == (name == "cut20000")


def test_a_measurement_of_signals_says_what_it_is(measured: Path) -> None:
    """A decoded .mf4 is no damaged log: the message names its signals and what reads them."""
    with pytest.raises(ConfigError, match=r"decoded signals .VehicleSpeed, Gap., without CAN frames"):
        open_log(measured / "reports" / "16-mf4" / "signals.mf4")


def test_groups_without_channel_numbers_are_buses_by_their_sources(tmp_path: Path) -> None:
    """A group for each bus, distinguished by what acquired it (ASAM MDF 4.1, SIBLOCK)."""
    file = asammdf.MDF(version="4.10")
    for name, id_ in (("CAN10", 0x10), ("CAN2", 0x2)):
        source = asammdf.Source(name=name, path=name, comment="", source_type=2, bus_type=2)
        columns = {
            "ID": np.full(3, id_, "<u4"),
            "DLC": np.full(3, 2, "u1"),
            "DataBytes": np.full((3, 8), id_, "u1"),
        }
        types = [(f"CAN_DataFrame.{key}", x.dtype, x.shape[1:]) for key, x in columns.items()]
        samples = np.rec.fromarrays(list(columns.values()), dtype=types)
        signal = asammdf.Signal(samples, np.arange(3.0), name="CAN_DataFrame", source=source)
        file.append([signal], acq_name=name, acq_source=source)
    file.save(tmp_path / "x.mf4")
    log = open_log(tmp_path / "x.mf4")
    assert {(frame.bus, frame.id) for frame in log} == {(0, 0x2), (1, 0x10)}
    assert [*log.remarks] == ["it has no channel numbers: CAN2 is bus 0, CAN10 is bus 1"]
