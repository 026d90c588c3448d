"""The residual tests as rows of a table."""

from __future__ import annotations

from typing import NamedTuple

from canid.estimators.plausibility import MAX_LEFT_OVER
from canid.types import ResidualTests
from canid.views.names import readable
from canid.views.numbers import DASH, number


class ResidualRow(NamedTuple):
    """One test."""

    name: str
    passed: bool | None  # None: not possible
    value: str
    limit: str
    says: str


def rows(tests: ResidualTests) -> list[ResidualRow]:
    """Whiteness, left-over response per input, stationarity; and whether the loop is closed.

    Example:
        >>> of = rows(ResidualTests(True, 20.0, 41.6, ("range_rate",), (), True, {"range_rate": 9}, {"range_rate": 0.2}))
        >>> [(row.name, row.passed, row.value) for row in of][:2]
        [('whiteness (Ljung–Box)', True, '20'), ('response left over: range rate', False, '20 %')]
    """
    if tests.statistic != tests.statistic:
        return [ResidualRow("all", None, DASH, DASH, "too few data")]
    out = [
        ResidualRow(
            "whiteness (Ljung–Box)",
            tests.white,
            number(tests.statistic),
            number(tests.bound),
            "the noise model is complete"
            if tests.white
            else "the order of the model or of its noise is too low",
        )
    ]
    for name in tests.excitation_order:
        left = name in tests.left_over
        share = tests.left_over_share.get(name)
        says = "the response to this input is all in the model"
        if left:
            large = share is not None and share > MAX_LEFT_OVER
            says = "part of the response is not in the model"
            says += ": τ and θ may not be quoted" if large else ""
        out.append(
            ResidualRow(
                f"response left over: {readable(name)}",
                not left,
                DASH if share is None else number(100.0 * share, "%"),
                f"{number(100.0 * MAX_LEFT_OVER, '%')} for τ, θ",
                says,
            )
        )
    out.append(
        ResidualRow(
            "stationarity (reverse arrangements)",
            tests.stationary,
            DASH,
            DASH,
            "the residual's size has no trend" if tests.stationary else "the residual's size has a trend",
        )
    )
    return out
