"""Every package and extra that a message or a page names to be installed exists, by the metadata of what is installed."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

import can
import pytest

from canid.io.buses.bus_opener import PACKAGES, package_of

ROOT = Path(__file__).parents[2]
# NAME or NAME[EXTRA,EXTRA], quoted or not, behind `pip install` and its options
HINT = re.compile(r"pip3? install((?:[ \t]+(?:-\S+|'[^']+'|\"[^\"]+\"|[A-Za-z0-9._\[\],>=-]+))+)")
WORD = re.compile(r"'([^']+)'|\"([^\"]+)\"|(\S+)")
ANY = "\0"  # a part that is known at run time only
# named as a package to compare with, in an environment of its own
ELSEWHERE = {"sysidentpy"}


def literals(path: Path) -> Iterator[str]:
    """The texts of a module; what an f-string puts in is `ANY`."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(p.value) if isinstance(p, ast.Constant) else ANY for p in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside:
            yield node.value


def hints() -> Iterator[tuple[str, str]]:
    """Where it stands, and what is to be installed."""
    texts = [(path, text) for path in sorted(ROOT.glob("canid*/**/*.py")) for text in literals(path)]
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    texts += [(path, path.read_text(encoding="utf-8")) for path in pages]
    for path, text in texts:
        for found in HINT.finditer(re.sub(r"#.*", "", text) if path.suffix == ".md" else text):
            for word in (next(filter(None, one)) for one in WORD.findall(found[1])):
                if re.fullmatch(r"[A-Za-z][\w.-]*(\[.*\])?([<>=].*)?", word) and not word.startswith("-"):
                    yield str(path.relative_to(ROOT)), word.rstrip(".;,:")


def extras_of(name: str) -> set[str]:
    if name == "canid":  # by its source: an editable installation may be older
        project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        return set(project["optional-dependencies"])
    return set(metadata(name).get_all("Provides-Extra") or [])


def wrong(word: str) -> str:
    found = re.fullmatch(r"([A-Za-z][\w.-]*)(?:\[(.*)\])?(?:[<>=].*)?", word)
    assert found is not None
    try:
        known = extras_of(found[1])
    except PackageNotFoundError:
        return "" if found[1] in ELSEWHERE else f"{word}: no such package is installed"
    named = [one for one in (found[2] or "").split(",") if one]
    return "".join(f"{word}: {found[1]} has no extra {one}" for one in named if one not in known)


@pytest.mark.slow("the commands of a page")
def test_what_is_to_be_installed_exists() -> None:
    """Each package is installed here, and has the extras that are named."""
    of = sorted({*hints()})
    assert len(of) > 15
    assert {word for _, word in of} >= {"canid[export]", "canid[report,web]", "canid[web]"}
    assert [f"{where}: {says}" for where, word in of if ANY not in word and (says := wrong(word))] == []


@pytest.mark.slow("the commands of a page")
def test_hints_that_are_known_at_run_time_only() -> None:
    """Those of interfaces, of schemes of URLs and of what needs DuckDB; there are no others that this test does not know."""
    for interface in can.VALID_INTERFACES:
        assert package_of(interface) == "" or wrong(package_of(interface)) == ""
    assert {*PACKAGES} <= set(can.VALID_INTERFACES)
    assert {"s3", "fleet"} <= extras_of("canid")
    source = "".join(path.read_text(encoding="utf-8") for path in sorted(ROOT.glob("canid/**/*.py")))
    for_duckdb = re.findall(r"(?:duckdb_files\.connected\(|NEEDS_DUCKDB = \()\"[^\"]+\", \"(\w+)\"", source)
    assert len(for_duckdb) >= 3
    assert {*for_duckdb} <= extras_of("canid")
    unknown = {f"{where}: {word}" for where, word in hints() if ANY in word}
    assert {one.partition(":")[0] for one in unknown} <= {
        "canid/io/files/duckdb_files.py",
        "canid/analysis/fleet/planning/remote.py",
        "canid/analysis/fleet/planning/fetched.py",
    }


def test_the_hint_of_udp_multicast(tmp_path: Path) -> None:
    """Without msgpack it is exit code 2 or 3, and one line that names the extra which brings msgpack."""
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['msgpack'] = None\n")
    words = [
        "record",
        "-i",
        "udp_multicast",
        "-c",
        "239.74.163.2",
        "--duration",
        "1",
        "-o",
        str(tmp_path / "x.blf"),
    ]
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "import sys; from canid.ui.cli import main; sys.exit(main(sys.argv[1:]))",
            *words,
        ],
        env=os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode in (2, 3), done
    assert "pip install 'canid[udp]'" in done.stderr
    assert done.stderr.count("\n") == 1
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert any(one.startswith("msgpack") for one in project["optional-dependencies"]["udp"])
    assert not (tmp_path / "x.blf").exists()


@pytest.mark.parametrize("word", ["python-can[udp_multicast]", "canid[nothing]", "no-such-package-here"])
def test_a_wrong_hint_is_found(word: str) -> None:
    assert wrong(word) != ""
