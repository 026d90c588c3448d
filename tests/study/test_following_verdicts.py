"""Verdicts of `study grover` on a log: each row where its claim is true, where it is false, and where the data are few."""

from __future__ import annotations

from types import SimpleNamespace as Of
from typing import Any

import numpy as np
import pytest

from canid.values.types import Channel, Identifiable, Interval
from canid_study.artifact import ClaimVerdict
from canid_study.grover import method_claims, printed_models
from canid_study.grover.episodes import INPUTS

HOLDS, FAILS, UNDECIDED = ClaimVerdict.HOLDS, ClaimVerdict.FAILS, ClaimVerdict.UNDECIDED
NOT_CHECKABLE, IMPOSSIBLE = ClaimVerdict.NOT_CHECKABLE, ClaimVerdict.IMPOSSIBLE
FEW, MANY = 3, 12


def numbers(seed: int, mean: float, n: int, sd: float = 0.5) -> list[float]:
    """Around a mean."""
    return (mean + sd * np.random.default_rng(seed).normal(size=n)).tolist()


def channel(K: float, sd: float) -> Channel:
    """A gain that may be quoted."""
    return Channel(K=Interval(K, K - 1.96 * sd, K + 1.96 * sd), status=Identifiable.OK)


def per_input(**more: Any) -> Any:
    """A fit of one input."""
    p1 = Of(K=5.0, tau=0.2, fit_percent=95.0, **{})
    made = {"p1": p1, "p1d": Of(fit_percent=95.0), "truncated": Of(K=5.0, tau=0.2, says="", error_bound=0.1)}
    return Of(**made | more)


def episode(joint_channels: dict[str, Channel] | None = None, **more: Any) -> Any:
    """An episode whose two inputs are alike."""
    inputs = (per_input(**more), per_input(**more))
    return Of(inputs=inputs, joint=Of(channels=joint_channels or {}))


@pytest.mark.parametrize(
    ("mean", "n", "wanted"), [(2.0, MANY, HOLDS), (-2.0, MANY, FAILS), (2.0, FEW, UNDECIDED)]
)
def test_the_speed_in_eq_2_1(mean: float, n: int, wanted: ClaimVerdict, seed: int) -> None:
    """The model with the speed fits better, worse, or too few drives say it."""
    drives = [Of(speed_fit=80.0 + x, joint=Of(fit_percent=80.0)) for x in numbers(seed, mean, n)]
    assert printed_models.speed_factor(drives).verdict is wanted  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("mean", "n", "wanted"), [(0.0, MANY, HOLDS), (5.0, MANY, FAILS), (0.0, FEW, UNDECIDED)]
)
def test_a_lag_in_place_of_a_dead_time(mean: float, n: int, wanted: ClaimVerdict, seed: int) -> None:
    """A dead time adds nothing, five points of fit, or too few episodes say it."""
    every = [
        episode(p1=Of(K=5.0, tau=0.2, fit_percent=90.0), p1d=Of(fit_percent=90.0 + x))
        for x in numbers(seed, mean, n, 0.2)
    ]
    for row in printed_models.first_order_forms((Of(), every[0]), every):  # type: ignore[arg-type]
        assert row.verdict is wanted


@pytest.mark.parametrize(
    ("K", "sd", "wanted"), [(5.0, 0.05, HOLDS), (9.0, 0.5, FAILS), (5.0, 2.0, UNDECIDED)]
)
def test_gains_of_one_input_next_to_the_joint_fit(K: float, sd: float, wanted: ClaimVerdict) -> None:
    """The joint gain is the same, another one, hardly known, or may not be quoted."""
    joint = Of(channels={name: channel(K, sd) for name in INPUTS})
    drive, one = Of(joint=joint, output="pedal"), episode()
    rows = [*printed_models.reduced((drive, one)), printed_models.table_1((drive, one))]  # type: ignore[arg-type]
    assert [row.verdict for row in rows] == [wanted] * 3
    drive.joint = Of(channels={})
    assert printed_models.table_1((drive, one)).verdict is NOT_CHECKABLE  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("right", "n", "wanted"), [(1.0, 24, HOLDS), (0.3, 24, FAILS), (1.0, FEW, UNDECIDED)]
)
def test_gains_of_many_records(right: float, n: int, wanted: ClaimVerdict) -> None:
    """Gains inside the joint fit's intervals in all records, in a third, or in too few records to say."""
    every = []
    for k in range(n):
        K = 5.0 if k < right * n else 9.0
        every.append(episode({name: channel(K, 0.1) for name in INPUTS}))
    assert method_claims.table_2(every).verdict is wanted


