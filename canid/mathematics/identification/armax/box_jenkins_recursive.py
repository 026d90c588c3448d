"""Box-Jenkins model sample by sample: recursive generalised least squares with several memories.

y = c0 + sum K_i e^(-theta_i s) / (1 + tau_i s) u_i + e / D: each input has a pole and a dead time of its own, and the noise
its own poles (Hastings-James & Sage 1969; Young 2011, ch. 7). The answers of all poles and dead times are weighted sums of
a fixed basis (fopdt/reduced_basis.py), so that the recursion is linear: exponentially forgotten inner products of columns
that are whitened as they come, with the lagged residuals among them for what D still errs by. Gains, poles and dead times
are the posterior of these products. D and the band come from a batch fit of the first minutes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from canid.mathematics.identification import innovation_law
from canid.mathematics.identification.armax import forgetting_mixture
from canid.mathematics.identification.armax.armax_recursive import (
    MAX_SQUARED_INNOVATION,
    RESTART_WIDENING,
    WHITENESS_BLOCKS,
)
from canid.mathematics.identification.armax.box_jenkins_columns import Columns, columns, reach
from canid.mathematics.identification.armax.box_jenkins_posterior import located
from canid.mathematics.identification.armax.box_jenkins_state import (
    Quality,
    State,
    lead,
    solved,
    unit_answers,
)
from canid.mathematics.identification.armax.rates import rates
from canid.mathematics.identification.armax.square_root_covariance import RENEWAL
from canid.mathematics.identification.fopdt import fopdt_fit
from canid.mathematics.identification.fopdt import regression_rows as rows
from canid.mathematics.identification.fopdt.row_noise import NOISE_ORDER
from canid.values.types import NAN, Array, OutputFilter

# s of innovations that are kept for the residual tests
TESTED_S = 60.0
# s; over which the simulation is compared with the output
FIT_MEMORY_S = 60.0
# Blocks after which the point that predictions are made at is found anew: 40 s.
LOCATE_BLOCKS = 20


def begin(
    layout: rows.Layout,
    samples: Array,
    forgetting: Sequence[float],
    output_filter: OutputFilter | None,
    settle: float,
    restarts: int = 0,
) -> State | None:
    """Begin with a batch fit of the samples so far; None: they do not suffice.

    Args:
        layout: of the rows.
        samples: (n, 3 + m) as of `regression_rows.put`.
        forgetting: per row, ascending.
        output_filter: that the output has passed; None: not known.
        settle: s after a break in which the unknown history still matters.
        restarts: so far.

    >>> from canid.mathematics.identification.armax.box_jenkins_posterior import channels
    >>> from canid.mathematics.identification.first_order import scan
    >>> rng = np.random.default_rng(0)
    >>> u = scan(rng.normal(size=900), np.array([0.82]))
    >>> x = np.roll(scan(0.22 * u, np.array([0.78])), 2)  # a lag of 0.4 s behind 0.2 s
    >>> y = 3.0 + 5.6 * x + 0.05 * rng.normal(size=900)
    >>> samples = np.column_stack([y, np.ones(900), np.zeros(900), u])
    >>> layout = fopdt_fit.row_layout(1, 0.1, 3.0, 1.5)
    >>> state = begin(layout, samples[:300], (0.98, 1.0), None, 4.5)
    >>> for k in range(300, 900, 20): state = step(layout, state, samples[k : k + 20], (0.98, 1.0), None, 4.5)
    >>> found = channels(layout, state)[0]
    >>> found.K.low < 5.6 < found.K.high, abs(found.tau_plus_dead_time.value - 0.55) < 0.01
    (True, True)
    """
    m, b, k = layout.inputs, layout.basis.size, len(forgetting)
    making, made = rows.put(layout, rows.State(), samples, settle)
    fit = fopdt_fit.fit_rows(layout, made, fopdt_fit.Settings(output_filter=output_filter))
    if fit.start is None or not all(math.isfinite(x) for x in (*fit.point.K, fit.point.offset)):
        return None
    # the order that a minute chooses is not that of an hour: the lagged residuals hold all of them
    ar = np.concatenate([fit.noise, np.zeros(NOISE_ORDER - len(fit.noise))])
    c = m * b + 2 + len(ar)
    stride = fit.stride
    state = State(
        making=making,
        tail=np.zeros((0, layout.width)),
        ready=0,
        ar=ar,
        mean_ar=ar,
        stride=stride,
        reference=fit.point.offset,
        products=np.zeros((k, c, c)),
        weights=np.zeros((2, k)),
        regions=fit.start.search_grid.regions,
        point=np.array([fit.point.K, fit.point.tau, fit.point.dead_time]),
        nodes=unit_answers(layout, fit.point.tau, fit.point.dead_time),
        offset=0.0,
        trust=forgetting_mixture.begin(forgetting, rates(stride * layout.step).stated),
        recent=fit.sigma**2,
        score=np.zeros((2, 3 * m)),
        tested=np.zeros((0, 2 + m)),
        law=fit.law if fit.law is not None else innovation_law.equal(0).law,
        quality=Quality((0.0, 0.0), (0.0, 0.0), 0),
        blocks=0,
        phase=0,
        restarts=restarts,
    )
    before, _ = reach(layout, state, output_filter)
    state = state._replace(tail=np.zeros((before, layout.width)), ready=before)
    block = rates(layout.step).block
    for first in range(0, len(made), block):
        state = _taken(layout, state, made[first : first + block], forgetting, output_filter, weighing=False)
    return located(layout, state)


def step(
    layout: rows.Layout,
    state: State,
    samples: Array,
    forgetting: Sequence[float],
    output_filter: OutputFilter | None,
    settle: float,
) -> State:
    """Take in a block of samples; arguments as of `begin`."""
    making, made = rows.put(layout, state.making, samples, settle)
    state = _taken(layout, state._replace(making=making), made, forgetting, output_filter, weighing=True)
    return located(layout, _with_law(layout, state)) if state.blocks % LOCATE_BLOCKS == 0 else state


def _taken(
    layout: rows.Layout,
    state: State,
    made: Array,
    forgetting: Sequence[float],
    output_filter: OutputFilter | None,
    *,
    weighing: bool,
) -> State:
    """Take in rows; `weighing`: let them judge the memories."""
    before, after = reach(layout, state, output_filter)
    state = state._replace(tail=np.concatenate([state.tail, made]))
    first, stop = state.ready, len(state.tail) - after
    if stop <= first:
        return state
    new = columns(layout, state, first, stop, output_filter)
    kept = state.tail[stop - before :]
    state = state._replace(tail=kept, ready=before, blocks=state.blocks + 1)
    count, size = int(new.used.sum()), layout.inputs * layout.basis.size
    fresh = np.column_stack([np.full(len(new.used), NAN), np.where(new.known, new.output, NAN), new.inputs])
    longest = round(TESTED_S / layout.step)
    if count:
        predicted = _predicted(layout, state, new)
        if not weighing:
            # the first memories know nothing yet: these rows' innovations are the residuals of the batch fit
            of_fit = new.white[size] - state.point[0] @ (state.nodes[0] @ new.white[:size])
            predicted = predicted._replace(lead=of_fit, variance=state.recent)
        fresh[new.used, 0] = predicted.lead[new.used]
    state = state._replace(tested=np.concatenate([state.tested, fresh])[-longest:])
    if count:
        weights = _weights(layout, state, predicted.lead)
        state = _judged(layout, state, new, predicted, weights) if weighing else state
        state = _learnt(layout, state, *_weighed(new, predicted, weights), forgetting)
        best = forgetting_mixture.refuted(state.trust) if weighing else None
        state = state if best is None else _renewed(state, best)
    state = state._replace(
        quality=_compared(state.quality, new, layout.step / FIT_MEMORY_S),
        phase=(state.phase + stop - first) % state.stride,
    )
    return state


class _Predicted(NamedTuple):
    """One-step predictions of the memories."""

    errors: Array  # (k, q)
    spreads: Array  # (k, q) variance of an error over that of the noise
    lead: Array  # (q,) errors of the memory that is believed most
    variance: float  # of the noise
    held: Array  # (k, m) sums of squares of the unit answers that each memory knows
    brought: Array  # (m,) and that the rows bring


def _predicted(layout: rows.Layout, state: State, new: Columns) -> _Predicted:
    """Predict with gains, offset and D of each memory, at the common lags and dead times."""
    size = layout.inputs * layout.basis.size
    turn, along, theta, inverse, held = solved(layout, state)
    made = turn @ new.white
    errors = new.white[size] - theta @ made
    spreads = 1.0 + ((inverse @ made) * made).sum(axis=1)
    first = lead(state)
    left = state.products[:, size, size] - np.einsum("ki,ki->k", theta, along)
    freedom = state.weights[0] - len(turn)
    variance = (
        float(left[first] / freedom[first]) if freedom[first] > 1.0 and left[first] > 0.0 else state.recent
    )
    brought = np.square(made[: layout.inputs]).sum(axis=1)
    return _Predicted(errors, spreads, errors[first], variance, held, brought)


class _Innovations(NamedTuple):
    """The last innovations, one phase of the stride after the other."""

    e: Array  # (n,)
    known: npt.NDArray[np.bool_]  # (n,)
    features: Array  # (2, n) that the scale may follow


def _innovations(layout: rows.Layout, state: State) -> _Innovations:
    n = len(state.tested) // state.stride * state.stride
    kept = state.tested[len(state.tested) - n :, :2]
    e, y = kept.reshape(-1, state.stride, 2).transpose(2, 1, 0).reshape(2, n)
    known, seen = np.isfinite(e), np.isfinite(y)
    e = np.where(known, e, 0.0)
    change = innovation_law.changes(np.where(seen, y, 0.0), seen)
    per_second = 1.0 / (layout.step * state.stride)
    return _Innovations(e, known, innovation_law.features(e, known, change, per_second))


def _with_law(layout: rows.Layout, state: State) -> State:
    """Fit the law to the innovations that are kept."""
    last = _innovations(layout, state)
    if np.count_nonzero(last.known) < innovation_law.MIN_ROWS:
        return state
    fitted = innovation_law.fit(last.e, last.known, last.features, 1.0 / state.stride, state.law)
    return state._replace(law=fitted.law)


def _weights(layout: rows.Layout, state: State, e: Array) -> innovation_law.Weights:
    """Weigh the last rows by their innovations (q,), which are the last of those that are kept."""
    law, q = state.law, len(e)
    if not len(law.slopes):
        return innovation_law.applied(e, law, np.zeros((0, q)))
    last = _innovations(layout, state)
    every = innovation_law.applied(last.e, law, last.features)
    # back from phases to the order of time; what is not kept counts as one
    both = np.array([every.size, every.mixture]).reshape(2, state.stride, -1).transpose(0, 2, 1)
    both = np.concatenate([np.ones((2, q)), both.reshape(2, -1)], axis=1)[:, -q:]
    return innovation_law.Weights(law, both[0], both[1])


def _weighed(
    new: Columns, predicted: _Predicted, weights: innovation_law.Weights
) -> tuple[Columns, _Predicted]:
    """Let each row count as its innovation does."""
    if weights.law.is_plain:
        return new, predicted
    root = np.sqrt(weights.weight)
    return new._replace(white=new.white * root), predicted._replace(lead=predicted.lead * root)


def _judged(
    layout: rows.Layout,
    state: State,
    new: Columns,
    predicted: _Predicted,
    weights: innovation_law.Weights,
) -> State:
    """Weigh the memories by their predictions, one phase of the stride; and follow the noise's variance."""
    trust, recent, w = state.trust, state.recent, 1.0 / rates(layout.step).recent
    errors, spreads = (predicted.errors / weights.size).T.tolist(), predicted.spreads.T.tolist()
    mixture, freedom = weights.mixture.tolist(), weights.law.freedom
    for i in np.flatnonzero(new.used).tolist():
        worst = max(predicted.variance, recent)
        # the shortest memory follows every change, so that its errors are noise alone
        square = min(mixture[i] * errors[i][0] ** 2 / spreads[i][0], MAX_SQUARED_INNOVATION * worst)
        recent += w * (square - recent)
        if (state.phase + i) % state.stride == 0:
            trust = forgetting_mixture.step(trust, errors[i], spreads[i], worst, freedom)
    return state._replace(trust=trust, recent=recent)


