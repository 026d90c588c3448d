"""One confidence level: its quantiles are written in one module and nowhere else."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from scipy.stats import chi2, norm, t

from canid.mathematics.identification import confidence

ROOT = Path(__file__).parents[2]
PACKAGES = (ROOT / "canid", ROOT / "canid_study")
# 95 % as a normal quantile, as a chi-squared quantile, as a tail on each side
SPELT = re.compile(r"(?<![\d.])(1\.96|1\.9599?\d*|3\.84\d*|0?\.025|0?\.975)(?![\d])")


def test_no_other_module_spells_the_level() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for package in PACKAGES
        for path in sorted(package.rglob("*.py"))
        if path.name != "confidence.py"
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if SPELT.search(line) and not re.search(r"0\.025 m/s", line)  # a radar's resolution
    ]
    assert not found, "\n".join(found)


def test_the_quantiles_belong_to_the_level() -> None:
    assert pytest.approx(norm.isf(confidence.TAIL), abs=5e-7) == confidence.NORMAL_QUANTILE
    assert round(confidence.NORMAL_QUANTILE, 2) == confidence.SIGMAS
    assert round(float(chi2.isf(confidence.MISS, 1)), 2) == confidence.CHI_SQUARED_QUANTILE
    assert confidence.QUANTILES == (0.025, 0.975)


def test_students_quantile_is_that_of_scipy() -> None:
    for freedom in (*range(1, 130), 1000):
        assert confidence.student_quantile(freedom) == pytest.approx(
            t.isf(confidence.TAIL, freedom), rel=1e-9
        )
