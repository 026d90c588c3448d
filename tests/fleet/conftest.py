"""Logs whose results a local folder has: what storage is held against."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.fleet import short_logs
from tests.fleet.storage_servers import LOGS, numbers


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """So many short logs, of several drivers."""
    folder = tmp_path_factory.mktemp("logs")
    short_logs.write(folder, LOGS, 8.0)
    return folder


@pytest.fixture(scope="module")
def expected(logs: Path, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Any, ...]]:
    """What a local folder has of them."""
    into = tmp_path_factory.mktemp("local") / "results"
    assert short_logs.fleet_here(logs, "-o", into, *short_logs.QUICK).returncode == 0
    return numbers(into)
