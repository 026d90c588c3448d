"""Which DBC files under folders canid reads, repairs or refuses, next to plain cantools.

    python -m benchmarks dbc FOLDER... [--all]

Each file on its own; with what was repaired, or the reason of a refusal. --all lists files too that need no repair.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import cantools

from canid.signals.dbc_text.parsing import Parser
from canid.signals.vehicle.database import load
from canid.values.errors import ConfigError

SUFFIXES = (".dbc", ".arxml", ".kcd", ".sym")


def of_cantools(path: Path, *, strict: bool) -> bool:
    """Whether cantools alone reads a file."""
    try:
        cantools.database.load_file(path, strict=strict)
    except Exception:  # of any kind: it refuses the file
        return False
    return True


def main() -> None:
    """Print a line for each file that is not read as it is, and the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks dbc", description=__doc__.split("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--all", action="store_true", help="list every file")
    options = parser.parse_args()
    files = sorted({f for folder in options.folders for f in folder.rglob("*") if f.suffix in SUFFIXES})
    counts: Counter[str] = Counter()
    for path in files:
        strict, lenient = of_cantools(path, strict=True), of_cantools(path, strict=False)
        counts["cantools, strict"] += strict
        counts["cantools, not strict"] += lenient
        with Parser() as child:
            try:
                dbc, warnings, _ = load(path, None, child)
            except ConfigError as error:
                counts["canid: refused"] += 1
                print(f"refused   {path.name}: {error}")
                continue
        signals = sum(len(message.signals) for message in dbc.messages.values())
        outcome = "read" if lenient else "repaired"
        counts[f"canid: {outcome}"] += 1
        if options.all or not lenient:
            print(f"{outcome:9} {path.name}: {len(dbc.messages)} messages, {signals} signals")
            for line in warnings:
                print(f"            {line}")
    print(f"\n{len(files)} files")
    for what, n in sorted(counts.items()):
        print(f"{what:22} {n:5}")


if __name__ == "__main__":
    main()
