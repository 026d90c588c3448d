"""Figures of the study by the paper's numbers (Grover 2021), and those that the paper has not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from canid.values.types import Array, Interval
from canid_study.artifact import Curve, Figure, Panel
from canid_study.grover.drive_analysis import MAP_EVERY, DriveAnalysis, unit_of
from canid_study.grover.episode_analysis import Analysis
from canid_study.printed_numbers import SELECTION_PERCENT


def route(drives: Sequence[DriveAnalysis]) -> Figure | None:
    """Fig. 8: the route."""
    curves = tuple(
        Curve(d.route.east[::MAP_EVERY], d.route.north[::MAP_EVERY], d.log, role="measured")
        for d in drives
        if d.route is not None
    )
    if not curves:
        return None
    panel = Panel("east (m)", "north (m)", curves, equal=True)
    return Figure("fig_08", "Fig. 8: route", (panel,), "Position from the log; the first one is the origin.")


def places(drives: Sequence[DriveAnalysis]) -> Figure | None:
    """Fig. 17: where the episodes are."""
    curves: list[Curve] = []
    for d in drives:
        if d.route is None:
            continue
        east, north = d.route
        curves.append(Curve(east[::MAP_EVERY], north[::MAP_EVERY], d.log, role="other"))
        fitted = {a.episode.number for a in d.analyses}
        for e in d.episodes:
            label = f"episode {e.number}" if e.number in fitted and len(fitted) <= 6 else ""
            role = "reproduced" if e.number in fitted else "measured"
            curves.append(Curve(east[e.part], north[e.part], label, role=role))
    if not curves:
        return None
    panel = Panel("east (m)", "north (m)", tuple(curves), equal=True)
    caption = "Where the episodes are; transfer functions are fitted to the longest ones."
    return Figure("fig_17", "Fig. 17: episodes on the route", (panel,), caption)


def throttle(drive: DriveAnalysis, a: Analysis) -> list[Figure]:
    """Fig. 10 and 11: the output against each input."""
    unit = unit_of(drive.output)
    out = []
    for number, column, what, x_unit in ((10, 0, "headway error", "s"), (11, 1, "range rate", "m/s")):
        x, y = a.raw[:, column], a.raw[:, 2]
        at = np.array([x.min(), x.max()])
        slope, level = np.polyfit(x, y, 1)
        curves = (
            Curve(x, y, "recorded", points=True, role="measured"),
            Curve(at, level + slope * at, f"line, {slope:.3g} {unit} per {x_unit}", role="reproduced"),
        )
        caption = f"Episode {a.episode.number} of {drive.log}, the longest."
        if column == 1:
            caption += (
                " Range rate is lead minus own speed; the paper's relative velocity has the other sign."
            )
        panel = Panel(f"{what} ({x_unit})", f"{drive.output} ({unit})", curves)
        out.append(Figure(f"fig_{number}", f"Fig. {number}: output against {what}", (panel,), caption))
    return out


def responses(drive: DriveAnalysis, a: Analysis, dt: float) -> list[Figure]:
    """Fig. 12 to 16: what the models simulate."""
    place = f"Episode {a.episode.number} of {drive.log}."
    t = _times(a, dt)
    data = Curve(t, a.output, "recorded", role="measured")
    out = []
    for number, fits, what in ((12, a.inputs[0], "headway error"), (13, a.inputs[1], "range rate")):
        m = fits.model
        label = f"order {m.order}, {m.fit_percent:.1f} %"
        curve = Curve(t, m.simulated, label, role="reproduced")
        says = f"{place} Both inputs can explain the same output on their own; neither is the driver's response to it alone."
        out.append(_response(drive, number, f"transfer function from {what}", (data, curve), says))
    both = a.together
    joint = Curve(t, a.joint_simulated, f"joint model, {a.joint_fit:.1f} %", role="corrected")
    high = Curve(t, both.high, f"sum of the two, {both.high_sum:.1f} %", role="reproduced")
    again = Curve(
        t, both.high_weighed, f"weighed anew, {both.high_refit:.1f} %", role="reproduced", dashed=True
    )
    low = Curve(t, both.low, f"sum of the reduced, {both.reduced_sum:.1f} %", role="reproduced")
    low_again = Curve(
        t, both.low_weighed, f"weighed anew, {both.reduced_refit:.1f} %", role="reproduced", dashed=True
    )
    twice = f"{place} Two models that each fit the output add up to about twice the output."
    out.append(_response(drive, 14, "both transfer functions", (data, high, again), twice))
    out.append(_response(drive, 15, "both reduced", (data, low, low_again), place))
    out.append(_response(drive, 16, "data, reduced and joint model", (data, low_again, joint), place))
    return out


def further(cases: Sequence[tuple[DriveAnalysis, Analysis]], dts: Sequence[float]) -> list[Figure]:
    """Fig. 18 to 20: up to three further episodes."""
    out = []
    for number, (drive, a), dt in zip((18, 19, 20), cases, dts, strict=False):
        t = _times(a, dt)
        b = a.together
        curves = (
            Curve(t, a.output, "recorded", role="measured"),
            Curve(
                t,
                b.high_weighed,
                f"transfer functions, weighed anew, {b.high_refit:.1f} %",
                role="reproduced",
            ),
            Curve(
                t,
                b.low_weighed,
                f"reduced, weighed anew, {b.reduced_refit:.1f} %",
                role="reproduced",
                dashed=True,
            ),
            Curve(t, a.joint_simulated, f"joint model, {a.joint_fit:.1f} %", role="corrected"),
        )
        caption = f"Episode {a.episode.number} of {drive.log}, from {a.episode.t:.0f} s."
        out.append(_response(drive, number, f"case {number - 17}", curves, caption))
    return out


def orders(cases: Sequence[Analysis]) -> Figure:
    """Percentage of fit by order."""
    panels = []
    for index, what in enumerate(("headway error", "range rate")):
        curves = [
            Curve(
                np.arange(1.0, len(a.inputs[index].fits) + 1.0),
                np.array(a.inputs[index].fits),
                role="reproduced",
            )
            for a in cases
        ]
        most = max(len(a.inputs[index].fits) for a in cases)
        gate = Curve(
            np.array([1.0, most]), np.full(2, SELECTION_PERCENT), "gate of 90 %", role="limit", dashed=True
        )
        panels.append(Panel("order", "fit (%)", (*curves, gate), title=what, y_range=(0.0, 100.0)))
    caption = "Transfer functions of one input, each line an episode: the fit rises with the order on the data of the fit."
    return Figure("orders", "Percentage of fit by order (sec. 4.2)", tuple(panels), caption)


def next_episode(cases: Sequence[Analysis]) -> Figure | None:
    """Percentage of fit on the next episode against that on the own one."""
    pairs = [(a, a.held) for a in cases if a.held is not None]
    if not pairs:
        return None

    def points(own_episode: list[float], held: list[float], label: str, role: str) -> Curve:
        y: Array = np.maximum(np.array(held), -100.0)
        return Curve(np.array(own_episode), y, label, points=True, role=role)

    curves = (
        points(
            [a.together.high_refit for a, _ in pairs],
            [h.high for _, h in pairs],
            "transfer functions",
            "reproduced",
        ),
        points(
            [a.together.reduced_refit for a, _ in pairs], [h.reduced for _, h in pairs], "reduced", "other"
        ),
        points(
            [a.joint.fit_percent for a, _ in pairs], [h.joint for _, h in pairs], "joint model", "corrected"
        ),
    )
    panel = Panel("fit on the episode (%)", "fit on the next episode (%)", curves)
    caption = (
        "What fits an episode better does not predict the next one better. Below -100 % is shown at -100 %."
    )
    return Figure("next_episode", "Percentage of fit on the next episode", (panel,), caption)


def input_correlation(drives: Sequence[DriveAnalysis]) -> Figure | None:
    """K1 per input and joint by the correlation of the inputs."""
    panels = []
    for drive in drives:
        cost = drive.cost
        if cost is None:
            continue
        turned, recorded = cost.cases[1:], cost.recorded
        x = np.array([c.correlation for c in turned])
        unit = unit_of(drive.output)
        curves = (
            _band(x, [c.per_record for c in turned], "headway error alone, per record", "other"),
            _band(x, [c.per_input for c in turned], "headway error alone, all records", "reproduced"),
            Curve(x, np.array([c.expected for c in turned]), "without noise", role="reproduced", dashed=True),
            _band(x, [c.joint for c in turned], "both inputs, all records", "corrected"),
            Curve(x, np.full(len(x), cost.K1), "truth of the simulation", role="measured", dashed=True),
            _band(
                np.array([recorded.correlation]),
                [recorded.per_input],
                "headway error alone, recorded inputs",
                "limit",
                points=True,
            ),
        )
        panels.append(
            Panel(
                "correlation of headway error and range rate", f"K1 ({unit} per s)", curves, title=drive.log
            )
        )
    if not panels:
        return None
    caption = "Simulated on each drive's own inputs. Bands hold 95 % of the estimates."
    return Figure("input_correlation", "What one fit per input costs", tuple(panels), caption)


def _response(
    drive: DriveAnalysis, number: int, what: str, curves: tuple[Curve, ...], caption: str
) -> Figure:
    label = f"{drive.output} less its line ({unit_of(drive.output)})"
    return Figure(f"fig_{number}", f"Fig. {number}: {what}", (Panel("t (s)", label, curves),), caption)


def _band(x: Array, y: Sequence[Interval], label: str, role: str, *, points: bool = False) -> Curve:
    low, middle, high = (
        np.array([getattr(interval, name) for interval in y]) for name in ("low", "value", "high")
    )
    return Curve(x, middle, label, low, high, points, role)


def _times(a: Analysis, dt: float) -> Array:
    """Times of an episode's samples, s of the drive."""
    out: Array = np.asarray(a.episode.t + np.arange(len(a.output)) * dt, np.float64)
    return out
