"""The command line of a table over drives that are functions of their seeds alone."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

T = TypeVar("T")


def print_table(
    module: str,
    description: str | None,
    drives: int,
    first_seed: int,
    run: Callable[[int], T | None],
    table: Callable[[Sequence[T]], list[str]],
    argv: Sequence[str] | None,
) -> int:
    """Run drives and print their table.

    Args:
        module: runs as `python -m MODULE`.
        description: its docstring.
        drives: how many, unless `--drives` says otherwise.
        first_seed: unless `--first-seed` says otherwise.
        run: a seed -> what came of its drive; None: it does not count. A function of a module, for other processes.
        table: what came of the drives that count -> lines.
        argv: the command line; None: that of the process.
    """
    parser = argparse.ArgumentParser(
        prog=f"python -m {module}",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--drives", type=int, default=drives)
    parser.add_argument("--first-seed", type=int, default=first_seed)
    parser.add_argument("--workers", type=int, default=1)
    args = parser.parse_args(argv)
    with ProcessPoolExecutor(args.workers) as pool:
        found = pool.map(run, range(args.first_seed, args.first_seed + args.drives))
        print("\n".join(table([one for one in found if one is not None])))
    return 0
