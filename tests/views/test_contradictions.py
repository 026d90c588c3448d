"""No page contradicts itself, in any of the kinds that readers have found; each kind is seen where it is planted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from canid.ui.cli import main
from canid.ui.views.diagnosis_report.diagnosis_document import page
from canid.ui.views.diagnosis_report.spectra import _bands
from canid.ui.views.drive_report.gates import gate_strip
from canid.ui.views.drive_report.strips import strips
from canid.values.findings import Report, Verdict
from canid.values.types import LearnGate
from tests.fixtures.contradictions import contradictions

ReportOf = Callable[..., Report]
UNTESTABLE = "gain drift: too little (expected evidence 5 of the 13 needed, at rate 0.3)"
ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("verdict", Verdict)
def test_a_diagnosis_does_not_contradict_itself(report_of: ReportOf, verdict: Verdict) -> None:
    assert contradictions(page(report_of(verdict, minutes=4))) == []


@pytest.mark.slow("identifies and checks shipped logs")
@pytest.mark.parametrize("log", ["following_urban.blf", "following_lost_lead.blf", "following_mixed.blf"])
@pytest.mark.parametrize("verb", ["identify", "check"])
def test_pages_of_shipped_logs_do_not_contradict_themselves(tmp_path: Path, log: str, verb: str) -> None:
    out = tmp_path / "page.html"
    main([verb, str(ROOT / "replay_logs" / log), "--vehicle", "generic", "--report", str(out)])
    assert contradictions(out.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "planted",
    [
        "<p>residual tests p 3e-05</p>",
        "<p>31 causes tried</p><p>19 causes tried</p>",
        "<p>31 causes tried</p><p>11 causes fitted in full, of the 40 of this block</p>",
        "<p>✗ message 0x100 never seen</p><p>✓ No finding on the signals.</p>",
        "<p>K 5.0 [5.2, 6.1] % per m/s</p>",
        "<p>K 5.0 [6.1, 4.2] % per m/s</p>",
        "<p>later by nan s</p>",
        "<p>Nothing is wrong with the model.</p><p>range rate: the residuals still hold a response of 80 %</p>",
        "<p>usable for identification 403 s</p><p>usable for identification 406 s</p>",
        f"<h1>Cause found: gain drift</h1><li>{UNTESTABLE}</li>",
        f"<li>{UNTESTABLE}</li><li>gain drift from rate 0.3 on</li>",
    ],
)
def test_a_contradiction_is_found(planted: str) -> None:
    assert contradictions(planted)


def test_all_states_of_the_learning_gate_are_drawn_differently() -> None:
    """However many of them a drive has."""
    rng = np.random.default_rng(1)
    gates = [*LearnGate, *rng.choice(np.array(list(LearnGate), dtype=object), 40)]
    stretches = gate_strip(np.arange(float(len(gates))), gates, np.zeros(len(gates), bool), (), 1.0)
    figure = strips("s", "", "", stretches, (0.0, float(len(gates))))
    assert figure is not None
    styles = [(d["marker"]["color"], d["marker"]["pattern"]["shape"]) for d in figure.data]
    assert len(set(styles)) == len(styles) > len(LearnGate) - 1


def test_nowhere_above_it_is_said_where_no_frequency_is_above(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(200):
        above = rng.random(40) < rng.choice([0.0, 0.02, 0.3])
        says = _bands(np.linspace(0.01, 2.0, 40), above)
        assert ("nowhere" in says) == (not above.any())
