"""Answers of the process that evaluates are counted in the order in which frames were offered, whatever is lost."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from canid.analysis.session import estimator_process
from canid.analysis.session.estimator_process import Estimating, Run
from canid.values.frame_columns import columns_of
from canid.values.types import Frame

# answers that every frame with the id 1 is true; dies now and then
CHILD = """
import pickle, random, sys, time
say = lambda *what: (pickle.dump(what, sys.stdout.buffer), sys.stdout.flush())
left = random.Random(int(sys.argv[1])).randint(2, 6)
say("ready", "")
while True:
    try:
        chunk = pickle.load(sys.stdin.buffer)
    except EOFError:
        break
    ids = chunk[2].tolist()
    time.sleep(0.01)
    left -= 1
    if left == 0:
        sys.exit(1)
    say("out", (len(ids), [], {}, [], [(k, k + 1, "x") for k, id_ in enumerate(ids) if id_ == 1]))
say("end", None)
"""


def test_each_answer_belongs_to_its_frame(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With frames that found no room and children that die: each frame is answered for once, truly or not at all."""
    monkeypatch.setattr(estimator_process, "MAX_WAITING_FRAMES", 300)
    monkeypatch.setattr(estimator_process, "RESTART_DELAYS_S", (0.0,))
    answers: list[tuple[int, list[Run] | None]] = []
    script = tmp_path / "child.py"
    script.write_text(CHILD)
    running = Estimating(
        "generic",
        lambda t, item: None,
        [sys.executable, str(script), str(seed)],
        on_truth=lambda n, runs: answers.append((n, None if runs is None else list(runs))),
    )
    frames: list[Frame] = []
    until = time.monotonic() + 120.0
    # on a busy machine a child starts late, and dies late
    while (len(frames) < 6000 or not (running.counts().restarts and running.counts().dropped)) and (
        time.monotonic() < until
    ):
        more = [Frame(0.001 * k, 0, int(k % 7 == 0), b"") for k in range(len(frames), len(frames) + 100)]
        running.put(columns_of(more))
        frames += more
        time.sleep(0.01)
    while sum(n for n, _ in answers) < len(frames) and time.monotonic() < until:
        time.sleep(0.05)
    counts = running.counts()
    running.close(5.0)
    said: list[bool | None] = []
    for n, runs in answers:
        rows = {row for start, stop, _ in runs or () for row in range(start, stop)}
        said += [None if runs is None else row in rows for row in range(n)]
    assert len(said) == len(frames)
    wrong = [k for k, answer in enumerate(said) if answer not in (None, frames[k].id == 1)]
    assert wrong == []
    assert said.count(None) == counts.dropped > 0
    assert counts.restarts > 0
