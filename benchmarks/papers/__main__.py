"""Check and reproduce both papers with `canid study`, and write the results into a page.

    python -m benchmarks papers [--into docs/evidence/papers.md] [--keep DIR] [--full]

Three commands: `canid study prints`, `canid study grover --reproduce`, `canid study chen-ulsoy --reproduce`.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

BEGIN, END = "<!-- papers: begin -->", "<!-- papers: end -->"
# sizes of the reproductions, and with --full those of the papers: 50 drives of two hours take some 40 minutes
SIZES: dict[str, tuple[str, ...]] = {"grover": (), "chen-ulsoy": ("--drivers", "6", "--minutes", "60")}
FULL: dict[str, tuple[str, ...]] = {"grover": (), "chen-ulsoy": ()}
# a larger table is left to the study's own page
MAX_ROWS, MAX_COLUMNS = 16, 12


def main(argv: Sequence[str] | None = None) -> int:
    """Run the studies."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks papers",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--into", type=Path, metavar="PAGE", help="replace the results of this page")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep the studies' folders")
    parser.add_argument("--full", action="store_true", help="as many drives of lane keeping as the paper has")
    parser.add_argument("--seed", default="1")
    args = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        home = args.keep or Path(folder)
        home.mkdir(parents=True, exist_ok=True)
        sizes = FULL if args.full else SIZES
        lines = section("Printed numbers", *studied(home / "prints", "prints"))
        for paper, more in sizes.items():
            made = studied(home / paper, paper, "--reproduce", "--seed", args.seed, *more)
            lines += section(f"{'Grover' if paper == 'grover' else 'Chen & Ulsoy'} reproduced", *made)
    text = "\n".join(lines)
    print(text)
    if args.into is not None:
        before, _, rest = args.into.read_text(encoding="utf-8").partition(BEGIN)
        args.into.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.partition(END)[2]}", encoding="utf-8")
    return 0


def studied(folder: Path, *words: str) -> tuple[str, float, list[dict[str, Any]]]:
    """Run one study: its command, s, and its results."""
    began = time.monotonic()
    command = [sys.executable, "-m", "canid", "study", *words, "-o", str(folder)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    took = time.monotonic() - began
    made = json.loads((folder / "study.json").read_text(encoding="utf-8"))
    return f"canid study {' '.join(words)}", took, made if isinstance(made, list) else [made]


def section(title: str, command: str, took: float, made: list[dict[str, Any]]) -> list[str]:
    """One command's results as Markdown."""
    lines = [f"## {title}", "", f"    {command}        # {took:.0f} s"]
    for study in made:
        lines += ["", f"**{study['paper']}.** " + " ".join(study["says"]), ""]
        lines += artifacts(study["artifacts"])
        for table in study["tables"] if "--reproduce" in command else ():
            if len(table["rows"]) <= MAX_ROWS and len(table["columns"]) <= MAX_COLUMNS:
                lines += ["", table["title"] + ":", "", *rows(table)]
        lines += [f"\n- Missed: {one}" for one in study["failed"]]
    return [*lines, ""]


def artifacts(found: list[dict[str, Any]]) -> list[str]:
    """A row for each artifact that something is known of."""
    lines = ["| artifact | published | reproduced | canid | verdict | why |", "|---|---|---|---|---|---|"]
    drawings = []
    for a in found:
        if not (a["published"] or a["reproduced"] or a["corrected"]):
            drawings.append(a["name"])
            continue
        cells = (a["published"], a["reproduced"], a["corrected"])
        words = " | ".join(escaped(x) or "–" for x in cells)
        lines.append(
            f"| {escaped(a['name'])}: {escaped(a['what'])} | {words} | {a['verdict']} | {escaped(a['why'])} |"
        )
    if drawings:
        lines += ["", f"Without a number to check: {', '.join(drawings)}."]
    return lines


def rows(table: dict[str, Any]) -> list[str]:
    """A table as Markdown."""
    lines = [
        "| " + " | ".join(map(escaped, table["columns"])) + " |",
        "|" + "---|" * len(table["columns"]),
    ]
    return lines + ["| " + " | ".join(map(shown, row)) + " |" for row in table["rows"]]


def shown(x: Any) -> str:
    """A cell; four digits of a number."""
    if x is None:
        return "–"
    return f"{x:.4g}" if isinstance(x, float) else escaped(str(x))


def escaped(text: str) -> str:
    r"""Text for a cell of Markdown.

    Example:
        >>> escaped("|v|")
        '\\|v\\|'
    """
    return text.replace("|", "\\|").replace("\n", " ")


if __name__ == "__main__":
    sys.exit(main())
