"""Files written from docs/formats/*.md, and how many of each dialect canid reads as they were written.

    python -m benchmarks formats --files 10000
    python -m benchmarks formats --files 200 --only mf4         # several seconds a file

Prints a table per format: of each property the files that have it, and those of them in which anything differs. Ends with 1
where one does; `--keep FOLDER` keeps these files.
"""

from __future__ import annotations

import argparse
import random
import tempfile
from collections import Counter
from pathlib import Path

from tests.formats_oracle.comparison import differences
from tests.formats_oracle.generators import GENERATORS, SLOW_GENERATORS

ALL = GENERATORS | SLOW_GENERATORS
# differences that are printed, of each format
_SHOWN = 5


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks formats", description=__doc__)
    parser.add_argument("--files", type=int, default=1_000, help="of each format")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", choices=tuple(ALL), default=tuple(GENERATORS), metavar="FORMAT")
    parser.add_argument("--keep", type=Path, metavar="FOLDER")
    args = parser.parse_args()
    failed = sum([_format(name, args.files, args.seed, args.keep) for name in args.only])
    return int(failed > 0)


def _format(name: str, files: int, seed: int, keep: Path | None) -> int:
    """Write and read files of one format; returns in how many something differs."""
    all_of: Counter[str] = Counter()
    bad: Counter[str] = Counter()
    frames = failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for k in range(files):
            written = ALL[name](random.Random(f"{seed} {k}"))
            says = differences(written, Path(folder) / f"drive{written.suffix}")
            frames += len(written.frames)
            all_of.update({*written.properties})
            if not says:
                continue
            failed += 1
            bad.update({*written.properties})
            if failed <= _SHOWN:
                print(f"{name} {seed} {k} ({', '.join(written.properties)}): {says[0]}", flush=True)
            if keep is not None:
                keep.mkdir(parents=True, exist_ok=True)
                (keep / f"{name}-{k}{written.suffix}").write_bytes(written.content)
    print(f"\n.{name}: {files:,} files, {frames:,} frames, {failed:,} files differ", flush=True)
    for what, n in sorted(all_of.items()):
        print(f"  {what:48} {n:7,} {bad[what]:7,}")
    return failed


if __name__ == "__main__":
    raise SystemExit(main())
