"""Tests that read the source text of canid run in `make test`: whoever changes the source must hear of them at once."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
MARK = re.compile(r"mark\.(slow|long)\b")


def slow_ones(source: str) -> list[str]:
    """Tests that are marked as long or slow and go through files of Python."""
    if "rglob" not in source or "mark." not in source:
        return []
    return [
        node.name
        for node in ast.parse(source).body
        if isinstance(node, ast.FunctionDef)
        and node.name.startswith("test")
        and any(MARK.search(ast.unparse(mark)) for mark in node.decorator_list)
        and ".rglob('*.py')" in ast.unparse(node)
    ]


def test_no_test_of_the_source_is_slow() -> None:
    """A sixth of the slow tests is drawn for a run: what such a test forbids would be found days later."""
    sources = {
        path: path.read_text(encoding="utf-8")
        for path in sorted(TESTS.rglob("test_*.py"))
        if path != Path(__file__)
    }
    assert [f"{path}: {name}" for path, source in sources.items() for name in slow_ones(source)] == []


@pytest.mark.parametrize("mark", ["slow", "long"])
def test_such_a_test_is_found(mark: str) -> None:
    body = "    for path in ROOT.rglob('*.py'):\n        ...\n"
    assert slow_ones(f"@pytest.mark.{mark}('many files')\ndef test_a():\n{body}\ndef test_b():\n{body}") == [
        "test_a"
    ]
