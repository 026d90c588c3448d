"""With little memory a session has a whole recording, or nothing at all and one line that says why."""

from __future__ import annotations

import random
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from canid.io.logs import open_log
from canid.values.errors import NO_BUS, NOT_WRITTEN
from tests.cli.conftest import ROOT

# MB of addresses: the interpreter starts with the least, and the most is enough
LEAST, MOST = 40, 1000


@pytest.mark.slow("whole commands, one after the other")
@pytest.mark.parametrize("verb", ["live", "record"])
def test_it_works_or_has_not_begun(verb: str, tmp_path: Path, seed: int) -> None:
    """Under drawn limits of the address space: a recording that can be read (of a silent bus: exit 3), or exit 5, one line
    and no file; never a traceback."""
    rng = random.Random(seed)
    ends = set()
    for k, megabytes in enumerate([LEAST, MOST, *(rng.randrange(LEAST, MOST) for _ in range(5))]):
        folder = tmp_path / str(k)
        folder.mkdir()
        words = [verb, "-i", "virtual", "-c", str(folder), "--duration", "0.5"]
        words += ["--vehicle", "generic", "--record", "x.blf"] if verb == "live" else ["-o", "x.blf"]
        limit = megabytes * 1024 * 1024
        done = subprocess.run(
            [sys.executable, "-m", "canid", *words],
            cwd=folder,
            env={"PYTHONPATH": str(ROOT), "PATH": ""},
            preexec_fn=lambda limit=limit: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),  # type: ignore[misc]
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        shown = f"{megabytes} MB: {done.returncode} {done.stderr}"
        assert "Traceback" not in done.stderr, shown
        assert done.returncode in (NO_BUS, NOT_WRITTEN), shown
        ends.add(done.returncode)
        if done.returncode == NO_BUS:
            assert list(open_log(folder / "x.blf")) == []
        else:
            assert done.stderr.count("\n") == 1, shown
            assert "not enough memory" in done.stderr, shown
            assert list(folder.iterdir()) == [], shown
    assert ends == {NO_BUS, NOT_WRITTEN}
