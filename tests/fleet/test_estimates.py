"""The table of drives holds what may be quoted of each of them, and nothing else; what is left out has a reason."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canid.analysis.fleet.answers import estimates
from canid.analysis.fleet.answers.estimates import LANE, MAIN, TIMES, kinds, selection
from canid.analysis.fleet.answers.pooled import own_estimates
from canid.analysis.fleet.answers.summary import summarise
from canid.analysis.fleet.storage.columns import POOLED
from canid.analysis.fleet.storage.database import opened
from canid.mathematics.estimators import plausibility
from canid.mathematics.identification.confidence import NORMAL_QUANTILE
from canid.mathematics.population import drive_table as tables
from canid.values.fleet_summary import Kind
from tests.fixtures.fleet_folder import Planted, made, write

ACCEL = Kind("accel", "m/s²")


@pytest.fixture
def planted(tmp_path: Path, seed: int) -> Planted:
    return made(tmp_path / "fleet", seed, drivers=3, drives=3)


def chosen(folder: Path, kind: Kind = ACCEL, names: tuple[str, ...] = MAIN) -> estimates.Selection:
    with opened(folder) as db:
        return selection(db, kind, names)


def changed(planted: Planted, number: int, **values: Any) -> dict[str, Any]:
    """Write the folder with one drive changed, and return that drive."""
    planted.rows[number] |= values
    write(planted.folder, planted.rows)
    return planted.rows[number]


def row_of(of: estimates.Selection, log: str) -> int:
    return of.table.drives.index(log)


def test_estimates_and_covariances_are_those_of_the_joint_posterior(planted: Planted) -> None:
    """Element by element, whatever the order of names in the folder and in the table."""
    order = np.random.default_rng(1).permutation(8)
    row = planted.rows[4]
    covariance = np.array(row["covariance"]).reshape(8, 8)
    changed(
        planted,
        4,
        names=[POOLED[k] for k in order],
        estimate=[row["estimate"][k] for k in order],
        covariance=covariance[np.ix_(order, order)].ravel().tolist(),
    )
    names = (*TIMES, *MAIN)
    of = chosen(planted.folder, names=names)
    assert len(of.table.drives) == 9
    k = row_of(of, row["log"])
    places = [POOLED.index(name) for name in names if "." in name]
    at = [names.index(POOLED[place]) for place in places]
    truth = dict(zip(row["names"], row["estimate"], strict=True))
    assert of.table.estimate[k, at] == pytest.approx([truth[POOLED[place]] for place in places])
    assert of.table.covariance[k][np.ix_(at, at)] == pytest.approx(covariance[np.ix_(places, places)])
    assert of.table.drivers[of.table.driver[k]] == row["driver"]
    assert of.table.start[k] == row["start_utc"]


def test_noise_and_wanted_headway_come_from_their_intervals(planted: Planted) -> None:
    """Of a skewed interval of noise the logarithm is symmetric; both are independent of all others."""
    row = planted.rows[0]
    of = chosen(planted.folder)
    k, j, h = row_of(of, row["log"]), MAIN.index("log_noise_sd"), MAIN.index("log_wanted_headway")
    sd = math.log(row["noise_sd_high"] / row["noise_sd_low"]) / (2.0 * NORMAL_QUANTILE)
    assert of.table.estimate[k, j] == pytest.approx(math.log(row["noise_sd"]))
    assert of.table.covariance[k, j, j] == pytest.approx(sd**2)
    assert of.table.estimate[k, h] == pytest.approx(math.log(row["wanted_headway"]))
    ratio = (row["wanted_headway_high"] - row["wanted_headway_low"]) / (
        2.0 * NORMAL_QUANTILE * row["wanted_headway"]
    )
    assert of.table.covariance[k, h, h] == pytest.approx(math.log(1.0 + ratio**2))
    off = np.delete(of.table.covariance[k, j], j)
    assert off == pytest.approx(np.zeros(len(MAIN) - 1))


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_headway_is_positive_however_little_is_known(planted: Planted) -> None:
    """Drives whose intervals reach below 0 count, with less weight; the population, drivers and new drivers stay above 0."""
    folder = planted.folder
    for k in range(0, 9, 2):
        changed(planted, k, wanted_headway=0.8, wanted_headway_low=-0.4, wanted_headway_high=2.0)
    found = summarise(folder)
    (of,) = (one for one in found.populations if one.kind.output == "accel")
    (wanted,) = (one for one in of.parameters if one.name == "log_wanted_headway")
    assert wanted.drives == 9
    assert 0.0 < wanted.mean.low < wanted.mean.value < wanted.mean.high
    assert wanted.new_driver.low > 0.0
    for driver in of.drivers:
        for iv in (driver.own["log_wanted_headway"], driver.shrunken["log_wanted_headway"]):
            assert 0.0 < iv.low < iv.value < iv.high


@pytest.mark.slow("runs of a fleet in processes of their own")
@pytest.mark.parametrize(
    ("status", "K", "total", "apart"),
    [
        ("ok", True, True, True),
        ("sum_only", True, True, False),
        ("gain_only", True, False, False),
        ("not_identifiable", True, False, False),
        (None, False, False, False),
        ("a status of a later canid", False, False, False),
    ],
)
def test_a_status_decides_what_is_known(
    planted: Planted, status: str | None, K: bool, total: bool, apart: bool
) -> None:
    """A delay that the box decides is no estimate, however narrow; a gain counts in every status."""
    row = changed(planted, 2, range_rate_status=status)
    of = chosen(planted.folder, names=(*MAIN, *TIMES))
    known = dict(zip(of.table.names, tables.known(of.table)[row_of(of, row["log"])].tolist(), strict=True))
    assert known["range_rate.K"] is K
    assert known["range_rate.log_tau_plus_dead_time"] is total
    assert known["range_rate.log_tau"] is known["range_rate.dead_time"] is apart
    assert known["headway_error.K"] is known["headway_error.log_tau"] is True
    where = np.isnan(of.table.estimate)
    assert np.isnan(of.table.covariance[where]).all()


def test_a_drive_without_a_joint_posterior_counts_with_its_intervals(planted: Planted) -> None:
    """Such as of ARMAX's headline: the variance of its interval, no correlation; one that is infinite counts nothing."""
    row = changed(planted, 1, names=None, estimate=None, covariance=None, headway_error_K_high=None)
    of = chosen(planted.folder)
    k, j = row_of(of, row["log"]), MAIN.index("range_rate.K")
    sd = (row["range_rate_K_high"] - row["range_rate_K_low"]) / (2.0 * NORMAL_QUANTILE)
    assert of.table.estimate[k, j] == pytest.approx(row["range_rate_K"])
    assert of.table.covariance[k, j, j] == pytest.approx(sd**2)
    assert not tables.known(of.table)[k, MAIN.index("headway_error.K")]
    own = of.table.covariance[k]
    assert own[np.isfinite(own) & ~np.eye(len(MAIN), dtype=bool)] == pytest.approx(0.0)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_what_is_left_out_has_a_reason(planted: Planted) -> None:
    """Changes of the gains, faults of signals, too little driving; failed logs and copies are not drives at all."""
    channels = [name for name in planted.rows[0] if name.startswith(("range_rate_", "headway_error_"))]
    ends = [f"{name}{end}" for name in ("noise_sd", "wanted_headway") for end in ("", "_low", "_high")]
    unknown = dict.fromkeys([*channels, *ends, "names", "estimate", "covariance"])
    steps = changed(planted, 0, gain_steps=1)
    faulty = changed(planted, 1, **unknown, signal_findings=["frozen_gap"])
    short = changed(planted, 2, **unknown, usable=20.0)
    still = changed(planted, 3, **unknown, usable=900.0)
    nobody = changed(planted, 4, driver=None)
    leaning = changed(
        planted, 6, identify_json='{"whole": {"channels": {"range_rate": {"prior_weight": 0.4}}}}'
    )
    changed(planted, 7, identify_json='{"whole": {"channels": {"range_rate": {"prior_weight": null}}}}')
    # as the engine writes a copy: a row of its log without numbers
    copy = {
        **dict.fromkeys(planted.rows[5]),
        "log": "copy.blf",
        "driver": "driver 001",
        "status": "ok",
    }
    planted.rows.append({**copy, "duplicate_of": planted.rows[5]["log"]})
    write(planted.folder, planted.rows)
    of = chosen(planted.folder)
    why = {one.log: one.why for one in of.excluded}
    assert "changed during the drive" in why[steps["log"]]
    assert "frozen gap" in why[faulty["log"]]
    assert "a minute" in why[short["log"]]
    assert "excites too little" in why[still["log"]]
    assert "no driver" in why[nobody["log"]]
    assert "[fopdt.prior]" in why[leaning["log"]]
    assert len(why) == 6
    assert set(of.table.drives) == {planted.rows[k]["log"] for k in (5, 7, 8)}
    assert of.table.estimate.shape == (3, len(MAIN))


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_gains_of_different_outputs_units_and_pedals_are_never_pooled(planted: Planted) -> None:
    """Accelerations of two cars are of one kind, pedals of two cars are of two, and no drive is in two tables."""
    for number, (output, unit, car) in enumerate(
        [
            ("pedal", "%", "car A"),
            ("pedal", "%", "car B"),
            ("pedal", "%", "car B"),
            ("accel_command", "m/s²", "car A"),
        ]
    ):
        changed(planted, number, output=output, unit=unit, car=car)
    changed(planted, 4, unit="g")
    with opened(planted.folder) as db:
        found = kinds(db)
        tables_of = {kind: selection(db, kind, estimates.names_of(db, kind)[0]).table for kind in found}
    assert found[0] == ACCEL
    assert set(found[1:]) == {
        Kind("pedal", "%", "car A"), Kind("pedal", "%", "car B"), Kind("accel_command", "m/s²"), Kind("accel", "g")
    }  # fmt: skip
    drives = [drive for table in tables_of.values() for drive in table.drives]
    assert sorted(drives) == sorted(row["log"] for row in planted.rows if row.get("key"))
    assert "log_wanted_headway" not in tables_of[Kind("pedal", "%", "car A")].names
    assert len(tables_of[ACCEL].drives) == 4


