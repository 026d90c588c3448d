"""Tables of text fit a terminal of 80 columns: no number is broken over two lines."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canid.values.errors import DONE

LOGS = Path(__file__).parents[2] / "replay_logs"


@pytest.mark.long("verbs on whole logs")
@pytest.mark.parametrize(
    ("log", "vehicle"), [("following_urban.blf", "generic"), ("lane_keeping.blf", "generic_lane")]
)
def test_the_tables_of_check_fit_80_columns(canid: Callable[..., Any], log: str, vehicle: str) -> None:
    """With the frame and signal of each role, and how many readings came, in a table of their own."""
    ran = canid("check", LOGS / log, "--vehicle", vehicle)
    assert ran.code == DONE
    roles, sources = ran.out.split("\n\n")[1:3]
    assert max(map(len, (*roles.splitlines(), *sources.splitlines()))) <= 80
    names = [[line.split()[0] for line in table.splitlines()] for table in (roles, sources)]
    assert names[0] == names[1]
    assert "STEERING" in sources.upper() or "PedalPosition" in sources
