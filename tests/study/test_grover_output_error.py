"""Output error, reduction and both inputs together: textbook systems come back."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter

from canid.values.types import Array
from canid_study.grover import miso, output_error, reduction
from canid_study.grover.episodes import detrended
from canid_study.grover.reduction import FirstOrder
from canid_study.grover.settings import GroverSettings
from canid_study.printed_numbers import SELECTION_PERCENT
from tests.seeds import mostly

DT = 0.1
# poles 0.9 +- 0.2i: damped oscillation of 0.35 Hz
NUM, DEN = np.array([0.0, 0.4, -0.3]), np.array([1.0, -1.8, 0.85])


def smooth(rng: np.random.Generator, n: int = 600) -> Array:
    """An input with the spectrum of a headway error: a random walk that returns."""
    return np.asarray(lfilter([1.0], [1.0, -0.95], rng.standard_normal(n)))


def test_a_second_order_system_comes_back_exactly(seed: int) -> None:
    """Without noise the coefficients of a known system are recovered to rounding, initial state included."""
    u = smooth(np.random.default_rng(seed))
    start = lfilter([1.0], DEN, np.concatenate([[3.0, -1.0], np.zeros(len(u) - 2)]))
    y = lfilter(NUM, DEN, u) + start
    model = output_error.fit(y, u, DT, 2)
    assert model is not None
    np.testing.assert_allclose(model.num, NUM, atol=1e-5)
    np.testing.assert_allclose(model.den, DEN, atol=1e-5)
    np.testing.assert_allclose(model.initial, [3.0, -1.0], atol=1e-4)
    assert model.fit_percent > 99.99
    assert model.growing == 0
    assert model.dc_gain == pytest.approx(NUM.sum() / DEN.sum(), rel=1e-3)


def test_noise_costs_no_bias_and_the_fit_is_that_of_the_truth(seed: int) -> None:
    """With white noise of half the response's sd the fit is that of the true response, and a little more."""
    rng = np.random.default_rng(seed)
    u = smooth(rng)
    response = lfilter(NUM, DEN, u)
    y = response + 0.5 * response.std() * rng.standard_normal(len(u))
    model = output_error.fit(y, u, DT, 2)
    assert model is not None
    truth = output_error.fit_percent(y, response)
    assert truth - 1e-6 <= model.fit_percent < truth + 3.0


def test_the_minimum_is_that_of_a_general_optimizer(seed: int) -> None:
    """Second route: scipy's least squares over all coefficients, from the result, finds nothing better."""
    rng = np.random.default_rng(seed)
    u = smooth(rng, 300)
    y = lfilter(NUM, DEN, u) + rng.standard_normal(len(u))
    model = output_error.fit(y, u, DT, 2)
    assert model is not None

    def residual(x: Array) -> Array:
        impulse = np.concatenate([x[5:7], np.zeros(len(u) - 2)])
        den = np.concatenate([[1.0], x[3:5]])
        return np.asarray(y - lfilter(x[:3], den, u) - lfilter([1.0], den, impulse))

    begin = np.concatenate([model.num, model.den[1:], model.initial])
    np.testing.assert_allclose(y - residual(begin), model.simulated, atol=1e-6)
    found = least_squares(residual, begin)
    assert float(residual(begin) @ residual(begin)) <= 2.0 * found.cost * (1.0 + 2e-3)


def test_the_fit_rises_with_the_order(seed: int) -> None:
    """Each order begins at the one below: its fit does not fall short of it."""
    rng = np.random.default_rng(seed)
    u, y = smooth(rng), smooth(rng)
    fits = [
        m.fit_percent
        for m in output_error.orders(detrended(y), detrended(u), DT, GroverSettings(max_order=8))
    ]
    assert len(fits) == 8
    assert all(after >= before - 0.05 for before, after in pairwise(fits))


def test_the_first_order_at_the_gate_is_selected(seed: int) -> None:
    """An exact second-order system is selected at order 2 at the latest, and no higher order is fitted."""
    u = smooth(np.random.default_rng(seed))
    models = output_error.orders(lfilter(NUM, DEN, u), u, DT, GroverSettings())
    assert len(models) <= 2
    best = output_error.selected(models)
    assert best is not None
    assert best.fit_percent >= SELECTION_PERCENT


def test_nothing_is_fitted_to_constants_and_to_short_records() -> None:
    """A constant signal or a record shorter than three times the parameters has no model."""
    u = smooth(np.random.default_rng(1), 100)
    assert output_error.fit(np.zeros(100), u, DT, 1) is None
    assert output_error.fit(u, np.zeros(100), DT, 1) is None
    assert output_error.fit(u[:10], u[:10], DT, 1) is None
    assert output_error.orders(np.full(100, np.nan), u, DT, GroverSettings()) == ()


def test_an_unstable_response_is_found_and_counted(seed: int) -> None:
    """A growing mode in the record is fitted and counted; the simulation of another record may diverge without error."""
    rng = np.random.default_rng(seed)
    u = smooth(rng, 300)
    den = np.array([1.0, -1.01])  # grows twentyfold in 30 s
    y = lfilter([0.0, 1.0], den, u)
    model = output_error.fit(y, u, DT, 1)
    assert model is not None
    assert model.growing == 1
    assert reduction.balanced(model).says
    longer = miso.on_another(np.zeros(100_000), np.ones((100_000, 2)), [model, model])
    assert output_error.fit_percent(smooth(rng, 100_000), longer) <= 0.0


# --- reduction ------------------------------------------------------------------------------------------


