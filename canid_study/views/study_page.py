"""A study as one self-contained HTML page: results, artifacts, tables and figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files

from markupsafe import Markup

from canid.ui.views.document.templates import environment, file_text
from canid.values.findings import Provenance
from canid_study.artifact import ClaimVerdict, Study
from canid_study.views.figure_svg import inline
from canid_study.views.study_files import cell

# class of the style sheet
CLASSES = {
    ClaimVerdict.HOLDS: "passed",
    ClaimVerdict.FAILS: "failed",
    ClaimVerdict.IMPOSSIBLE: "failed",
}


def page(studies: Sequence[Study], provenance: Provenance, drawings: Mapping[tuple[str, str], str]) -> str:
    """Several studies as one page, one after the other.

    Args:
        studies: one or more; each has its own section.
        provenance: of the logs, and the command.
        drawings: (paper, name of the figure) -> from `figure_svg.drawn`.

    Example:
        >>> "Two claims fail" in page([Study("Grover 2021", "Prints", ("Two claims fail.",), ())], Provenance(), {})
        True
    """
    counts = {
        verdict: sum(a.verdict is verdict for study in studies for a in study.artifacts)
        for verdict in ClaimVerdict
    }
    templates = environment()
    templates.filters["cell"] = cell
    return templates.from_string(_file("study.html.j2")).render(
        studies=studies,
        title=", ".join(study.title for study in studies),
        counts={verdict.value: n for verdict, n in counts.items() if n},
        classes=CLASSES,
        drawn={f"{paper} {name}": Markup(inline(text, name)) for (paper, name), text in drawings.items()},
        p=provenance,
        style=file_text("document/page.css") + Markup(_file("study.css")),
    )


def _file(name: str) -> str:
    """A file of this folder."""
    return files("canid_study.views").joinpath(name).read_text(encoding="utf-8")
