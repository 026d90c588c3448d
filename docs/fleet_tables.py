"""The tables of a fleet and their columns in docs/fleet_folder.md, from canid/analysis/fleet/storage/columns.py.

python docs/fleet_tables.py
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent))

from canid.analysis.fleet.storage.columns import LOGS, SUMMARIES, TABLES, Column  # noqa: E402

PAGE = DOCS / "fleet_folder.md"
BEGIN, END = "<!-- columns: begin -->\n", "<!-- columns: end -->"
WHAT = {
    "logs": "one row per log of the plan",
    "drives": "one row per log, with what was found over the whole drive",
    "windows": "one row per window and estimator",
    "events": "what monitor, signal checks and the detection of steps reported, with its time",
    "findings": "one row per cause that the diagnosis of a drive names",
    "power": "per drive and cause that it does not name: the strength that would have been named",
    "drivers": "one row per driver and kind of output: shrunken estimates, and own ones (`_own`)",
    "population": "one row per kind of output and parameter",
    "joint_findings": "causes that the diagnosis of several drives together names",
}


def markdown() -> str:
    """All tables."""
    parts = []
    for name, columns in {"logs": LOGS, **TABLES, **SUMMARIES}.items():
        rows = "\n".join(f"| {' | '.join(row)} |" for row in _rows(columns))
        parts.append(
            f"### {name}\n\n{WHAT[name].capitalize()}.\n\n| column | type | unit | |\n|---|---|---|---|\n{rows}\n"
        )
    return "\n".join(parts)


def _rows(columns: Sequence[Column]) -> Iterator[tuple[str, str, str, str]]:
    """A row for each column; the ends of an interval stand with it, and those of all channels or parameters together."""
    names = {column.name for column in columns}
    for column in columns:
        stem = column.name.removesuffix("_low").removesuffix("_high")
        if stem != column.name and {stem, f"{stem}_low", f"{stem}_high"} <= names:
            continue
        with_ends = f"{column.name}_low" in names
        name = f"`{column.name}`" + (", `_low`, `_high`" if with_ends else "")
        yield name, column.type, column.unit, column.meaning.replace("|", "\\|")


def replaced(page: str) -> str:
    """The page with its tables."""
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}{markdown()}{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    PAGE.write_text(replaced(PAGE.read_text("utf-8")), "utf-8")