def _learnt(
    layout: rows.Layout, state: State, new: Columns, predicted: _Predicted, forgetting: Sequence[float]
) -> State:
    """Add the block to the products, which forget as much as it renews."""
    size, count = layout.inputs * layout.basis.size, int(new.used.sum())
    block = new.white @ new.white.T
    nodes = state.nodes
    share = (predicted.brought / np.maximum(predicted.held + predicted.brought, 1e-300)).min(axis=1)
    fade = 1.0 - np.minimum(1.0 - np.array(forgetting) ** count, RENEWAL * share)
    slopes = np.concatenate([nodes[0], *(state.point[0][:, None] * x for x in nodes[1:])])
    psi = slopes @ new.white[:size]
    constant = new.white[size + 1]
    psi -= np.outer(psi @ constant / (constant @ constant), constant)
    # Fisher's information of one innovation
    variance = predicted.variance / state.law.inflation
    score = np.array([(psi @ predicted.lead) ** 2, (psi**2).sum(axis=1) * variance * state.stride])
    known = float(fade[-1] * state.weights[0, -1])
    return state._replace(
        mean_ar=(known * state.mean_ar + count * state.ar) / (known + count),
        products=fade[:, None, None] * state.products + block,
        weights=state.weights * [fade, fade * fade] + count,
        score=state.score * (1.0 - 1.0 / WHITENESS_BLOCKS) + score,
    )


def _renewed(state: State, best: int) -> State:
    """Let the longest memory, which was refuted, and the shortest begin anew from `best`."""
    k = len(state.trust.weights)
    kept = [best, *range(1, k - 1), best]
    share = np.ones(k)
    share[[0, -1]] = RESTART_WIDENING**-2
    return state._replace(
        products=share[:, None, None] * state.products[kept],
        weights=state.weights[:, kept] * share,
        trust=forgetting_mixture.renew(state.trust),
        restarts=state.restarts + 1,
    )


def _compared(before: Quality, new: Columns, rate: float) -> Quality:
    mean, power, count = list(before.mean), list(before.power), before.samples
    for pair in zip(new.output[new.known].tolist(), new.left[new.known].tolist(), strict=True):
        count += 1
        w = max(rate, 1.0 / count)
        for i, x in enumerate(pair):
            away = x - mean[i]
            mean[i] += w * away
            power[i] = (1.0 - w) * (power[i] + w * away * away)
    return Quality((mean[0], mean[1]), (power[0], power[1]), count)


def seconds(layout: rows.Layout, state: State) -> float:
    """S of data that the longest memory knows."""
    return float(state.weights[0, -1]) * layout.step
