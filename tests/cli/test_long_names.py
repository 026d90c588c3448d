"""Names that no file can have: said in one line, with the exit code of a configuration that is wrong.

`Path.is_file`, `exists` and `is_dir` raise OSError where a name is too long or a folder may not be searched;
`os.path.isfile`, `exists` and `isdir` say no.
"""

from __future__ import annotations

import io
import re
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from canid.ui.cli import main
from canid.values.errors import USAGE

ROOT = Path(__file__).parents[2]
RAISES = re.compile(r"\.(is_file|exists|is_dir)\(\)")
LOG = "following_mixed.blf"

READ = {
    "identify": ("identify", "NAME", "--vehicle", "generic"),
    "vehicle": ("identify", LOG, "--vehicle", "NAME"),
    "check": ("check", "NAME", "--vehicle", "generic"),
    "check vehicle": ("check", "--vehicle", "NAME"),
    "look": ("look", "NAME"),
    "look dbc": ("look", LOG, "--dbc", "NAME"),
    "replay": ("replay", "NAME", "--vehicle", "generic"),
    "diagnose": ("diagnose", "NAME", "--vehicle", "generic"),
    "recover": ("recover", "NAME"),
    "compare": ("compare", "NAME", "NAME"),
    "init": ("init", "NAME"),
    "decode": ("decode", LOG, "--dbc", "NAME"),
    "columns": ("identify", "a.csv", "--columns", "NAME"),
    "fleet": ("fleet", "run", "NAME", "--vehicle", "generic"),
    "study": ("study", "grover", "NAME"),
}


def test_no_question_for_a_file_raises() -> None:
    """canid asks the system whether a file is there in the way that answers."""
    found = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for folder in ("canid", "canid_study")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for line in path.read_text().splitlines()
        if RAISES.search(line) and ">>>" not in line and "entry.is_dir()" not in line  # os.DirEntry's
    ]
    assert not found, found


@pytest.mark.parametrize("suffix", ["", ".blf", ".dbc", ".toml"])
@pytest.mark.parametrize("what", READ)
def test_a_name_that_is_too_long(
    what: str, suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every verb refuses it in one line, without a traceback."""
    monkeypatch.chdir(tmp_path)
    name = "x" * 3000 + suffix
    err = io.StringIO()
    with redirect_stdout(io.StringIO()), redirect_stderr(err):
        try:
            code = main([name if word == "NAME" else word for word in READ[what]])
        except SystemExit as end:
            code = int(end.code or 0)
    assert code == USAGE, err.getvalue()[-300:]
    assert err.getvalue().startswith("canid: ")
    assert "Traceback" not in err.getvalue()
