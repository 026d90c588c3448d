"""Do the pages of a drive contradict themselves? Each kind that a reader has found is looked for in every page.

    python -m benchmarks.pages [--drives 60] [--first-seed 7000] [--workers 1]

Each drive is planted: with one effect of the catalogue or none, of two simulators that share no code with canid, of 1 to
5 minutes, with drawn noise and course. Read are the pages of `check`, `identify` and `diagnose`, and that of `compare`
with the drive of the next seed. The kinds stand in `tests/fixtures/contradictions.py`.
"""

from __future__ import annotations

import io
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np

from benchmarks.hidden_effects.drawn_drives import print_table
from benchmarks.hidden_effects.first_sentence import PLANTED
from canid.ui.cli import main as canid_main
from tests.fixtures.contradictions import contradictions
from tests.plants import plant_one, plant_two
from tests.plants.measurement import LEAN, write

VERBS = ("check", "identify", "diagnose", "compare")
# minutes of a drive: from too short for anything to enough for most
MINUTES = (1.0, 2.0, 3.0, 5.0)


class Read(NamedTuple):
    """What was found in the pages of one drive."""

    seed: int
    pages: int
    found: tuple[tuple[str, str], ...]  # verb, what contradicts what


def drive(seed: int, folder: Path) -> Path:
    """A planted drive as a log: a function of its seed alone."""
    rng = np.random.default_rng(seed)
    effects = (None, *PLANTED)
    effect = effects[seed % len(effects)]
    hidden = {}
    if effect is not None:
        name, weakest, strongest = PLANTED[effect]
        hidden[effect] = {name: float(rng.uniform(weakest, strongest))}
    plant = (plant_one, plant_two)[seed // len(effects) % 2]
    minutes, noise = float(rng.choice(MINUTES)), str(rng.choice(("white", "ar1", "mix")))
    profile = str(rng.choice(("urban", "mixed")))
    made = plant.plant(hidden, seed=seed, minutes=minutes, noise=noise, profile=profile)
    write(made, folder / f"{seed}.blf")
    return folder / f"{seed}.blf"


def run(seed: int, verbs: Sequence[str] = VERBS) -> Read:
    """Write the pages of a drive, and read them."""
    found, pages = [], 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = drive(seed, folder)
        for verb in verbs:
            logs = [log, drive(seed + 1, folder)] if verb == "compare" else [log]
            out = folder / f"{verb}.html"
            words = [verb, *map(str, logs), "--vehicle", str(LEAN), "--report", str(out)]
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                canid_main(words)
            if not out.is_file():
                found.append((verb, "no page: it was not written"))
                continue
            pages += 1
            found += [(verb, says) for says in contradictions(out.read_text(encoding="utf-8"))]
    for verb, says in found:
        print(f"{seed} {verb}: {says}", file=sys.stderr, flush=True)
    print(f"{seed}: {pages} pages, {len(found)} contradictions", file=sys.stderr, flush=True)
    return Read(seed, pages, tuple(found))


def table(read: Sequence[Read]) -> list[str]:
    """Counts, and a row for each kind that was found."""
    kinds = Counter((verb, says.partition(":")[0]) for one in read for verb, says in one.found)
    lines = [
        f"{len(read)} drives, {sum(one.pages for one in read)} pages, {sum(kinds.values())} contradictions"
    ]
    if kinds:
        lines += ["", "| page | kind | times |", "|---|---|---|"]
    return lines + [f"| {verb} | {kind} | {count} |" for (verb, kind), count in kinds.most_common()]


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table."""
    return print_table("benchmarks.pages", __doc__, 60, 7000, run, table, argv)


if __name__ == "__main__":
    sys.exit(main())
