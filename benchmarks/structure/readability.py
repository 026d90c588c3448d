"""Readability of the source tree in figures: sizes, long functions, constants, effects outside the catalogue, words."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from tests.vocabulary import OLD_WORDS

LONG_LINES = 60


def sources(folder: Path) -> list[Path]:
    """Python files of a folder, sorted."""
    return sorted(path for path in folder.rglob("*.py") if "__pycache__" not in path.parts)


def lines_per_folder(tree: Path) -> dict[str, tuple[int, int]]:
    """Folder of canid/ -> files and physical lines in it, subfolders apart."""
    out: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for path in sources(tree / "canid"):
        count = out[str(path.parent.relative_to(tree))]
        count[0] += 1
        count[1] += len(path.read_text(encoding="utf-8").splitlines())
    return {folder: (files, lines) for folder, (files, lines) in sorted(out.items())}


def long_functions(tree: Path) -> list[tuple[int, str]]:
    """Functions of canid/ over `LONG_LINES` lines, docstrings not counted, longest first."""
    found = []
    for path in sources(tree / "canid"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                first = node.body[0]
                doc = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
                length = (node.end_lineno or 0) - node.lineno + 1
                length -= ((first.end_lineno or 0) - first.lineno + 1) if doc else 0
                if length > LONG_LINES:
                    found.append((length, f"{path.relative_to(tree)}:{node.name}"))
    return sorted(found, reverse=True)


def numeric(node: ast.expr) -> bool:
    """Is an expression a plain number, or arithmetic of such?"""
    return isinstance(
        ast.parse(ast.unparse(node), mode="eval").body, ast.Constant | ast.BinOp | ast.UnaryOp
    ) and (
        not any(isinstance(part, ast.Name | ast.Call) for part in ast.walk(node))
        and any(
            isinstance(part, ast.Constant) and isinstance(part.value, int | float) for part in ast.walk(node)
        )
    )


def doubled_constants(tree: Path) -> dict[str, list[str]]:
    """Names of numeric module constants that two or more files give different values."""
    values: dict[str, dict[str, str]] = defaultdict(dict)
    for path in sources(tree / "canid"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            targets = (
                node.targets
                if isinstance(node, ast.Assign)
                else [node.target]
                if isinstance(node, ast.AnnAssign)
                else []
            )
            value = getattr(node, "value", None)
            for target in targets:
                if (
                    isinstance(target, ast.Name)
                    and target.id.isupper()
                    and value is not None
                    and numeric(value)
                ):
                    values[target.id][str(path.relative_to(tree))] = ast.unparse(value)
    return {name: sorted(where) for name, where in sorted(values.items()) if len(where) > 1}


def catalogue(tree: Path) -> list[Path]:
    """Files of the catalogue of effects, whichever layer it lies in in this checkout."""
    return [path for path in sources(tree / "canid") if "effects" in path.relative_to(tree).parts[:-1]]


def effect_ids(tree: Path) -> set[str]:
    """Ids of the catalogue, by the files that hold an EFFECT."""
    pattern = re.compile(r'^\s*id="(\w+)"', re.MULTILINE)
    return {found for path in catalogue(tree) for found in pattern.findall(path.read_text("utf-8"))}


def named_effects(tree: Path) -> dict[str, int]:
    """File of canid/ outside effects/ -> how many times an effect's id or module stands in its code, docstrings left out."""
    ids, effects = effect_ids(tree), set(catalogue(tree))
    out = {}
    for path in sources(tree / "canid"):
        if path in effects:
            continue
        parsed = ast.parse(path.read_text(encoding="utf-8"))
        docs = {
            id(node.body[0].value)
            for node in ast.walk(parsed)
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
            and node.body and isinstance(node.body[0], ast.Expr)
        }  # fmt: skip
        count = 0
        for node in ast.walk(parsed):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
                count += node.value in ids
            elif isinstance(node, ast.ImportFrom) and ".effects." in f"{node.module}.":
                count += ((node.module or "").rpartition(".")[2] in ids) + sum(
                    a.name in ids for a in node.names
                )
        if count:
            out[str(path.relative_to(tree))] = count
    return out


def old_words(tree: Path) -> dict[str, int]:
    """Part of the tree -> occurrences of `OLD_WORDS` as whole words."""
    pattern = re.compile(rf"(?<![\w-])(?:{'|'.join(OLD_WORDS)})(?![\w-])")
    out = {}
    for part in ("canid", "tests", "benchmarks", "docs", "README.md", "CHANGELOG.md", "CONTRIBUTING.md"):
        root = tree / part
        paths: Iterator[Path] = (p for p in root.rglob("*") if p.suffix in {".py", ".md", ".toml", ".j2"})
        files = [root] if root.is_file() else sorted(paths)
        out[part] = sum(
            len(pattern.findall(path.read_text(encoding="utf-8")))
            for path in files
            if path.name != "vocabulary.py"
        )
    return out


def report(tree: Path) -> None:
    """Print the figures of a checkout."""
    folders = lines_per_folder(tree)
    print("folder: files, lines")
    for folder, (files, lines) in folders.items():
        print(f"  {folder:32} {files:4} {lines:7,}")
    print(
        f"  {'canid, all':32} {sum(f for f, _ in folders.values()):4} {sum(n for _, n in folders.values()):7,}"
    )
    for part in ("tests", "benchmarks"):
        lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in sources(tree / part))
        print(f"  {part:32} {len(sources(tree / part)):4} {lines:7,}")
    functions = long_functions(tree)
    print(f"functions over {LONG_LINES} lines: {len(functions)}")
    for length, name in functions:
        print(f"  {length:4} {name}")
    constants = doubled_constants(tree)
    print(f"names of numeric constants in two or more files: {len(constants)}")
    for name, where in constants.items():
        print(f"  {name}: {len(where)}")
    named = named_effects(tree)
    print(f"effect ids or modules named outside effects/: {sum(named.values())} in {len(named)} files")
    for name, count in named.items():
        print(f"  {count:3} {name}")
    words = old_words(tree)
    print(f"words of the old vocabulary: {sum(words.values())}")
    for part, count in words.items():
        print(f"  {count:5} {part}")
