"""The key of one log's results: SHA-256 of all that decides their numbers."""

from __future__ import annotations

import hashlib
import json
import sys

from canid import __version__
from canid.analysis.fleet.job import Settings

# grows with every change of the analysis that changes a number, or a column of `columns.TABLES`, between two releases
ANALYSIS_VERSION = 2
# of what gives the numbers
IDENTITY = f"{__version__}/{ANALYSIS_VERSION}"
# of what must be the same on every machine of a cluster: what one Python pickles another need not read
PROGRAM = f"{IDENTITY}/{sys.version_info.major}.{sys.version_info.minor}"


def key(sha256: str, fingerprint: str, settings: Settings) -> str:
    """Return the key under which the results of these bytes, decoded so, with these settings, are stored.

    The limits of time and memory are no part of it: they change no number.

    Args:
        sha256: of the log's bytes.
        fingerprint: of the `Source`.
        settings: what is computed.

    Example:
        >>> a = key("00", "generic", Settings())
        >>> a == key("00", "generic", Settings(timeout_s=1.0)), a == key("00", "generic", Settings(windows=False))
        (True, False)
    """
    computed = [settings.windows, settings.diagnosis, settings.traffic]
    text = json.dumps([sha256, fingerprint, computed, __version__, ANALYSIS_VERSION])
    return hashlib.sha256(text.encode()).hexdigest()
