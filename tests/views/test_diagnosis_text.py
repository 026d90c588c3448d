"""A diagnosis as text and as JSON: the verdict first, every number with its unit and interval, no NaN."""

import json
import math
import re
from collections.abc import Callable

import numpy as np
import pytest

from canid.ui.views.diagnosis_report import diagnosis_json, diagnosis_parts, diagnosis_text
from canid.ui.views.diagnosis_report.diagnosis_document import page
from canid.values.findings import Blocked, Finding, NotTestable, NullGain, Report, Verdict
from canid.values.text import json_values, numbers
from canid.values.types import Interval

ReportOf = Callable[..., Report]
NAN = float("nan")
# names of docs/json.md that others rely on
FINDING = {
    "effect",
    "where",
    "rivals",
    "surrogate",
    "parameters",
    "gain",
    "null_gain",
    "log_score_gain",
    "says",
}
INTERVAL = {"value", "low", "high"}
NULL = {"median", "high", "replicates"}


def said(report: Report) -> list[str]:
    return diagnosis_text.text(report, "drive.blf", "Some car")


def as_json(report: Report) -> dict:
    return json.loads(
        json_values.line(json_values.plain(diagnosis_json.document(report, "drive.blf", "Some car")))
    )


def unlinked(html: str) -> str:
    """A page without the spans that keep numbers in one line, and without links to terms."""
    return re.sub(r'<span class="whole">|</span>|<a class="term"[^>]*>|</a>', "", html)


@pytest.mark.parametrize("verdict", Verdict)
def test_the_first_line_is_the_verdict(report_of: ReportOf, verdict: Verdict) -> None:
    """The text begins with the verdict, once, whether or not the sentence contains it as well."""
    report = report_of(verdict)
    word, title = verdict.value.replace("_", " ").upper(), diagnosis_parts.TITLES[verdict].upper()
    first = said(report)[0]
    assert first == f"{title}: {report.says}"
    assert said(report._replace(says=f"{word}: {report.says}"))[0] == first
    assert not any(line != line.rstrip() or "nan" in line.split() for line in said(report))


def test_the_text_holds_what_there_is_to_know(named: Report) -> None:
    """Evidence with threshold, gain and parameters with interval and unit, rivals, advice, shifts, worst windows."""
    text = "\n".join(said(named))
    for part in (
        "headway dead zone (driver)",
        "evidence 96.4 (needed 15.8)",
        "gain 31 [24, 37] %",
        "width 0.34 [0.28, 0.41] s",
        "rivals: none",
        "standstill gap or range offset: same shape",
        "10 min of urban following",
        "headway error K (% per s)",
        "30 causes tried",
        "checks: 5 of 5 passed",
    ):
        assert part in text, part
    before, after = (numbers.interval(iv) for iv in named.shifts["range_rate K"])
    assert any("range rate K" in line and before in line and after in line for line in said(named))
    assert numbers.time_range(named.worst[0].start, named.worst[0].stop) in text


def test_a_surrogate_is_never_shown_as_the_cause(report_of: ReportOf) -> None:
    text = "\n".join(said(report_of(Verdict.UNEXPLAINED)))
    assert "surrogate: it helps, but is not the cause" in text
    assert "surrogate" not in "\n".join(said(report_of(Verdict.NAMED)))


def test_failed_checks_are_named_and_passed_ones_counted(report_of: ReportOf) -> None:
    lines = said(report_of(Verdict.UNEXPLAINED))
    assert "checks: 3 of 5 passed" in lines  # the sixth could not be made
    assert [line.split(":")[0] for line in lines if "✗" in line] == [
        "  ✗ stale signals",
        "  ✗ adequacy, left-over structure",
    ]
    assert any("3.4 %, limit 1 %" in line for line in lines)


def test_rivals_are_named(report_of: ReportOf) -> None:
    assert "  rivals: speed gain" in said(report_of(Verdict.ONE_OF))


def test_many_undecided_causes_stay_short(named: Report) -> None:
    """Twenty causes with one reason are one line; of twenty reasons some are shown, with a note where the rest is."""
    same = tuple(NotTestable((f"cause_{k}",), "no lead") for k in range(20))
    lines = said(named._replace(not_testable=same))
    assert sum("  cause " in line for line in lines) == 1
    other = tuple(NotTestable((f"cause_{k}",), f"reason {k}") for k in range(20))
    lines = said(named._replace(not_testable=other))
    assert sum("  cause " in line for line in lines) == diagnosis_text.UNDECIDED_SHOWN
    assert any("14 more" in line for line in lines)


