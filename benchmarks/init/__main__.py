"""How often `canid init` names the right signal of five roles, from DBC files alone.

    python -m benchmarks init [--dbc FOLDER ...] [--each]

Each role of a file ends as right, wrong or open. "Exists" are the roles for which the file has a signal, "found" is the
share of these that is written rightly. The truth is two tables of names: of the brands that were read when the rules
were written, and of the others.
"""

from __future__ import annotations

import argparse
import fnmatch
import tomllib
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from canid.analysis.proposal import databases, proposal
from canid.analysis.proposal.choice import Decisions
from canid.values.errors import CanidError

HERE = Path(__file__).parent
HALVES = {"rules": "truth_rules_half.toml", "judged": "truth_judged_half.toml", "unseen": "truth_unseen.toml"}
ROLES = ("pedal", "speed", "gap", "range_rate", "brake")
DEFAULT = Path(__file__).parents[3] / "shared" / "data" / "opendbc"


class Outcome(NamedTuple):
    """One role of one file."""

    half: str
    brand: str
    file: str
    role: str
    exists: bool
    result: str  # right, wrong, open
    written: str


def judge(
    decisions: Decisions, truth: Mapping[str, Any], half: str, file: str, held: Collection[str]
) -> Iterator[Outcome]:
    """Compare one proposal with the truth.

    Args:
        decisions: of the proposal.
        truth: of the file.
        half: of the brands.
        file: its name.
        held: the signals that this version of the file has.
    """
    for role in ROLES:
        right = truth.get(role, [])
        chosen = decisions.roles[role].chosen
        written = chosen.candidate.where if chosen is not None else ""
        by_tracks = (
            role in ("gap", "range_rate") and decisions.tracks is not None and not decisions.tracks.unknown
        )
        if by_tracks and decisions.tracks is not None:
            written, right = decisions.tracks.pattern, truth.get("tracks", [])
        fits = any(fnmatch.fnmatchcase(written, pattern) for pattern in right)
        result = "open" if not written else "right" if fits else "wrong"
        exists = any(fnmatch.filter(held, pattern) for pattern in truth.get(role, []))
        exists |= role in ("gap", "range_rate") and bool(truth.get("tracks"))
        yield Outcome(half, truth["brand"], file, role, exists, result, written)


def outcomes(folders: Sequence[Path]) -> Iterator[Outcome]:
    """Judge every file of the truth that is in one of the folders."""
    for half, name in HALVES.items():
        table = tomllib.loads((HERE / name).read_text(encoding="utf-8")) if (HERE / name).is_file() else {}
        for file, truth in table.items():
            path = next((folder / file for folder in folders if (folder / file).is_file()), None)
            if path is None:
                continue
            try:
                decisions = proposal(path).decisions
                held = {
                    f"{m.name}.{s.name}"
                    for f in databases([path])[0]
                    for m in f.messages.values()
                    for s in m.signals
                }
            except CanidError as error:
                print(f"{file}: {error}")
                continue
            yield from judge(decisions, truth, half, file, held)


def share(part: int, whole: int) -> str:
    """A share in %, with its numbers."""
    return f"{100 * part / whole:5.1f} % ({part} of {whole})" if whole else "-"


def summary(name: str, of: Sequence[Outcome]) -> str:
    """One line."""
    results = Counter(each.result for each in of)
    exist = [each for each in of if each.exists]
    found = sum(each.result == "right" for each in exist)
    good = results["right"] + results["open"]
    return (
        f"{name:24} right or open {share(good, len(of)):>22}   wrong {share(results['wrong'], len(of)):>20}"
        f"   found of existing {share(found, len(exist)):>22}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks init", description=__doc__)
    parser.add_argument("--dbc", metavar="FOLDER", type=Path, nargs="+", default=[DEFAULT])
    parser.add_argument(
        "--each", action="store_true", help="also each role that is wrong, or open although it exists"
    )
    args = parser.parse_args()
    of = list(outcomes(args.dbc))
    if not of:
        parser.error(f"none of the files of the truth is in {', '.join(map(str, args.dbc))}")
    brands: dict[str, list[Outcome]] = defaultdict(list)
    for each in of:
        brands[f"{each.brand} ({each.half})"].append(each)
    print(f"{'brand':24} " + " ".join(f"{role:>12}" for role in ROLES) + "   right+wrong/exist")
    for brand, its in brands.items():
        cells = []
        for role in ROLES:
            its_role = [each for each in its if each.role == role]
            counts = Counter(each.result for each in its_role)
            cells.append(f"{counts['right']}+{counts['wrong']}/{sum(each.exists for each in its_role)}")
        print(f"{brand:24} " + " ".join(f"{cell:>12}" for cell in cells))
    print()
    for role in ROLES:
        print(summary(role, [each for each in of if each.role == role]))
    for half in HALVES:
        its = [each for each in of if each.half == half]
        if its:
            print(summary(f"half: {half}, {len({e.brand for e in its})} brands", its))
    print(summary(f"all, {len({each.brand for each in of})} brands", of))
    if args.each:
        for each in of:
            if each.result == "wrong" or (each.exists and each.result == "open"):
                print(f"{each.result:6} {each.file}: {each.role} {each.written}")


if __name__ == "__main__":
    main()
