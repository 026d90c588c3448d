"""Print every table of the identification benchmark: canid, its peers, and the Cramér-Rao bound.

python -m benchmarks identification [--only TABLE ...] [--runs 200] [--first-seed S] [--no-peers] [--workers 1]
    [--peers-python PATH] [--into docs/evidence/identification.md]
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
import warnings
from pathlib import Path

# one thread: the matrices are small, and times would be those of threads that wait for each other
os.environ["OMP_NUM_THREADS"] = "1"
# run as a folder, Python puts the folder itself first; its files are the package benchmarks.identification
if not __package__:
    sys.path[0] = str(Path(__file__).resolve().parents[2])

from benchmarks.identification.peers.peer import ELSEWHERE
from benchmarks.identification.table import Settings, markdown
from benchmarks.identification.tables import TABLES


def put(page: str, name: str, text: str) -> str:
    r"""Put a table into its place on a page.

    >>> put("a <!-- t -->old<!-- /t --> b", "t", "new")
    'a <!-- t -->\nnew\n<!-- /t --> b'
    """
    begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    before, found, rest = page.partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        raise SystemExit(f"no {begin} ... {end} in the page")
    return f"{before}{begin}\n{text}\n{end}{after}"


def main(argv: list[str] | None = None) -> int:
    names = [name for name, _ in TABLES]
    parser = argparse.ArgumentParser(prog="benchmarks/identification", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--only", nargs="+", choices=names, metavar="TABLE", default=names, help=", ".join(names)
    )
    parser.add_argument("--runs", type=int, default=200, help="runs per row; slow rows take fewer and say so")
    parser.add_argument("--first-seed", type=int, default=50_000, metavar="S")
    parser.add_argument("--no-peers", action="store_true", help="canid and the bounds alone")
    parser.add_argument("--workers", type=int, default=1, help="processes; times are only true with one")
    parser.add_argument(
        "--peers-python", metavar="PATH", help="another interpreter, for peers that need an older numpy"
    )
    parser.add_argument(
        "--into",
        metavar="FILE",
        type=Path,
        help="also replace what stands between <!-- TABLE --> and <!-- /TABLE --> there",
    )
    args = parser.parse_args(argv)
    if args.runs < 2 or args.workers < 1:
        parser.error("--runs at least 2, --workers at least 1")
    if args.peers_python:
        os.environ[ELSEWHERE] = args.peers_python
    # peers warn a lot, mostly of numpy's future; what they print would stand between the tables
    warnings.simplefilter("ignore")
    settings = Settings(args.runs, args.first_seed, not args.no_peers, args.workers)
    print(f"Python {platform.python_version()}, {platform.machine()}, {settings}\n", flush=True)
    for name, table in TABLES:
        if name not in args.only:
            continue
        began = time.perf_counter()
        parts = [markdown(part) for part in table(settings)]
        last = settings.first_seed + settings.runs - 1
        took = time.perf_counter() - began
        source = f"`{name}`: {settings.runs} runs, seeds {settings.first_seed} to {last}, {took:.0f} s"
        text = "\n\n".join(parts)
        # in the paragraph of the notes; after a table's last row it needs one of its own
        text += f"\n\n{source}" if text.endswith("|") else f" {source}"
        print(text + "\n", flush=True)
        if args.into:
            args.into.write_text(put(args.into.read_text(encoding="utf-8"), name, text), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
