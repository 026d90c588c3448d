"""`canid diagnose` as a user calls it: what it writes where, with which exit code. A report takes the engine's place."""

import hashlib
import json
import re
import shlex
import sys
from collections.abc import Callable
from html import unescape
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest

from canid.signals.vehicle import read_vehicle
from canid.ui.cli import main
from canid.values.errors import CHECK_FAILED, DAMAGED, DONE, NOT_WRITTEN, USAGE
from canid.values.findings import Report, Verdict
from canid.values.types import Trace

ROOT = Path(__file__).parents[2]
URBAN = ROOT / "replay_logs/following_urban.blf"
# s of the log, so that reading it takes no time
PART = ("--vehicle", "generic", "--stop", "5")


class Ran(NamedTuple):
    """Exit code and output of a command."""

    code: int
    out: str
    err: str


@pytest.fixture
def canid(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    report_of: Callable[..., Report],
) -> Callable[..., Ran]:
    """Run `canid diagnose ...` in an empty folder, with a given verdict of the engine."""
    monkeypatch.chdir(tmp_path)

    def run(*words: object, verdict: Verdict = Verdict.NAMED) -> Ran:
        def diagnose(trace: Trace, **_: Any) -> Report:
            assert len(trace.t) > 10
            return report_of(verdict, minutes=2)

        engine = SimpleNamespace(diagnose=diagnose)
        monkeypatch.setitem(sys.modules, "canid.models.diagnosis.diagnose", engine)
        capsys.readouterr()
        code = main(["diagnose", *map(str, words)])
        return Ran(code, *capsys.readouterr())

    return run


def test_no_file_unless_asked(canid: Callable[..., Ran], tmp_path: Path) -> None:
    ran = canid(URBAN, *PART)
    assert (ran.code, ran.err) == (DONE, "")
    assert ran.out.startswith("CAUSE FOUND: ")
    assert str(URBAN) in ran.out
    assert list(tmp_path.iterdir()) == []


def test_the_page_lies_in_this_folder_under_the_log_s_name(canid: Callable[..., Ran], tmp_path: Path) -> None:
    ran = canid(URBAN, *PART, "--report")
    assert ran.code == DONE
    assert [path.name for path in tmp_path.iterdir()] == ["following_urban.diagnosis.html"]
    assert "following_urban.diagnosis.html written" in ran.err
    html = (tmp_path / "following_urban.diagnosis.html").read_text(encoding="utf-8")
    # provenance: whoever has these files and this command gets the same page
    assert hashlib.sha256(URBAN.read_bytes()).hexdigest() in html
    vehicle = read_vehicle("generic")
    assert f" · {vehicle.name} · recorded" in html
    for file in (vehicle.path, *vehicle.dbc):
        assert hashlib.sha256(Path(file).read_bytes()).hexdigest() in html
    assert f"canid diagnose {shlex.quote(str(URBAN))} --vehicle generic --stop 5" in unescape(html)


def test_a_named_page_replaces_what_was_there(canid: Callable[..., Ran], tmp_path: Path) -> None:
    (tmp_path / "mine.html").write_text('<!DOCTYPE html><meta name="generator" content="canid diagnosis">old')
    assert canid(URBAN, *PART, "-o", "mine.html").code == DONE
    assert (tmp_path / "mine.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_json_alone_is_on_standard_output(canid: Callable[..., Ran]) -> None:
    """With `--json -` the text goes to standard error; one log gives an object, several a list in their order."""
    ran = canid(URBAN, *PART, "--json", "-")
    result = json.loads(ran.out)
    assert result["verdict"] == "named"
    assert result["provenance"]["versions"]["canid"]
    assert re.fullmatch(r"[0-9a-f]{64}", result["provenance"]["log_sha256"])
    assert "canid: CAUSE FOUND: " in ran.err
    other = ROOT / "replay_logs/following_mixed.blf"
    result = json.loads(canid(URBAN, other, *PART, "--json", "-").out)
    assert [one["log"] for one in result] == [str(URBAN), str(other)]


def test_several_logs_get_a_page_each(canid: Callable[..., Ran], tmp_path: Path) -> None:
    ran = canid(URBAN, ROOT / "replay_logs/following_mixed.blf", *PART, "--report")
    assert ran.code == DONE
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "following_mixed.diagnosis.html",
        "following_urban.diagnosis.html",
    ]


@pytest.mark.parametrize("verdict", Verdict)
def test_a_verdict_is_no_failure_unless_checked(canid: Callable[..., Ran], verdict: Verdict) -> None:
    assert canid(URBAN, *PART, verdict=verdict).code == DONE
    expected = DONE if verdict is Verdict.ADEQUATE else CHECK_FAILED
    assert canid(URBAN, *PART, "--check", verdict=verdict).code == expected


def test_a_damaged_log_is_4_and_still_diagnosed(canid: Callable[..., Ran], tmp_path: Path) -> None:
    """Intact data are used; exit 4 takes precedence over the 1 of --check."""
    cut = tmp_path / "cut.blf"
    whole = URBAN.read_bytes()
    cut.write_bytes(whole[: len(whole) // 2])
    ran = canid(cut, *PART[:2], "--check")
    assert ran.code == DAMAGED
    assert ran.out.startswith("CAUSE FOUND: ")
    assert "canid: " in ran.err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((URBAN, *PART, "--report", URBAN), "is not an .html file"),
        ((URBAN, URBAN, *PART, "-o", "one.html"), "for one log only"),
        ((URBAN, URBAN, *PART, "--report"), "two logs would write following_urban.diagnosis.html"),
        ((URBAN,), "--vehicle"),
        ((URBAN, "--vehicle", "generic", "--stop", "x"), "time in seconds"),
    ],
)
def test_wrong_use_is_one_line_and_2(canid: Callable[..., Ran], words: tuple[object, ...], says: str) -> None:
    """A log given in the place of the page's name is not overwritten."""
    before = URBAN.read_bytes()
    ran = canid(*words)
    assert ran.code == USAGE
    assert ran.err.count("\n") == 1
    assert says in ran.err
    assert URBAN.read_bytes() == before


def test_a_page_that_cannot_be_written_is_5(canid: Callable[..., Ran], tmp_path: Path) -> None:
    """The verdict is printed all the same; a failure before it leaves the old page as it was."""
    (tmp_path / "full.html").symlink_to("/dev/full")
    ran = canid(URBAN, *PART, "-o", tmp_path / "full.html")
    assert (ran.code, ran.err.count("\n")) == (NOT_WRITTEN, 1)
    assert ran.out.startswith("CAUSE FOUND: ")
    (tmp_path / "full.html").unlink()
    ran = canid(URBAN, *PART, "-o", tmp_path / "no_such_folder" / "page.html")
    assert (ran.code, ran.out, ran.err.count("\n")) == (NOT_WRITTEN, "", 1)
    (tmp_path / "page.html").write_text("old")
    ran = canid(URBAN, *PART, "-o", tmp_path / "page.html")
    assert (ran.code, ran.out) == (NOT_WRITTEN, "")
    assert "is not a page of canid diagnose" in ran.err
    # a misspelt log is said first
    ran = canid(tmp_path / "no_such.blf", *PART[:2], "-o", tmp_path / "page.html")
    assert (ran.code, ran.err.count("\n")) == (2, 1)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]
