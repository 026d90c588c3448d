"""Do two checkouts give the same results? Write those of each, then compare the folders.

    python -m benchmarks unchanged write FOLDER [--canid EXECUTABLE] [--drives 120] [--seed 90000] [--data ../shared/data]
    python -m benchmarks unchanged compare FOLDER FOLDER

`write` asks for identify and diagnose of planted drives, and for `look`, `check`, identify and diagnose of shipped logs
and of the measured ones, where they are. The drives are planted by this checkout, a function of their seeds, into
FOLDER.drives, or where --logs says; --canid is another checkout's .venv/bin/canid. Results that FOLDER holds are kept, so
a run may be cut and goes on. `compare` ends with 1 where an exit code, a word or a number (1e-9, relative) of a JSON
differs; `schema` and `versions` are left out, and texts that differ are listed.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path

from benchmarks.unchanged.comparison import compare
from benchmarks.unchanged.tasks import HERE, Task, measured, planted, run, shipped

# differences of one result that are printed
SHOWN = 8


def write(args: argparse.Namespace) -> int:
    """Write results; those that are there are kept."""
    os.environ["OMP_NUM_THREADS"] = "1"
    args.folder.mkdir(parents=True, exist_ok=True)
    logs = args.logs or args.folder.with_name(f"{args.folder.name}.drives")
    canid = args.canid.absolute()

    def work(task: Task) -> None:
        if not (args.folder / f"{task.name}.json").exists():
            run(canid, task, args.folder)
            print(task.name, file=sys.stderr, flush=True)

    tasks = chain(shipped(), planted(logs, args.drives, args.seed), measured(args.data))
    with ThreadPoolExecutor(args.workers) as pool:
        list(pool.map(work, tasks))
    print(f"{len(list(args.folder.glob('*.json')))} results in {args.folder}")
    return 0


def show(args: argparse.Namespace) -> int:
    """Compare two folders and print what differs."""
    compared = compare(*args.folders)
    for name, texts in compared.different.items():
        print(f"{name}: {len(texts)} differences", *texts[:SHOWN], sep="\n  ")
    for name in compared.texts:
        print(f"{name}: printed text differs")
    for name in compared.alone:
        print(f"{name}: in one folder only")
    print(
        f"{compared.results} results compared: {len(compared.different)} differ, {len(compared.texts)} in their text; "
        f"numbers that count as equal differ by at most {compared.largest:.1e}"
    )
    return int(bool(compared.different) or not compared.results)


def main(argv: Sequence[str] | None = None) -> int:
    """Write or compare."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks unchanged",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verbs = parser.add_subparsers(required=True)
    writing = verbs.add_parser("write")
    writing.add_argument("folder", type=Path)
    writing.add_argument("--canid", type=Path, default=HERE / ".venv/bin/canid", metavar="EXECUTABLE")
    writing.add_argument("--drives", type=int, default=120)
    writing.add_argument("--seed", type=int, default=90_000, help="of the first drive")
    writing.add_argument("--data", type=Path, default=HERE.parent / "shared/data", metavar="FOLDER")
    writing.add_argument("--logs", type=Path, metavar="FOLDER", help="for the planted drives")
    writing.add_argument("--workers", type=int, default=2)
    writing.set_defaults(do=write)
    comparing = verbs.add_parser("compare")
    comparing.add_argument("folders", type=Path, nargs=2)
    comparing.set_defaults(do=show)
    args = parser.parse_args(argv)
    return int(args.do(args))


if __name__ == "__main__":
    sys.exit(main())