def test_the_reduction_of_a_first_order_model_is_itself(seed: int) -> None:
    """P1 of a P1, by the spectrum of its input and from the record."""
    u = detrended(smooth(np.random.default_rng(seed)))
    y = 5.0 * reduction.response(u, 0.8, 0.0, DT)
    model = output_error.fit(y, u, DT, 1)
    assert model is not None
    assert model.fit_percent > 99.9
    for found in (
        reduction.of_model(model, u, dead_time=False),
        reduction.of_record(y, u, DT, dead_time=False),
    ):
        # sampling at 10 Hz with straight lines between is worth a twentieth of a second of phase at most
        assert pytest.approx(5.0, rel=0.02) == found.K
        assert found.tau == pytest.approx(0.8, abs=0.03)
        assert found.fit_percent > 98.0


def test_a_dead_time_is_separated_from_a_lag_where_the_input_is_rich(seed: int) -> None:
    """P1D of the record finds lag and dead time with an input of white noise."""
    u = np.random.default_rng(seed).standard_normal(600)
    one = reduction.of_record(2.0 * reduction.response(u, 0.5, 0.4, DT), u, DT, dead_time=True)
    assert pytest.approx(2.0, rel=0.02) == one.K
    assert one.tau == pytest.approx(0.5, abs=0.03)
    assert one.dead_time == pytest.approx(0.4, abs=0.03)


def test_balanced_truncation_keeps_the_bilinear_hankel_values() -> None:
    """Hankel singular values of the sampled system are those of its bilinear transform; G(1) is that of the model."""
    model = output_error.OutputError(2, NUM, DEN, np.zeros(2), np.zeros(0), 100.0, DT)
    found = reduction.balanced(model)
    if found.says:
        pytest.skip(found.says)
    # Hankel matrix of the impulse response, long enough that the poles of radius 0.92 have decayed
    h = lfilter(NUM, DEN, np.concatenate([[1.0], np.zeros(600)]))[1:]
    hankel = np.array([h[k : k + 250] for k in range(250)])
    expected = np.linalg.svd(hankel, compute_uv=False)[:2]
    np.testing.assert_allclose(found.hankel, expected, rtol=1e-3)
    assert found.error_bound == pytest.approx(2.0 * expected[1], rel=1e-3)


def test_the_response_is_that_of_the_differential_equation() -> None:
    """Exact for an input that is straight between samples: a ramp's response is the ramp, tau later, and a transient."""
    t = np.arange(100) * DT
    y = reduction.response(t, 0.6, 0.2, DT)
    later = np.maximum(t - 0.2, 0.0)
    expected = later - 0.6 * (1.0 - np.exp(-later / 0.6))
    np.testing.assert_allclose(y, expected, atol=1e-9)


# --- both inputs ----------------------------------------------------------------------------------------


@mostly(0.95)
def test_the_sum_of_two_good_fits_is_no_fit(seed: int) -> None:
    """Two inputs that are one: each model explains the output, their sum is twice the output, inside its bound."""
    rng = np.random.default_rng(seed)
    u = smooth(rng)
    inputs = detrended(np.column_stack([u, u]))
    y = detrended(3.0 * reduction.response(u, 0.5, 0.0, DT) + 0.2 * rng.standard_normal(len(u)))
    high = [output_error.fit(y, u, DT, 2) for u in inputs.T]
    assert all(m is not None and m.fit_percent > 85.0 for m in high)
    low = [FirstOrder(3.0, 0.5, 0.0, 100.0)] * 2
    found = miso.together(y, inputs, DT, [m for m in high if m is not None], low)
    assert found.bound[0] - 1e-6 <= found.high_sum <= found.bound[1] + 1e-6
    assert found.high_sum < 15.0
    assert found.high_refit > 85.0
    assert found.reduced_refit > 80.0


def test_models_predict_another_record_from_any_initial_state(seed: int) -> None:
    """The true model fits a second record exactly, although that begins in another state."""
    rng = np.random.default_rng(seed)
    u = np.column_stack([smooth(rng), smooth(rng)])
    model = output_error.OutputError(2, NUM, DEN, np.zeros(2), np.zeros(0), 100.0, DT)
    state = lfilter([1.0], DEN, np.concatenate([[5.0], np.zeros(len(u) - 1)]))
    y = lfilter(NUM, DEN, u[:, 0]) + lfilter(NUM, DEN, u[:, 1]) + state
    assert output_error.fit_percent(y, miso.on_another(y, u, [model, model])) > 99.9


def test_initial_states_are_not_fitted_to_what_is_predicted(seed: int) -> None:
    """Slow modes fit unrelated records by their initial states alone; found from the first third they predict nothing."""
    rng = np.random.default_rng(seed)
    turns = np.exp(2j * np.pi * DT * np.array([0.02, 0.05, 0.1]))
    den = np.real(np.poly([0.999, *(0.999 * turns), *(0.999 * turns.conj())]))
    model = output_error.OutputError(7, np.zeros(8), den, np.zeros(7), np.zeros(0), 100.0, DT)
    nothing = np.zeros((600, 2))
    own, predicted = [], []
    for _ in range(11):
        y = detrended(np.cumsum(rng.standard_normal(600)))
        own.append(output_error.fit_percent(y, miso.on_another(y, nothing, [model, model])))
        begun = miso.on_another(y, nothing, [model, model], begin=200)
        predicted.append(output_error.fit_percent(y[200:], begun[200:]))
        assert not miso.on_another(y, nothing, [model, model], begin=0).any()
    assert np.median(own) > 10.0
    assert np.median(predicted) < 0.0
