"""Reference of commands, man page, tables of README and docs/json.md are those of the present verbs.

Every page is in a table of contents.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from canid.analysis.fleet.storage.columns import LOGS, SUMMARIES, TABLES

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def made(tmp_path: Path) -> Path:
    """A folder in which the script has written its files."""
    script = "import sys; sys.path.insert(0, sys.argv[1]); from pathlib import Path; import reference_of_commands as r; "
    write = (
        "Path('page').write_text(r.markdown(), 'utf-8'); Path('man').write_text(r.manual(), 'utf-8'); "
        "Path('readme').write_text(r.readme(r.README.read_text('utf-8')), 'utf-8'); "
        "Path('names').write_text(r.names(r.NAMES.read_text('utf-8')), 'utf-8')"
    )
    subprocess.run([sys.executable, "-c", script + write, DOCS], check=True, cwd=tmp_path)
    return tmp_path


@pytest.mark.slow("the commands of a page")
def test_all_are_current(made: Path) -> None:
    again = "verbs, options or results have changed: run python docs/reference_of_commands.py"
    assert (made / "page").read_text("utf-8") == (DOCS / "commands.md").read_text("utf-8"), again
    assert (made / "man").read_text("utf-8") == (DOCS / "man/canid.1").read_text("utf-8"), again
    assert (made / "readme").read_text("utf-8") == (DOCS.parent / "README.md").read_text("utf-8"), again
    assert (made / "names").read_text("utf-8") == (DOCS / "json.md").read_text("utf-8"), again


def test_the_tables_of_a_fleet_are_current(tmp_path: Path) -> None:
    """The columns that docs/fleet_folder.md lists are those of canid/analysis/fleet/storage/columns.py."""
    script = (
        "import sys; sys.path.insert(0, sys.argv[1]); from pathlib import Path; import fleet_tables as f; "
    )
    write = "Path('page').write_text(f.replaced(f.PAGE.read_text('utf-8')), 'utf-8')"
    subprocess.run([sys.executable, "-c", script + write, DOCS], check=True, cwd=tmp_path)
    again = "columns have changed: run python docs/fleet_tables.py"
    assert (tmp_path / "page").read_text("utf-8") == (DOCS / "fleet_folder.md").read_text("utf-8"), again


def test_every_number_of_a_fleets_tables_has_a_unit_or_is_a_share() -> None:
    """[unit]: what the row's column `unit` says; of a window, that of its drive."""
    for name, columns in {"logs": LOGS, **TABLES, **SUMMARIES}.items():
        for column in columns:
            share = column.meaning.startswith(("share of", "relative reduction"))
            assert column.type != "DOUBLE" or column.unit or share, (name, column)
            of = TABLES["drives"] if name == "windows" else columns
            assert "[unit]" not in column.unit or any(each.name == "unit" for each in of), (name, column)


def test_groff_takes_the_man_page_without_a_warning() -> None:
    if shutil.which("groff") is None:
        pytest.skip("groff is missing: apt-get install groff-base")
    command = ["groff", "-man", "-K", "utf8", "-T", "utf8", "-ww", "-b", DOCS / "man/canid.1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "--vehicle V.toml" in re.sub(r".\x08|\x1b\[[\d;]*m", "", done.stdout)


def test_every_page_is_in_a_table_of_contents() -> None:
    """As `make docs` has it, which also follows every link; this takes no time."""
    listed = [
        entry.strip()
        for page in DOCS.rglob("*.md")
        for tree in re.findall(r"```\{toctree\}\n(.*?)```", page.read_text("utf-8"), flags=re.S)
        for entry in tree.splitlines()
        if entry and not entry.startswith(":")
    ]
    assert {path.stem for path in DOCS.glob("*.md")} - set(listed) == {"index"}
    assert len(listed) == len(set(listed)), "a page is listed twice"
