"""A path in a line for a shell is one word of it, whatever it holds: a checkout in a folder with a blank runs the tests."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# functions whose text a shell reads
SHELLS = {"shell", "_start", "system", "popen", "getoutput", "_Calls"}
# what is put into such a line and is no path: an address, a port, a line of the shell
WORDS = {"HOST", "self.port", "self.address", "made.address", "one", "setting + ' ' if setting else ''"}
# where programs are
PROGRAMS = re.compile(r"\bsys\.executable\b|\bDASK\b")
MENTIONS = re.compile(r"\{.*(sys\.executable|\bDASK\b)|\b(" + "|".join(SHELLS) + r")\(")
QUOTED = re.compile(r"(shlex\.)?(quote|join)\(.*\)", re.DOTALL)


def unquoted(source: str) -> Iterator[str]:
    """What a source puts into a line for a shell as it is: the path of a program into any text, or a path into a call."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        of_shell = isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in SHELLS
        texts = [each for each in ast.walk(node) if isinstance(each, ast.JoinedStr)] if of_shell else [node]
        for value in (value for text in texts if isinstance(text, ast.JoinedStr) for value in text.values):
            if isinstance(value, ast.FormattedValue) and value.conversion != ord("r"):
                put = ast.unparse(value.value)
                if QUOTED.fullmatch(put) or put in WORDS:
                    continue
                # the folder of a program is no word yet
                if of_shell or (PROGRAMS.search(put) and "parent" not in put):
                    yield put


def test_no_path_is_put_into_a_shell_line_as_it_is() -> None:
    """Read from the source of tests, benchmarks and pages: `shlex.quote` makes a word of it."""
    found = {
        f"{path.relative_to(ROOT)}: {put}"
        for folder in ("tests", "benchmarks", "docs", "examples")
        for path in sorted((ROOT / folder).rglob("*.py"))
        # to parse all of them takes seconds
        if path != Path(__file__) and MENTIONS.search(source := path.read_text(encoding="utf-8"))
        for put in unquoted(source)
    }
    assert found == set()


@pytest.mark.parametrize(
    "source",
    [
        "start(f'{sys.executable} -m canid')",
        "line = f'exec {DASK} worker'",
        "shell(f'canid check {log}')",
        "made._start(f'cat {tmp_path / name} | head')",
        "os.system(f'touch {marker}')",
    ],
)
def test_such_a_path_is_found(source: str) -> None:
    """The test above would fail for each of these."""
    assert list(unquoted(source))
    assert not list(unquoted(re.sub(r"\{(.*?)\}", r"{shlex.quote(str(\1))}", source)))
