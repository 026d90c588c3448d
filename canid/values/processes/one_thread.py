"""One thread for linear algebra: canid's matrices are small, and threads that wait for each other cost twice the time."""

from __future__ import annotations

import os


def use_one_thread() -> None:
    """Let BLAS begin with one thread, unless the environment says otherwise; to be called before numpy is imported."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
