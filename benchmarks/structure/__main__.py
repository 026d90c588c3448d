"""Structure of the source tree in figures, as a markdown table, before and after a change.

    python -m benchmarks structure [--tree PATH] [--no-walks] [--readability]

Lines of code, layers, folders and loose modules of `canid/`; files and back-calls of three calls, traced by
sys.setprofile; what three commands import. --readability prints long functions, doubled constants and old words instead.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.structure import readability, walks
from benchmarks.structure.code_lines import lines_in
from benchmarks.structure.import_cost import COMMANDS, import_cost

HERE = Path(__file__).resolve().parents[2]
# at the root of canid/ in any case
ROOT_MODULES = {"__init__.py", "__main__.py"}


def layers(tree: Path) -> int:
    """Layers that the test of imports of a checkout lists in `LAYERS`, whatever that test is called."""
    for path in sorted((tree / "tests").glob("test_*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "LAYERS":
                return len(getattr(node.value, "elts", getattr(node.value, "keys", ())))
    raise ValueError(f"{tree / 'tests'}: no test has LAYERS")


def modules_per_folder(tree: Path) -> Counter[str]:
    """Folder of canid/ -> modules directly in it, `__init__.py` left out."""
    paths = (path for path in readability.sources(tree / "canid") if path.name != "__init__.py")
    return Counter(str(path.parent.relative_to(tree)) for path in paths)


def walk(tree: Path, name: str) -> walks.Walk:
    """Trace a walk through a checkout, in a process of its own."""
    env = {**os.environ, "PYTHONPATH": str(tree)}
    command = [sys.executable, str(Path(walks.__file__).resolve()), name]
    done = subprocess.run(command, check=True, cwd=tree, env=env, stdout=subprocess.PIPE, text=True)
    return walks.Walk(**json.loads(done.stdout))


def rows(tree: Path, walked: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Name and figure of each row of the table."""
    sources = readability.sources(tree / "canid")
    lines = lines_in(sources)
    yield "code lines of `canid/`", f"{lines.code:,}"
    yield "docstrings and comments; blank", f"{lines.text:,}; {lines.blank:,}"
    if (tree / "canid_study").is_dir():
        yield "code lines of `canid_study/`", f"{lines_in(readability.sources(tree / 'canid_study')).code:,}"
    yield "layers", str(layers(tree))
    folders = [path for path in (tree / "canid").iterdir() if (path / "__init__.py").exists()]
    yield "folders of `canid/`, with subfolders", f"{len(folders)}, {len({p.parent for p in sources}) - 1}"
    loose = [path for path in sources if path.parent == tree / "canid" and path.name not in ROOT_MODULES]
    yield "loose modules at the root", str(len(loose))
    counts = modules_per_folder(tree)
    yield "most modules in a folder", ", ".join(f"{name} {n}" for name, n in counts.most_common(3))
    yield "folders over 24 modules", str(sum(n > 24 for n in counts.values()))
    for name in walked:
        seen = walk(tree, name)
        yield f"{name}: files, functions", f"{seen.files}, {seen.functions}"
        yield f"{name}: back-calls", f"{seen.back_calls} of {seen.pairs}"
    for command in COMMANDS:
        cost = import_cost(tree, command)
        yield f"`canid {' '.join(command)}`: modules, CPU s", f"{cost.modules}, {cost.seconds:.2f}"


def main(argv: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks structure",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--tree", type=Path, default=HERE, metavar="PATH", help="another checkout, to compare with"
    )
    parser.add_argument("--no-walks", action="store_true", help="leave the traced calls out (1 min)")
    parser.add_argument(
        "--readability", action="store_true", help="long functions, doubled constants, old words instead"
    )
    args = parser.parse_args(argv)
    tree = args.tree.resolve()
    if args.readability:
        readability.report(tree)
        return
    print(f"| {tree.name} | |\n|---|---|")
    for name, figure in rows(tree, () if args.no_walks else tuple(walks.WALKS)):
        print(f"| {name} | {figure} |", flush=True)


if __name__ == "__main__":
    main()
