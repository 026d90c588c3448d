"""Numbers that no column can hold are damage in every format: never an exception, never another number."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from canid.io.logs import open_log
from canid.io.logs.mf4 import bus_groups
from canid.values.errors import LogError
from canid.values.timestamps import EPOCH_FLOOR_S, NS_PER_S
from canid.values.types import Flag
from tests.damaged_logs.numbers import EDGES, MAX_EXTENDED, MAX_STANDARD, SUFFIXES, Numbers, log

_ANY = st.sampled_from(EDGES) | st.integers(0, 1 << 70)


def _mostly(limit: int) -> st.SearchStrategy[int]:
    return st.integers(0, limit) | st.integers(0, limit) | _ANY


_LINES = st.lists(
    st.builds(Numbers, _mostly(10_000), _mostly(900), _mostly(MAX_STANDARD), st.booleans(), _mostly(8)),
    min_size=1,
    max_size=40,
)


def unstamped(stamps: list[int]) -> list[int]:
    """An adapter that does not stamp what it sends writes 0 among times of day: those frames have the time around them."""
    first = next((ns for ns in stamps if ns), 0)
    if first < EPOCH_FLOOR_S * NS_PER_S:
        return stamps
    found, latest = [], first
    for ns in stamps:
        latest = ns or latest
        found.append(latest)
    return found


@pytest.mark.long("many or long logs")
@pytest.mark.parametrize("suffix", [*SUFFIXES, ".asc relative"])
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(lines=_LINES)
def test_each_line_is_exactly_its_numbers_or_damage(
    suffix: str, lines: list[Numbers], tmp_path: Path
) -> None:
    """Frames that are read are those that can be, with their numbers; all others are counted."""
    suffix, _, relative = suffix.partition(" ")
    data, expected = log(suffix, lines, bool(relative))
    path = tmp_path / f"x{suffix}"
    path.write_bytes(data)
    sound = [one for one in expected if one is not None]
    if not sound:
        with contextlib.suppress(LogError):
            assert list(open_log(path)) == []
            assert suffix == ".blf"  # which may be of a silent bus
        return
    opened = open_log(path)
    got = list(opened)
    scale = 1 if suffix == ".blf" else 10**9
    stamps = [one.seconds * scale for one in sound]
    if suffix in (".log", ".csv"):
        stamps = unstamped(stamps)
    first = stamps[0]
    assert [(f.bus, f.id, bool(f.flags & (Flag.EXTENDED | Flag.ERROR)), len(f.data)) for f in got] == [
        (one.bus, one.id, one.extended, one.length) for one in sound
    ]
    assert [f.t for f in got] == pytest.approx([(ns - first) * 1e-9 for ns in stamps], rel=1e-12)
    assert opened.damaged == len(expected) - len(sound)
    columns = [chunk.id.tolist() for chunk in opened.columns()]
    assert [id_ for part in columns for id_ in part] == [f.id for f in got]


@settings(max_examples=300, deadline=None)
@given(
    stamp=st.floats() | st.sampled_from([1e300, -1e300, 4.7e9]),
    id_=st.integers(0, (1 << 32) - 1),
    ide=st.none() | st.integers(0, 1),
    channel=st.none() | st.integers(-1, 1 << 17),
    size=st.integers(0, 255),
    width=st.sampled_from([8, 64, 80]),
)
def test_a_record_of_an_mf4_is_exactly_a_frame_or_damage(
    stamp: float, id_: int, ide: int | None, channel: int | None, size: int, width: int
) -> None:
    """What the child process sends holds what asammdf gave, or counts the record as one that cannot be."""
    members = {
        "t": np.array([stamp]),
        "ID": np.array([id_], np.uint32),
        "DataLength": np.array([size], np.uint8),
        "DataBytes": np.arange(width, dtype=np.uint8)[None, :],
        **({} if ide is None else {"IDE": np.array([ide])}),
        **({} if channel is None else {"BusChannel": np.array([channel])}),
    }
    names = [name for name in members if name != "t"]
    group = bus_groups.Group(
        "CAN_DataFrame", names, 1, lambda name, start, n: members[name][start : start + n]
    )
    (part,) = bus_groups.parts(group, 10, 10)
    plain = id_ & MAX_EXTENDED
    extended = bool(id_ >> 31) or (plain > MAX_STANDARD if ide is None else bool(ide))
    sound = abs(stamp) <= 2**62 * 1e-9 and (extended or plain <= MAX_STANDARD) and size <= min(64, width)
    sound = sound and (channel is None or 0 <= channel <= 0xFFFF)
    assert group.damaged == (not sound)
    if not sound:
        assert not len(part.ns)
        return
    assert (part.id[0], bool(part.flags[0] & Flag.EXTENDED)) == (plain, extended)
    assert (part.bus[0], part.length[0]) == (max((channel or 0) - 1, 0), size)
    assert part.data[0, :size].tolist() == list(range(size))
    assert not part.data[0, size:].any()
    assert part.ns[0] == round(stamp * 1e9)


@pytest.mark.slow("whole logs")
def test_interfaces_beyond_what_a_bus_number_holds_are_damaged_lines(tmp_path: Path) -> None:
    """70,000 interfaces in a candump log: the first 65,535 are buses, lines of others are damaged."""
    path = tmp_path / "x.log"
    lines = [f"({1.7e9 + k:.6f}) c{k} 123#00\n" for k in range(70_000)] + ["(1700100000.000000) c7 123#07\n"]
    path.write_text("".join(lines), encoding="utf-8")
    opened = open_log(path)
    buses = [bus for chunk in opened.columns() for bus in chunk.bus.tolist()]
    assert buses == [*range(65_535), 7]
    assert opened.damaged == 70_000 - 65_535
    assert opened.damage is not None
    assert "line 65536: it names another interface than the first 65,535" in opened.damage.says


@pytest.mark.long("many or long logs")
def test_blank_lines_are_passed_over_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten million blank lines of all kinds between two frames: no line of them is read by itself."""
    from canid.io.logs import text_lines

    seen = 0
    line = text_lines.line

    def counted(*args: object) -> text_lines.Line:
        nonlocal seen
        seen += 1
        return line(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(text_lines, "line", counted)
    path = tmp_path / "x.log"
    frame = b"(1700000000.000000) can0 123#00\n"
    path.write_bytes(frame + b"\n" * 5_000_000 + b"\r\n" * 2_500_000 + b" \t\n" * 2_500_000 + frame)
    opened = open_log(path)
    assert len(list(opened)) == 2
    assert opened.damaged == 0
    assert seen < 100
