"""Recompute the papers' printed numbers and write the result that `canid study prints` shows.

python -m benchmarks prints [--into canid_study]
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.papers.prints import chen_ulsoy_results, grover_results, misprint_scan, studies
from canid.values.text import json_values
from canid.values.types import Array
from canid_study.artifact import Curve, Study
from canid_study.printed_numbers import EQ_2_5
from canid_study.prints import CHEN_ULSOY, CURVES, DEEP, GROVER, RESULT

FOLDER = Path(__file__).parents[3] / "canid_study"
# characters of a line of the JSON file
WIDTH = 200


def main(argv: Sequence[str] | None = None) -> int:
    """Write both files."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks prints",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--into", type=Path, default=FOLDER, metavar="DIR", help="default: canid_study")
    args = parser.parse_args(argv)
    result, arrays = encoded()
    (args.into / RESULT).write_text(text(result) + "\n", encoding="utf-8")
    np.savez_compressed(args.into / CURVES, *arrays)
    print(f"{args.into / RESULT} and {CURVES} written")
    return 0


def encoded() -> tuple[dict[str, Any], list[Array]]:
    """The studies as JSON objects whose curves hold indices of the arrays; equal arrays are stored once."""
    found = grover_results.results()
    plain = studies.grover(found)
    deep = studies.grover(found._replace(scans=misprint_scan.scans(EQ_2_5, deep=True)), deep=True)
    changes = deep._replace(
        says=(),
        artifacts=tuple(a for a in deep.artifacts if a not in plain.artifacts),
        tables=(),
        figures=(),
        settings=tuple(s for s in deep.settings if s not in plain.settings),
    )
    arrays: dict[bytes, tuple[int, Array]] = {}
    made = {GROVER: plain, DEEP: changes, CHEN_ULSOY: studies.chen_ulsoy(chen_ulsoy_results.results())}
    result = {name: json_values.plain(_indexed(study, arrays)) for name, study in made.items()}
    return result, [values for _, values in arrays.values()]


def text(value: Any, indent: str = "") -> str:
    """JSON with a line for whatever fits into `WIDTH` characters, such as a row of a table.

    Example:
        >>> text({"a": [1, None], "b": "c"})
        '{"a": [1, null], "b": "c"}'
    """
    line = json.dumps(value, ensure_ascii=False)
    if len(line) <= WIDTH or not isinstance(value, dict | list):
        return line
    inner = f"{indent} "
    if isinstance(value, list):
        parts = [text(item, inner) for item in value]
    else:
        parts = [f"{json.dumps(key)}: {text(item, inner)}" for key, item in value.items()]
    first, last = ("{", "}") if isinstance(value, dict) else ("[", "]")
    return f"{first}\n{inner}" + f",\n{inner}".join(parts) + f"\n{indent}{last}"


def _indexed(study: Study, arrays: dict[bytes, tuple[int, Array]]) -> Study:
    """The study with an index in the place of each array of a curve."""

    def index(values: Array | None) -> Any:
        if values is None:
            return None
        floats = np.asarray(values, dtype=np.float64)
        return arrays.setdefault(floats.tobytes(), (len(arrays), floats))[0]

    def curve(c: Curve) -> Curve:
        return c._replace(x=index(c.x), y=index(c.y), low=index(c.low), high=index(c.high))

    figures = (
        f._replace(panels=tuple(p._replace(curves=tuple(map(curve, p.curves))) for p in f.panels))
        for f in study.figures
    )
    return study._replace(figures=tuple(figures))


if __name__ == "__main__":
    sys.exit(main())
