"""One rule decides what may be quoted of a channel, and what it withholds is withheld everywhere."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import canid
from canid.findings import Report
from canid.identification import identifiability
from canid.identification.identifiability import QUOTABLE
from canid.types import NAN, Channel, Identifiable, Interval
from canid.views import diagnosis_json, diagnosis_text, identification_json
from canid.views.report import page
from tests.plants import plant_one
from tests.plants.measurement import trace as sensed_trace

ROOT = Path(__file__).parents[2]
LOGS = sorted(path for path in (ROOT / "replay_logs").glob("*.[ba][ls][fc]"))
FIELDS = ("K", "tau", "dead_time", "tau_plus_dead_time")
# simulated drives: a lively one, one whose lead hardly changes, and one that is short
DRIVES = (("mixed", 6.0, 7), ("motorway", 4.0, 8), ("urban", 2.0, 9))


def test_only_one_module_gives_a_channel_its_status() -> None:
    """Every other module that makes a channel makes an empty one."""
    made = []
    for path in sorted((ROOT / "canid").rglob("*.py")):
        if path.name == "identifiability.py":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            name = node.func if isinstance(node, ast.Call) else None
            if isinstance(name, ast.Name) and name.id == "Channel" and isinstance(node, ast.Call):
                made += [path.name] if node.args or node.keywords else []
            if isinstance(node, ast.keyword) and node.arg == "status" and path.name != "identifiability.py":
                value = ast.unparse(node.value)
                made += [path.name] if value.startswith("Identifiable") else []
    assert not made


def test_a_number_that_is_not_finite_is_not_quoted() -> None:
    K, one, gone = Interval(5.0, 4.0, 6.0), Interval(0.5, 0.4, 0.6), Interval()
    for tau in (one, gone):
        found = identifiability.channel(Identifiable.OK, K, tau, one, one)
        assert found.status is (Identifiable.OK if tau is one else Identifiable.NOT)
        assert_withheld(found)


@pytest.mark.parametrize("sd", [NAN, 0.01, 0.15, 5.0])
def test_unknown_deviations_withhold(sd: float) -> None:
    K = Interval(5.0, 4.0, 6.0)
    status = identifiability.judge(K, 0.5, sd, sd, sd)
    expected = {0.01: Identifiable.OK, 0.15: Identifiable.SUM_ONLY}
    assert status is expected.get(sd, Identifiable.GAIN_ONLY)
    assert identifiability.judge(Interval(5.0, -1.0, 6.0), 0.5, sd, sd, sd) is Identifiable.NOT


def assert_withheld(channel: Channel) -> None:
    for field in FIELDS:
        quoted = all(math.isfinite(x) for x in getattr(channel, field))
        assert quoted == (field in QUOTABLE[channel.status]), (field, channel)


def channels(value: Any) -> Iterator[dict[str, Any]]:
    """Every channel in a JSON value."""
    if isinstance(value, dict):
        if {"K", "tau", "dead_time", "status"} <= set(value):
            yield value
        value = list(value.values())
    if isinstance(value, list):
        for each in value:
            yield from channels(each)


def assert_json_withholds(value: Any) -> None:
    for channel in channels(value):
        quotable = QUOTABLE[Identifiable(channel["status"])]
        for field in FIELDS:
            assert (channel[field]["value"] is not None) == (field in quotable), (field, channel)


def assert_report_withholds(report: Report) -> None:
    for fit in (report.baseline, report.extended):
        for channel in fit.channels.values():
            assert_withheld(channel)
    for key, (_, after) in report.shifts.items():
        name, field = key.split(" ")
        channel = report.extended.channels[name]
        assert math.isfinite(after.value) == (field in QUOTABLE[channel.status])
    assert "nan" not in "\n".join(diagnosis_text.text(report, "log", "car")).split()
    assert ">nan" not in page(report)


@pytest.mark.parametrize("log", LOGS, ids=lambda p: p.name)
def test_both_verbs_withhold_the_same_of_shipped_logs(log: Path) -> None:
    trace = canid.read_trace(log, "generic_lane" if "lane" in log.name else "generic")
    identified = canid.identify(trace, select_orders=False)
    for channel in identified.channels.values():
        assert_withheld(channel)
    assert_json_withholds(identification_json.to_json(identified, log.name, "car"))
    report = canid.diagnose(trace)
    assert_report_withholds(report)
    assert_json_withholds(diagnosis_json.to_json(report, log.name, "car"))


def test_the_urban_log_quotes_no_delay_of_headway_in_either_verb() -> None:
    trace = canid.read_trace(ROOT / "replay_logs" / "following_urban.blf", "generic")
    one = canid.identify(trace, select_orders=False).channels["headway_error"]
    other = canid.diagnose(trace).baseline.channels["headway_error"]
    assert one.status is other.status is Identifiable.GAIN_ONLY


@pytest.mark.parametrize(("profile", "minutes", "seed"), DRIVES)
def test_simulated_drives_withhold_alike(profile: str, minutes: float, seed: int) -> None:
    trace = sensed_trace(plant_one.plant({}, seed=seed, minutes=minutes, noise="ar1", profile=profile))
    for channel in canid.identify(trace, select_orders=False).channels.values():
        assert_withheld(channel)
    assert_report_withholds(canid.diagnose(trace))


def test_both_verbs_follow_one_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits that nothing meets leave gains alone in both verbs."""
    trace = canid.read_trace(ROOT / "replay_logs" / "following_urban.blf", "generic")
    monkeypatch.setattr(identifiability, "DEAD_TIME_SD", 0.0)
    monkeypatch.setattr(identifiability, "SUM_SD", 0.0)
    identified = canid.identify(trace, select_orders=False).channels
    for channels_ in (identified, canid.diagnose(trace).baseline.channels):
        assert {channel.status for channel in channels_.values()} == {Identifiable.GAIN_ONLY}
