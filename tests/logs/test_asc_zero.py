"""From where an .asc counts its times: the date of its head or that of its Triggerblock; and times before the trigger."""

from __future__ import annotations

from pathlib import Path

import pytest

from canid.io.logs import open_log

HEAD = "date Mon Mar 3 10:00:00.000 am 2025"
# s since 1970
AT = 1_740_996_000


def log(tmp_path: Path, block: str, times: list[str], *, base: str = "hex", kind: str = "absolute") -> Path:
    form = "{t} 1 123 Rx d 2 0{k} 10" if base == "hex" else "{t} 1 291 Rx d 2 {k} 16"
    rows = [form.format(t=t, k=k % 10) for k, t in enumerate(times)]
    lines = [
        HEAD,
        f"base {base}  timestamps {kind}",
        *([f"Begin Triggerblock {block}"] if block else []),
        *rows,
    ]
    path = tmp_path / "drive.asc"
    path.write_text("\n".join([*lines, "End TriggerBlock", ""]))
    return path


@pytest.mark.parametrize(
    ("block", "first", "start", "says"),
    [
        ("", 0.0, AT, ""),
        ("Mon Mar 3 10:00:00.000 am 2025", 0.25, AT + 0.25, ""),
        ("Mon Mar 3 10:00:00.200 am 2025", 0.0, AT + 0.2, ""),
        # 100 s later: from the block, unless the first time lies beyond the half of it
        ("Mon Mar 3 10:01:40.000 am 2025", 0.0, AT + 100.0, "Triggerblock"),
        ("Mon Mar 3 10:01:40.000 am 2025", 3.0, AT + 103.0, "Triggerblock"),
        ("Mon Mar 3 10:01:40.000 am 2025", -2.5, AT + 97.5, "Triggerblock"),
        ("Mon Mar 3 10:01:40.000 am 2025", 99.0, AT + 99.0, "date line"),
        ("Mon Mar 3 10:01:40.000 am 2025", 100.5, AT + 100.5, "date line"),
        # a block before the head's date
        ("Mon Mar 3 9:00:00.000 am 2025", 5.0, AT - 3600.0 + 5.0, "Triggerblock"),
    ],
)
def test_from_which_date_times_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: str, first: float, start: float, says: str
) -> None:
    monkeypatch.setenv("CANID_TIME_ZONE", "UTC")
    read = open_log(log(tmp_path, block, [f"{first + 0.1 * k:.6f}" for k in range(30)]))
    assert [frame.t for frame in read] == pytest.approx([0.1 * k for k in range(30)], abs=1e-9)
    assert read.start_utc == start
    assert bool(says) is any(says in remark for remark in read.remarks if "Triggerblock" in remark)
    assert len(read.remarks) == bool(says)


@pytest.mark.parametrize("base", ["hex", "dec"])
@pytest.mark.parametrize("block", ["", "Mon Mar 3 10:00:00.000 am 2025"])
def test_frames_from_before_the_trigger_are_frames(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, base: str, block: str
) -> None:
    """CANoe writes them with negative times: none is damage, and the log begins with them."""
    monkeypatch.setenv("CANID_TIME_ZONE", "UTC")
    times = [f"{-2.0 + 0.1 * k:.6f}" for k in range(50)]
    read = open_log(log(tmp_path, block, times, base=base))
    frames = list(read)
    assert [frame.t for frame in frames] == pytest.approx([0.1 * k for k in range(50)], abs=1e-9)
    assert {(frame.id, frame.data[1]) for frame in frames} == {(0x123, 0x10)}
    assert read.damage is None
    assert read.start_utc == AT - 2.0
    (chunk,) = read.columns()
    assert chunk.t.tolist() == [frame.t for frame in frames]
