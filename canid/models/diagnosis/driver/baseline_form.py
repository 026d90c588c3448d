"""Choice of the baseline's form by evidence (`wanted_gap`), where the output is an acceleration.

The literature states the forms for accelerations. What a pedal must be at a steady speed depends on the speed through the
car's drag, which nobody can separate from a wanted gap: there the form stays Grover's, and what depends on the speed is a
finding. Of an acceleration, a form must exceed the evidence that any cause needs, and that of every effect which states
another wanted gap (a standstill distance in a time-headway driver, say), so that such an effect keeps its name; and behind
the recorded lead, in closed loop, it must keep the measured gap at least as well as a constant time headway does. Of two
such forms the closed loop decides: what the driver wants at a steady speed shows in the gap, hardly in the next sample.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.confidence import SIGMAS
from canid.models.diagnosis.driver import closed_loop, driver_candidates, local_minima, noise_law
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import (
    DESIRED,
    FREE_SPEED,
    HIGH,
    K1,
    LOW,
    OFFSET,
    OWN,
    STANDSTILL,
    DriverModel,
    with_effects,
)
from canid.models.diagnosis.fitting.candidates import EVIDENCE_PER_PARAMETER
from canid.models.diagnosis.fitting.fitted_model import polished, solve
from canid.models.diagnosis.fitting.search import RIVAL
from canid.models.diagnosis.fitting.uncertainty import inflation, needed, sandwich
from canid.models.effects.effect import Effect, Kind
from canid.models.effects.wanted_gap import REFERENCE_SPEED, Form
from canid.values.findings import BaselineForm
from canid.values.types import Array, Interval, Trace

# s, m, and parts of the highest driven speed: where the fit of a form begins, after screening with its gains refitted
INITIAL_T, INITIAL_S0, INITIAL_V0 = (0.7, 1.2, 1.8, 2.5), (0.0, 4.0), (1.05, 1.3, 2.0)
# the forms that are compared with a constant time headway
OTHERS = (Form.GAP, Form.FREE_SPEED)
# of a parameter's range; a form with a parameter nearer than this to its bound is another form
BOUND_FORM_SHARE = 0.01
# of the screened initial guesses, fitted in full
FULL_FITS = 2
SAYS = {
    Form.TIME_HEADWAY: "the wanted time headway is constant",
    Form.GAP: "the gap is controlled, with a standstill distance and a time gap (OVRV)",
    Form.FREE_SPEED: "the wanted gap has a standstill distance, a time headway and a free speed (IDM)",
}


class Choice(NamedTuple):
    """The baseline in its form."""

    fitted: FittedDriver
    why: str


def choose(trace: Trace, data: DriverData, fitted: FittedDriver, effects: tuple[Effect, ...]) -> Choice:
    """Choose the form of the baseline.

    Args:
        trace: of the drive, on the driver's grid.
        data: the driver's columns.
        fitted: the baseline with a constant time headway.
        effects: candidates of the driver's block.
    """
    if data.pedal:
        return Choice(fitted, "the form for a pedal")
    best: _Fitted | None = None
    for form in OTHERS:
        candidate = _fitted(trace, data, fitted, form)
        if candidate is not None and (best is None or candidate.gap_error < best.gap_error):
            best = candidate
    if best is None:
        return Choice(fitted, "no other form explains more than chance")
    rivals = tuple(effect for effect in effects if effect.wanted_gap and effect.kind is Kind.PARAMETRIC)
    for effect in rivals:
        rival = driver_candidates.tried(effect, data, fitted, driver_candidates.screen(effect, data, fitted))
        margin = fitted.deviance - rival.solved.deviance - EVIDENCE_PER_PARAMETER * rival.parameters
        # of two that explain the same, the one with fewer parameters; of two equals, the form
        if margin > best.margin + (RIVAL if rival.parameters >= best.extra else 0.0):
            return Choice(fitted, "another wanted gap explains more than the other forms")
    best_fit = best.solved
    chosen = polished(data, noise_law.again(data, best_fit))
    return Choice(
        chosen, f"evidence {best.evidence:.0f} over a constant time headway, {best.needed:.0f} needed"
    )


class _Fitted(NamedTuple):
    """A form that explains more than chance."""

    solved: FittedDriver
    extra: int  # parameters
    evidence: float
    needed: float
    margin: float  # 2 Δ log likelihood less what the parameters cost
    gap_error: float  # m², mean square, in closed loop


def _fitted(trace: Trace, data: DriverData, fitted: FittedDriver, form: Form) -> _Fitted | None:
    solved = of_form(data, fitted, form)
    if solved is None:
        return None
    extra = len(solved.fitted.free) - len(fitted.fitted.free)
    form_places = [k for k in OWN[form] if k in solved.fitted.free and k != OFFSET]
    near = [BOUND_FORM_SHARE * (HIGH[k] - LOW[k]) for k in form_places]
    if any(
        min(solved.q[k] - LOW[k], HIGH[k] - solved.q[k]) < edge
        for k, edge in zip(form_places, near, strict=True)
    ):
        return None
    standstill = stated(data, solved, "").parameters.get("s0")
    # of a gap error s0 follows from the offset: a driver who wants −20 m when standing is another kind of driver
    if standstill is not None and not LOW[STANDSTILL] <= standstill.value <= HIGH[STANDSTILL]:
        return None
    won = fitted.deviance - solved.deviance
    evidence, bound = won / inflation(solved.fitted, form_places, data.output.dt), needed(extra, len(OTHERS))
    if evidence < bound:
        return None
    square, before = (closed_loop.gap_error(trace, data, model_fit) for model_fit in (solved, fitted))
    # not <=: NaN, no stretch to compare on
    if not square <= before:
        return None
    return _Fitted(solved, extra, evidence, bound, won - EVIDENCE_PER_PARAMETER * extra, square)


def of_form(data: DriverData, fitted: FittedDriver, form: Form) -> FittedDriver | None:
    """Fit a baseline of another form, from its best initial guesses."""
    model = with_effects((), form, fitted.model.begins, fitted.model.tied)
    guesses = [local_minima.regained(model, data, fitted, q) for q in _starts(data, fitted, model)]
    guesses.sort(key=lambda guess: -guess.explains)
    fits = [
        polished(data, solve(data, model, guess.q, fitted.noise, fitted.rows))
        for guess in guesses[:FULL_FITS]
    ]
    return min(fits, key=lambda fit: fit.deviance, default=None)


def _starts(data: DriverData, fitted: FittedDriver, model: DriverModel) -> Iterator[Array]:
    top = float(np.quantile(data.seen.speed[data.output.usable], 0.99))
    gap = model.form is Form.GAP
    for T, s0, v0 in product(INITIAL_T, INITIAL_S0[:1] if gap else INITIAL_S0, (1.0,) if gap else INITIAL_V0):
        q = fitted.q.copy()
        q[[DESIRED, STANDSTILL]] = T, s0
        if not gap:
            q[OFFSET], q[FREE_SPEED] = 0.0, np.clip(v0 * top, model.low[FREE_SPEED], model.high[FREE_SPEED])
        yield q


def stated(data: DriverData, solved: FittedDriver, why: str) -> BaselineForm:
    """The form with its parameters and their intervals (delta method).

    At the wanted gap nobody accelerates: where the output is an acceleration, the offset belongs to the wanted gap. A pedal
    has another offset at every speed, and shows no wanted gap.
    """
    form, q = solved.model.form, solved.q
    units = {"T": "s", "s0": "m", "v0": "m/s"}
    says = f"{SAYS[form]} ({why})"
    if data.pedal:
        return BaselineForm(form.value, {}, {}, says)
    C, place = sandwich(solved.fitted, data.output.dt).C, {k: i for i, k in enumerate(solved.fitted.free)}

    def interval(value: float, slopes: dict[int, float]) -> Interval:
        g = np.zeros(len(place))
        for k, slope in slopes.items():
            if k in place:
                g[place[k]] = slope
        sd = float(np.sqrt(g @ C @ g))
        return Interval(value, value - SIGMAS * sd, value + SIGMAS * sd)

    def of_place(k: int) -> Interval:
        return interval(float(q[k]), {k: 1.0})

    if form is Form.FREE_SPEED:
        estimates = {"T": of_place(DESIRED), "s0": of_place(STANDSTILL), "v0": of_place(FREE_SPEED)}
    else:
        # K1 e + offset = 0
        K, offset = float(q[K1]) or np.nan, float(q[OFFSET])
        away = -offset / K
        slopes = {OFFSET: -1.0 / K, K1: offset / K**2}
        if form is Form.TIME_HEADWAY:
            estimates = {"T": interval(float(q[DESIRED]) + away, slopes | {DESIRED: 1.0})}
        else:
            scaled = {k: REFERENCE_SPEED * slope for k, slope in slopes.items()}
            estimates = {"T": of_place(DESIRED), "s0": interval(REFERENCE_SPEED * away, scaled)}
    sure = float(q[K1]) > SIGMAS * float(np.sqrt(C[place[K1], place[K1]]))
    known = estimates if sure else {}
    return BaselineForm(form.value, known, {name: units[name] for name in known}, says)
