"""An atheris target: any bytes at all as a log, guided by which lines of canid's readers they reach.

    pip install canid[fuzz]
    python -m benchmarks.damaged_logs.fuzz corpus/ -max_total_time=600

The first byte chooses the format, the rest is the file; `corpus/` gets small whole logs to begin with where it is empty.
All options are libFuzzer's. A finding ends the run and leaves the input in a file of its own. Besides what must hold of
every file (no error but LogError, columns and frames alike), whatever was read must come back from a recovered copy.
"""

from __future__ import annotations

import random
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["canid.io.logs"]):
    from canid.io.logs import open_log
    from canid.io.logs.recovery import recover
    from canid.values.errors import LogError
    from canid.values.frame_columns import frames_of

SUFFIXES = (".blf", ".asc", ".log", ".csv", ".trc", ".asc.gz")
# bytes; enough for some containers, and small enough for thousands of runs a second
MAX_INPUT_BYTES = 8192
# s, frames; libFuzzer's: a run without an end is a finding, and so is one that needs too much memory
LIMITS = ("-timeout=2", "-rss_limit_mb=2048", f"-max_len={MAX_INPUT_BYTES}")
FOLDER = Path(tempfile.mkdtemp(prefix="canid-fuzz-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))


def read_any(data: bytes) -> None:
    """One input."""
    if not data:
        return
    suffix = SUFFIXES[data[0] % len(SUFFIXES)]
    path, copy = FOLDER / f"x{suffix}", FOLDER / "copy.blf"
    path.write_bytes(data[1:])
    try:
        log = open_log(path)
        got = [frame for chunk in log.columns() for frame in frames_of(chunk)]
    except LogError as error:
        if "\n" in str(error):
            raise
        return
    damage = log.damage
    assert list(log) == got
    assert log.damage == damage
    copy.unlink(missing_ok=True)
    try:
        found = recover(path, copy)
    except LogError:
        assert not got
        return
    again = open_log(copy)
    assert sum(1 for _ in again) == len(got) == found.frames
    assert again.damage is None, again.damage


def seeds(folder: Path) -> None:
    """Small whole logs, one of each kind."""
    from tests.damaged_logs.bases import bases

    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        return
    rng = random.Random(1)
    with tempfile.TemporaryDirectory() as made:
        for base in bases(Path(made)):
            index = SUFFIXES.index(base.suffix)
            for k in range(3):
                # a few containers or lines from anywhere
                begin = rng.choice(base.parts[: len(base.parts) // 2 or 1]).begin
                data = base.data[: base.header] + base.data[begin : begin + MAX_INPUT_BYTES // 2]
                (folder / f"{base.name}-{k}").write_bytes(bytes([index]) + data)


def main() -> None:
    words = sys.argv[1:]
    for word in words:
        if not word.startswith("-"):
            seeds(Path(word))
    given = {word.partition("=")[0] for word in words}
    limits = [limit for limit in LIMITS if limit.partition("=")[0] not in given]
    atheris.Setup([sys.argv[0], *words, *limits], read_any)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
