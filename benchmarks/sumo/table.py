"""The table of docs/evidence/sumo.md."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from benchmarks import other_drive
from benchmarks.sumo.outcomes import OF_TIME, Outcome
from benchmarks.sumo.sumo_drivers import SMOOTH, STEP_S
from canid.values.findings import ClosedLoopError

CANIDS = (other_drive.BASELINE, other_drive.CHOSEN, other_drive.RECOMMENDED)
# 1/s; SUMO's function gives none of some models
MIN_DERIVATIVE = 1e-3


def table(rows: Sequence[Outcome]) -> list[str]:
    """Drives one by one, then figures over all."""
    heads = (
        "seed", "model", "acts every s", "leads", "K of range rate | its own ∂a/∂Δv", "K of headway | its own",
        "fit %", "verdict", "named", "gain stated | on the second drive",
        "gap error: baseline | chosen | recommended | best rival", "CPU s: identify | diagnose",
    )  # fmt: skip
    out = [f"| {' | '.join(head.replace(' | ', ' / ') for head in heads)} |", f"|{'---|' * len(heads)}"]
    return [*out, *(_row(one) for one in rows), "", *_figures(rows)]


def _row(of: Outcome) -> str:
    named = ", ".join([*of.named, *(f"{name} (surrogate)" for name in of.surrogates)]) or "–"
    errors = _errors(of)
    gap = "–"
    if errors:
        best = min(_rivals(errors), key=lambda name: errors[name].gap)
        names = (other_drive.BASELINE, other_drive.CHOSEN, other_drive.RECOMMENDED, best)
        figures = (errors[name].gap for name in names if name in errors)
        gap = " / ".join(f"{x:.3f}" for x in figures) + f" ({best})"
    cells = (
        f"{of.seed}", of.model, f"{of.action_step:.2f}", of.leads,
        f"{_interval(of.range_rate_gain)} / {_derivative(of.range_rate_derivative)}",
        f"{_interval(of.headway_gain)} / {_derivative(of.headway_derivative)}",
        f"{of.fit_percent:.0f}", of.verdict, named, f"{_interval(of.stated_gain)} / {_number(of.achieved_gain)}", gap,
        f"{of.identify_s:.0f} / {of.diagnose_s:.0f}",
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


def _rivals(errors: other_drive.Errors) -> list[str]:
    """Names of the published models."""
    return [name for name in errors if name not in CANIDS]


def _figures(rows: Sequence[Outcome]) -> list[str]:
    steady = [one for one in rows if one.action_step <= STEP_S]
    rarely = [one for one in rows if one.action_step > STEP_S]
    smooth = [one for one in rows if one.model in SMOOTH]
    answers = (
        ("range rate", [(one.range_rate_gain, one.range_rate_derivative) for one in smooth]),
        ("headway", [(one.headway_gain, one.headway_derivative) for one in smooth]),
    )
    of_time = [one for one in rows if OF_TIME & {*one.named, *one.surrogates}]
    gained = [one for one in rows if math.isfinite(one.achieved_gain) and math.isfinite(one.stated_gain[0])]
    inside = [one.stated_gain[1] <= one.achieved_gain <= one.stated_gain[2] for one in gained]
    out = ["| figure | |", "|---|---|"]
    out += [f"| drives | {len(rows)}, seeds {min(r.seed for r in rows)} to {max(r.seed for r in rows)} |"]
    for verdict in sorted({one.verdict for one in rows}):
        out += [f"| verdict {verdict} | {sum(one.verdict == verdict for one in rows)} |"]
    out += [
        *(
            f"| {' and '.join(SMOOTH)}: interval of K of {name} holds the model's own derivative | "
            f"{_share([iv[1] <= true <= iv[2] for iv, true in pairs if math.isfinite(iv[0])])}; "
            f"median of the ratio {_median([iv[0] / true for iv, true in pairs if math.isfinite(iv[0])])} |"
            for name, pairs in answers
        ),
        f"| an effect of time named or surrogate, of drivers that are constant | {len(of_time)}/{len(rows)} |",
        f"| any driver's effect named, driver acts every step | {sum(bool(one.named) for one in steady)}/{len(steady)} |",
        f"| act_and_wait named, driver acts every 0.3 to 1 s | "
        f"{sum('act_and_wait' in one.named for one in rarely)}/{len(rarely)} |",
        f"| stated gain holds the gain on the second drive | {_share(inside)} |",
        f"| CPU s per drive, median: identify, diagnose | {_median([one.identify_s for one in rows])}, "
        f"{_median([one.diagnose_s for one in rows])} |",
    ]
    errors = [found for found in map(_errors, rows) if found]
    return [*out, "", *(other_drive.summary(errors) if errors else [])]


def _errors(of: Outcome) -> other_drive.Errors:
    return {name: ClosedLoopError(*error) for name, error in of.errors.items()}


def _derivative(x: float) -> str:
    return f"{x:.2f}" if x > MIN_DERIVATIVE else "–"


def _number(x: float) -> str:
    return f"{x:.2f}" if math.isfinite(x) else "–"


def _interval(iv: Sequence[float]) -> str:
    return f"{iv[0]:.2f} [{iv[1]:.2f}, {iv[2]:.2f}]" if math.isfinite(iv[0]) else "–"


def _share(hits: Sequence[bool]) -> str:
    return f"{sum(hits)}/{len(hits)}"


def _median(values: Sequence[float]) -> str:
    return f"{np.median(values):.2f}" if len(values) else "–"
