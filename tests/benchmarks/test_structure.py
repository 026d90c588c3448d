"""The figures of the source tree count what they say."""

from __future__ import annotations

import doctest
import sys
from pathlib import Path

import pytest

from benchmarks.structure import code_lines, walks
from benchmarks.structure.__main__ import HERE, layers, main
from benchmarks.structure.code_lines import Lines, lines_of


def test_lines_are_code_text_or_blank() -> None:
    source = 'def f():\n    """First.\n\n    Last."""\n    return """a\n\nb"""  # c\n\n# d\n'
    assert lines_of(source) == Lines(code=4, text=4, blank=1)
    assert doctest.testmod(code_lines).failed == 0


def test_a_trace_counts_successions_of_calls_in_both_directions(tmp_path: Path) -> None:
    """a calls b, which returns; then a function of a is called: one back-call of two pairs."""
    names: dict[str, object] = {}
    for name, text in (
        ("b", "def low():\n    return [k for k in (1,)]\n"),
        ("a", "def high():\n    low()\n    return other()\ndef other():\n    return 1\n"),
    ):
        exec(compile(text, str(tmp_path / f"{name}.py"), "exec"), names)
    tracer = walks.Tracer(f"{tmp_path}/")
    sys.setprofile(tracer.trace)
    try:
        names["high"]()  # type: ignore[operator]
    finally:
        sys.setprofile(None)
    assert tracer.walk() == walks.Walk(files=2, functions=3, pairs=2, back_calls=1)


def test_the_layers_are_those_of_the_test_of_imports(tmp_path: Path) -> None:
    assert layers(HERE) > 1
    (tmp_path / "tests").mkdir()
    for name in ("test_floors.py", "test_layers.py"):
        test = tmp_path / "tests" / name
        test.write_text('LAYERS = (("values", ("types",)), ("mathematics", ()))\n')
        assert layers(tmp_path) == 2
        test.write_text('"""Another test."""\n')
        with pytest.raises(ValueError, match="no test has LAYERS"):
            layers(tmp_path)


def test_a_module_is_found_in_whichever_layer_it_lies() -> None:
    assert walks.module("logs").open_log is walks.module("logs", "log").open_log
    with pytest.raises(StopIteration):
        walks.module("logs", "no_such_module")


def test_the_table_is_markdown(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.structure.__main__.COMMANDS", (("--version",),))
    main(["--no-walks"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "|---|---|"
    assert all(line.count("|") == 3 for line in lines)
    assert int(lines[2].split("|")[2].replace(",", "")) > 10_000
