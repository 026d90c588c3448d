"""Whatever the clocks that stamp frames do, every frame stands in a file at its own stamp, for any reader."""

from __future__ import annotations

import random
import threading
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from canid.io.logs import open_log
from canid.io.logs.recovery import recover
from canid.io.recording.clock_events import ClockEvents
from canid.io.recording.log_writer_thread import LogWriterThread
from canid.io.recording.rotation import Rotation
from canid.io.recording.running_time import MAX_BACK_NS, RunningTime
from canid.values.frame_columns import CLASSIC_BYTES
from canid.values.types import Columns
from tests.fixtures.readers import by_python_can, by_tshark

S = 10**9
EPOCH = 1_790_000_000 * S + 123_456_789
FORMATS = (".blf", ".asc", ".log")


def drawn_stamps(rng: random.Random, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Epoch ns of n frames in the order in which they came, and the bus of each."""
    ns = np.cumsum(np.array([rng.choice((0, 100_000, 1_000_000)) for _ in range(n)])) + rng.choice(
        (EPOCH, EPOCH, 12 * S, 700_000_000)
    )
    bus = np.array([rng.randrange(rng.choice((1, 2, 3))) for _ in range(n)])
    kind = rng.choice(("small", "hour", "swap", "offset", "backwards", "ntp", "all"))
    at = rng.randrange(1, n)
    if kind in ("small", "all"):
        ns[at:] -= rng.choice((1, 3_000_000, 400_000_000, 900_000_000))
    if kind in ("hour", "all"):
        ns[at:] += rng.choice((-3600, 3600)) * S
    if kind in ("swap", "all"):
        ns[[0, 1]] = ns[[1, 0]] + np.array([3_000_000, 0])
    if kind in ("offset", "all"):
        ns[bus == 1] -= rng.choice((5, 400, 86_400)) * S
    if kind == "backwards":
        ns = ns[0] - (ns - ns[0]) * rng.choice((1, 1000))
    if kind == "ntp":
        ns[:at] = 50 * S + ns[:at] - ns[0]
    return np.maximum(ns, 0), bus


def recorded(
    folder: Path, suffix: str, ns: np.ndarray, bus: np.ndarray, rotation: Rotation | None = None
) -> list[Path]:
    """Record these frames, numbered, through the writing thread; the files in the order of the recording."""
    begun: list[Path] = []
    log = LogWriterThread(
        folder / f"x{suffix}", rotation, lambda *_: None, lambda path, *_: begun.append(path)
    )
    log.start()
    step = 37
    for row in range(0, len(ns), step):
        k = np.arange(row, min(row + step, len(ns)))
        data = np.zeros((len(k), CLASSIC_BYTES), np.uint8)
        data[:, :4] = k.astype(">u4").view(np.uint8).reshape(-1, 4)
        chunk = Columns(
            (ns[k] - ns[0]) * 1e-9,
            bus[k].astype(np.uint16),
            (k % 2048).astype(np.uint32),
            np.zeros(len(k), np.uint8),
            np.full(len(k), 4, np.uint8),
            data,
        )
        log.put(chunk, 0.0, int(ns[0]))
        if rotation is not None:
            threading.Event().wait(0.001)
    log.close()
    assert log.files.written == len(ns)
    return list(dict.fromkeys(begun))


def as_read(paths: list[Path], by: str) -> tuple[list[int], list[float]]:
    """Numbers and absolute stamps, s, as another program reads them."""
    numbers, times = [], []
    for path in paths:
        found = by_python_can(path) if by == "python-can" else by_tshark(path)
        if found is None:
            pytest.skip("tshark is not installed")
        assert found.complaint == ""
        numbers += [int.from_bytes(data[:4], "big") for _, data in found.frames]
        times += found.times
    return numbers, times


@pytest.mark.parametrize("trial", range(6))
@pytest.mark.parametrize("suffix", FORMATS)
def test_python_can_reads_every_frame_at_its_stamp(
    suffix: str, trial: int, seed: int, tmp_path: Path
) -> None:
    """Steps of any size, offsets between buses, swapped frames, a clock that runs backwards: order and stamps survive."""
    rng = random.Random(f"{seed} {trial} {suffix}")
    ns, bus = drawn_stamps(rng, 400)
    rotation = rng.choice((None, Rotation(time=60.0), Rotation(size=20_000)))
    paths = recorded(tmp_path, suffix, ns, bus, rotation)
    numbers, times = as_read(paths, "python-can")
    assert numbers == list(range(len(ns)))
    assert np.abs(np.array(times) - ns * 1e-9).max() < 1.2e-6  # us in the text formats, 0.24 us by its floats


@pytest.mark.parametrize("trial", range(3))
def test_tshark_reads_every_frame_at_its_stamp(trial: int, seed: int, tmp_path: Path) -> None:
    """The same of a .blf by Wireshark's reader, which shares no code with python-can's."""
    ns, bus = drawn_stamps(random.Random(f"{seed} {trial}"), 300)
    numbers, times = as_read(recorded(tmp_path, ".blf", ns, bus), "tshark")
    assert numbers == list(range(len(ns)))
    assert np.abs(np.array(times) - ns * 1e-9).max() < 1e-6


@pytest.mark.parametrize("target", FORMATS)
def test_a_recovered_copy_keeps_stamps_before_the_first(target: str, seed: int, tmp_path: Path) -> None:
    """A candump log whose lines are out of order, by ms or by days: python-can reads the copy at the same stamps."""
    rng = random.Random(f"{seed} {target}")
    ns, _ = drawn_stamps(rng, 50)
    # a drawn step back to 1970 would double the stamps, and the floats that python-can gives them in are as coarse again
    ns = EPOCH + np.abs(ns - ns[0]) % (300 * 86_400 * S) // 1000 * 1000 + 400_000 * S
    ns[1] -= rng.choice((5_000_000, 86_400 * S))
    lines = [f"({at // S}.{at % S // 1000:06d}) can0 123#{k:08X}" for k, at in enumerate(ns.tolist())]
    (tmp_path / "y.log").write_text("\n".join(lines) + "\n")
    recover(tmp_path / "y.log", tmp_path / f"z{target}")
    numbers, times = as_read([tmp_path / f"z{target}"], "python-can")
    assert numbers == list(range(len(ns)))
    assert np.abs(np.array(times) - ns * 1e-9).max() < 1.2e-6
    assert open_log(tmp_path / f"z{target}").start_utc == pytest.approx(ns[0] * 1e-9, abs=1e-6)


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_clock_that_runs_backwards_begins_some_files_not_thousands(suffix: str, tmp_path: Path) -> None:
    """Each new file has twice the room of the one before."""
    ns = EPOCH - np.arange(3000) * 20 * S
    paths = recorded(tmp_path, suffix, ns, np.zeros(len(ns), np.int64))
    assert len(paths) <= 20
    assert as_read(paths, "python-can")[0] == list(range(len(ns)))


@pytest.mark.parametrize("apart", [5, -400, 86_400])
def test_buses_whose_clocks_differ_share_files_of_the_asked_length(apart: int, tmp_path: Path) -> None:
    """20 s of two buses in files of 5 s: four files, not one more for each change between the buses."""
    ns = EPOCH + np.arange(4000) * 5_000_000
    bus = np.arange(4000) % 2
    paths = recorded(tmp_path, ".blf", ns + bus * apart * S, bus, Rotation(time=5.0))
    assert len(paths) == 4
    assert as_read(paths, "python-can")[0] == list(range(len(ns)))


def test_running_time_never_goes_back_and_keeps_what_passes(seed: int) -> None:
    """In any cut of any stamps: it ascends, and clocks that agree within a second give their own time."""
    rng = random.Random(seed)
    for _ in range(50):
        ns, bus = drawn_stamps(rng, 200)
        ns = ns - ns[0]
        cuts = sorted({0, len(ns), *(rng.randrange(len(ns)) for _ in range(6))})
        whole, parts = RunningTime(), RunningTime()
        at_once = whole.of(ns, bus.astype(np.uint16))
        in_parts = [parts.of(ns[a:b], bus[a:b].astype(np.uint16)) for a, b in pairwise(cuts)]
        assert np.concatenate(in_parts).tolist() == at_once.tolist()
        assert (np.diff(at_once) >= 0).all()
        highest = np.maximum.accumulate(ns)
        # where a step forward comes with another bus's first frame, that clock may be ahead: it is not believed
        first = [int(np.argmax(bus == each)) for each in np.unique(bus)]
        agree = all(ns[k] <= highest[max(k - 1, 0)] + MAX_BACK_NS for k in first)
        if agree and (ns >= highest - MAX_BACK_NS).all():
            assert at_once.tolist() == highest.tolist()


@pytest.mark.parametrize("suffix", [".blf", ".asc"])
def test_no_writer_takes_a_time_before_its_zero(suffix: str, tmp_path: Path) -> None:
    """It raises before any frame of the batch is taken; what it has stays readable."""
    from canid.io.logs.log_writer import open_writer
    from canid.values.frame_columns import columns_of
    from canid.values.types import Event, Frame

    writer = open_writer(tmp_path / f"x{suffix}", EPOCH)
    writer.append(Frame(0.0, 0, 1, b"a"))
    early = writer.earliest_ns * 1e-9 - 0.001
    with pytest.raises(ValueError, match="zero"):
        writer.append_columns(columns_of([Frame(0.5, 0, 2, b"b"), Frame(early, 0, 3, b"c")]))
    with pytest.raises(ValueError, match="zero"):
        writer.note(Event(early, "mark", "too early"))
    writer.close()
    assert [data for _, data in by_python_can(tmp_path / f"x{suffix}").frames] == [b"a"]


def test_what_is_added_to_stamps_is_a_time_that_people_read() -> None:
    """A number of 19 digits says nothing; the time since which they count does, to the millisecond."""
    heard: list[tuple[str, str]] = []
    watch = SimpleNamespace(update_many=lambda *_: ())
    bus = SimpleNamespace(name="virtual a", offset_ns=1_767_682_800_250_000_001)
    frames = SimpleNamespace(ns=np.zeros(1, dtype=np.int64))
    each: Any = SimpleNamespace(bus=bus, watch=watch)
    arrival: Any = SimpleNamespace(bus=0, frames=frames, at=0.0)
    ClockEvents([each], lambda what, says: heard.append((what, says))).received(arrival)
    assert heard == [
        (
            "stamp_offset",
            "virtual a: its stamps do not count from 1970: 2026-01-06T07:00:00.250 UTC is added to each",
        )
    ]
