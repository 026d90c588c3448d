"""List the benchmarks, or run one by its name.

    python -m benchmarks [NAME [ARGUMENT ...]]

Durations are those of the usual form on a 2-core machine.
"""

from __future__ import annotations

import argparse
import runpy
import sys
from collections.abc import Sequence

from benchmarks.registry import BENCHMARKS


def listing() -> str:
    """One line per benchmark: name, duration, what it measures."""
    names = max(len(each.name) for each in BENCHMARKS)
    durations = max(len(each.duration) for each in BENCHMARKS)
    return "\n".join(
        f"{each.name:{names}}  {each.duration:>{durations}}  {each.measures}" for each in BENCHMARKS
    )


def main(argv: Sequence[str] | None = None) -> None:
    """Print the list, or become the benchmark."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=f"Run a benchmark; NAME --help lists its options.\n\n{listing()}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="one of the names above")
    words = list(sys.argv[1:] if argv is None else argv)
    name = parser.parse_args(words[:1]).name
    modules = {each.name: each.module for each in BENCHMARKS}
    if name is None:
        print(listing())
    elif name in modules:
        sys.argv[1:] = words[1:]
        runpy.run_module(modules[name], run_name="__main__", alter_sys=True)
    else:
        parser.error(f"there is no benchmark {name}; `python -m benchmarks` lists them")


if __name__ == "__main__":
    main()
