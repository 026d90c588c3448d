"""Terms of a diagnosis lead to a sentence of the glossary, causes have names in words, rivals their sizes."""

import ast
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from canid.models.effects import CATALOGUE
from canid.ui.views.diagnosis_report import diagnosis_answer, diagnosis_document, diagnosis_text
from canid.ui.views.document.terms import TERMS
from canid.values.findings import NotTestable, Report, RivalCause, Verdict
from canid.values.types import Interval

ReportOf = Callable[..., Report]
ROOT = Path(__file__).parents[2]
GLOSSARY = ROOT / "docs/glossary.md"


def as_text(report: Report) -> str:
    return " ".join(" ".join(diagnosis_text.text(report, "drive.blf", "Some car")).split())


def test_a_term_has_the_sentence_of_the_glossary() -> None:
    rows = [
        line.split(" | ")
        for line in GLOSSARY.read_text(encoding="utf-8").splitlines()
        if line.startswith("| ")
    ]
    # "lag τ": a symbol is no part of the name
    glossary = {row[0].removeprefix("| ").rstrip(" τθ"): row[1] for row in rows}
    assert {name: glossary.get(name) for name in TERMS} == TERMS


@pytest.mark.parametrize("verdict", Verdict)
def test_a_term_of_a_page_leads_to_its_sentence(report_of: ReportOf, verdict: Verdict) -> None:
    html = diagnosis_document.page(report_of(verdict))
    links = set(re.findall(r'<a class="term" href="#(term-[^"]+)"', html))
    assert links == set(re.findall(r'<div id="(term-[^"]+)"', html))
    assert verdict is Verdict.NOT_ENOUGH_DATA or {"term-evidence", "term-baseline", "term-residual"} <= links


def test_the_details_end_with_the_terms_that_they_use(named: Report) -> None:
    lines = diagnosis_text.text(named, "drive.blf", "Some car")
    body, terms = lines[: lines.index("terms")], lines[lines.index("terms") + 1 :]
    assert f"  evidence: {TERMS['evidence']}" in terms
    assert all(line.partition(":")[0].strip().lower() in " ".join(body).lower() for line in terms)
    assert not any("NRMSE" in line for line in terms)


@pytest.mark.parametrize("verdict", Verdict)
def test_no_cause_is_named_as_in_the_code(report_of: ReportOf, verdict: Verdict) -> None:
    report = report_of(verdict)
    html = diagnosis_document.page(report)
    read = re.sub(r"<(style|script)\b.*?</\1>", "", html, flags=re.DOTALL)
    said = [as_text(report), *diagnosis_answer.summary(report), re.sub(r"<[^>]*>", " ", read)]
    for effect in CATALOGUE:
        assert "_" not in effect.id or not any(effect.id in text for text in said), effect.id


def test_a_rival_that_was_fitted_has_its_size_and_what_would_decide(report_of: ReportOf) -> None:
    report = report_of(Verdict.ONE_OF)
    (finding, *_) = report.findings
    fitted = RivalCause("speed_gain", {"exponent": Interval(0.6, 0.4, 0.8)}, {"exponent": "1"})
    sized = report._replace(findings=(finding._replace(rival_causes=(fitted,)),))
    decides = {effect.id: effect.decides for effect in CATALOGUE}
    for shown in (as_text(sized), " ".join(diagnosis_answer.summary(sized))):
        assert "speed gain (exponent 0.60 [0.40, 0.80])" in " ".join(shown.split())
    assert (
        f"what would decide between them: {decides[finding.effect]}; or {decides['speed_gain']}"
        in as_text(sized)
    )


def test_no_sentence_of_the_models_has_an_id_in_it() -> None:
    """An f-string with words takes an effect's name through `readable`, not its id."""
    found = []
    for path in sorted((ROOT / "canid/models/diagnosis").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.JoinedStr):
                continue
            words = any(isinstance(part, ast.Constant) and " " in str(part.value) for part in node.values)
            ids = [
                part
                for part in node.values
                if isinstance(part, ast.FormattedValue)
                and isinstance(part.value, ast.Attribute)
                and part.value.attr in ("id", "effect")
            ]
            found += [f"{path.name}:{node.lineno}"] if words and ids else []
    assert found == []


def test_the_summary_says_what_to_drive_next(report_of: ReportOf) -> None:
    """Of rivals first, then of what is nearest to be decided; reasons that it does not print hide no advice."""
    report = report_of(Verdict.ONE_OF)
    rival = f"{report.findings[0].effect.replace('_', ' ')}: a longer drive"
    undecided = tuple(
        NotTestable((name,), f"too little; what would decide: {drive}", evidence, 13.0)
        for name, drive, evidence in (
            ("gain_drift", "an hour", 1.0),
            ("speed_gain", "town and motorway", 9.0),
        )
    )
    advice = ("gain drift: an hour", "speed gain: town and motorway", rival)
    shown = diagnosis_answer.summary(report._replace(not_testable=undecided, advice=advice))
    first, second = " ".join(" ".join(shown).split()).split("to drive next: ")[1:]
    decides = {effect.id: effect.decides for effect in CATALOGUE}
    (finding, *_) = report.findings
    assert first.startswith(
        f"headway dead zone or speed gain: {decides[finding.effect]}; or {decides[finding.rivals[0]]}"
    )
    assert second.startswith("speed gain: town and motorway")
    assert len(shown) <= diagnosis_answer.MAX_LINES
