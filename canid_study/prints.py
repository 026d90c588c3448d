"""`canid study prints`: every equation, table, figure and claim of both papers against their own printed numbers.

The check takes no input, so that its result is a constant: `prints.json` and, for the curves of its figures, `curves.npz`.
`python -m benchmarks prints` computes both anew; a test compares.
"""

from __future__ import annotations

import json
from collections import Counter
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from canid.values.types import Array
from canid_study.artifact import Artifact, ClaimVerdict, Curve, Figure, Panel, Study, Table

GROVER, CHEN_ULSOY, BOTH = "grover", "chen-ulsoy", "both"
PAPERS = {GROVER: "Grover 2021", CHEN_ULSOY: "Chen & Ulsoy 2001"}
# in prints.json: what --deep changes in the study of Grover's numbers
DEEP = "deep"
TITLE = "Printed numbers, recomputed"
# files of this package
RESULT, CURVES = "prints.json", "curves.npz"


def study(which: str = BOTH, deep: bool = False) -> Study:
    """Check of the papers' printed numbers against each other; no log.

    Args:
        which: "grover", "chen-ulsoy" or "both".
        deep: scan eq. 2.5 for three and four misprinted exponents too.

    Raises:
        ValueError: another paper.

    Example:
        >>> made = study("grover")
        >>> next(a.verdict.value for a in made.artifacts if a.name == "eq. 2.5")
        'impossible'
    """
    if which not in (*PAPERS, BOTH):
        raise ValueError(f"paper {which!r}: choose {GROVER}, {CHEN_ULSOY} or {BOTH}")
    result, arrays = _result()
    parts = [decoded(result[name], arrays) for name in PAPERS if which in (name, BOTH)]
    if deep and which != CHEN_ULSOY:
        parts[0] = _deep(parts[0], decoded(result[DEEP], arrays))
    # both papers have a Table 1
    artifacts = tuple(
        a._replace(name=f"{part.paper}, {a.name}") if len(parts) > 1 else a
        for part in parts
        for a in part.artifacts
    )
    return Study(
        paper=" and ".join(part.paper for part in parts),
        title=TITLE,
        says=(_counts(artifacts), *(sentence for part in parts for sentence in part.says)),
        artifacts=artifacts,
        tables=tuple(t for part in parts for t in part.tables),
        figures=tuple(f for part in parts for f in part.figures),
        settings=tuple(dict.fromkeys(s for part in parts for s in part.settings)),
    )


def _counts(artifacts: tuple[Artifact, ...]) -> str:
    claims = Counter(a.verdict for a in artifacts if a.name.split(", ")[-1].startswith("claim"))
    listed = ", ".join(f"{v.value} {claims[v]}" for v in ClaimVerdict if claims[v])
    return f"{sum(claims.values())} claims checked by the printed numbers: {listed}."


def _deep(plain: Study, changes: Study) -> Study:
    """The study with the rows and settings that the deep scan changes."""
    rows = {a.name: a for a in changes.artifacts}
    settings = dict(plain.settings) | dict(changes.settings)
    return plain._replace(
        artifacts=tuple(rows.get(a.name, a) for a in plain.artifacts), settings=tuple(settings.items())
    )


@cache
def _result() -> tuple[dict[str, Any], list[Array]]:
    """The committed result: a study for each paper, and the arrays that its curves name by their index."""
    folder = files("canid_study")
    result = json.loads(folder.joinpath(RESULT).read_text(encoding="utf-8"))
    with folder.joinpath(CURVES).open("rb") as file, np.load(file) as stored:
        return result, [stored[name] for name in stored.files]


def decoded(study: dict[str, Any], arrays: list[Array]) -> Study:
    """A study from its JSON object, whose curves hold indices of `arrays` in the place of x, y, low and high.

    Example:
        >>> decoded({"paper": "Grover 2021", "title": "", "says": ["Two claims fail."], "artifacts": []}, []).says
        ('Two claims fail.',)
    """
    return Study(
        study["paper"],
        study["title"],
        tuple(study["says"]),
        tuple(
            Artifact(**a | {"verdict": ClaimVerdict(a["verdict"]), "files": tuple(a["files"])})
            for a in study["artifacts"]
        ),
        tuple(Table(**t | {"columns": tuple(t["columns"])}) for t in study.get("tables", ())),
        tuple(
            Figure(**f | {"panels": tuple(_panel(panel, arrays) for panel in f["panels"])})
            for f in study.get("figures", ())
        ),
        settings=tuple((name, value) for name, value in study.get("settings", ())),
    )


def _panel(panel: dict[str, Any], arrays: list[Array]) -> Panel:
    curves = tuple(
        Curve(**c | {k: None if c[k] is None else arrays[c[k]] for k in ("x", "y", "low", "high")})
        for c in panel["curves"]
    )
    ranges = {k: panel[k] and tuple(panel[k]) for k in ("x_range", "y_range")}
    return Panel(**panel | {"curves": curves} | ranges)
