"""canid does not depend on canid_study: its verb alone imports it, when it is run."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

CANID = Path(__file__).parents[1] / "canid"
VERB = "ui/cli/commands/study.py"


def imports(tree: ast.AST) -> set[str]:
    """Top-level packages that a tree imports."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module)
    return {name.split(".")[0] for name in names}


def test_the_verb_alone_imports_it_and_inside_a_function() -> None:
    users = set()
    for path in sorted(CANID.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if "canid_study" not in text:
            continue
        tree = ast.parse(text)
        if "canid_study" in imports(tree):
            users.add(path.relative_to(CANID).as_posix())
            functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
            rest = ast.Module([node for node in tree.body if node not in functions], [])
            assert "canid_study" not in imports(rest)
    assert users == {VERB}


def test_prints_are_shown_without_python_control_and_matplotlib() -> None:
    code = (
        "import sys; from canid.ui.cli import main; main(['study', 'prints', 'grover'])\n"
        "assert not {'control', 'matplotlib'} & set(sys.modules), 'imported early'"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "6 unstable poles" in done.stdout
