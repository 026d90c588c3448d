"""What became of a drive with an effect, and the table of it: a row per effect, a column per strength."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from tests.plants.quoted_intervals import Quoted
from tests.plants.sensor_effects import EFFECTS


class Outcome(NamedTuple):
    """One drive with one effect at one strength."""

    simulator: str
    seed: int
    place: int  # in EFFECTS; -1: the drive as it is
    strength: float
    before: tuple[Quoted, ...]
    after: tuple[Quoted, ...]
    refused: bool  # canid refuses the table
    findings: tuple[str, ...]  # names of findings that the drive as it is does not have
    causes: tuple[str, ...] | None  # that `diagnose` names; None: not diagnosed
    misses: tuple[Quoted, ...]  # silent ones


def _share(part: int, whole: int) -> str:
    return f"{part}/{whole}" if whole else "–"


def _cells(cells: Sequence[Outcome]) -> tuple[str, str, str, str]:
    """Coverage, withheld share, share with a finding, silent misses."""
    after = [each for cell in cells for each in cell.after]
    before = sum(len(cell.before) for cell in cells)
    return (
        _share(sum(each.covers for each in after), len(after)),
        _share(before - min(len(after), before), before),
        _share(sum(bool(cell.findings) or cell.refused for cell in cells), len(cells)),
        str(sum(len(cell.misses) for cell in cells)),
    )


def _names(cells: Iterable[Outcome]) -> str:
    counted = Counter(name for cell in cells for name in cell.findings)
    return ", ".join(f"`{name}` {number}" for name, number in counted.most_common(4))


def rows(found: Sequence[Outcome]) -> Iterator[str]:
    """Lines of the table, and of the silent misses."""
    yield "| effect | strengths | intervals that cover | withheld | found | false causes | findings |"
    yield "|---|---|---|---|---|---|---|"
    for place in sorted({each.place for each in found}):
        mine = [each for each in found if each.place == place]
        strengths = sorted({each.strength for each in mine})
        columns = [_cells([each for each in mine if each.strength == strength]) for strength in strengths]
        covers, withheld, named, _ = (" · ".join(part) for part in zip(*columns, strict=True))
        diagnosed = [each for each in mine if each.causes is not None]
        causes = Counter(name for each in diagnosed for name in each.causes or ())
        false = f"{sum(bool(each.causes) for each in diagnosed)} of {len(diagnosed)}" if diagnosed else "–"
        false += "".join(f", `{name}` {number}" for name, number in causes.most_common(3))
        name = "none" if place < 0 else EFFECTS[place].name
        unit = "" if place < 0 else f"{' · '.join(f'{x:g}' for x in strengths)} {EFFECTS[place].unit}"
        yield f"| {name} | {unit} | {covers} | {withheld} | {named} | {false} | {_names(mine)} |"
    for each in found:
        for miss in each.misses:
            effect = EFFECTS[each.place]
            yield (
                f"silent miss, {each.simulator} {each.seed}, {effect.name} {each.strength:g} {effect.unit}: {miss}"
                + (f" ({', '.join(each.findings)})" if each.findings else "")
            )