def test_a_finding_in_the_remnant_shows_its_gain_in_log_score_and_no_extended_model(
    report_of: ReportOf,
) -> None:
    law = Finding(
        "heavy_tails", "remnant", (), False, {"freedom": Interval(4.1, 3.4, 5.0)}, {"freedom": "1"}, Interval(),
        "Heavy tails.", 80.0, 13.6, log_score_gain=Interval(45.0, 38.0, 52.0),
    )  # fmt: skip
    blocks = (Blocked("remnant", "wrong", "Student's t with 4.1 [3.4, 5.0] degrees of freedom."),)
    report = report_of(Verdict.ADEQUATE)._replace(findings=(law,), blocks=blocks)
    text = "\n".join(said(report))
    assert "gain 45 [38, 52] nats/min of log score on held-out data" in text
    assert "remnant (not Gaussian): Student's t" in text
    assert "driver parameters: baseline, extended model" not in text
    (finding,) = as_json(report)["findings"]
    assert finding["gain"] == {"value": None, "low": None, "high": None}
    assert finding["log_score_gain"] == {"value": 45.0, "low": 38.0, "high": 52.0}
    shown = unlinked(page(report))
    assert "45 [38, 52] nats/min of log score" in shown
    assert "The simulation is adequate" in shown
    assert "Cause found" not in shown


def test_a_thousand_episodes_are_counted_and_not_printed(named: Report) -> None:
    spans = tuple((0.5 * k, 0.5 * k + 0.4) for k in range(1000))
    report = named._replace(findings=(named.findings[0]._replace(episodes=spans),))
    text = "\n".join(said(report))
    assert "988 times more" in text.replace("\n", " ")
    assert len(page(report)) < len(page(named)) + 60000
    assert len(as_json(report)["findings"][0]["episodes"]) == 1000


def test_both_gains_of_a_finding_of_the_driver_are_shown_with_the_null(named: Report) -> None:
    """In text, JSON and page: the simulation's gain next to its null, and the one-step log score."""
    gains = {"null_gain": NullGain(0.1, 0.25, 12), "log_score_gain": Interval(1.2, 0.5, 1.9)}
    findings = tuple(one._replace(**gains) for one in named.findings)
    report = named._replace(findings=findings, **gains)
    shown = "31 [24, 37] % (null 10 %, 95 % point 25 %), 1.2 [0.5, 1.9] nats/min of log score"
    assert shown in "\n".join(said(report))
    on_page = unlinked(page(report))
    for part in ("31 [24, 37] %", "(null 10 %, 95 % point 25 %)", "1.2 [0.5, 1.9] nats/min of log score"):
        # in the tile of the whole and in the lines of the finding
        assert on_page.count(part) >= 2, part
    assert "driver parameters: baseline, extended model" in "\n".join(said(report))
    out = as_json(report)
    for of in (out, *out["findings"]):
        assert of["null_gain"] == {"median": 0.1, "high": 0.25, "replicates": 12}
        assert of["log_score_gain"] == {"value": 1.2, "low": 0.5, "high": 1.9}


@pytest.mark.parametrize("verdict", Verdict)
def test_json_has_every_promised_name(report_of: ReportOf, verdict: Verdict) -> None:
    out = as_json(report_of(verdict))
    assert out["verdict"] == verdict.value
    for model in ("baseline", "extended"):
        assert set(out[model]) >= {"channels", "fit_percent"}
        for channel in out[model]["channels"].values():
            assert set(channel) >= {"K", "tau", "dead_time", "status"}
    for finding in out["findings"]:
        assert set(finding) >= FINDING
        assert finding["where"] in ("driver", "vehicle", "sensing", "remnant")
        assert set(finding["null_gain"]) == NULL
        for iv in (finding["gain"], finding["log_score_gain"], *finding["parameters"].values()):
            assert set(iv) == INTERVAL
        assert set(finding["parameters"]) == set(finding["units"])
    assert set(out["unexplained"]) == set(out["gain"]) == set(out["log_score_gain"]) == INTERVAL
    assert set(out["null_gain"]) == NULL
    assert all(set(u) == {"effects", "why", "evidence", "needed"} for u in out["not_testable"])
    assert isinstance(out["candidates_tried"], int)
    assert set(out) >= {
        "log",
        "vehicle",
        "says",
        "gain",
        "checks",
        "worst",
        "maps",
        "shifts",
        "steps",
        "provenance",
    }


