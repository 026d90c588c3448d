"""Published car-following models in the text, the JSON and the page of a diagnosis."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any

import pytest

from canid.ui.views.diagnosis_report import diagnosis_json, diagnosis_text
from canid.ui.views.diagnosis_report.diagnosis_document import page
from canid.values.findings import ClosedLoopError, Report, Rival, Verdict
from canid.values.text import json_values
from canid.values.types import Interval


def text(report: Report) -> list[str]:
    return diagnosis_text.text(report, "drive.blf", "Some car")


def to_json(report: Report) -> dict[str, Any]:
    return json.loads(
        json_values.line(json_values.plain(diagnosis_json.document(report, "drive.blf", "Some car")))
    )


def test_published_models_stand_in_text_json_and_page(report_of: Callable[..., Report]) -> None:
    """The nearest first; one that could not be calibrated has its reason and nulls."""
    named = report_of(Verdict.NAMED)
    calibrated = Rival(
        "OVRV", "a paper", {"T": Interval(1.5, 1.2, 1.8)}, {"T": "s"}, ClosedLoopError(1e-3, 2e-3),
        (ClosedLoopError(1e-3, 2e-3),),
    )  # fmt: skip
    lacking = Rival("IDM", "a paper", status="not_enough_data", says="drive longer")
    report = named._replace(rivals=(calibrated, lacking))
    lines = text(report)
    head = next(k for k, line in enumerate(lines) if line.startswith("published car-following models"))
    assert [line.split("  ")[1] for line in lines[head + 2 : head + 5]] == [
        "OVRV",
        "canid, extended",
        "canid, baseline",
    ]
    assert lines[head + 5] == "  drive longer"
    assert not any(line.startswith("published car-following models") for line in text(named))
    out = to_json(report)["rivals"]
    assert [one["model"] for one in out] == ["OVRV", "IDM"]
    assert (out[0]["nrmse_gap"], out[0]["folds"]) == (1e-3, [{"nrmse_gap": 1e-3, "nrmse_speed": 2e-3}])
    assert out[0]["parameters"] == {"T": {"value": 1.5, "low": 1.2, "high": 1.8}}
    assert (out[1]["status"], out[1]["nrmse_gap"], out[1]["folds"]) == ("not_enough_data", None, [])
    loop = to_json(report)["closed_loop"][0]
    assert loop["nrmse_after"] == pytest.approx(0.6 * loop["nrmse_before"])
    html = re.sub(r'<a class="term"[^>]*>|</a>', "", page(report))
    title = "published car-following models in closed loop"
    assert all(text in html for text in (title, "1.50 [1.20, 1.80] s", "drive longer"))
    assert title not in page(named)
