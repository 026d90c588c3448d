"""`identify` reports along the drive what live reported, and what its residuals say is true of the drive."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

import canid
from canid.analysis.drive import drive_parameters, drive_reader, identification_json
from canid.io.logs import open_log
from canid.mathematics.estimators import ESTIMATORS, fopdt, status
from canid.mathematics.estimators.armax import ARMAX
from canid.models.pipeline import pipeline
from canid.signals.vehicle import read_vehicle
from canid.ui.views import identification_text
from canid.values.text import json_values
from canid.values.types import Channel, Estimate, Interval, Sample, Status
from canid.values.window import Window
from tests.exact import exact

REPO = Path(__file__).parents[1]
LOG = REPO / "replay_logs" / "following_urban.blf"
UNTIL = 80.0  # s: both estimators are ok by then


def live() -> list[Estimate]:
    """What came out while the log ran."""
    return [
        item
        for _, _, out in drive_reader.run(open_log(LOG), read_vehicle("generic"), within=Window(stop=UNTIL))
        for item in out
        if isinstance(item, Estimate)
    ]


def windows() -> list[Estimate]:
    """What is reported along the drive afterwards."""
    vehicle = read_vehicle("generic")
    trace = drive_reader.read_drive(LOG, vehicle, estimating=False, stop=UNTIL).trace
    return drive_parameters.windows(trace, **vehicle.estimators)


def check_same() -> list[Estimate]:
    """Each window is one of the live estimates, to the last digit; returns the live ones."""
    reported = live()
    by_time = {(e.estimator, round(e.t, 6)): e for e in reported}
    along = windows()
    assert len(along) >= 2 * (UNTIL // status.REPORT_EVERY_S - 1)
    for e in along:
        assert exact(by_time[e.estimator, round(e.t, 6)]) == exact(e)
    return reported


@pytest.mark.slow("whole drives through the pipeline")
def test_windows_are_live_estimates() -> None:
    """Status, numbers, sentence, headline: the same; and FOPDT carries the headline wherever it is ok."""
    fopdt = [e for e in check_same() if e.estimator == "fopdt"]
    assert any(e.status is Status.OK for e in fopdt)
    assert all(e.headline == (e.status is Status.OK) for e in fopdt)


@pytest.mark.slow("whole drives through the pipeline")
def test_a_contradiction_is_told_live_and_along_the_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    """An estimator that reports three times the gain is detected by the other, with the same words in both."""

    def wrong(setup: Any, state: Any, sample: Sample) -> tuple[Any, Estimate]:
        state, e = ARMAX.estimate(setup, state, sample)
        return state, e._replace(channels={name: tripled(ch) for name, ch in e.channels.items()})

    def tripled(ch: Channel) -> Channel:
        return ch._replace(K=Interval(*(3.0 * x for x in ch.K)))

    estimators = (ARMAX._replace(estimate=wrong), *ESTIMATORS[1:])
    monkeypatch.setattr(pipeline, "ESTIMATORS", estimators)
    monkeypatch.setattr(drive_parameters, "ESTIMATORS", estimators)
    contradicted = [e for e in check_same() if e.status is Status.INCONSISTENT]
    assert {e.estimator for e in contradicted} == {"armax", "fopdt"}
    assert not any(e.headline for e in contradicted)
    assert all("by FOPDT but" in e.says and "by ARMAX" in e.says for e in contradicted)
    assert all(math.isfinite(e.channels["range_rate"].K.value) for e in contradicted)
    line = json_values.plain(contradicted[-1])
    assert line["status"] == "inconsistent"
    assert line["channels"]["range_rate"]["K"]["value"] is not None


@pytest.mark.slow("whole drives through the pipeline")
def test_the_residuals_of_a_whole_drive() -> None:
    """A simulated driver in closed loop: the loop is seen, and report and JSON hold the same tests."""
    reported = canid.identify(canid.read_trace(LOG, "generic"), select_orders=False)
    assert reported.armax is not None
    tests = reported.armax.residual_tests
    assert tests.feedback
    assert set(tests.excitation_order) == {"headway_error", "range_rate"}
    assert min(tests.excitation_order.values()) >= 4  # enough for two parameters of each input and the poles
    as_json = identification_json.to_json(reported, "log", "vehicle")["armax"]
    assert as_json["residual_tests"]["feedback"] == list(tests.feedback)
    assert as_json["residual_tests"]["statistic"] == as_json["whiteness"]["statistic"]
    assert [name for name, x in as_json["cross"].items() if x["feedback"]] == list(tests.feedback)
    text = "\n".join(identification_text.text(reported, "log", "vehicle"))
    assert "the loop is closed" in text
    assert f"Ljung–Box {tests.statistic:.0f}" in text


@pytest.mark.slow("whole drives through the pipeline")
def test_a_drives_windows_need_no_other_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    """One FOPDT fit in ten seconds, while nobody contradicts; that they are live's is tested above."""
    fits = []
    fitted = fopdt.fopdt_fit.fit_rows

    def counted(*args: Any, **options: Any) -> Any:
        # the batch fits with which ARMAX begins continue none
        fits.extend([args] if "continued" in options else [])
        return fitted(*args, **options)

    monkeypatch.setattr(fopdt.fopdt_fit, "fit_rows", counted)
    reported = [e for e in windows() if e.estimator == "fopdt" and e.status is Status.OK]
    assert len(reported) >= 3
    assert 0 < len(fits) <= len(reported) + 2


@pytest.mark.slow("whole drives through the pipeline")
def test_windows_are_live_estimates_where_the_driver_stops_and_goes() -> None:
    """Cruise, brakes and lost leads move the instants at which estimates come: still the same, to the last digit."""
    path = REPO / "replay_logs" / "following_lost_lead.blf"
    vehicle = read_vehicle("generic")
    steps = drive_reader.run(open_log(path), vehicle, within=Window(stop=UNTIL))
    reported = {
        (item.estimator, round(item.t, 6)): item
        for _, _, out in steps
        for item in out
        if isinstance(item, Estimate)
    }
    trace = drive_reader.read_drive(path, vehicle, estimating=False, stop=UNTIL).trace
    along = drive_parameters.windows(trace, **vehicle.estimators)
    assert len(along) > 10
    for e in along:
        assert exact(reported[e.estimator, round(e.t, 6)]) == exact(e)
