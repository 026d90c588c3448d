"""Playback of a log: after a seek, forwards or backwards, the numbers are those of an uninterrupted replay."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest

from canid.analysis.drive import drive_reader
from canid.analysis.playback.playback import NO_WAY_BACK, Played, Position, play
from canid.io.logs import open_log
from canid.io.recording.controls import Controls
from canid.signals.vehicle import read_vehicle
from canid.values.text import json_values
from canid.values.types import Estimate
from canid.values.window import Window

LOG = Path(__file__).parents[2] / "replay_logs/following_urban.blf"
STOP_S = 34.0


def playing(controls: Controls, **more: Any) -> Iterator[Played | Position]:
    log, vehicle = open_log(LOG), read_vehicle("generic")
    return play(log, vehicle, controls, within=Window(stop=STOP_S), interactive=True, **more)


def rows(items: list[Any]) -> list[str]:
    return [json_values.line(json_values.plain(item)) for item in items if isinstance(item, Estimate)]


@pytest.mark.slow("a session and its page in a browser")
def test_seeks_change_no_number() -> None:
    """Forwards at real time, backwards from the end and from the middle: each pass gives the plain replay's estimates, to
    the last digit, and what is written to --json is the plain replay, once."""
    plain = [item for one in playing(Controls()) if isinstance(one, Played) for item in one.out]
    controls = Controls(speed=1.0)
    controls.seek(20.0)
    passes: dict[int, list[Any]] = {}
    fresh: list[Any] = []
    number, latest, asked = 1, 0.0, False
    for one in playing(controls, stays=True):
        if isinstance(one, Position):
            number = one.passes
            if one.ended and number == 3:
                controls.stop()
            elif one.ended:
                controls.seek(10.0)
            continue
        passes.setdefault(number, []).extend(one.out)
        fresh += one.fresh
        latest = one.t
        if number == 1 and latest >= 20.0:
            controls.set_speed(float("inf"))
        if number == 2 and latest >= 25.0 and not asked:
            asked = True
            controls.seek(5.0)
    assert sorted(passes) == [1, 2, 3]
    expected = rows(plain)
    assert len(expected) > 40
    assert rows(passes[1]) == rows(passes[3]) == rows(fresh) == expected
    middle = rows(passes[2])
    assert middle == expected[: len(middle)]
    assert 0 < len(middle) < len(expected)


def test_a_target_is_reached_exactly() -> None:
    """Paused, a seek runs the log up to the target and no further; a replay that is paused gives nothing."""
    controls = Controls(speed=1.0)
    controls.pause(True)
    controls.seek(7.0)
    last, positions = 0.0, 0
    for one in playing(controls):
        if isinstance(one, Played):
            last = one.t
        elif one.seeking is None:
            positions += 1
            assert one.t == last
            if positions == 3:
                break
    assert 6.9 < last < 7.0


def test_a_state_has_no_way_back(tmp_path: Path) -> None:
    """With --state a seek backwards is refused with a sentence, and the replay goes on."""
    controls = Controls()
    refused = set()
    t = 0.0
    for one in playing(controls, keep=tmp_path / "driver.state"):
        if isinstance(one, Position):
            refused.add(one.says)
            assert one.passes == 1
            continue
        assert one.t >= t
        t = one.t
        if 10.0 < t < 20.0:
            controls.seek(1.0)
            controls.set_speed(10.0 if t < 13.0 else float("inf"))
    assert NO_WAY_BACK in refused
    assert t == pytest.approx(STOP_S, abs=0.1)


@pytest.mark.slow("a replay, passed three times")
def test_a_seek_within_what_was_run_computes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the end back and forth: no chunk is run again, and each target is where the replay goes on."""
    run, chunks = drive_reader.run, [0]

    def counted(*args: Any, **more: Any) -> Generator[drive_reader.Step, None, None]:
        for step in run(*args, **more):
            chunks[0] += 1
            yield step

    monkeypatch.setattr(drive_reader, "run", counted)
    controls = Controls()
    targets, reached, before = [12.0, 3.0, 21.5, 8.25], [], 0
    asked, wait = 0.0, False
    for one in playing(controls, stays=True):
        if isinstance(one, Position):
            if one.ended and targets and not wait:
                before = before or chunks[0]
                controls.set_speed(1.0)
                asked, wait = targets.pop(0), True
                controls.seek(asked)
            continue
        if wait and one.t >= asked - 0.2:
            reached.append((asked, one.t))
            wait = False
            if targets:
                asked, wait = targets.pop(0), True
                controls.seek(asked)
            else:
                controls.stop()
    assert chunks[0] == before > 10
    assert [target for target, _ in reached] == [12.0, 3.0, 21.5, 8.25]
    assert all(abs(t - target) < 0.2 for target, t in reached)
