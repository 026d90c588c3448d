"""Hide causes in simulated drives and ask `diagnose`: how often is it right, silent, wrong?

    python -m benchmarks.hidden_effects [--logs 500] [--first-seed 90000] [--workers 2] [--out FILE] [--peers]

Two planting simulators, six noise kinds, three profiles, 10 to 60 min; `expected` prices each hidden effect as the
likelihood ratio that an oracle would see. A drive is a function of its seed alone: a run may be cut, and with --out it
goes on where it was.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path

# one thread: the matrices are small, and times would be those of threads that wait for each other
os.environ["OMP_NUM_THREADS"] = "1"

from benchmarks.hidden_effects import ablation, table
from benchmarks.hidden_effects.drives import Drive, drives
from benchmarks.hidden_effects.outcomes import CANID, Outcome, code, fresh, line, run, stored
from benchmarks.hidden_effects.peers.methods import PEERS, absent
from benchmarks.identification.peers.peer import ELSEWHERE

# drives between two lines of progress
PROGRESS_DRIVES = 20


def came(wanted: Sequence[Drive], peers: Sequence[str], workers: int) -> Iterator[Outcome]:
    """Run drives, in the order in which they end."""
    one = partial(run, peers={name: PEERS[name].ask for name in peers})
    if workers == 1:
        yield from map(one, wanted)
        return
    with ProcessPoolExecutor(workers) as pool:
        for done in as_completed([pool.submit(one, drive) for drive in wanted]):
            yield done.result()


def appended(path: Path | None, text: str) -> None:
    """Add a line to a file; one that was cut off in the middle of a line gets its end first."""
    if path is None:
        return
    with path.open("ab+") as file:
        if file.tell():
            file.seek(-1, os.SEEK_END)
            if file.read(1) != b"\n":
                file.write(b"\n")
        file.write(text.encode() + b"\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.hidden_effects",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--logs", type=int, default=500)
    parser.add_argument("--first-seed", type=int, default=90_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="JSON lines; drives that it holds are not run again"
    )
    parser.add_argument("--peers", action="store_true", help="naive, STLSQ and FROLS along with canid")
    parser.add_argument(
        "--peers-python", metavar="PATH", help="another interpreter, for peers that need an older numpy"
    )
    parser.add_argument("--wrong", action="store_true", help="list the drives that went wrong")
    parser.add_argument("--confusion", action="store_true", help="what was planted, and what was said of it")
    parser.add_argument("--parameters", action="store_true", help="how near each parameter comes")
    parser.add_argument(
        "--ablation", action="store_true", help="what each adequacy test is worth: answers without it"
    )
    args = parser.parse_args(argv)
    if args.logs < 1 or args.workers < 1 or args.first_seed < 0:
        parser.error("--logs and --workers at least 1, --first-seed at least 0")
    if args.peers_python:
        os.environ[ELSEWHERE] = args.peers_python
    peers = []
    for name in PEERS if args.peers else ():
        why = absent(name)
        if why:
            print(f"{name}: {why}", file=sys.stderr)
        else:
            peers.append(name)
    wanted = drives(args.logs, args.first_seed)
    done = fresh(stored(args.out), wanted, {CANID, *peers}) if args.out else {}
    left = [drive for drive in wanted if drive not in done]
    if done:
        print(f"{len(done)} drives are in {args.out}, {len(left)} to run", file=sys.stderr, flush=True)
    # now, and so in every worker: later somebody may have edited what is already loaded
    code()
    began = time.monotonic()
    for k, outcome in enumerate(came(left, peers, args.workers), 1):
        done[outcome.drive] = outcome
        appended(args.out, line(outcome))
        if k % PROGRESS_DRIVES == 0 or k == len(left):
            took = (time.monotonic() - began) / 60
            print(f"{k} of {len(left)} drives in {took:.1f} min", file=sys.stderr, flush=True)
    outcomes = [done[drive] for drive in wanted]
    print("\n".join(table.lines(outcomes, peers)))
    if args.parameters:
        print("\n" + "\n".join(table.by_parameter(outcomes)))
    for method in (CANID, *peers) if args.confusion else ():
        print(f"\n{method}:\n\n" + "\n".join(table.confusion(outcomes, method)))
    if args.ablation:
        print("\n" + "\n".join(ablation.lines(outcomes)))
    if args.wrong:
        print("\n" + "\n".join(table.wrong(outcomes)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
