"""Both papers' printed numbers, recomputed: the results of `canid study prints`, one study per paper."""

from __future__ import annotations

from benchmarks.papers.prints import (
    chen_ulsoy_figures,
    chen_ulsoy_results,
    chen_ulsoy_rows,
    chen_ulsoy_tables,
    grover_figures,
    grover_results,
    grover_rows,
    grover_tables,
)
from canid_study.artifact import Study
from canid_study.printed_numbers import EQ_2_9, MISO_FIT_PERCENT
from canid_study.prints import CHEN_ULSOY, GROVER, PAPERS, TITLE


def grover(r: grover_results.Results, deep: bool = False) -> Study:
    """Grover 2021; `deep`: the results hold the scan of three and four misprinted exponents."""
    return Study(
        PAPERS[GROVER],
        TITLE,
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


def chen_ulsoy(r: chen_ulsoy_results.Results) -> Study:
    """Chen & Ulsoy 2001."""
    first = r.draws[0]
    low, _, high = first.kept_dc_percentiles
    return Study(
        PAPERS[CHEN_ULSOY],
        TITLE,
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