def test_json_gives_the_numbers_back(named: Report) -> None:
    """Nothing is rounded or mixed up on the way."""
    out = as_json(named)
    assert out["findings"][0]["parameters"]["width"] == named.findings[0].parameters["width"]._asdict()
    assert out["findings"][0]["evidence"] == named.findings[0].evidence
    assert out["gain"] == named.gain._asdict()
    assert out["duration"] == pytest.approx(600.0)
    assert out["used_time"] == pytest.approx(0.1 * named.used.sum())
    back = np.array(out["maps"][0]["before"], dtype=float)
    assert np.array_equal(back, named.maps[0].before, equal_nan=True)
    assert (
        out["spectra"]["coherence_after"]["range_rate"][3] == named.spectra.coherence_after["range_rate"][3]
    )
    assert out["shifts"]["range_rate K"]["after"] == named.shifts["range_rate K"][1]._asdict()
    assert out["provenance"]["log_sha256"] == named.provenance.log_sha256


def test_what_is_not_known_is_null(named: Report) -> None:
    """NaN and infinity become null wherever a number may be."""
    holes = named._replace(
        unexplained=Interval(),
        gain=Interval(0.1, -math.inf, math.inf),
        checks=tuple(check._replace(value=NAN, limit=math.inf) for check in named.checks),
        findings=tuple(f._replace(evidence=NAN, gain=Interval()) for f in named.findings),
        worst=tuple(window._replace(after=NAN) for window in named.worst),
    )
    out = as_json(holes)
    assert out["unexplained"] == dict.fromkeys(INTERVAL)
    assert out["gain"] == {"value": 0.1, "low": None, "high": None}
    assert all(check["value"] is None and check["limit"] is None for check in out["checks"])
    assert out["findings"][0]["evidence"] is None
    assert {row["evidence"] for row in out["tried"] if row["outcome"] == "not_testable"} == {None}
    assert "nan" not in "\n".join(said(holes)).lower()


def test_numpy_s_own_scalars_are_written(named: Report) -> None:
    """Booleans, integers and floats of numpy are written as JSON."""
    check = named.checks[0]._replace(passed=np.bool_(True), value=np.float64(1.0), gate=np.bool_(False))
    finding = named.findings[0]._replace(surrogate=np.bool_(False), evidence=np.float64(9.0))
    tried = named.tried[0]._replace(step=np.int64(1), evidence=np.float64(2.0))
    out = as_json(
        named._replace(checks=(check,), findings=(finding,), tried=(tried,), candidates_tried=np.int64(3))
    )
    assert out["checks"][0]["passed"] is True
    assert out["candidates_tried"] == 3
    assert out["tried"][0]["step"] == 1


def test_before_anything_is_found_the_driver_has_one_column(report_of: ReportOf) -> None:
    """Without findings there is no extended model: each parameter is listed once."""
    report = report_of(Verdict.ADEQUATE)
    for shown in (report, report._replace(shifts={})):
        lines = said(shown)
        assert "driver parameters" in lines
        assert next(line for line in lines if "range rate K" in line).count("[") == 1


@pytest.mark.parametrize(
    ("iv", "unit", "text"),
    [
        (Interval(0.5, 0.5, 0.5), "s", "0.50 [0.50, 0.50] s"),
        (Interval(1234.0, 1000.0, 1500.0), "", "1234 [1000, 1500]"),
        (Interval(1e-5, -math.inf, 2e-5), "s", "0.00 [–, 0.00] s"),
        (Interval(1e-5, 0.9e-5, 1.1e-5), "s", "0.000010 [0.000009, 0.000011] s"),
        (Interval(-0.2, -0.31, -0.1), "", "-0.20 [-0.31, -0.10]"),
    ],
)
def test_an_interval_decides_the_decimals(iv: Interval, unit: str, text: str) -> None:
    assert numbers.interval(iv, unit) == text
