"""The seed of a run: drawn anew each time, or taken from CANID_SEED to run the same again.

pytest's processes share it by the environment. A test asks for its own part by the fixture `seed` of conftest.py, which
prints it where the test fails.
"""

from __future__ import annotations

import os
import secrets
from zlib import crc32

VARIABLE = "CANID_SEED"
SEED = int(os.environ.setdefault(VARIABLE, str(secrets.randbelow(10**6))))


def seed(purpose: str) -> int:
    """Derive a seed from that of the run.

    Args:
        purpose: the test's name, so that no two tests draw the same.

    Example:
        >>> seed("a") == seed("a") != seed("b")
        True
    """
    return crc32(f"{SEED} {purpose}".encode()) % 10**6
