"""Sentences of Grover 2021 that say something of the printed tables, against those tables (claims G7 to G15)."""

from __future__ import annotations

from typing import NamedTuple

from benchmarks.papers.prints.transfer_functions import properties
from canid_study.artifact import ClaimVerdict
from canid_study.printed_numbers import (
    EQ_2_4,
    EQ_2_5,
    FIG_10_ERROR_S,
    GROVER_DRIVERS,
    GROVER_RATE_HZ,
    REDUCED_FIT_PERCENT,
    SELECTION_PERCENT,
    Driver,
)

# s: no human reacts sooner (World Athletics, Technical Rules, rule 16: false start)
FALSE_START_S = 0.1


class Sentence(NamedTuple):
    """One statement and what the tables say of it."""

    claim: str
    what: str
    published: str
    tables_say: str
    verdict: ClaimVerdict
    why: str


def _verdict(holds: bool) -> ClaimVerdict:
    return ClaimVerdict.HOLDS if holds else ClaimVerdict.FAILS


def sentences() -> tuple[Sentence, ...]:
    """Every statement of the text that a printed number answers.

    Example:
        >>> [s.claim for s in sentences() if s.verdict is ClaimVerdict.FAILS]
        ['G7', 'G8', 'G10', 'G11', 'G15']
    """
    one, *rows = GROVER_DRIVERS
    first, second = rows[:2]
    third = rows[2]

    def against(d: Driver) -> bool:
        """Whether the channel with the longer lag has the smaller gain."""
        return (d.K1 - d.K2) * (d.tau1 - d.tau2) < 0.0

    shortest = min(d.tau2 for d in rows)
    dc = properties(EQ_2_5).dc_gain
    samples = (one.tau2 - one.tau1) * GROVER_RATE_HZ
    return (
        Sentence(
            "G7",
            "which input the driver answers sooner (sec. 4.4)",
            "the relative speed, from tau_d1 and tau_d2 of Table 1",
            f"tau_d1 {one.tau1:g} s, tau_d2 {one.tau2:g} s",
            _verdict(one.tau2 < one.tau1),
            f"the smaller one is tau_d1; the two differ by {samples:.1f} of a sample of 10 ms",
        ),
        Sentence(
            "G8",
            "gains on the curve (sec. V, case 2)",
            "K1 and K2 are both larger than in case 1",
            f"K1 {first.K1:g} -> {second.K1:g}, K2 {first.K2:g} -> {second.K2:g}",
            _verdict(second.K1 > first.K1 and second.K2 > first.K2),
            f"K2 falls by {100 * (1 - second.K2 / first.K2):.0f} %",
        ),
        Sentence(
            "G9",
            "a longer reaction time goes with a smaller gain (sec. V, case 3)",
            "of the two channels of case 3",
            f"K1 {third.K1:g}, tau_d1 {third.tau1:g} s; K2 {third.K2:g}, tau_d2 {third.tau2:g} s",
            _verdict(against(third)),
            f"so it is in {', '.join(d.name for d in GROVER_DRIVERS if against(d))}; not in "
            f"{', '.join(d.name for d in GROVER_DRIVERS if not against(d)) or 'none'}",
        ),
        Sentence(
            "G10",
            "tau_d2 is a reaction time",
            ", ".join(f"{d.tau2:g} s" for d in rows),
            f"the shortest are {shortest * GROVER_RATE_HZ:.1f} and "
            f"{sorted(d.tau2 for d in rows)[1] * GROVER_RATE_HZ:.1f} samples",
            _verdict(shortest > FALSE_START_S),
            f"a sprinter who answers the gun within {FALSE_START_S:g} s has a false start; a lag that short cannot be "
            "separated from 0 in a record that moves below 0.5 Hz",
        ),
        Sentence(
            "G11",
            "K2 > 0 with V_rel = V_F - V_L (sec. 4.1)",
            "K2 " + ", ".join(f"{d.K2:g}" for d in GROVER_DRIVERS),
            f"DC gain of eq. 2.5: {dc:.0f}",
            _verdict(dc > 0.0),
            "the text on Fig. 11 says that the pedal falls as V_rel rises: K2 is negative in that convention. "
            "canid's range rate is V_L - V_F",
        ),
        Sentence(
            "G12",
            "K1 > 0, and Fig. 10",
            "K1 " + ", ".join(f"{d.K1:g}" for d in GROVER_DRIVERS),
            f"the headway error falls {FIG_10_ERROR_S[0]:g} -> {FIG_10_ERROR_S[1]:g} s, the pedal rises",
            ClaimVerdict.SHOWN,
            "the paper does not say that Fig. 10 shows it; in the record "
            "as described the pedal goes on rising while the error goes to 0; the second input may "
            "explain it, the plot does not show a positive K1",
        ),
        Sentence(
            "G13",
            f"models that fit less than {SELECTION_PERCENT:g} % are rejected (sec. 4.2)",
            f"{SELECTION_PERCENT:g} %",
            f"eq. 2.4 {EQ_2_4.fit_percent:g} %, eq. 2.5 {EQ_2_5.fit_percent:g} %; the reduced model of sec. 4.5 "
            f"{REDUCED_FIT_PERCENT:g} %",
            _verdict(min(EQ_2_4.fit_percent, EQ_2_5.fit_percent) >= SELECTION_PERCENT),
            "the limit is stated for the models of high order; the reduced one, from which all printed parameters "
            "come, does not reach it",
        ),
        Sentence(
            "G14",
            "Table 1 is one of the three data sets of Table 2",
            f"K1 {one.K1:g}",
            "K1 " + ", ".join(f"{d.K1:g}" for d in rows),
            ClaimVerdict.HOLDS if any(d[1:5] == one[1:5] for d in rows) else ClaimVerdict.AMBIGUOUS,
            "no row agrees: at least four data sets were analysed, or one was analysed twice with different results",
        ),
        Sentence(
            "G15",
            "numbering and names",
            "Fig. 11 and 12 for the plots of sec. 4.1; PID and PIUZ for model types; 2 s or 3 s for the two-second "
            "rule",
            "the plots are Fig. 10 and 11; the types are P1D and P2UZ",
            ClaimVerdict.FAILS,
            "misprints; the rule of thumb is given two values in one sentence",
        ),
    )