def test_a_driver_who_keeps_the_lane_has_parameters_of_his_own(planted: Planted) -> None:
    values: dict[str, Any] = {
        "output": "steering_angle",
        "unit": "deg",
        "names": None,
        "range_rate_status": None,
    }
    for end, value in (("", -3.0), ("_low", -4.0), ("_high", -2.0)):
        values[f"lateral_offset_K{end}"] = value
    changed(planted, 0, **values, headway_error_status=None, lateral_offset_status="gain_only")
    kind = Kind("steering_angle", "deg", "car A")
    with opened(planted.folder) as db:
        assert estimates.names_of(db, kind) == (LANE,)
        of = selection(db, kind, LANE).table
    assert of.estimate[0, 0] == -3.0
    assert not tables.known(of)[0, 1]


def test_own_estimates_are_generalised_least_squares(seed: int) -> None:
    """Against a textbook loop over drivers with matrices of what each drive knows."""
    rng = np.random.default_rng(seed)
    n, p = 30, 3
    root = rng.standard_normal((n, p, p))
    covariance = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(p)
    estimate = rng.standard_normal((n, p))
    unknown = rng.random((n, p)) < 0.3
    estimate[unknown] = np.nan
    covariance[unknown[:, :, None] | unknown[:, None, :]] = np.nan
    names = tuple(f"driver {k}" for k in rng.integers(0, 6, n))
    within = np.diag([0.5, 0.1, np.nan])
    mean, sd = own_estimates(tables.drive_table(("a", "b", "c"), estimate, covariance, names), within)
    for i, driver in enumerate(dict.fromkeys(names)):
        A, b = np.zeros((p, p)), np.zeros(p)
        for k in (k for k in range(n) if names[k] == driver):
            has = np.flatnonzero(~unknown[k])
            X = np.eye(p)[has]
            V = np.linalg.inv(covariance[k][np.ix_(has, has)] + np.nan_to_num(within)[np.ix_(has, has)])
            A += X.T @ V @ X
            b += X.T @ V @ estimate[k, has]
        inside = np.flatnonzero(np.diag(A) > 0.0)
        C = np.linalg.inv(A[np.ix_(inside, inside)])
        assert mean[i, inside] == pytest.approx(C @ b[inside], rel=1e-8)
        assert sd[i, inside] == pytest.approx(np.sqrt(np.diag(C)), rel=1e-8)
        assert np.isnan(np.delete(mean[i], inside)).all()


