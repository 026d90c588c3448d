"""`python -m benchmarks` lists every benchmark, and each of them can be started."""

from __future__ import annotations

import importlib.util
import os
import re
import sys
from pathlib import Path

import pytest

import benchmarks
from benchmarks.__main__ import main
from benchmarks.registry import BENCHMARKS, Benchmark

FOLDER = Path(benchmarks.__file__).parent


def test_every_package_is_registered() -> None:
    """A folder of benchmarks/ is the package of at least one entry; no name stands there twice."""
    packages = {path.parent.name for path in FOLDER.glob("*/__init__.py")}
    assert packages == {each.module.split(".")[1] for each in BENCHMARKS}
    assert len({each.name for each in BENCHMARKS}) == len(BENCHMARKS)


def test_the_list_has_a_line_for_each(capsys: pytest.CaptureFixture[str]) -> None:
    main([])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [each.name for each in BENCHMARKS]
    assert all(each.duration in line for each, line in zip(BENCHMARKS, lines, strict=True))


def test_an_unknown_name_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["nothing"])
    assert "there is no benchmark nothing" in capsys.readouterr().err


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda each: each.name)
def test_help_works(
    benchmark: Benchmark, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`python -m benchmarks NAME --help` ends with 0 before anything is measured."""
    if benchmark.needs and not importlib.util.find_spec(benchmark.needs):
        pytest.skip(f"{benchmark.needs} is not installed")
    monkeypatch.setattr(os, "environ", os.environ.copy())
    monkeypatch.setattr(sys, "argv", ["benchmarks"])
    # runpy warns of a module that another test has imported
    monkeypatch.delitem(sys.modules, f"{benchmark.module}.__main__", raising=False)
    monkeypatch.delitem(sys.modules, benchmark.module, raising=False)
    # and the import anew would stay an attribute of the package, while other tests hold the first one
    package = benchmark.module.split(".")[1]
    monkeypatch.setattr(benchmarks, package, getattr(benchmarks, package, None), raising=False)
    with pytest.raises(SystemExit) as end:
        main([benchmark.name, "--help"])
    assert not end.value.code
    assert "usage:" in capsys.readouterr().out


def test_only_tests_of_benchmarks_import_them() -> None:
    """What tests of canid and benchmarks share is in tests/: plants, damaged_logs, fixtures."""
    tests = Path(__file__).parent
    found = {
        path.relative_to(tests).parts[0]
        for path in tests.rglob("*.py")
        if re.search(r"^\s*(from|import) benchmarks\b", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    assert found <= {"benchmarks", "reliability", Path(__file__).name}
