"""No file of canid but one opens a file for writing: read from the source, so that a new place cannot be forgotten."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CANID = ROOT / "canid"
PACKAGES = (CANID, ROOT / "canid_study")
OPENING = "io/files/opening.py"
# (file, what it calls) -> why nothing of the user's can be written
ALLOWED = {
    ("values/processes/limits.py", "os.open"): "a setting of a process: a file of /proc",
    ("values/processes/serve.py", "os.fdopen"): "a copy of standard output, for answers to the parent",
    (
        "ui/cli/output/complete_files.py",
        "os.fdopen",
    ): "descriptors of opening.create_temporary and opening.stream",
    ("ui/cli/output/complete_files.py", "shutil.copyfileobj"): "between files that are open",
    ("ui/terminal/streams.py", "os.open"): "the null device, for standard streams that are closed",
    (
        "analysis/export/mf4_child.py",
        "file.save",
    ): "asammdf writes by name: the random one of complete_files, which exists",
    ("canid_study/views/figure_svg.py", "canvas.savefig"): "into a text in memory",
    ("ui/cli/output/outputs.py", "sys.stdout.write_bytes"): "standard output",
    ("ui/cli/output/outputs.py", "self._file.write_bytes"): "an OutputFile, which is open",
    (
        "analysis/export/driver_fmu.py",
        "values.write_text",
    ): "in a new temporary folder that no other user may enter",
    ("analysis/export/driver_fmu.py", "zipfile.ZipFile"): "into memory",
    ("analysis/export/driver_models.py", "savemat"): "into memory",
    ("analysis/export/mat_file.py", "savemat"): "into an open file",
    (
        "io/files/duckdb_files.py",
        "COPY",
    ): "DuckDB writes into a descriptor of opening.create or opening.existing",
}
WRITES = ("O_WRONLY", "O_RDWR", "O_CREAT", "O_APPEND", "O_TRUNC", "O_TMPFILE")
# functions of modules, and methods, that open a file by its name for writing
FUNCTIONS = {
    "shutil": {"copy", "copy2", "copyfile", "copyfileobj", "copytree", "move"},
    "os": {"truncate", "mknod", "mkfifo", "symlink"},
    "tempfile": {"mkstemp", "mktemp", "NamedTemporaryFile", "SpooledTemporaryFile"},
    "logging": {"FileHandler"},
    "sqlite3": {"connect"},
    "scipy.io": {"savemat"},
}
METHODS = {
    *(
        "write_text",
        "write_bytes",
        "touch",
        "symlink_to",
        "hardlink_to",
        "savemat",
        "savetxt",
        "savez",
        "tofile",
    ),
    *("to_parquet", "to_excel", "to_pickle", "to_hdf", "to_feather", "write_html", "write_image", "savefig"),
    *("save", "write_parquet", "FileHandler", "RotatingFileHandler", "export_database", "NamedTemporaryFile"),
}
OPENERS = {"open", "fdopen", "GzipFile", "BZ2File", "LZMAFile", "ZipFile", "TarFile", "FileIO"}
CALLED = {"connect", *METHODS, *OPENERS, *(name for names in FUNCTIONS.values() for name in names)}
# a source without any of these words opens nothing: parsing it takes 20 times as long
MAY_OPEN = re.compile(rf"\b({'|'.join(sorted(CALLED))}|COPY|EXPORT|ATTACH)\b")
MODE = re.compile("[rwaxbtU+:|gz]{1,4}")
SQL = re.compile(r"\bCOPY\s.*\bTO\b|\bEXPORT\s+DATABASE\b|\bATTACH\s+'", re.DOTALL)


def writing(source: str) -> Iterator[str]:
    """What a source calls that may open a file for writing; what cannot be judged counts."""
    if not MAY_OPEN.search(source):
        return
    tree = ast.parse(source)
    assigned: dict[str, list[ast.expr]] = {}
    modules: dict[str, str] = {}
    for node in ast.walk(tree):
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                assigned.setdefault(name, []).append(value)
            case ast.AugAssign(target=ast.Name(id=name), value=value):
                assigned.setdefault(name, []).append(value)
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                assigned.setdefault(name, []).append(value)
            case ast.ImportFrom(module=str(module), names=names):
                modules |= {each.asname or each.name: f"{module}.{each.name}" for each in names}
            case ast.Import(names=names):
                modules |= {each.asname or each.name: each.name for each in names}
    documented = {id(node.body[0].value) for node in ast.walk(tree) if _has_docstring(node)}  # type: ignore[attr-defined]
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr) and SQL.search(ast.unparse(node)):
            yield "COPY"
        text = node.value if isinstance(node, ast.Constant) and id(node) not in documented else None
        if isinstance(text, str) and SQL.search(text):
            yield "COPY"
        if isinstance(node, ast.Call):
            yield from _call(node, assigned, modules)


def _has_docstring(node: ast.AST) -> bool:
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    return isinstance(node, kinds) and ast.get_docstring(node, clean=False) is not None


def _call(node: ast.Call, assigned: dict[str, list[ast.expr]], modules: dict[str, str]) -> Iterator[str]:
    match node.func:
        case ast.Attribute(attr=last) if last not in CALLED:
            return
        case ast.Name(id=last) if modules.get(last, last).rpartition(".")[2] not in CALLED:
            return
    spelled = ast.unparse(node.func)
    owner, _, name = spelled.rpartition(".")
    full = f"{modules.get(owner, owner)}.{name}" if owner else modules.get(name, name)
    module, _, name = full.rpartition(".")
    if module.startswith("canid."):
        return  # judged where it is
    if full == "os.open":
        if len(node.args) < 2 or not _reads(node.args[1], assigned, set()):
            yield spelled
    elif name in FUNCTIONS.get(module, ()) or (owner not in ("", "self", "saving") and name in METHODS):
        yield spelled
    elif name in OPENERS and module not in ("fsspec", "system", "zlib", "opening"):
        if not _mode_reads(node, first=0 if owner and module not in ("os", "io", "gzip", "codecs") else 1):
            yield spelled
    elif full == "duckdb.connect" and node.args:
        yield spelled


def _reads(flags: ast.expr, assigned: dict[str, list[ast.expr]], seen: set[str]) -> bool:
    """Whether flags of os.open, and all that they are made of, only read."""
    for node in ast.walk(flags):
        if isinstance(node, ast.Attribute) and node.attr in WRITES:
            return False
        if isinstance(node, ast.Constant) and node.value in WRITES:
            return False
        if isinstance(node, ast.Name) and node.id not in {"os", "getattr", *seen}:
            values = assigned.get(node.id)
            if not values or not all(_reads(each, assigned, {*seen, node.id}) for each in values):
                return False
    return True


def _mode_reads(node: ast.Call, first: int) -> bool:
    """Whether a call of an opener reads; `first`: the first argument that may be a mode."""
    given = [each.value for each in node.keywords if each.arg == "mode"]
    places = [*node.args[first : first + 1], *given]
    for mode in places:
        if not isinstance(mode, ast.Constant) or not isinstance(mode.value, str):
            return False
        if not MODE.fullmatch(mode.value) or set(mode.value) & set("wax+"):
            return False
    return not any(each.arg is None for each in node.keywords)


def test_one_module_opens_files_for_writing() -> None:
    """Every other place that may is known by name, with the reason; a place that is gone leaves the list."""
    found = {
        (str(path.relative_to(CANID if package == CANID else ROOT)), call)
        for package in PACKAGES
        for path in sorted(package.rglob("*.py"))
        for call in writing(path.read_text(encoding="utf-8"))
    }
    there = {call for file, call in found if file == OPENING}
    assert "os.open" in there
    assert {each for each in found if each[0] != OPENING} == set(ALLOWED)


@pytest.mark.parametrize(
    "source",
    [
        "open(path, 'w')",
        "open(path, mode='ab')",
        "open(path, mode)",
        "open(path, **settings)",
        "open(path, 'r+b')",
        "io.open(path, 'x')",
        "path.open('wb')",
        "path.open(mode='x')",
        "Path('a').open(mode)",
        "gzip.open(path, 'wt')",
        "gzip.GzipFile(path, 'w')",
        "zipfile.ZipFile(path, 'w')",
        "from os import open\nopen(path, O_RDWR)",
        "import os as system\nsystem.open(path, system.O_RDWR | system.O_CREAT)",
        "os.open(path, os.O_WRONLY)",
        "os.open(path, os.O_RDONLY | os.O_CREAT)",
        "F = os.O_RDWR\nos.open(path, F)",
        "flags = os.O_RDONLY\nflags |= os.O_TRUNC\nos.open(path, flags)",
        "from canid.io.files.new_file import FLAGS\nos.open(path, FLAGS)",
        "os.open(path, getattr(os, 'O_RDWR'))",
        "os.fdopen(fd, 'w')",
        "path.write_text('a')",
        "Path(path).write_bytes(b'a')",
        "path.touch()",
        "shutil.copy(a, b)",
        "from shutil import copyfile\ncopyfile(a, b)",
        "shutil.move(a, b)",
        "os.truncate(path, 0)",
        "tempfile.NamedTemporaryFile()",
        "from tempfile import mkstemp\nmkstemp()",
        "logging.FileHandler(path)",
        "duckdb.connect(path)",
        "db.execute(f\"COPY (SELECT 1) TO '{path}'\")",
        "db.execute(\"EXPORT DATABASE 'x'\")",
        "figure.write_html(path)",
        "mdf.save(path)",
        "scipy.io.savemat(path, {})",
        "from scipy.io import savemat\nsavemat(path, {})",
    ],
)
def test_what_opens_for_writing_is_found(source: str) -> None:
    """The test above would fail for each of these."""
    assert list(writing(source))


@pytest.mark.parametrize(
    "source",
    [
        "open(path)",
        "open(path, 'rb')",
        "path.open('rb')",
        "path.open()",
        "gzip.open(path, 'rb')",
        "F = os.O_RDONLY | getattr(os, 'O_CLOEXEC', 0)\nos.open(path, F)",
        "duckdb.connect(config=settings)",
        "values.copy()",
        "text.replace('a', 'w')",
        '"""COPY a TO b: not here."""',
    ],
)
def test_what_reads_is_not(source: str) -> None:
    """Reading is free."""
    assert not list(writing(source))
