"""What every test runs under: signals as in a terminal's foreground, and one seed for whatever is drawn.

Only `make test-all` draws; `make test` has fixed seeds, those of hypothesis too.
"""

from __future__ import annotations

import gc
import signal
from types import FrameType

import pytest
from hypothesis import settings

from tests import seeds
from tests.fixtures import measured_logs
from tests.fixtures.browser import browser
from tests.fixtures.measured_logs import measured
from tests.fixtures.rewritten import rewrite_share

__all__ = ["browser", "measured"]
settings.register_profile("fixed", derandomize=True, database=None)
settings.register_profile("drawn", print_blob=True)
settings.load_profile("drawn" if seeds.DRAWN else "fixed")
measured_logs.forbid_listing()


def _nothing(number: int, frame: FrameType | None) -> None:
    """A handler instead of SIG_IGN: this process ignores the signal, programs that it starts get the default."""


def pytest_configure(config: pytest.Config) -> None:
    """Signals: `make test &` in a script and nohup ignore them, and a program inherits what is ignored."""
    gc.disable()  # until all is collected
    rewrite_share(config)
    for name in ("SIGINT", "SIGHUP", "SIGQUIT"):
        number = getattr(signal, name, None)  # Windows has the first one alone
        if number is not None and signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, _nothing)


def pytest_collection_finish() -> None:
    """What is imported and collected stays: no collection of garbage goes through it again."""
    gc.collect()
    gc.freeze()
    gc.enable()


# folders and files that `make test` leaves out, and why; of the package it is its examples
_SAMPLES, _DRIVE = "its examples sample a population: 1.5 to 8 CPU-s each", "its example takes a whole drive"
SLOW = {
    "tests/benchmarks/": "benchmarks' own runs",
    "tests/study/": "studies of whole papers",
    "tests/fleet/test_report.py": "the report of 50 drives: 28 CPU-s",
    "canid/mathematics/population/": _SAMPLES,
    "canid/analysis/fleet/one_log/": _DRIVE,
    "canid/analysis/drive/drive_parameters.py": _DRIVE,
    "canid/analysis/drive/drive_series.py": _DRIVE,
    "canid/analysis/drive/drive_summary.py": _DRIVE,
    "canid/analysis/drive_results.py": _DRIVE,
    "canid/models/diagnosis/diagnose.py": _DRIVE,
    "canid/models/simulation/model_drive.py": _DRIVE,
    "canid/analysis/sumo/driver_model.py": _DRIVE,
    "canid_study/grover/": _DRIVE,
}


# before pytest's own, which leaves out by -m
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what draws; leave out cases that other runs take, unless the command names them."""
    for item in items:
        if "seed" in getattr(item, "fixturenames", ()) or hasattr(getattr(item, "obj", None), "hypothesis"):
            item.add_marker("draws")
        for folder, why in SLOW.items():
            if item.nodeid.startswith(folder):
                item.add_marker(pytest.mark.slow(why))
    if any("::" in word for word in config.args):
        return
    left = set(_in_other_runs(items)) if seeds.DRAWN and not seeds.ALL_CASES else set()
    left |= {item for item in items if item.get_closest_marker("another_run")}
    if left:
        config.hook.pytest_deselected(items=[*left])
        items[:] = [item for item in items if item not in left]


def _in_other_runs(items: list[pytest.Item]) -> list[pytest.Item]:
    """Slow tests that this run leaves to others: it takes a drawn sixth, of many cases of one test an eighth or a twelfth;
    half of the tests that draw their cases themselves, `seeds.in_turn`.
    """
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("slow"):
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    left: list[pytest.Item] = []
    for test, group in cases.items():
        turn = seeds.seed(f"turn of {test}")
        if any(item.get_closest_marker("another_run") for item in group):
            left += group if turn % 2 else []
            continue
        parts = 6 if len(group) < 6 else 8 if len(group) < 12 else 12
        turn %= parts
        left += [item for k, item in enumerate(group) if k % parts != turn]
    return left


def pytest_report_header() -> str:
    """How to run it again."""
    return f"{seeds.VARIABLE}={seeds.SEED} ({'drawn' if seeds.DRAWN else 'fixed'})\n{measured_logs.header()}"


@pytest.fixture
def seed(request: pytest.FixtureRequest) -> int:
    """A seed of this test's own, another one in each run; a failure prints it."""
    drawn = seeds.seed(request.node.nodeid)
    print(f"seed {drawn}; the same again: {seeds.VARIABLE}={seeds.SEED}")
    return drawn
