"""Two folders of results are the same but for `schema` and the last digits of numbers."""

from __future__ import annotations

import doctest
import json
import sys
from pathlib import Path
from typing import Any

import pytest

from benchmarks.unchanged import comparison
from benchmarks.unchanged.__main__ import main
from benchmarks.unchanged.tasks import Task, run


def folder(path: Path, result: Any, exit_code: int = 0, text: str = "") -> str:
    path.mkdir()
    whole = {"exit": exit_code, "stdout": [text], "stderr": [], "json": result}
    (path / "1.diagnose.json").write_text(json.dumps(whole))
    return str(path)


@pytest.mark.parametrize(
    ("other", "code"),
    [
        ({"schema": "b", "verdict": "adequate", "K": [1.0 + 1e-12, None]}, 0),
        ({"schema": "a", "verdict": "adequate", "K": [1.0 + 1e-6, None]}, 1),
        ({"schema": "a", "verdict": "unexplained", "K": [1.0, None]}, 1),
        ({"schema": "a", "verdict": "adequate", "K": [1.0, 2.0]}, 1),
        ({"schema": "a", "verdict": "adequate", "K": [1, None]}, 1),
        ({"schema": "a", "verdict": "adequate"}, 1),
    ],
)
def test_words_and_numbers_are_compared(tmp_path: Path, other: Any, code: int) -> None:
    first = folder(tmp_path / "a", {"schema": "a", "verdict": "adequate", "K": [1.0, None]})
    assert main(["compare", first, folder(tmp_path / "b", other)]) == code


def test_exit_codes_count_and_texts_are_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = folder(tmp_path / "a", {}, text="K 1.0")
    assert main(["compare", first, folder(tmp_path / "b", {}, text="K 1.1")]) == 0
    assert "1.diagnose: printed text differs" in capsys.readouterr().out
    assert main(["compare", first, folder(tmp_path / "c", {}, exit_code=1)]) == 1


def test_folders_without_a_common_result_are_not_the_same(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert main(["compare", folder(tmp_path / "a", {}), str(tmp_path / "empty")]) == 1


def test_a_result_holds_exit_code_texts_and_json(tmp_path: Path) -> None:
    canid = Path(sys.executable).with_name("canid")
    log = Path(__file__).parents[2] / "replay_logs" / "following_urban.blf"
    run(canid, Task("1", ("check", log.name, "--vehicle", "generic"), log.parent), tmp_path)
    result = json.loads((tmp_path / "1.json").read_text())
    assert result["exit"] == 0
    assert result["json"]["schema"] == "canid/check/1"
    assert result["stdout"]
    assert [path.name for path in tmp_path.iterdir()] == ["1.json"]


def test_examples() -> None:
    assert doctest.testmod(comparison).failed == 0
