"""The tables of a planted fleet's score."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from scipy.stats import beta

from benchmarks.fleet.planted_score import (
    APPROXIMATE,
    CHANGED,
    CLEAN,
    HABIT,
    QUANTITIES,
    SWAPPED,
    Estimate,
    Score,
    coverage,
    rmse,
)
from tests.fleet.planted.hidden_population import VALUES


def table(scores: Sequence[Score]) -> list[str]:
    """All tables of the scores together."""
    return [
        f"{_fleets(scores)}.",
        "",
        *_population(scores),
        "",
        *_estimates(scores),
        "",
        *_causes(scores),
    ]


def totals(scores: Sequence[Score]) -> str:
    """One line: how many intervals of all fleets hold, but for those whose truth is approximate."""
    held = [one for score in scores for one in score.population if one.what not in APPROXIMATE]
    shrunken = [
        one.shrunken for score in scores for one in score.estimates if one.parameter not in APPROXIMATE
    ]
    counts = {of: coverage(one for one in held if one.of == of) for of in QUANTITIES}
    return ", ".join(f"{of} {k}/{n}" for of, (k, n) in {**counts, "drivers": coverage(shrunken)}.items())


def _fleets(scores: Sequence[Score]) -> str:
    counts = Counter((one.drives, one.drivers) for one in scores)
    sizes = ", ".join(
        f"{n} fleet{'s' * (n > 1)} of {drives} drives of {drivers} drivers"
        for (drives, drivers), n in sorted(counts.items(), reverse=True)
    )
    return f"{sizes}; seeds {', '.join(str(one.seed) for one in scores)}"


def _population(scores: Sequence[Score]) -> list[str]:
    out = [
        "| population: 95 % interval holds the truth | mean | between drivers | within a driver | "
        "between, median of estimate / truth |",
        "|---|---|---|---|---|",
    ]
    held = [one for score in scores for one in score.population]
    for parameter in (*VALUES, "all but ~"):
        own = [
            one
            for one in held
            if one.what == parameter or (parameter == "all but ~" and one.what not in APPROXIMATE)
        ]
        if not own:
            continue
        cells = [_share(coverage(one for one in own if one.of == of)) for of in QUANTITIES]
        ratios = sorted(one.value / one.truth for one in own if one.of == "between")
        middle = f"{ratios[len(ratios) // 2]:.2f}" if ratios else "–"
        name = f"{parameter} ~" if parameter in APPROXIMATE else parameter
        out.append(f"| {name} | {' | '.join(cells)} | {middle} |")
    return [*out, "", "~: the truth is known up to the road's slope and the loop."]


def _estimates(scores: Sequence[Score]) -> list[str]:
    out = [
        "| drivers | coverage: own drives | shrunken | rms error in standard deviations between drivers: own drives | "
        "shrunken, same drivers | shrunken, all |",
        "|---|---|---|---|---|---|",
    ]
    every = [one for score in scores for one in score.estimates]
    for parameter in VALUES:
        clean = [one for one in every if one.parameter == parameter and one.kind == CLEAN]
        if clean:
            name = f"{parameter} ~" if parameter in APPROXIMATE else parameter
            out.append(f"| {name} | {_errors(clean)} |")
    sure = [one for one in every if one.parameter not in APPROXIMATE]
    for kind in (CLEAN, HABIT, CHANGED, SWAPPED):
        of_kind = [one for one in sure if one.kind == kind]
        if of_kind:
            out.append(f"| all but ~, {kind} | {_errors(of_kind)} |")
    return out


def _errors(of: Sequence[Estimate]) -> str:
    both = [(one.own, one) for one in of if one.own is not None and math.isfinite(one.own.value)]
    own = rmse((held.value - held.truth) / one.between for held, one in both)
    paired = rmse((one.shrunken.value - one.shrunken.truth) / one.between for _, one in both)
    every = rmse((one.shrunken.value - one.shrunken.truth) / one.between for one in of)
    return (
        f"{_share(coverage(held for held, _ in both))} | {_share(coverage(one.shrunken for one in of))} | "
        f"{_number(own)} | {_number(paired)} | {_number(every)}"
    )


def _causes(scores: Sequence[Score]) -> list[str]:
    every = [one for score in scores for one in score.causes]
    out = ["| causes, several drives together | planted | found | as a surrogate |", "|---|---|---|---|"]
    planted = [one for one in every if one.planted]
    for effect in sorted({(one.subject, one.effect) for one in planted}):
        own = [one for one in planted if (one.subject, one.effect) == effect]
        found = sum(one.named and not one.surrogate for one in own)
        surrogate = sum(one.named and one.surrogate for one in own)
        out.append(f"| {effect[0]}: {effect[1]} | {len(own)} | {found} | {surrogate} |")
    false = [one for one in every if one.named and not one.planted]
    clean = sum(score.clean_subjects for score in scores)
    listed = "; ".join(
        f"{one.effect}{' (surrogate)' * one.surrogate} of {one.subject} {one.who}" for one in false
    )
    out.append(f"| false names, of {clean} clean subjects and all others | | {len(false)} | |")
    return [*out, "", f"False names: {listed or 'none'}."]


def _share(hits: tuple[int, int]) -> str:
    """Hits of all, with the interval of Clopper and Pearson.

    Example:
        >>> _share((19, 20))
        '19/20 (95 % [75, 100])'
    """
    k, n = hits
    if n == 0:
        return "–"
    low = 0.0 if k == 0 else float(beta.ppf(0.025, k, n - k + 1))
    high = 1.0 if k == n else float(beta.ppf(0.975, k + 1, n - k))
    return f"{k}/{n} ({100 * k / n:.0f} % [{100 * low:.0f}, {100 * high:.0f}])"


def _number(x: float) -> str:
    return f"{x:.2f}" if math.isfinite(x) else "–"
