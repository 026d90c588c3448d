"""The window logic of a triggered recording, against a plain offline reference; and what of it any thread may do."""

from __future__ import annotations

import random
from itertools import accumulate

import pytest

from canid.io.recording.pre_trigger_buffer import (
    MARK_AHEAD_S,
    MARK_MARGIN_S,
    SETTLE_S,
    Begin,
    End,
    PreTriggerBuffer,
)
from canid.values.frame_columns import columns_of, frames_of
from canid.values.types import Columns, Frame


def windows(times: list[float], true: list[bool], marks: list[float], pre: float, post: float) -> list[bool]:
    """The definition: which frames are at most `pre` s before or `post` s after a true frame or a mark."""
    triggers = [t for t, is_true in zip(times, true, strict=True) if is_true] + marks
    return [any(at - pre <= t <= at + post for at in triggers) for t in times]


def stretches(times: list[float], true: list[bool], marks: list[float], pre: float, post: float) -> int:
    """How many windows there are: those that overlap are one."""
    spans = [(times[start] - pre, times[stop - 1] + post) for start, stop, _ in runs(true)]
    count, reached = 0, -1e9
    for start, end in sorted(spans + [(at - pre, at + post) for at in marks]):
        count += start > reached
        reached = max(reached, end)
    return count


def drive(rng: random.Random, n: int) -> list[Frame]:
    """Frames of two buses that are out of order by some ms, with pauses and bursts of equal stamps."""
    t, frames = 0.0, []
    for k in range(n):
        t += rng.choice((0.0, 0.001, 0.01, 0.01, 0.05, 0.4 if rng.random() < 0.05 else 0.01))
        frames.append(Frame(max(t - rng.choice((0.0, 0.0, 0.004)), 0.0), k % 2, k, bytes([k % 256])))
    return frames


def pulses(rng: random.Random, n: int) -> list[bool]:
    """Truth with pulses of one frame and long stretches; sometimes from the first frame on, sometimes never."""
    true = [False] * n
    for _ in range(rng.choice((0, 1, 2, 4))):
        start = rng.randrange(n) if rng.random() < 0.9 else 0
        for k in range(start, min(start + rng.choice((1, 1, 3, 40)), n)):
            true[k] = True
    return true


def runs(true: list[bool]) -> list[tuple[int, int, str]]:
    edges = [False, *true, False]
    starts = [k for k in range(len(true)) if true[k] and not edges[k]]
    return [(k, next(j for j in range(k, len(true) + 1) if not edges[j + 1]), "x") for k in starts]


@pytest.mark.parametrize("trial", range(60))
def test_what_is_written_is_the_reference_to_the_frame(trial: int, seed: int) -> None:
    """Whatever the answers' delay, the batches, the deaths of the child: the frames written are those of the windows.

    Frames that the child never answers for count as true, and so does what comes `SETTLE_S` after them.
    """
    rng = random.Random(f"{seed} {trial}")
    n = rng.choice((1, 20, 200, 400))
    pre, post = rng.choice((0.0, 0.1, 1.0)), rng.choice((0.0, 0.2, 1.0))
    frames, true = drive(rng, n), pulses(rng, n)
    times = list(accumulate((frame.t for frame in frames), max))
    buffer = PreTriggerBuffer(pre, post)
    written: list[Frame] = []
    order: list[object] = []
    counted, marks, came, answered, settled = list(true), list[float](), 0, 0, -1.0
    dies = rng.random() < 0.4

    def take() -> None:
        for item in buffer.take(rng.choice((1, 50, 1e9))):
            order.append(item)
            if isinstance(item, Columns):
                written.extend(frames_of(item))

    while came < n or answered < n:
        if came < n and (rng.random() < 0.6 or answered == came):
            batch = frames[came : came + rng.choice((1, 3, 30))]
            buffer.put(columns_of(batch), at=times[came])
            came += len(batch)
            if rng.random() < 0.03:
                # a person, late by less than the margin that is kept, or ahead of what was read
                # once a window has begun, a late mark can only make it longer at its end
                late = rng.uniform(-MARK_AHEAD_S, 0.9 * MARK_MARGIN_S if not order else 0.0)
                marks.append(max(times[came - 1] - late, 0.0))
                buffer.mark(marks[-1], "mark")
        else:
            some = rng.randint(1, came - answered)
            if dies and rng.random() < 0.1:
                buffer.unanswered(some)
                counted[answered : answered + some] = [True] * some
                settled = max(settled, times[answered + some - 1] + SETTLE_S)
            else:
                buffer.answered(some, runs(true[answered : answered + some]))
                for k in range(answered, answered + some):
                    counted[k] |= times[k] <= settled
            answered += some
        take()
    buffer.end()
    while buffer.buffered:
        take()
    take()
    expected = windows(times, counted, marks, pre, post)
    assert written == [frame for frame, inside in zip(frames, expected, strict=True) if inside]
    begins, ends = ([i.window for i in order if isinstance(i, kind)] for kind in (Begin, End))
    assert [id(w) for w in begins] == [id(w) for w in ends]
    assert len(begins) == buffer.opened == stretches(times, counted, marks, pre, post)
    assert not any(w.missing for w in begins)


def test_a_window_that_waits_for_answers_keeps_what_a_late_mark_may_still_ask_for() -> None:
    """Two marks, the later one for an earlier time; the child answers late."""
    frames = [Frame(0.1 * k, 0, k, b"") for k in range(60)]
    buffer = PreTriggerBuffer(pre=0.0, post=0.15)
    buffer.put(columns_of(frames[:40]), at=4.0)
    buffer.answered(35, [])
    buffer.mark(3.8, "first")
    assert buffer.take() == []
    buffer.mark(2.0, "second")
    buffer.put(columns_of(frames[40:]), at=6.0)
    buffer.answered(25, [])
    buffer.end()
    given = [frame.id for item in buffer.take() if isinstance(item, Columns) for frame in frames_of(item)]
    assert given == [20, 21, 38, 39]
