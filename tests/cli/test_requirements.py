"""`canid identify --require` and `--junit`: the exit code, the lines and the XML say the same of the same numbers."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from canid.analysis.drive.requirements import requirement
from canid.values.errors import CHECK_FAILED, DONE, NOT_WRITTEN, ConfigError

Canid = Callable[..., Any]
LOG = Path(__file__).parents[2] / "replay_logs" / "following_mixed.blf"


@pytest.mark.slow("identifies a drive several times")
def test_the_verdict_is_that_of_the_numbers(canid: Canid, tmp_path: Path, seed: int) -> None:
    """Ranges drawn around what the JSON has: inside is met, outside and what may not be quoted is not."""
    rng = random.Random(seed)
    json_file, junit = tmp_path / "j.json", tmp_path / "r.xml"
    assert canid("identify", LOG, "--vehicle", "generic", "--json", json_file).code == DONE
    whole = json.loads(json_file.read_text())["whole"]
    required, expected = [], []
    for name, channel in whole["channels"].items():
        for what, quoted in (
            ("K", True),
            ("tau_plus_dead_time", channel["status"] != "gain_only"),
            ("tau", channel["status"] == "ok"),
        ):
            value = channel[what]["value"]
            low = value + rng.choice((-2.0, 0.5))
            required += ["--require", f"{name}.{what} in {low:.3f}..{low + rng.choice((1.0, 3.0)):.3f}"]
            bounds = requirement(required[-1])
            expected.append(quoted and bounds.low <= value <= bounds.high)
    ran = canid("identify", LOG, "--vehicle", "generic", *required, "--junit", junit)
    assert ran.code == (DONE if all(expected) else CHECK_FAILED)
    assert [line[0] == "✓" for line in ran.out.splitlines() if line[:2] in ("✓ ", "✗ ")] == expected
    suites = ET.parse(junit).getroot()
    assert (suites.get("tests"), suites.get("failures")) == (str(len(expected)), str(expected.count(False)))
    assert [case.find("failure") is None for case in suites.iter("testcase")] == expected
    # an existing file is replaced only by one of its kind
    (tmp_path / "other.xml").write_text("<notes/>")
    ran = canid("identify", LOG, "--vehicle", "generic", *required, "--junit", tmp_path / "other.xml")
    assert (ran.code, (tmp_path / "other.xml").read_text()) == (NOT_WRITTEN, "<notes/>")


@pytest.mark.parametrize(
    "text",
    [
        "K in 1..2",
        "range_rate.K",
        "range_rate.K in 1",
        "range_rate.K in 2..1",
        "range_rate.K in nan..1",
        "fit in 1..2",
        "a.b.K in 1..2",
    ],
)
def test_what_is_no_requirement_is_said(text: str) -> None:
    with pytest.raises(ConfigError, match="--require"):
        requirement(text)


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [("a.K in -1.5..2", -1.5, 2), ("a.K in .5..1e2", 0.5, 100), ("a.K in 1...5", 1, 0.5)],
)
def test_ranges(text: str, low: float, high: float) -> None:
    if low > high:
        with pytest.raises(ConfigError, match="empty"):
            requirement(text)
    else:
        assert requirement(text)[3:] == (low, high)
