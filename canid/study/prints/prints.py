"""`canid study prints`: every equation, table, figure and claim of both papers against their own printed numbers."""

from __future__ import annotations

from collections import Counter

from canid.study.artifact import Artifact, ClaimVerdict, Study
from canid.study.prints import (
    chen_ulsoy_figures,
    chen_ulsoy_results,
    chen_ulsoy_rows,
    chen_ulsoy_tables,
    grover_figures,
    grover_results,
    grover_rows,
    grover_tables,
)
from canid.study.prints.printed_numbers import EQ_2_9, MISO_FIT_PERCENT

GROVER, CHEN_ULSOY, BOTH = "grover", "chen-ulsoy", "both"
PAPERS = {GROVER: "Grover 2021", CHEN_ULSOY: "Chen & Ulsoy 2001"}


def study(which: str = BOTH, deep: bool = False) -> Study:
    """Check the printed numbers of the papers against each other; no log.

    Args:
        which: "grover", "chen-ulsoy" or "both".
        deep: scan eq. 2.5 for three and four misprinted exponents too (0.3 s more).

    Raises:
        ValueError: another paper.

    Example:
        >>> found = study("grover")
        >>> next(a.verdict.value for a in found.artifacts if a.name == "eq. 2.5")
        'impossible'
    """
    if which not in (*PAPERS, BOTH):
        raise ValueError(f"paper {which!r}: choose {GROVER}, {CHEN_ULSOY} or {BOTH}")
    parts = [_PARTS[name](deep) for name in PAPERS if which in (name, BOTH)]
    # both papers have a Table 1
    artifacts = tuple(
        a._replace(name=f"{part.paper}, {a.name}") if len(parts) > 1 else a
        for part in parts
        for a in part.artifacts
    )
    return Study(
        paper=" and ".join(part.paper for part in parts),
        title="Printed numbers, recomputed",
        says=(_counts(artifacts), *(sentence for part in parts for sentence in part.says)),
        artifacts=artifacts,
        tables=tuple(t for part in parts for t in part.tables),
        figures=tuple(f for part in parts for f in part.figures),
        settings=tuple(dict.fromkeys(s for part in parts for s in part.settings)),
    )


def _counts(artifacts: tuple[Artifact, ...]) -> str:
    claims = Counter(a.verdict for a in artifacts if a.name.split(", ")[-1].startswith("claim"))
    listed = ", ".join(f"{v.value} {claims[v]}" for v in ClaimVerdict if claims[v])
    return f"{sum(claims.values())} claims checked by the printed numbers: {listed}."


def _grover(deep: bool) -> Study:
    r = grover_results.results(deep)
    return Study(
        PAPERS[GROVER],
        "",
        (
            f"Grover's eq. 2.5 has {r.second.unstable} unstable poles and a DC gain of {r.second.dc_gain:.0f}, next "
            f"to a published reduction with a gain of {EQ_2_9.K:g}; the sum of the two published models can fit "
            f"{r.miso[1]:.2f} % at most, next to a published {MISO_FIT_PERCENT:g} %.",
        ),
        grover_rows.rows(r),
        grover_tables.tables(r),
        grover_figures.figures(r),
        settings=(
            ("car (longitudinal), assumed", "0.04 m/s² per %, lag 0.3 s, drag 0.05 1/s"),
            ("exponents scanned", "up to four at a time" if deep else "up to two at a time; --deep: four"),
        ),
    )


def _chen_ulsoy(deep: bool) -> Study:
    r = chen_ulsoy_results.results()
    first = r.draws[0]
    low, _, high = first.kept_dc_percentiles
    return Study(
        PAPERS[CHEN_ULSOY],
        "",
        (
            "Drawn with the standard deviations of Chen & Ulsoy's Table 1 and no correlation, "
            f"{100 * first.unstable:.0f} % of the drivers are unstable and the DC gain of the others reaches from "
            f"{low:.0f} to {high:.0f} (5 to 95 %): the unprinted correlations, {r.fitted[0].corr[2, 3]:.4f} of b1 and "
            "b2, are needed.",
        ),
        chen_ulsoy_rows.rows(r),
        chen_ulsoy_tables.tables(r),
        chen_ulsoy_figures.figures(r),
        settings=(
            (
                "car (lateral), assumed",
                "one-track, 1500 kg, 1.2 + 1.5 m, 80 and 90 kN/rad, steering ratio 15",
            ),
        ),
    )


_PARTS = {GROVER: _grover, CHEN_ULSOY: _chen_ulsoy}
