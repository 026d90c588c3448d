"""The attacks of benchmarks/reliability/attack in a short form: half of the families, once, with seeds that are drawn."""

from __future__ import annotations

import math
import random
import subprocess
import sys
from pathlib import Path

import msgpack
import pytest

from benchmarks.reliability import attack
from benchmarks.reliability.attack import hostile_folder, judging, sender
from benchmarks.reliability.attack.traffic_process import Sender
from benchmarks.reliability.outcome import Outcome
from tests import seeds
from tests.fixtures.traffic import number

# times that are promised are measured by the benchmark; here a busy machine's pauses are no failure
SLACK = 15.0
NETWORK = ("talk", "impossible", "lost", "ring", "kill", "stop", "writes", "ages")


@pytest.mark.slow("recordings that are attacked")
@pytest.mark.parametrize("family", seeds.in_turn(tuple(attack.FAMILIES), 2, "attacks"))
def test_attacks_with_drawn_seeds(
    family: str, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest, seed: int
) -> None:
    """Every promise holds; again: `python -m benchmarks.reliability attack --only FAMILY --seed SEED --trials 1`."""
    if family in NETWORK:
        request.getfixturevalue("between_processes")
    monkeypatch.setattr(judging, "SLACK", SLACK)
    outcomes = attack.round_of(family, 0, seed)
    assert [f"seed {seed}: {outcome.group}: {outcome.wrong}" for outcome in outcomes if outcome.wrong] == []
    assert outcomes


def test_modules_in_a_folder_do_bite(tmp_path: Path) -> None:
    """What canid must not import leaves its mark where Python is started in that folder as usual."""
    marker = tmp_path / "imported"
    for name in ("calendar", "queue"):
        hostile_folder._plant(tmp_path, name, marker, random.Random(1))
    subprocess.run([sys.executable, "-c", "import calendar, queue"], cwd=tmp_path, check=True)
    assert marker.read_text().count("\n") == 2


def test_the_senders_frames_are_python_cans() -> None:
    """What the sender process packs by hand is what msgpack gives, with the number and the id of benchmarks' traffic."""
    for i in (0, 1, 2047, 2048, 70_000):
        fields = msgpack.unpackb(sender.good(i))
        assert fields == sender.FIELDS | {"arbitration_id": i % 2048, "data": number(i)}


@pytest.mark.parametrize(
    ("numbers", "says"),
    [
        ([*range(3, 10)], ""),
        ([*range(5, 10)], "the first 2 frames"),
        ([*range(3, 8)], "the last 2 frames"),
        ([3, 4, 6, 7, 8, 9], "1 frames are missing inside"),
        ([3, 4, 4, 5, 6, 7, 8, 9], "1 are there twice"),
        ([], "no frame"),
    ],
)
def test_what_is_missing_is_found(numbers: list[int], says: str, tmp_path: Path) -> None:
    """Between two instants every frame is asked for, once."""
    traffic = Sender(tmp_path, 1.0)
    traffic.sent = [100.0 + i for i in range(12)]
    wrong = judging.missing(judging.Found(numbers, []), traffic, since=102.5, until=109.5)
    assert says in "; ".join(wrong)
    assert bool(wrong) == bool(says)


def test_the_table_counts_what_was_broken() -> None:
    """One row per attack, the promise in the first row of its family."""
    rows = [
        Outcome("stop: a", 0.5, 0, measure="ended within"),
        Outcome("stop: a", 0.7, 0, "bad"),
        Outcome("stop: b", math.nan, 0, tried=3),
    ]
    table = attack.markdown(rows).splitlines()
    assert "| a | 2 | 1 of 2 kept; ended within 0.70 s; broken: bad |" in table[2]
    assert table[3] == "|  | b | 1 | 1 of 1 kept, 3 cases |"
