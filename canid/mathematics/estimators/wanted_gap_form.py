"""Which gap the driver wants at a speed, by evidence over a whole drive: a time headway alone, or one with a standstill gap.

With a standstill gap s0 the error that is answered is headway − T − s0/v. Fitted without it, K1 takes what the answer to
s0/v should have: in town it comes out a seventh too large. Each s0 of a few has a search of its own; their likelihoods,
joined by a parabola, give the posterior of s0, half of the prior at none, and one more fit at the likeliest. K1 is the
mixture over all that are possible; where one kind is not, it is said which holds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification.confidence import MISS, SIGMAS
from canid.mathematics.identification.fopdt import channel_mixture
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.mathematics.identification.identifiability import PARAMETERS, not_quotable, quotable, with_gain
from canid.values.types import Array, Channel, Interval, Trace

# m; standstill gaps that are compared
STANDSTILLS = (1.5, 3.0, 4.5, 6.0)
# m/s; below it a headway is not meaningful
MIN_SPEED = 2.0
# m; between them likelihoods are a parabola, and gains lines
FINE = np.linspace(0.0, STANDSTILLS[-1], 121)
# of the half-width of K, below which what s0/v of the largest can move it changes nothing that is quoted
LEAST_SHARE = 0.25
HELD = "headway_error"


class Chosen(NamedTuple):
    """The form, and the drive in it."""

    trace: Trace  # with the headway error of the likeliest form
    fit: ProcessFit  # of the likeliest, its intervals those of all forms that are possible
    standstill: float  # m, of the likeliest; 0: a time headway alone
    share: float  # of the posterior, of all forms with a standstill gap
    says: str  # empty: nothing to say
    open: bool = False  # several forms are possible, with gains that differ, or one that no fit knows
    spread: float = 0.0  # standard deviation of the gain on headway over the gaps that are possible


def with_standstill(trace: Trace, standstill: float) -> Trace:
    """Return the drive with the error of a driver who wants `standstill` m besides the time headway."""
    if standstill == 0.0:
        return trace
    inputs = trace.inputs.copy()
    inputs[:, trace.input_names.index(HELD)] -= standstill * _per_speed(trace)
    return trace._replace(inputs=inputs)


def _per_speed(trace: Trace) -> Array:
    out: Array = 1.0 / np.maximum(trace.signals["speed"], MIN_SPEED)
    return out


def _matters(trace: Trace, fit: ProcessFit) -> bool:
    """Whether a standstill gap moves the gain on headway by as much as its interval shows."""
    if HELD not in trace.input_names or "speed" not in trace.signals:
        return False
    i = trace.input_names.index(HELD)
    use = trace.learn & np.isfinite(trace.signals["speed"])
    error, K = trace.inputs[use, i], fit.channels[i].K
    if not len(error):
        return False
    moved = STANDSTILLS[-1] * float(np.std(_per_speed(trace)[use])) * abs(K.value)
    return moved > LEAST_SHARE * 0.5 * (K.high - K.low) * float(np.nanstd(error))


def choose(trace: Trace, fitted: Callable[[Trace], ProcessFit]) -> Chosen:
    """Compare the forms.

    Args:
        trace: of the drive.
        fitted: fits a trace, from several starts: each form may have several answers that reproduce themselves, and one
            that begins where another form ended is compared by the luck of its descent.
    """
    fit = fitted(trace)
    if fit.posterior is None or not _matters(trace, fit):
        return Chosen(trace, fit, 0.0, 0.0, "")
    every = [(0.0, fit), *((s0, fitted(with_standstill(trace, s0))) for s0 in STANDSTILLS)]
    # fits of one stride may be compared
    usable = [
        (s0, form_fit)
        for s0, form_fit in every
        if form_fit.posterior is not None and form_fit.stride == fit.stride
    ]
    if len(usable) < 2:
        return Chosen(trace, fit, 0.0, 0.0, "")
    at = np.array([s0 for s0, _ in usable])
    inflation = max(usable, key=lambda pair: pair[1].score)[1].variance_inflation
    score = np.array([form_fit.score for _, form_fit in usable]) / inflation
    weight = _posterior(at, score)
    with_gap, i = 1.0 - float(weight[0]), trace.input_names.index(HELD)
    nearest = float(FINE[1 + int(np.argmax(weight[1:]))])
    gap_fit = fitted(with_standstill(trace, nearest))
    if gap_fit.posterior is None or gap_fit.stride != fit.stride:
        nearest, gap_fit = max(usable[1:], key=lambda pair: pair[1].score)
    fits = [form_fit for _, form_fit in usable]
    tables = [_table(at, fits, k, fit, nearest, gap_fit) for k in range(len(fit.channels))]
    forms = _likely(fit, gap_fit, with_gap)
    channels = [_mixed(forms, table, weight, k) for k, table in enumerate(tables)]
    standstill, likeliest = (nearest, gap_fit) if with_gap > 0.5 else (0.0, fit)
    says, several = "", False
    if with_gap >= 1.0 - MISS:
        mean = float(weight @ FINE)
        says = f"the wanted gap is about {mean:.1f} m + T·v (a time headway alone is excluded): K of headway error is for it"
        if float(weight[0.5 * (STANDSTILLS[-1] + STANDSTILLS[-2]) < FINE].sum()) > MISS:
            says = (
                f"the wanted gap depends on the speed by more than a standstill gap of {STANDSTILLS[-1]:.0f} m: K of "
                "headway error may not be quoted"
            )
            channels[i], several = not_quotable(channels[i], says), True
    elif with_gap > MISS and _differ(fit.channels[i], gap_fit.channels[i]):
        several = True
        says = "the drive does not show whether the wanted gap is T·v or s0 + T·v: K of headway error covers both"
    mixed = likeliest._replace(channels=tuple(channel_mixture.with_progress(channels, likeliest.channels)))
    gains = tables[i][PARAMETERS.index("K")][0]
    spread = float(np.sqrt(max(float(weight @ gains**2) - float(weight @ gains) ** 2, 0.0)))
    return Chosen(with_standstill(trace, standstill), mixed, standstill, with_gap, says, several, spread)


def _posterior(at: Array, score: Array) -> Array:
    """Share of each standstill gap of `FINE`; half of the prior is at none.

    Log likelihoods are joined by lines, and about the largest by a parabola.

    >>> weight = _posterior(np.array([0.0, 1.5, 3.0, 4.5]), -50.0 * (np.array([0.0, 1.5, 3.0, 4.5]) - 2.2) ** 2)
    >>> round(float(weight @ FINE), 2), round(float(weight @ (FINE - 2.2) ** 2) ** 0.5, 2)
    (2.2, 0.1)
    """
    fine = np.interp(FINE, at, score, right=-np.inf)
    if len(at) > 2:
        k = min(max(int(np.argmax(score)), 1), len(at) - 2)
        parabola = np.polyfit(at[k - 1 : k + 2], score[k - 1 : k + 2], 2)
        near = (at[k - 1] <= FINE) & (at[k + 1] >= FINE)
        if parabola[0] < 0.0:
            fine[near] = np.polyval(parabola, FINE[near])
    # the one at none is that of its own fit
    fine[0] = score[0]
    prior = np.full(len(FINE), 0.5 / (len(FINE) - 1))
    prior[0] = 0.5
    weight: Array = prior * np.exp(fine - fine.max())
    weight /= weight.sum()
    return weight


def _table(
    at: Array, fits: list[ProcessFit], k: int, none: ProcessFit, nearest: float, gap_fit: ProcessFit
) -> Array:
    """Value, and distances to the ends, of each parameter of a channel along `FINE`, of none by its own fit: (4, 3, f)."""
    out = []
    for name in PARAMETERS:
        value, low, high = np.array([getattr(form_fit.channels[k], name) for form_fit in fits]).T
        columns = np.array([np.interp(FINE, at, x) for x in (value, value - low, high - value)])
        # the fit nearest to the likeliest gap says what holds there
        held_there = getattr(gap_fit.channels[k], name)
        columns[0] += held_there.value - float(np.interp(nearest, FINE, columns[0]))
        without: Interval = getattr(none.channels[k], name)
        columns[:, 0] = without.value, without.value - without.low, without.high - without.value
        out.append(columns)
    return np.array(out)


def _likely(fit: ProcessFit, gap_fit: ProcessFit, with_gap: float) -> list[ProcessFit]:
    """The forms that are possible, the likeliest first."""
    forms = [(1.0 - with_gap, fit), (with_gap, gap_fit)]
    return [form for share, form in sorted(forms, key=lambda pair: -pair[0]) if share > MISS]


def _mixed(forms: list[ProcessFit], table: Array, weight: Array, k: int) -> Channel:
    """The channel over all forms: intervals widened by what the forms differ by, quotable what all may quote."""
    parts = [form.channels[k] for form in forms]
    if len(parts) == 1 and float(weight.max()) > 1.0 - MISS / 2:
        return parts[0]
    fields: dict[str, Any] = {}
    for name, (value, down, up) in zip(PARAMETERS, table, strict=True):
        mean = float(weight @ value)
        apart = (SIGMAS * (value - mean)) ** 2
        fields[name] = Interval(
            mean,
            # no delay is negative
            max(mean - float(weight @ (down**2 + apart)) ** 0.5, -np.inf if name == "K" else 0.0),
            mean + float(weight @ (up**2 + apart)) ** 0.5,
        )
    least = min((part.status for part in parts), key=channel_mixture.ORDER.index)
    return parts[0]._replace(**fields, status=least, progress=None)


def with_spread(result: WholeDrive, spread: float) -> WholeDrive:
    """Widen the gain on headway of a method that was given one standstill gap by what the gap is not known to.

    Args:
        result: by that method.
        spread: standard deviation of the gain over the gaps that are possible.
    """
    if HELD not in result.channels or not spread > 0.0:
        return result
    channel = result.channels[HELD]
    value, low, high = channel.K
    wide = SIGMAS * spread
    K = Interval(
        value, value - float(np.hypot(value - low, wide)), value + float(np.hypot(high - value, wide))
    )
    return result._replace(channels={**result.channels, HELD: with_gain(channel, K)})


# why a method that knows one form of the wanted gap, or one that stays, may not quote the gain on headway
ONE_FORM = "K is for one form of the wanted gap, and the drive does not show which holds: not to be quoted"
STAYS = "K is for a wanted gap that stays, and on this drive it drifts: not to be quoted"


def without_gain(result: WholeDrive, reason: str) -> WholeDrive:
    """Withhold the gain on headway of a method whose model is too narrow for this drive.

    Args:
        result: by that method.
        reason: `ONE_FORM` or `STAYS`.
    """
    if HELD not in result.channels or not quotable(result.channels[HELD], "K"):
        return result
    says = f"headway error: {reason}"
    channels = {**result.channels, HELD: not_quotable(result.channels[HELD], says)}
    return result._replace(channels=channels, lines=(says, *result.lines))


def _differ(channel: Channel, other: Channel) -> bool:
    """Whether gains of two forms differ by more than half of a half-width."""
    return abs(channel.K.value - other.K.value) > 0.25 * (channel.K.high - channel.K.low)
