"""The table: every figure that the diagnosis is judged by, of canid per simulator, and of its peers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import permutations
from typing import NamedTuple

from benchmarks.hidden_effects import shares
from benchmarks.hidden_effects.drives import CLEAN, FAINT, FOREIGN, IDS, ONE, REMOVED, TWO
from benchmarks.hidden_effects.hiding import BOTH, SHARE
from benchmarks.hidden_effects.outcomes import CANID, Outcome
from benchmarks.hidden_effects.peers.answer import ADEQUATE, BROKE, NAMED, UNEXPLAINED, Answer
from tests.plants.planted_drive import NOISES

STRONG, EDGE = 50.0, 30.0  # expected likelihood ratios
LARGE_SHARE = 0.20  # share of the residual variance from which a gain must show
# causes that kill the noise: they have rows of their own, whatever their share in the mean
APART = ("attention_gap", "pedal_ceiling")
TIME_PER_MIN = 10.0  # min; times are given per so many

# a cell: the outcomes of a column and the method whose answers count -> text
Cell = Callable[[Sequence[Outcome], str], str]
Of = Callable[[Outcome], bool]
Hit = Callable[[Outcome, Answer], bool]


class Row(NamedTuple):
    """One figure."""

    name: str
    target: str
    cell: Cell
    peers: bool = True  # can a method other than canid have it?


# --- what a drive is ---------------------------------------------------------------------------------


def clean(o: Outcome) -> bool:
    return o.drive.kind == CLEAN


def single(o: Outcome) -> bool:
    """One effect, which is in the catalogue."""
    return o.drive.kind in (ONE, FAINT)


def strong(o: Outcome) -> bool:
    return single(o) and price(o) >= STRONG


def edge(o: Outcome) -> bool:
    return single(o) and EDGE <= price(o) < STRONG


def unknown(o: Outcome) -> bool:
    """One effect that is not in the catalogue, and large enough."""
    return o.drive.kind in (FOREIGN, REMOVED) and part(o) >= SHARE


def two(o: Outcome) -> bool:
    return o.drive.kind == TWO and all(p.lr >= BOTH for p in o.prices.values())


def price(o: Outcome) -> float:
    return o.prices[effect(o)].lr


def part(o: Outcome) -> float:
    return o.prices[effect(o)].share


def effect(o: Outcome) -> str:
    """The one effect of a drive that hides one."""
    (name,) = o.truth
    return name


# --- what an answer is -------------------------------------------------------------------------------


def names(o: Outcome, a: Answer) -> bool:
    return a.says == NAMED


def right(o: Outcome, a: Answer) -> bool:
    """The truth is a name, or among the rivals of one."""
    return a.says == NAMED and any(effect(o) in found for found in a.sets)


def alone(o: Outcome, a: Answer) -> bool:
    return right(o, a) and len(a.sets) == 1


def first(o: Outcome, a: Answer) -> bool:
    """The strongest name is the truth, rivals not counted."""
    return a.says == NAMED and a.sets[0][0] == effect(o)


def noticed(o: Outcome, a: Answer) -> bool:
    return a.says in (NAMED, UNEXPLAINED)


def declined(o: Outcome, a: Answer) -> bool:
    """Something is wrong, and no name is given as the cause."""
    return a.says == UNEXPLAINED


def found(o: Outcome, a: Answer) -> int:
    """How many of the planted effects have a finding of their own."""
    effects = list(o.truth)
    if a.says != NAMED or len(a.sets) < 1:
        return 0
    padded = [*a.sets, *[()] * len(effects)]
    ways = permutations(padded, len(effects))
    return max(sum(e in one for e, one in zip(effects, way, strict=True)) for way in ways)


def exactly(o: Outcome, a: Answer) -> bool:
    return found(o, a) == len(o.truth) == len(a.sets)


# --- cells -------------------------------------------------------------------------------------------


def part_of(of: Of, hit: Hit, say: Callable[[Sequence[bool]], str] = shares.share) -> Cell:
    """Share of the drives of a kind on which an answer is of a kind."""

    def cell(outcomes: Sequence[Outcome], method: str) -> str:
        return say([hit(o, o.answers[method]) for o in outcomes if of(o) and method in o.answers])

    return cell


def size(of: Of) -> Cell:
    """Mean number of causes that one finding holds for possible."""

    def cell(outcomes: Sequence[Outcome], method: str) -> str:
        chosen = [o.answers[method] for o in outcomes if of(o) and method in o.answers]
        return shares.mean([float(len(one)) for a in chosen if a.says == NAMED for one in a.sets])

    return cell


def count(of: Of) -> Cell:
    """Mean number of findings, where there is one."""

    def cell(outcomes: Sequence[Outcome], method: str) -> str:
        chosen = [o.answers[method] for o in outcomes if of(o) and method in o.answers]
        return shares.mean([float(len(a.sets)) for a in chosen if a.says == NAMED])

    return cell


def ratio(outcomes: Sequence[Outcome], method: str) -> str:
    return shares.median([b.value / b.truth for o in outcomes if counted(o) for b in o.parameters if b.truth])


def coverage(outcomes: Sequence[Outcome], method: str) -> str:
    return shares.share([b.low <= b.truth <= b.high for o in outcomes if counted(o) for b in o.parameters])


def counted(o: Outcome) -> bool:
    """Its parameters are those of a named cause."""
    return o.drive.kind in (ONE, FAINT, TWO) and o.answers[CANID].says == NAMED


def extended(o: Outcome) -> bool:
    """The extended model is the true one: the planted cause alone is named, and known by its own name."""
    a = o.answers[CANID]
    return single(o) and a.says == NAMED and len(a.sets) == 1 and a.sets[0][0] == effect(o)


def covered(of: Of, *numbers: str) -> Cell:
    """Share of drives on which the intervals of all these numbers of the driver hold the truth."""

    def cell(outcomes: Sequence[Outcome], method: str) -> str:
        hits = []
        for o in outcomes:
            asked = [b for b in o.driver if b.name in numbers]
            if of(o) and len(asked) == len(numbers):
                hits.append(all(b.low <= b.truth <= b.high for b in asked))
        return shares.share(hits)

    return cell


def off(number: str) -> Cell:
    """Median of estimate over truth."""

    def cell(outcomes: Sequence[Outcome], method: str) -> str:
        return shares.median(
            [b.value / b.truth for o in outcomes if extended(o) for b in o.driver if b.name == number]
        )

    return cell


def gain_shows(o: Outcome, a: Answer) -> bool:
    return o.gain.low > 0.0


def gain_covers_zero(o: Outcome, a: Answer) -> bool:
    """No gain is claimed, or one whose interval holds 0."""
    return math.isnan(o.gain.value) or o.gain.low <= 0.0 <= o.gain.high


def took(of: Of) -> Cell:
    def cell(outcomes: Sequence[Outcome], method: str) -> str:
        return shares.seconds(
            [
                o.answers[method].seconds * TIME_PER_MIN / o.drive.minutes
                for o in outcomes
                if of(o) and method in o.answers
            ]
        )

    return cell


def short(o: Outcome) -> bool:
    return o.drive.minutes == TIME_PER_MIN


def every(o: Outcome) -> bool:
    return True


def _noise(kind: str) -> Of:
    return lambda o: clean(o) and o.drive.noise == kind


def _of(name: str) -> Of:
    return lambda o: strong(o) and effect(o) == name


ROWS = (
    Row("false names on clean logs", "≤ 1 %, bound ≤ 2 %", part_of(clean, names, shares.rare)),
    *(Row(f"· {kind}", "≤ 3 %", part_of(_noise(kind), names, shares.rare)) for kind in NOISES),
    Row(
        "names in the remnant, clean logs of Gaussian noise of one scale",
        "≤ 1 %",
        part_of(lambda o: clean(o) and o.drive.noise != "state", lambda o, a: bool(o.remnant), shares.rare),
        peers=False,
    ),
    Row("“unexplained” on clean logs", "", part_of(clean, declined, shares.rare), peers=False),
    Row("right name or among its rivals, LR ≥ 50", "≥ 97 %", part_of(strong, right)),
    *(Row(f"· {name}", "≥ 97 %", part_of(_of(name), right)) for name in APART),
    Row("· one finding, and no other", "", part_of(strong, alone)),
    Row("· first name is the truth", "", part_of(strong, first)),
    Row("LR 30–50: detected (named or unexplained)", "≥ 95 %", part_of(edge, noticed)),
    Row("LR 30–50: right", "≥ 90 %", part_of(edge, right)),
    Row(
        "truth in cause + rivals, where named, LR ≥ 30",
        "≥ 99 %",
        lambda os, m: part_of(
            lambda o: single(o) and price(o) >= EDGE and m in o.answers and o.answers[m].says == NAMED, right
        )(os, m),
    ),
    Row("· mean size of cause + rivals", "≤ 1.5", size(lambda o: single(o) and price(o) >= EDGE)),
    Row("· mean number of findings", "", count(lambda o: single(o) and price(o) >= EDGE)),
    Row(
        "outside the catalogue, share ≥ 10 %: unexplained or surrogate",
        "≥ 90 %",
        part_of(unknown, declined),
        peers=False,
    ),
    Row(
        "· in nobody's catalogue",
        "",
        part_of(lambda o: unknown(o) and o.drive.kind == FOREIGN, declined),
        peers=False,
    ),
    Row(
        "· taken out of the catalogue",
        "",
        part_of(lambda o: unknown(o) and o.drive.kind == REMOVED, declined),
        peers=False,
    ),
    Row("· a wrong name instead", "", part_of(unknown, names)),
    Row("two effects, both LR ≥ 60: exactly both", "≥ 90 %", part_of(two, exactly)),
    Row("· both, and perhaps others", "", part_of(two, lambda o, a: found(o, a) == 2)),
    Row("· at least one", "", part_of(two, lambda o, a: found(o, a) >= 1)),
    Row("parameters: median of estimate / truth", "0.95–1.05", ratio, peers=False),
    Row("parameters: interval holds the truth", "90–98 %", coverage, peers=False),
    Row(
        "gain's interval above 0, share ≥ 20 %",
        "≥ 95 %",
        part_of(lambda o: single(o) and part(o) >= LARGE_SHARE, gain_shows),
        peers=False,
    ),
    Row(
        "· where the right cause is named",
        "",
        part_of(lambda o: single(o) and part(o) >= LARGE_SHARE and right(o, o.answers[CANID]), gain_shows),
        peers=False,
    ),
    Row(
        "gain's interval holds 0 on clean logs, or none is claimed",
        "≥ 97 %",
        part_of(clean, gain_covers_zero),
        peers=False,
    ),
    Row("K2 in its interval after the extension", "95 ± 3 %", covered(extended, "K2"), peers=False),
    Row("tau2", "95 ± 3 %", covered(extended, "tau2"), peers=False),
    Row("theta2", "95 ± 3 %", covered(extended, "dead_time2"), peers=False),
    Row("· all three at once", "", covered(extended, "K2", "tau2", "dead_time2"), peers=False),
    Row("· K2, median of estimate / truth", "", off("K2"), peers=False),
    Row("· K2 on clean logs", "", covered(clean, "K2"), peers=False),
    Row("· tau2 on clean logs", "", covered(clean, "tau2"), peers=False),
    Row("· theta2 on clean logs", "", covered(clean, "dead_time2"), peers=False),
    Row("CPU time of 10 min logs: median / p95 / worst", "≤ 5 s", took(short)),
    Row("· of all, per 10 min", "", took(every)),
    Row("broke", "0", part_of(every, lambda o, a: a.says == BROKE, shares.rare)),
)


def lines(outcomes: Sequence[Outcome], peers: Sequence[str] = ()) -> list[str]:
    """Lay out the table in Markdown.

    Args:
        outcomes: of any drives, in any order.
        peers: methods whose answers stand next to canid's.
    """
    by = {s: [o for o in outcomes if o.drive.simulator == s] for s in ("one", "two")}
    head = ("figure", "target", "canid", "· simulator one", "· simulator two", *peers)
    out = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in ROWS:
        cells = [row.cell(outcomes, CANID), *(row.cell(by[s], CANID) for s in by)]
        cells += [row.cell(outcomes, peer) if row.peers else shares.NOTHING for peer in peers]
        out.append("| " + " | ".join((row.name, row.target, *cells)) + " |")
    states = sorted({o.code for o in outcomes})
    kinds = [
        f"{sum(o.drive.kind == kind for o in outcomes)} {kind}"
        for kind in (CLEAN, ONE, FAINT, TWO, REMOVED, FOREIGN)
    ]
    out += ["", f"{len(outcomes)} drives: {', '.join(kinds)}. canid {', '.join(states)}."]
    if len(states) > 1:
        out.append("These drives were diagnosed by different states of canid: the figures are nobody's.")
    return out


def by_parameter(outcomes: Sequence[Outcome]) -> list[str]:
    """Lay out how near each parameter comes, effect by effect."""
    out = ["| parameter | estimate / truth, median | interval holds the truth |", "|---|---|---|"]
    chosen = [b for o in outcomes if counted(o) for b in o.parameters]
    for key in sorted({(b.effect, b.name) for b in chosen}):
        these = [b for b in chosen if (b.effect, b.name) == key]
        near = shares.median([b.value / b.truth for b in these if b.truth])
        holds = shares.share([b.low <= b.truth <= b.high for b in these])
        out.append(f"| {'.'.join(key)} | {near} | {holds} |")
    return out


def confusion(outcomes: Sequence[Outcome], method: str = CANID) -> list[str]:
    """Lay out what was planted and what was said of it, strong enough effects only.

    A row counts drives; a drive with several findings stands in the column of its first.
    """
    rows: dict[str, dict[str, int]] = {}
    for o in outcomes:
        if not (clean(o) or strong(o) or unknown(o)) or method not in o.answers:
            continue
        planted = CLEAN if clean(o) else effect(o) + (f" ({o.drive.kind})" if unknown(o) else "")
        a = o.answers[method]
        said = a.sets[0][0] if a.says == NAMED else a.says
        if a.says == NAMED and not clean(o) and effect(o) in a.sets[0][1:]:
            said = f"{said} (rival)"
        cells = rows.setdefault(planted, {})
        cells[said] = cells.get(said, 0) + 1
    order = [CLEAN, *IDS]
    out = ["| planted | drives | said |", "|---|---|---|"]
    for planted in sorted(rows, key=lambda p: (order.index(p) if p in order else len(order), p)):
        cells = rows[planted]
        cells_text = ", ".join(
            f"{name} {n}" for name, n in sorted(cells.items(), key=lambda kv: (-kv[1], kv[0]))
        )
        out.append(f"| {planted} | {sum(cells.values())} | {cells_text} |")
    return out


def wrong(outcomes: Sequence[Outcome], method: str = CANID) -> list[str]:
    """List the drives on which the answer was wrong and strong enough effects were planted."""
    out = []
    for o in outcomes:
        a = o.answers[method]
        if clean(o):
            fine = a.says == ADEQUATE
        elif o.drive.kind == TWO:
            fine = not two(o) or exactly(o, a)
        elif o.drive.kind in (FOREIGN, REMOVED):
            fine = not unknown(o) or declined(o, a)
        else:
            fine = not (strong(o) or edge(o)) or alone(o, a)
        if not fine or a.says == BROKE:
            d = o.drive
            planted = ", ".join(f"{e} LR {p.lr:.0f} share {p.share:.2f}" for e, p in o.prices.items())
            said = " and ".join("/".join(one) for one in a.sets)
            out.append(
                f"seed {d.seed} {d.kind} simulator {d.simulator} {d.noise} {d.profile} {d.minutes:g} min: "
                f"{planted or 'nothing'} -> {a.says} {said}{a.why}"
            )
    return out
