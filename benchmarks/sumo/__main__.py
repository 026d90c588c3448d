"""Seven driver models of Eclipse SUMO through DBC, radar noise and .blf: identify, diagnose, a second lead, rivals.

    python -m benchmarks sumo [--drives 28] [--first-seed S] [--minutes 10] [--out FILE.jsonl] [--into docs/evidence/sumo.md]

A drive is a function of its seed alone. Without --first-seed one is drawn, and printed. With --out a run goes on where it
was. Needs `pip install 'canid[bench]'`; every fourth drive has a recorded lead and is skipped where the logs are missing.
"""

from __future__ import annotations

import argparse
import os
import secrets
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

# one thread: the matrices are small
os.environ["OMP_NUM_THREADS"] = "1"

from benchmarks.sumo import table
from benchmarks.sumo.lead_speeds import RECORDED, RECORDED_EVERY
from benchmarks.sumo.outcomes import line, run, stored

# the table of a page stands between these lines
BEGIN, END = "<!-- sumo: begin -->", "<!-- sumo: end -->"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the drives and print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks sumo",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=28)
    parser.add_argument("--first-seed", type=int, help="default: drawn")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument(
        "--data", type=Path, default=Path("../shared/data"), help="folder of the recorded leads"
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="JSON lines; drives that it holds are not run again"
    )
    parser.add_argument("--into", type=Path, metavar="PAGE", help="replace the table of this page")
    args = parser.parse_args(argv)
    if find_spec("libsumo") is None:
        print("libsumo is not installed: pip install 'canid[bench]'", file=sys.stderr)
        return 2
    first = secrets.randbelow(10**6) if args.first_seed is None else args.first_seed
    print(f"seeds {first} to {first + args.drives - 1}", file=sys.stderr)
    recorded = sum((args.data / log).exists() for log, _ in RECORDED) >= 2
    wanted = range(first, first + args.drives)
    rows = {one.seed: one for one in stored(args.out)}
    for seed in wanted:
        if seed in rows:
            continue
        if seed % RECORDED_EVERY == RECORDED_EVERY - 1 and not recorded:
            print(f"seed {seed}: skipped, {args.data} has no recorded leads", file=sys.stderr)
            continue
        rows[seed] = run(seed, args.minutes, args.data)
        if args.out is not None:
            with args.out.open("a", encoding="utf-8") as file:
                file.write(line(rows[seed]) + "\n")
        print(table.table([rows[seed]])[2], file=sys.stderr, flush=True)
    shown = [rows[seed] for seed in sorted(rows)]
    if not shown:
        print("no drive was run", file=sys.stderr)
        return 1
    text = "\n".join(table.table(shown))
    print(text)
    if args.into is not None:
        page = args.into.read_text(encoding="utf-8")
        before, _, rest = page.partition(BEGIN)
        _, _, after = rest.partition(END)
        args.into.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
