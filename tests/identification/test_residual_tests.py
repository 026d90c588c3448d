"""The residual tests keep their level whatever the input's spectrum, and detect what they test for."""

import math

import numpy as np
import pytest

from canid.mathematics.identification import residual_tests

N = 600  # a minute at 10 Hz


def recursion(noise, *poles):
    """Filter noise by 1 / prod (1 - p q^-1)."""
    for pole in poles:
        out = np.empty_like(noise)
        x = 0.0
        for k, w in enumerate(noise):
            out[k] = x = pole * x + w
        noise = out
    return noise


def white(rng, n=N):
    return rng.normal(size=n)


def slow(rng, n=N):
    """Twice smoothed, as a range rate is: its power ends below 0.5 Hz."""
    return recursion(rng.normal(size=n + 200), 0.95, 0.8)[200:]


def drifting(rng, n=N):
    return 5.0 + recursion(rng.normal(size=n + 200), 0.98)[200:]


def sine(rng, n=N):
    return 3.0 + np.sin(rng.uniform(0.05, 0.2) * np.arange(n) + rng.uniform(0.0, 6.0))


def steps(rng, n=N):
    return np.repeat(rng.normal(size=n // 20), 20)


INPUTS = (white, slow, drifting, sine, steps)


def alarms(test):
    return np.array([not test.white, bool(test.left_over), bool(test.feedback), not test.stationary])


@pytest.mark.parametrize("spectrum", INPUTS, ids=lambda f: f.__name__)
def test_a_right_model_alarms_in_one_per_cent(spectrum):
    """White residuals with an independent input: of 400, each test alarms about four times, for every spectrum."""
    rng = np.random.default_rng(10)
    count = sum(
        alarms(residual_tests.run_tests(white(rng), spectrum(rng)[:, None], ["u"], 0)) for _ in range(400)
    )
    # binomial 99.9 % of 0.01, and for Ljung-Box of the 0.013 that its approximation has at this length
    assert (count <= [13, 11, 11, 11]).all(), count


@pytest.mark.slow("whole drives through the pipeline")
def test_the_tests_can_alarm_at_all():
    """Over all noise spectra together each test does alarm at right models, as one per cent says."""
    rng = np.random.default_rng(11)
    count = sum(
        alarms(residual_tests.run_tests(white(rng), spectrum(rng)[:, None], ["u"], 0))
        for spectrum in INPUTS
        for _ in range(200)
    )
    assert (count >= 2).all(), count  # binomial 0.01 of 1000: 99.9 %; feedback is not detected for sines


def test_coloured_noise_is_not_taken_for_a_left_over_answer():
    """Noise with more order than the model's fails whiteness alone, with an input of the same spectrum too."""
    rng = np.random.default_rng(12)
    count = sum(
        alarms(residual_tests.run_tests(drifting(rng), spectrum(rng)[:, None], ["u"], 0))
        for spectrum in (slow, drifting)
        for _ in range(150)
    )
    assert count[0] == 300
    assert (count[1:] <= 10).all(), count  # binomial 0.01 of 300: 99.9 %


def test_white_noise_passes_at_the_stated_level():
    """Of 400 white series about one per cent fails, and autocorrelated ones fail nearly all."""
    rng = np.random.default_rng(0)
    failed = sum(not residual_tests.whiteness(rng.normal(size=600)).white for _ in range(400))
    assert failed <= 11  # binomial 0.01: 99.9 %
    correlated = 0
    for _ in range(50):
        e = rng.normal(size=601)
        correlated += not residual_tests.whiteness(e[1:] + 0.3 * e[:-1]).white
    assert correlated >= 48


def test_the_statistic_is_that_of_ljung_and_box():
    """Q = n (n+2) sum r_k^2 / (n-k), summed plainly; a hole takes its pairs out of the count."""
    e = np.random.default_rng(14).normal(size=80)
    r = [sum(e[t] * e[t - k] for t in range(k, 80)) / sum(e * e) for k in range(1, 21)]
    plain = 80 * 82 * sum(x * x / (80 - k) for k, x in enumerate(r, start=1))
    found = residual_tests.whiteness(e, fitted=3)
    assert found.lags == 20
    assert math.isclose(found.statistic, plain, rel_tol=1e-9)
    assert found.bound == residual_tests.chi2_bound(17)
    e[40:45] = np.nan
    pairs = [sum(np.isfinite(e[t] * e[t - k]) for t in range(k, 80)) for k in range(1, 19)]
    r = [np.nansum(e[k:] * e[:-k]) / np.nansum(e * e) for k in range(1, 19)]
    holed = 75 * 77 * sum(x * x / n for n, x in zip(pairs, r, strict=True))
    assert math.isclose(residual_tests.whiteness(e).statistic, holed, rel_tol=1e-9)


def test_bound_agrees_with_the_exact_quantile():
    """Wilson and Hilferty's chi-squared quantile agrees with scipy's."""
    stats = pytest.importorskip("scipy.stats")
    for k in (5, 22, 25, 60):
        assert abs(residual_tests.chi2_bound(k) / stats.chi2.ppf(0.99, k) - 1) < 3e-3
    for k in (1, 2):  # a constant less than nothing, one sine
        assert abs(residual_tests.chi2_bound(k) / stats.chi2.ppf(0.99, k) - 1) < 9e-3


@pytest.mark.parametrize("spectrum", [white, slow, drifting, steps], ids=lambda f: f.__name__)
def test_a_missed_answer_is_left_over_and_no_feedback(spectrum):
    """An answer that the model lacks shows as such, also where the input's autocorrelation carries it to negative lags."""
    rng = np.random.default_rng(1)
    found = np.zeros(4)
    for _ in range(40):
        u = spectrum(rng)
        test = residual_tests.run_tests(
            white(rng) + 0.8 * np.roll(u - u.mean(), 6) / u.std(), u[:, None], ["u"], 0
        )
        found += alarms(test)
    assert found[1] >= 38
    assert found[2] <= 3  # binomial 0.01 of 40: 99.9 %


def test_feedback_is_feedback_and_not_a_left_over_answer():
    """Where the output moves the input through a slow car, the loop is closed and the model still right."""
    rng = np.random.default_rng(2)
    found = np.zeros(4)
    for _ in range(40):
        e = white(rng)
        moved = recursion(np.concatenate([np.zeros(3), e[:-3]]), 0.98)
        # five per cent of the input's variance
        u = slow(rng)
        u = u / u.std() + 0.22 * moved / moved.std()
        found += alarms(residual_tests.run_tests(e, u[:, None], ["u"], 0))
    assert found[2] >= 38
    assert found[1] <= 3


def test_an_answer_at_once_is_left_over_and_no_feedback():
    """Lag zero belongs to the answer: the model's inputs come before its output."""
    rng = np.random.default_rng(13)
    u = white(rng)
    test = residual_tests.run_tests(white(rng) + 0.5 * u, u[:, None], ["u"], 0)
    assert test.left_over == ("u",)
    assert test.feedback == ()


def test_each_input_is_named_by_itself():
    """Of two inputs the one with the missing answer and the one in the loop are distinguished."""
    rng = np.random.default_rng(3)
    e, a = white(rng), slow(rng)
    b = slow(rng) + 0.5 * np.concatenate([np.zeros(2), e[:-2]])
    test = residual_tests.run_tests(e + 0.4 * np.roll(a, 3) / a.std(), np.column_stack([a, b]), ["a", "b"], 0)
    assert test.left_over == ("a",)
    assert test.feedback == ("b",)
    assert set(test.excitation_order) == {"a", "b"}


def test_left_over_is_the_textbook_regression():
    """The verdict is n R^2 against chi-squared, as least squares on the input's lags gives it, case by case."""
    rng = np.random.default_rng(4)
    agreed, alarmed = 0, 0
    for strength in np.linspace(0.1, 0.5, 60):
        u = white(rng)
        e = white(rng) + strength * np.roll(u, 4)
        own = residual_tests.innovations(e, residual_tests.OWN)
        rows = np.column_stack([np.roll(u, k) for k in range(residual_tests.LAGS)])[residual_tests.LAGS :]
        y = own[residual_tests.LAGS :] - own[residual_tests.LAGS :].mean()
        rows = rows - rows.mean(axis=0)
        rest = y - rows @ np.linalg.lstsq(rows, y, rcond=None)[0]
        statistic = len(y) * (1.0 - (rest @ rest) / (y @ y))
        flagged = bool(residual_tests.run_tests(e, u[:, None], ["u"], 0).left_over)
        agreed += flagged == (statistic > residual_tests.chi2_bound(residual_tests.LAGS))
        alarmed += flagged
    assert agreed == 60
    assert 10 < alarmed < 50


def test_growing_residuals_are_not_stationary():
    """A size that grows twofold in a minute is seen, whatever comes with it."""
    rng = np.random.default_rng(5)
    grow = np.linspace(1.0, 2.0, N)
    seen = sum(
        not residual_tests.run_tests(white(rng) * grow, slow(rng)[:, None], ["u"], 0).stationary
        for _ in range(40)
    )
    assert seen >= 38


def test_reverse_arrangements_agree_with_the_published_table():
    """Bendat & Piersol, table A.6, 20 values: 98 % of steady series have 59 to 130, so 99 % pass there."""

    def flagged(reverse):
        # a permutation of 20 with that many inversions: each number may stand behind as many smaller as there are
        left, order = reverse, []
        for k in range(20):
            jump = min(left, k)
            order.insert(len(order) - jump, k)
            left -= jump
        sizes = np.sqrt(1.0 + np.array(order))
        return residual_tests.stationary(np.repeat(sizes, residual_tests.BLOCK) * np.tile([1.0, -1.0], 100))

    assert [flagged(r) for r in (59, 95, 130)] == [True] * 3
    # 2.6 standard deviations of 15.4 about 95
    assert [flagged(r) for r in (50, 140)] == [False] * 2


def test_a_sine_excites_two_parameters():
    """Order of persistent excitation: two for each sine, none for a constant, all for noise (Ljung, ex. 13.1 ff.)."""
    t = np.arange(N)
    e = white(np.random.default_rng(6))

    def order(u):
        return residual_tests.run_tests(e, u[:, None], ["u"], 0).excitation_order["u"]

    assert order(np.full(N, 7.3)) == 0
    for k in (1, 2, 3):
        sines = sum(np.sin(w * t + w) for w in (0.1, 0.45, 0.9)[:k])
        assert order(sines) == 2 * k
        assert order(sines + 4.0) == 2 * k
    assert order(white(np.random.default_rng(7))) == residual_tests.LAGS
    # a sine above the noise of a sensor of half a per cent
    assert order(np.sin(0.1 * t) + 0.003 * white(np.random.default_rng(8))) == 2


def test_what_is_not_there_is_left_out():
    """Rows without a residual at the ends change nothing; holes keep the level and the power."""
    rng = np.random.default_rng(9)
    e, u = white(rng), slow(rng)
    u = u / u.std()
    none = np.full(50, np.nan)
    cut = residual_tests.run_tests(e, u[:, None], ["u"], 2)
    padded = residual_tests.run_tests(
        np.concatenate([none, e, none]), np.concatenate([none, u, none])[:, None], ["u"], 2
    )
    assert padded[3:] == cut[3:]
    assert math.isclose(padded.statistic, cut.statistic, rel_tol=1e-9)

    def holed(answer):
        e, u = white(rng), slow(rng)
        e += answer * np.roll(u, 6) / u.std()
        for at in rng.integers(0, N - 20, 3):
            e[at : at + 15] = np.nan
        u[100:104] = np.nan
        return alarms(residual_tests.run_tests(e, u[:, None], ["u"], 0))

    assert (sum(holed(0.0) for _ in range(200)) <= 8).all()  # binomial 0.01: 99.9 %
    assert sum(holed(1.2) for _ in range(40))[1] >= 38


@pytest.mark.parametrize(
    "e",
    [np.zeros(0), np.ones(3), np.zeros(200), np.full(N, np.nan), np.full(N, 2.0), np.arange(30.0), np.eye(1, N)[0]],
    ids=["none", "three", "zeros", "nan", "constant", "thirty", "one"],
)  # fmt: skip
@pytest.mark.parametrize("u", [0.0, 1e6, math.nan, None], ids=["zero", "constant", "nan", "moving"])
def test_weak_data_give_an_answer_and_no_alarm(e, u):
    """Empty, short, constant or missing residuals and inputs: nothing is passed, nothing found, nothing raised."""
    moving = np.sin(np.arange(len(e)) ** 1.5)
    inputs = np.full((len(e), 1), u) if u is not None else moving[:, None]
    test = residual_tests.run_tests(e, inputs, ["u"], 3)
    assert test.left_over == ()
    assert test.feedback == ()
    assert 0 <= test.excitation_order["u"] <= (residual_tests.LAGS if u is None else 0)
    if not np.any(np.diff(e[np.isfinite(e)])):
        assert not test.white
        assert not test.stationary


@pytest.mark.parametrize("size", [1e-300, 1e-6, 1e12, 1e300])
def test_no_test_depends_on_the_unit(size):
    """Residuals and inputs of any size give the same answers; infinity is a value that is not there."""
    rng = np.random.default_rng(15)
    u = slow(rng)
    e = white(rng) + 0.5 * np.roll(u, 5)
    plain = residual_tests.run_tests(e, u[:, None], ["u"], 1)
    scaled = residual_tests.run_tests(size * e, u[:, None] / size, ["u"], 1)
    assert scaled[3:] == plain[3:]
    assert math.isclose(scaled.statistic, plain.statistic, rel_tol=1e-9)
    e[100] = math.nan
    missing = residual_tests.run_tests(e, u[:, None], ["u"], 1)
    e[100] = math.inf
    assert residual_tests.run_tests(e, u[:, None], ["u"], 1) == missing


def test_shapes_that_do_not_belong_together_are_a_wrong_call():
    with pytest.raises(ValueError, match="inputs"):
        residual_tests.run_tests(np.zeros(10), np.zeros((9, 1)), ["u"], 0)


def test_left_over_colour_widens_and_white_noise_does_not():
    """For an AR(1) score of 0.6 the factor approaches (1+0.6)/(1-0.6) = 4; for white noise it is one."""
    rng = np.random.default_rng(2)
    e = np.zeros(20_000)
    w = rng.normal(size=20_000)
    for k in range(1, 20_000):
        e[k] = 0.6 * e[k - 1] + w[k]
    ones = np.ones((1, 20_000))
    assert 3.3 < residual_tests.long_run_inflation(ones * e, ones * e.std(), 60) < 4.5
    assert residual_tests.long_run_inflation(ones * w, ones, 20) < 1.3


def test_nothing_to_test_is_not_white():
    """Empty, short or constant-zero residuals pass no test."""
    for e in (np.zeros(0), np.zeros(200), np.ones(3)):
        assert not residual_tests.whiteness(e).white
