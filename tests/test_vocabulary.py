"""The words that the glossary replaces do not come back into code, tests, benchmarks and docs."""

from __future__ import annotations

from pathlib import Path

from tests.vocabulary import old_words

ROOT = Path(__file__).parents[1]
PLACES = ("canid", "tests", "benchmarks", "docs", "README.md", "CONTRIBUTING.md")
# the lists of the words themselves
LISTS = {"tests/vocabulary.py", "docs/glossary.md"}
# still to be translated: a part leaves this list when it is clean, and no part joins it
UNTRANSLATED = frozenset(
    {
        "README.md",
        "canid/drive_reader.py",
        "canid/effects",
        "canid/identification",
        "canid/logs",
        "canid/saving",
        "canid/session.py",
        "canid/simulation",
        "canid/vehicle",
        "docs/monitor.md",
        "docs/reading.md",
        "docs/report.md",
        "tests/estimators",
        "tests/identification",
        "tests/saving",
    }
)


def part(path: Path) -> str:
    """`canid/diagnosis` of canid/diagnosis/driver/driver_fit.py; a file at the top of a place is a part of its own."""
    return "/".join(path.relative_to(ROOT).parts[:2])


def texts() -> list[Path]:
    files = [path for place in PLACES for path in (ROOT / place).rglob("*") if path.suffix in (".py", ".md")]
    files += [ROOT / place for place in PLACES if (ROOT / place).is_file()]
    return [path for path in files if str(path.relative_to(ROOT)) not in LISTS]


def test_old_words_stay_away() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {word}"
        for path in texts()
        if part(path) not in UNTRANSLATED
        for number, word in old_words(path.read_text(encoding="utf-8"))
    ]
    assert not found, "\n".join(["docs/glossary.md says what to write instead:", *found])