@pytest.mark.long("runs of a fleet in processes of their own")
def test_a_gain_that_identify_withholds_is_not_pooled_and_the_reason_is_said(
    planted: Planted, seed: int
) -> None:
    """An average over a cause has a narrow interval, which the status alone does not take out."""
    number = seed % len(planted.rows)
    why = plausibility.average_over_cause("range_rate")
    written = json.dumps({"whole": {"channels": {"range_rate": {"withheld": why}}}})
    row = changed(planted, number, range_rate_status="not_identifiable", identify_json=written)
    of = chosen(planted.folder)
    column = of.table.estimate[:, MAIN.index("range_rate.K")]
    assert np.isnan(column[row_of(of, row["log"])])
    assert np.isfinite(np.delete(column, row_of(of, row["log"]))).all()
    (population,) = summarise(planted.folder).populations
    assert f"range rate K of 1 drive does not count; {why}" in population.says


def test_a_driver_of_whom_no_drive_counts_is_named(planted: Planted) -> None:
    driver = planted.rows[0]["driver"]
    for number, row in enumerate(planted.rows):
        if row["driver"] == driver:
            changed(planted, number, gain_steps=1)
    why = "the gains changed during the drive: it has no one estimate"
    assert f"nothing is known of 1 driver ({driver}); {why}" in summarise(planted.folder).sentences


def test_a_small_gain_that_nothing_withholds_stays(planted: Planted) -> None:
    row = changed(planted, 2, range_rate_status="not_identifiable", identify_json='{"whole": null}')
    of = chosen(planted.folder)
    assert np.isfinite(of.table.estimate[row_of(of, row["log"]), MAIN.index("range_rate.K")])
