"""Odd logs: `check` and `identify` give the true reason, and a check fails where nothing can be estimated."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from canid.io.logs import open_log
from canid.io.logs.log_writer import write_log
from canid.values.shipped_files import shipped
from canid.values.types import Frame
from tests.cli.conftest import Ran

START_UTC = 1.7e9
TOO_SHORT = "is too short: an estimate takes 10 s or more"


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    return list(open_log(shipped().parent / "replay_logs" / "following_urban.blf"))


def flat(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.slow("commands in processes of their own")
def test_a_log_of_two_seconds_is_too_short(
    canid: Callable[..., Ran], frames: list[Frame], tmp_path: Path
) -> None:
    """Not "the file fits", and not a signal that does not arrive."""
    path = tmp_path / "x.blf"
    write_log(path, [frame for frame in frames if frame.t < 2.0], start_utc=START_UTC)
    checked = canid("check", path, "--vehicle", "generic")
    assert checked.code == 1
    assert TOO_SHORT in flat(checked.out)
    found = canid("identify", path, "--vehicle", "generic")
    assert TOO_SHORT in flat(found.out)
    assert "does not arrive" not in found.out


@pytest.mark.slow("commands in processes of their own")
def test_a_part_near_the_end_is_too_short(canid: Callable[..., Ran]) -> None:
    """--start with 8 s left."""
    found = canid("identify", "following_urban.blf", "--vehicle", "generic", "--start", "170")
    assert TOO_SHORT in flat(found.out)


@pytest.mark.slow("commands in processes of their own")
def test_a_gap_of_hours_is_a_gap_and_no_frames_from_the_past(
    canid: Callable[..., Ran], frames: list[Frame], tmp_path: Path
) -> None:
    """Both verbs name the pause, its length and its time; the log is not damaged by it."""
    path = tmp_path / "x.blf"
    later = [frame if frame.t < 90.0 else frame._replace(t=frame.t + 36_000.0) for frame in frames]
    write_log(path, later, start_utc=START_UTC)
    for verb in ("check", "identify"):
        ran = canid(verb, path, "--vehicle", "generic")
        assert ran.code == 0, verb
        assert "no frame for 10 h at 89.99 s: a pause" in flat(ran.out + ran.err), verb
        assert "back in time" not in ran.out + ran.err
