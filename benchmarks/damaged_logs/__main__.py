"""More damaged logs than the tests read: `python -m benchmarks.damaged_logs --mutants 100000 --seed 7`.

Ends with 1 where a claim does not hold of one of them; `--keep FOLDER` keeps these files.

`--hostile MIB`: instead, files of so many MiB that were made to stop a reader (see `hostile`), each read, read again
and recovered; prints the longest CPU time between two advances, how much in all, and the largest memory.
"""

from __future__ import annotations

import argparse
import random
import shutil
import tempfile
import time
from pathlib import Path

from benchmarks.damaged_logs.progress import measure
from tests.damaged_logs import hostile
from tests.damaged_logs.bases import bases
from tests.damaged_logs.claims import check
from tests.damaged_logs.mutants import mutant

# one in so many is read frame by frame too
_ONE_BY_ONE = 10
# what is promised: CPU s between two advances, MB
_STANDSTILL, _MEMORY = 2.0, 512.0
# s after which a hostile file is given up, per MiB
_TIMEOUT_S_PER_MIB = 120.0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=5_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, metavar="FOLDER")
    parser.add_argument("--hostile", type=float, metavar="MIB")
    parser.add_argument("--only", default="", metavar="WORD", help="hostile files with this in their name")
    args = parser.parse_args()
    if args.hostile:
        return _hostile(args.hostile, args.only)
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        made = bases(Path(folder), args.seed)
        for base in made:
            rng = random.Random(f"{args.seed} {base.name}")
            path = Path(folder) / f"x{base.suffix}"
            n, kept, lost, worst, begun = args.mutants // len(made), 0, 0, 0.0, time.process_time()
            for k in range(n):
                damaged = mutant(rng, base)
                one = time.process_time()
                try:
                    found = check(base, damaged, path, one_by_one=k % _ONE_BY_ONE == 0)
                except Exception as error:  # of any kind: each is a finding
                    failed += 1
                    print(f"{base.name} {k}, {damaged.what}: {type(error).__name__}: {error}", flush=True)
                    if args.keep:
                        args.keep.mkdir(parents=True, exist_ok=True)
                        shutil.copy(path, args.keep / f"{base.name}-{k}{base.suffix}")
                    continue
                worst = max(worst, time.process_time() - one)
                kept, lost = kept + found.kept, lost + found.lost
            spent = time.process_time() - begun
            print(
                f"{base.name:16} {n:7} mutants, {100 * lost / max(n * len(base.frames), 1):4.1f} % of the frames lost, "
                f"none of {kept} outside the damage; {1e3 * spent / max(n, 1):.1f} ms of CPU each, {1e3 * worst:.0f} at most",  # noqa: E501
                flush=True,
            )
    print(f"{failed} failed")
    return int(failed > 0)


def _hostile(mib: float, only: str) -> int:
    """Measure all hostile files; 1 where one breaks a promise."""
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for name in hostile.FAMILIES:
            if only not in name:
                continue
            path = hostile.write(name, Path(folder), int(mib * hostile.MIB))
            size = path.stat().st_size / hostile.MIB
            found = measure(path, _TIMEOUT_S_PER_MIB * max(mib, 1))
            path.unlink()
            # of .mf4 nothing is known from within while asammdf reads
            well = found.longest <= _STANDSTILL and found.memory <= _MEMORY
            failed += not well
            print(
                f"{name:34} {size:7.2f} MiB, {found.longest:5.2f} s without an advance, {found.cpu:6.2f} s of CPU, "
                f"{found.memory:4.0f} MB{'' if well else '  FAILED'}: {found.says.rpartition('/')[2]}",
                flush=True,
            )
    print(f"{failed} failed")
    return int(failed > 0)


if __name__ == "__main__":
    raise SystemExit(main())
