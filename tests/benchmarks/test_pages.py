"""The pages of drawn drives, read as `python -m benchmarks.pages` reads them."""

from __future__ import annotations

import pytest

from benchmarks.pages.__main__ import run


@pytest.mark.slow("checks, identifies and diagnoses drawn drives")
def test_pages_of_drawn_drives_do_not_contradict_themselves(seed: int) -> None:
    """Of `python -m benchmarks.pages`, which reads those of 60 drives, a few."""
    for k in range(2):
        read = run(seed + k, ("check", "identify", "diagnose"))
        assert (read.pages, read.found) == (3, ())
