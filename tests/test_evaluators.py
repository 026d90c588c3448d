"""No text of an input reaches an evaluator: what could interpret one is not used, or stands here with why it may."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("canid", "canid_study")
# modules that interpret, load or run what they are given
MODULES = {
    "cloudpickle", "code", "codeop", "dill", "exec", "imp", "jinja2", "joblib", "jsonpickle", "logging.config", "marshal",
    "mako", "numexpr", "pickle", "pydoc", "runpy", "shelve", "sympy", "xmlrpc", "yaml",
}  # fmt: skip
# functions by their names, and methods that evaluate an expression or unpickle
BUILTINS = {"eval", "exec", "compile", "__import__", "execfile"}
METHODS = {
    "from_string", "eval", "lambdify", "sympify", "parse_expr", "read_pickle", "to_pickle", "full_load",
    "unsafe_load", "safe_load", "allow_pickle", "load_module", "exec_module",
}  # fmt: skip

# (file, what): why it may
ALLOWED = {
    (
        "canid/values/processes/child.py",
        "pickle",
    ): "messages of children of canid's own; those that parse answer by plain_values",
    ("canid/values/processes/serve.py", "pickle"): "messages of the parent, which started this child",
    ("canid/values/processes/plain_values.py", "pickle"): "an unpickler that names nothing but listed types",
    (
        "canid/analysis/session/diagnosis_process.py",
        "pickle",
    ): "samples of this process, sent to the child that it started",
    ("canid/ui/views/document/templates.py", "jinja2"): "templates of the package, found by a PackageLoader",
    ("canid_study/views/study_page.py", "from_string"): "a template of the package",
    ("canid/io/logs/mf4/raw_mdf.py", "numexpr"): "makes it refuse",
    ("canid/io/logs/mf4/raw_mdf.py", "sympy"): "makes it unimportable",
}


def uses(source: str) -> Iterator[str]:
    """Evaluators that a source text imports, calls or names as a keyword, or as an entry of sys.modules."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (name for alias in node.names if (name := _module(alias.name)))
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            of = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            yield from (name for each in of if (name := _module(each)))
        elif isinstance(node, ast.Call):
            called = node.func
            if isinstance(called, ast.Name) and called.id in BUILTINS | METHODS:
                yield called.id
            elif isinstance(called, ast.Attribute) and called.attr in METHODS:
                yield called.attr
            for word in node.keywords:
                if word.arg == "allow_pickle" and not (
                    isinstance(word.value, ast.Constant) and word.value.value is False
                ):
                    yield "allow_pickle"
                if word.arg == "shell" and not (
                    isinstance(word.value, ast.Constant) and not word.value.value
                ):
                    yield "shell"
        elif isinstance(node, ast.Subscript) and ast.unparse(node.value) == "sys.modules":
            text = node.slice.value if isinstance(node.slice, ast.Constant) else ""
            if str(text) in MODULES:
                yield str(text)


def _module(name: str) -> str:
    return next((each for each in MODULES if name == each or name.startswith(f"{each}.")), "")


def sources() -> dict[str, str]:
    """The text of every module, by its path from the root."""
    paths = (path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py")))
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}


# parsing takes 3 ms a file: only those are that have one of the words
_WORDS = re.compile(
    r"\b(?:" + "|".join(map(re.escape, {*MODULES, *BUILTINS, *METHODS, "shell", "config"})) + r")\b"
)


def test_no_evaluator_is_used_but_for_these() -> None:
    """Each use in the package stands in the list with its reason, and the list has nothing that is not used."""
    found = {(name, use) for name, text in sources().items() if _WORDS.search(text) for use in uses(text)}
    assert found - ALLOWED.keys() == set()
    assert ALLOWED.keys() - found == set()


def test_children_that_parse_answer_with_values() -> None:
    """Whoever gives up rights answers with values alone, and whoever starts such a child says which types those have."""
    texts = {name: text for name, text in sources().items() if not name.startswith("canid/values/processes/")}
    parsers = {name for name, text in texts.items() if "connect(plain=True)" in text}
    # fetches, and parses nothing but the answers of a storage
    fetcher = "canid/analysis/fleet/one_log/fetch_process.py"
    assert {name.rpartition("/")[2] for name in parsers - {fetcher}} == {
        *("parsing.py", "mf4_child.py", "signals_child.py", "analysis_process.py"),
    }
    for parser in parsers:
        module = parser.removesuffix(".py").replace("/", ".")
        starters = [name for name, text in texts.items() if f'"{module}"' in text]
        assert starters, module
        for starter in starters:
            tree = ast.parse(texts[starter])
            names = _names_of_child(tree)
            calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
            started = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id in names]
            assert started, starter
            for call in started:
                assert "answers" in {word.arg for word in call.keywords}, starter
        # by itself, or where it opens an .mf4
        confined = (
            re.search(r"^ +confine\(", texts[parser], re.MULTILINE) or "raw_mdf.opened(" in texts[parser]
        )
        assert confined or parser == fetcher, parser


def _names_of_child(tree: ast.Module) -> set[str]:
    """How a module calls `Child` of the module child.py of canid's processes."""
    return {
        alias.asname or alias.name
        for statement in ast.walk(tree)
        if isinstance(statement, ast.ImportFrom) and str(statement.module).endswith("processes.child")
        for alias in statement.names
        if alias.name == "Child"
    }


def test_asammdf_is_opened_in_one_place() -> None:
    """Elsewhere it would evaluate formulas: only `raw_mdf` and the writer of the export import it."""
    users = {
        name
        for name, text in sources().items()
        if "asammdf" in text
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Import | ast.ImportFrom)
        and "asammdf"
        in {(getattr(node, "module", None) or alias.name).partition(".")[0] for alias in node.names}
    }
    assert users == {"canid/io/logs/mf4/raw_mdf.py", "canid/analysis/export/mf4_child.py"}


@pytest.mark.parametrize(
    ("source", "what"),
    [
        ("import numexpr as ne", "numexpr"),
        ("def f():\n    from sympy import lambdify", "sympy"),
        ("from logging import config", "logging.config"),
        ("eval(text)", "eval"),
        ("frame.eval(text)", "eval"),
        ("np.load(path, allow_pickle=True)", "allow_pickle"),
        ("np.load(path, allow_pickle=flag)", "allow_pickle"),
        ("subprocess.run(text, shell=True)", "shell"),
        ("environment.from_string(text)", "from_string"),
        ("import yaml", "yaml"),
        ("pd.read_pickle(path)", "read_pickle"),
    ],
)
def test_such_a_use_is_found(source: str, what: str) -> None:
    assert what in set(uses(source))


def test_what_only_looks_like_one_is_not() -> None:
    """Regular expressions, arrays without pickles, calls without a shell."""
    harmless = "re.compile(x)\nnp.load(p, allow_pickle=False)\nrun(x, shell=False)\nevaluate(x)\nimport pickletools_of_mine"
    assert list(uses(harmless)) == []
