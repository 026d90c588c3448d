"""Try out what recording promises.

    python -m benchmarks.reliability kill|cut|ends|seams|disks|buses [--trials N] [--seed S] [--out FILE] [--load N]
    python -m benchmarks.reliability kill --format asc --rates 8000 --load 12
    python -m benchmarks.reliability attack [--only FAMILY ...] [--trials N] [--seed S]
    python -m benchmarks.reliability soak [--hours 1] [--rate 4000] [--channel vcan0]

Runs itself in a network namespace that has loopback alone (tests/bus/alone). Prints a table; exit code 1 where a
promise was broken. With --out it goes on where it was. `cut` and `disks` need root: they mount file systems.
"""

from __future__ import annotations

import argparse
import math
import secrets
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks.network_namespace import enter

PROMISES = {
    "kill": "kills",
    "cut": "cuts",
    "ends": "ends",
    "seams": "seams",
    "disks": "disks",
    "buses": "buses",
    "attack": "attack",
}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reliability", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("promise", choices=(*PROMISES, "soak"))
    parser.add_argument("--trials", type=int, help="default: what docs/reliability.md states")
    parser.add_argument("--seed", type=int, help="default: 0; attack: drawn, and printed")
    parser.add_argument("--only", nargs="+", default=(), metavar="FAMILY", help="attack: of these alone")
    parser.add_argument("--out", type=Path, help="one line per trial; a run goes on where the file ends")
    parser.add_argument("--hours", type=float, default=1.0, help="soak")
    parser.add_argument("--rate", type=float, default=4000.0, help="soak: frames/s")
    parser.add_argument(
        "--channel", default="", help="soak: of SocketCAN, without a wire; default: udp_multicast"
    )
    parser.add_argument("--format", choices=("blf", "asc", "log"), default="blf", help="kill")
    parser.add_argument("--rates", type=int, nargs="+", help="kill: frames/s, in turn")
    parser.add_argument("--load", type=int, default=0, metavar="N", help="busy processes in addition")
    args = parser.parse_args()
    if args.seed is None:
        args.seed = secrets.randbelow(10**6) if args.promise == "attack" else 0
        # the namespace below starts this again: with the same seed
        sys.argv += ["--seed", str(args.seed)]
    enter("benchmarks.reliability")
    from benchmarks.reliability.load import load

    with load(args.load):
        if args.promise == "soak":
            from benchmarks.reliability import soak

            return soak.run(args.hours, args.rate, args.channel)
        return tried(args)


def tried(args: argparse.Namespace) -> int:
    """Run the trials that are not stored yet, and print the table of all."""
    from benchmarks.reliability import table
    from benchmarks.reliability.outcome import Outcome

    promise = import_module(f"benchmarks.reliability.{PROMISES[args.promise]}")
    words: dict[str, Any] = {"suffix": f".{args.format}"} if args.promise == "kill" else {}
    words |= {"rates": tuple(args.rates)} if args.promise == "kill" and args.rates else {}
    if args.promise == "attack":
        words |= {"only": args.only}
        print(f"seed {args.seed}", file=sys.stderr, flush=True)
    done = table.stored(args.out) if args.out else {}
    for k in range(args.trials or promise.TRIALS):
        if k in done:
            continue
        try:
            done[k] = list(promise.trial(k, args.seed, **words))
        except Exception as error:  # a trial that cannot be judged is one that went wrong
            done[k] = [Outcome("not judged", math.nan, 0, f"trial {k}: {type(error).__name__}: {error}")]
        for outcome in done[k]:
            if outcome.wrong:
                print(f"trial {k}: {outcome.group}: {outcome.wrong}", file=sys.stderr, flush=True)
        if args.out:
            with args.out.open("a") as file:
                file.write(table.line(k, done[k]) + "\n")
    outcomes = [outcome for k in sorted(done) for outcome in done[k]]
    print(getattr(promise, "markdown", table.markdown)(outcomes))
    return int(any(outcome.wrong for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
