"""Words that the glossary replaces do not come back into code, tests, benchmarks and docs; no variable has an empty name."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.vocabulary import old_words

ROOT = Path(__file__).parents[1]
PLACES = ("canid", "canid_study", "tests", "benchmarks", "docs", "README.md", "CONTRIBUTING.md")
# the lists of the words themselves
LISTS = {"tests/vocabulary.py", "docs/glossary.md"}
# still to be translated: a part leaves this list when it is clean, and no part joins it
UNTRANSLATED = frozenset(
    {
        "canid/models/effects",
        "canid/mathematics/identification",
        "canid/io/logs",
        "canid/signals/vehicle",
        "docs/monitor.md",
        "docs/report.md",
        "tests/identification",
    }
)
# a variable says what it holds: `signal`, `rows`, `fit`, `match`
EMPTY_NAMES = {"of", "one", "found", "own"}
# such a name where it may be bound: most files have none, and parsing all of them takes seconds
_MAYBE_BOUND = re.compile(
    rf"(?:\b(?:for|lambda|as)\b[^\n]*|[(\[,*=]\s*|^\s*)\b(?:{'|'.join(EMPTY_NAMES)})\b\s*(?:[,:)=\]]|in\b)",
    re.MULTILINE,
)


def empty_names(text: str) -> Iterator[tuple[int, str]]:
    """Line and name of each variable or argument with an empty name; fields of a class are no variables."""
    if not _MAYBE_BOUND.search(text):
        return
    tree = ast.parse(text)
    fields = {
        statement.target
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
        for statement in node.body
        if isinstance(statement, ast.AnnAssign)
    }
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name, ctx=ast.Store()) if node not in fields:
                pass
            case ast.arg(arg=name) | ast.ExceptHandler(name=name) | ast.MatchAs(name=name):
                pass
            case _:
                continue
        if name in EMPTY_NAMES:
            yield node.lineno, name


def untranslated(path: Path) -> bool:
    """Is a file one of `UNTRANSLATED`, or in a folder of it?"""
    name = path.relative_to(ROOT).as_posix()
    return any(f"{name}/".startswith(f"{part}/") for part in UNTRANSLATED)


def texts() -> list[Path]:
    files = [path for place in PLACES for path in (ROOT / place).rglob("*") if path.suffix in (".py", ".md")]
    files += [ROOT / place for place in PLACES if (ROOT / place).is_file()]
    return [path for path in files if str(path.relative_to(ROOT)) not in LISTS]


def test_old_words_stay_away() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {word}"
        for path in texts()
        if not untranslated(path)
        for number, word in old_words(path.read_text(encoding="utf-8"))
    ]
    assert not found, "\n".join(["docs/glossary.md says what to write instead:", *found])


def test_variables_say_what_they_hold() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for package in ("canid", "canid_study")
        for path in (ROOT / package).rglob("*.py")
        for line, name in empty_names(path.read_text(encoding="utf-8"))
    ]
    assert not found, "\n".join(["these names say nothing of what they hold:", *found])


def test_empty_names_are_found_wherever_they_are_bound() -> None:
    bound = (
        "for of in x: y",
        "a, own = x",
        "[a, own] = x",
        "x = [one for one in y]",
        "x = {key: of for key, of in y}",
        "x = lambda found: 0",
        "x = lambda a, *own: 0",
        "if (found := x): y",
        "found: int = 3",
        "with x as own: y",
        "def f(a, one=1): x",
        "try: x\nexcept E as one: y",
        "match x:\n  case [one, 1]: y",
        "match x:\n  case A(a=own): y",
    )
    assert [code for code in bound if not list(empty_names(code))] == []
    assert list(empty_names("class A:\n    own: float = 1\n    def of(self): ...\nx = A(own=1).own")) == []