@pytest.mark.parametrize(
    ("rejects", "draws", "wanted"), [(0.0, 100, HOLDS), (90.0, 100, FAILS), (0.0, 10, UNDECIDED)]
)
def test_the_gate_at_90_percent(rejects: float, draws: int, wanted: ClaimVerdict) -> None:
    """The true model is never rejected, nearly always, or in too few records to say."""
    every = [Of(inputs=[Of(model=Of(fit_percent=95.0))] * 2, joint_fit=95.0)]
    drives = [Of(cost=Of(gate_rejects=rejects))]
    assert method_claims.gate(drives, every, draws).verdict is wanted  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("mean", "n", "wanted"), [(95.0, MANY, HOLDS), (80.0, MANY, FAILS), (95.0, FEW, UNDECIDED)]
)
def test_the_step_of_reduction(mean: float, n: int, wanted: ClaimVerdict, seed: int) -> None:
    """First order fits the response, does not, or too few episodes say it."""
    every = [episode(p1=Of(K=5.0, tau=0.2, fit_percent=x)) for x in numbers(seed, mean, n)]
    assert method_claims.reduction_step(every).verdict is wanted


@pytest.mark.parametrize(
    ("mean", "bound", "n", "wanted"),
    [
        (95.0, 99.0, MANY, HOLDS),
        (20.0, 99.0, MANY, FAILS),
        (95.0, 99.0, FEW, UNDECIDED),
        (20.0, 30.0, MANY, IMPOSSIBLE),
    ],
)
def test_the_sum_of_both_models(mean: float, bound: float, n: int, wanted: ClaimVerdict, seed: int) -> None:
    """The sum fits, does not, too few say it; or no sum of two such models can."""
    every = [Of(together=Of(high_sum=x, high_refit=x, bound=(0.0, bound))) for x in numbers(seed, mean, n)]
    assert method_claims.summed_orders(every).verdict is wanted  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("mean", "n", "wanted"), [(5.0, MANY, HOLDS), (-5.0, MANY, FAILS), (5.0, FEW, UNDECIDED)]
)
def test_the_next_episode(mean: float, n: int, wanted: ClaimVerdict, seed: int) -> None:
    """The published kind of model predicts better than the joint one, worse, or too few episodes say it."""
    every = [
        Of(held=Of(high=70.0 + x, reduced=60.0, joint=70.0), together=Of(high_refit=90.0))
        for x in numbers(seed, mean, n)
    ]
    assert method_claims.validation(every).verdict is wanted  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("K", "sd", "wanted"), [(5.0, 0.05, HOLDS), (9.0, 0.5, FAILS), (5.0, 2.0, UNDECIDED)]
)
def test_one_input_alone(K: float, sd: float, wanted: ClaimVerdict) -> None:
    """One fit per input finds K1, misses it, hardly knows it; or K1 may not be quoted, or there is nothing to simulate."""
    found = Interval(K, K - 1.96 * sd, K + 1.96 * sd)
    case = Of(correlation=0.1, per_record=found, per_input=found, joint=found, expected=K)
    cost = Of(K1=5.0, K2=4.0, cases=(case, case), recorded=case)
    drive = Of(cost=cost, log="a", joint=Of(channels={INPUTS[0]: channel(5.0, 0.1)}))
    assert method_claims.cost([drive])[0].verdict is wanted  # type: ignore[list-item]
    drive.joint = Of(channels={})
    assert method_claims.cost([drive])[0].verdict is NOT_CHECKABLE  # type: ignore[list-item]
    drive.cost = None
    assert method_claims.cost([drive])[0].verdict is NOT_CHECKABLE  # type: ignore[list-item]
