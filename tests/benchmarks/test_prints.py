"""The committed result of `canid study prints` is what the papers' printed numbers give: recomputed and compared."""

from __future__ import annotations

import doctest
import importlib
import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.papers import prints as package
from benchmarks.papers.prints.__main__ import encoded
from canid_study.prints import CURVES, RESULT

pytestmark = pytest.mark.slow  # recomputes both papers: 12 s

# of a quantity that a search or an optimisation ends at: its own tolerance, far below any printed digit
SEARCHED = 1e-6


def test_the_committed_result_is_what_is_recomputed() -> None:
    """Every word, every number of the tables, every point of the figures."""
    result, arrays = encoded()
    folder = files("canid_study")
    assert_same(result, json.loads(folder.joinpath(RESULT).read_text(encoding="utf-8")))
    with folder.joinpath(CURVES).open("rb") as file, np.load(file) as stored:
        committed = [stored[name] for name in stored.files]
    assert len(arrays) == len(committed)
    for recomputed, values in zip(arrays, committed, strict=True):
        scale = float(np.nanmax(np.abs(values)))
        np.testing.assert_allclose(recomputed, values, rtol=SEARCHED, atol=SEARCHED * scale)


def assert_same(recomputed: Any, committed: Any, where: str = "") -> None:
    """Equal, but for rounding of numbers."""
    if isinstance(committed, dict):
        assert recomputed.keys() == committed.keys(), where
        for key in committed:
            assert_same(recomputed[key], committed[key], f"{where}.{key}")
    elif isinstance(committed, list):
        assert len(recomputed) == len(committed), where
        for k, (x, y) in enumerate(zip(recomputed, committed, strict=True)):
            assert_same(x, y, f"{where}[{k}]")
    elif isinstance(committed, float) and recomputed is not None:
        assert recomputed == pytest.approx(committed, rel=SEARCHED, abs=SEARCHED), where
    else:
        assert recomputed == committed, where


def test_examples_of_the_recomputation() -> None:
    """The doctests of its modules."""
    for path in sorted(Path(package.__file__).parent.glob("[!_]*.py")):
        module = importlib.import_module(f"{package.__name__}.{path.stem}")
        assert doctest.testmod(module).failed == 0, path.name
