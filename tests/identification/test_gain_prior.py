"""A declared prior of gains and of one channel's delays: Bayes' rule, stated shares, and a driver who is not typical."""

import math

import numpy as np
import pytest
from scipy import integrate
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

from canid.mathematics.estimators.fopdt import FOPDT, FopdtSettings
from canid.mathematics.identification.fopdt import fopdt_fit, gain_prior, posterior_cells
from canid.mathematics.identification.fopdt.gain_prior import ATYPICAL_FACTOR, Normal
from canid.mathematics.identification.fopdt.prior import (
    ChannelPrior,
    InputPrior,
    Prior,
    check_prior,
    density,
    for_inputs,
    states_all,
)
from canid.mathematics.identification.fopdt.reduced_basis import Box
from canid.values.types import Identifiable, LearnGate, Sample

DT = 0.1
NAMES = ("headway_error", "range_rate")
BOX = Box(0.02, 3.0, 1.5)


def fit(y, u, prior):
    """Fit with names."""
    return fopdt_fit.fit_process(
        y, u, np.full(len(y), True), DT, fopdt_fit.Settings(prior=prior, names=NAMES)
    )


def by_quadrature(K, information, mean, sd, r, atypical):
    """Textbook Bayes in two gains: mixture weights, log evidence and posterior by formulas of conjugacy in full matrices."""
    S, out = np.linalg.inv(information), []
    for a, wa in ((1.0, 1.0 - atypical), (ATYPICAL_FACTOR, atypical)):
        for b, wb in ((1.0, 1.0 - atypical), (ATYPICAL_FACTOR, atypical)):
            d = np.array([a * sd[0], b * sd[1]])
            P = np.outer(d, d) * np.array([[1.0, r], [r, 1.0]])
            evidence = math.log(wa * wb) + multivariate_normal(mean, S + P).logpdf(K)
            C = np.linalg.inv(np.linalg.inv(P) + information)
            out.append((evidence, C @ (information @ K + np.linalg.solve(P, mean)), C))
    total = logsumexp([e for e, _, _ in out])
    share = [math.exp(e - total) for e, _, _ in out]
    m = sum(w * x for w, (_, x, _) in zip(share, out, strict=True))
    C = sum(w * (C + np.outer(x - m, x - m)) for w, (_, x, C) in zip(share, out, strict=True))
    return total, m, C


def multiplied(prior, K, information):
    """`multiply` at one pair of cells, from a gain and an information matrix."""
    size = np.sqrt(np.diag(information))
    shared = np.array(information[0, 1] / (size[0] * size[1]))
    alone = (information @ K) / size
    one = np.array(1.0)
    return gain_prior.multiply(
        prior, [alone[0] * one, alone[1] * one], [size[0] * one, size[1] * one], shared, 1.0 - shared**2, one
    )


@pytest.mark.parametrize("draw", range(20))
def test_bayes_rule_at_one_pair_of_cells(draw, seed):
    """Evidence, mean and covariance are those of conjugate normals in full matrices, mixed over typical and atypical."""
    rng = np.random.default_rng([seed, draw])
    A = rng.normal(size=(2, 2)) * 10.0 ** rng.uniform(-2, 2, 2)[:, None]
    information = A @ A.T + 1e-3 * np.diag(np.diag(A @ A.T))
    K, mean, sd = rng.normal(0.0, 5.0, 2), rng.normal(0.0, 5.0, 2), 10.0 ** rng.uniform(-1, 1, 2)
    r, atypical = rng.uniform(-0.9, 0.9), rng.uniform(0.01, 0.5)
    prior = gain_prior.make([Normal(m, s) for m, s in zip(mean, sd, strict=True)], r, atypical)
    evidence, m, C = by_quadrature(K, information, mean, sd, r, atypical)
    made = multiplied(prior, K, information)
    own = np.array([float((made.share * x).sum()) for x in made.mean])
    assert np.allclose(own, m, rtol=1e-6, atol=1e-9)
    variance = [
        float((made.share * (v + (x - k) ** 2)).sum())
        for x, v, k in zip(made.mean, made.variance, own, strict=True)
    ]
    assert np.allclose(variance, np.diag(C), rtol=1e-6)
    between = float(
        (made.share * (made.covariance + (made.mean[0] - own[0]) * (made.mean[1] - own[1]))).sum()
    )
    assert math.isclose(between, C[0, 1], rel_tol=1e-5, abs_tol=1e-6 * math.sqrt(C[0, 0] * C[1, 1]))
    # over the likelihood at its maximum: the evidence without the normalisation of the likelihood, sqrt(det 2 pi S)
    S = np.linalg.inv(information)
    by_hand = evidence + 0.5 * float(np.linalg.slogdet(2.0 * math.pi * S)[1])
    assert math.isclose(float(made.log), by_hand, rel_tol=1e-6, abs_tol=1e-6)


def test_evidence_of_one_gain_by_integration():
    """Of one input: the integral of likelihood times contaminated normal."""
    prior = gain_prior.make([Normal(5.0, 0.7)], 0.0, 0.2)
    K, information = 8.0, 4.0
    made = gain_prior.multiply(
        prior, [np.array([K * 2.0])], [np.array([2.0])], np.zeros(1), np.ones(1), np.ones(1)
    )

    def joint(k):
        of_prior = 0.8 * norm(5.0, 0.7).pdf(k) + 0.2 * norm(5.0, 0.7 * ATYPICAL_FACTOR).pdf(k)
        return math.exp(-0.5 * information * (k - K) ** 2) * of_prior

    total, _ = integrate.quad(joint, -10.0, 20.0)
    mean, _ = integrate.quad(lambda k: k * joint(k) / total, -10.0, 20.0)
    assert math.isclose(float(made.log[0]), math.log(total), abs_tol=1e-6)
    assert math.isclose(float((made.share * made.mean[0]).sum()), mean, rel_tol=1e-7)


@pytest.mark.parametrize(
    "own",
    [
        ChannelPrior(tau=0.4, tau_factor=1.5, dead_time=0.4, dead_time_sd=0.1),
        ChannelPrior(tau_plus_dead_time=0.8, tau_plus_dead_time_factor=1.2),
        ChannelPrior(
            tau_plus_dead_time=0.9, tau_plus_dead_time_factor=1.15, dead_time=0.3, dead_time_sd=0.05
        ),
        ChannelPrior(tau_plus_dead_time=0.9, tau_plus_dead_time_factor=1.15, tau=0.5, tau_factor=1.2),
    ],
)
def test_the_prior_of_delays_is_the_one_that_is_stated(own):
    """Over a fine grid of the box each stated distribution comes back: median, and one sd to each side."""
    cells = posterior_cells.make_cells(posterior_cells.whole_box(BOX), BOX, cells=400)
    given = density(InputPrior(Prior(), (own,), None, 0.0), [cells], BOX)
    weight = cells.weight * np.exp(given.log + given.measure)

    def at(x, q):
        order = np.argsort(x)
        return float(np.interp(q, np.cumsum(weight[order]) / weight.sum(), x[order]))

    ends = norm.cdf([-1.0, 0.0, 1.0])
    for name, x in (("tau", cells.tau), ("tau_plus_dead_time", cells.tau + cells.dead_time)):
        median, factor = getattr(own, name), getattr(own, f"{name}_factor")
        if median > 0.0:
            expected = [median / factor, median, median * factor]
            assert [at(x, q) for q in ends] == pytest.approx(expected, rel=0.015), name
    if own.dead_time > 0.0:
        expected = own.dead_time + own.dead_time_sd * np.array([-1.0, 0.0, 1.0])
        assert [at(cells.dead_time, q) for q in ends] == pytest.approx(expected, rel=0.015)


def test_without_a_prior_of_gains_every_bit_stays(follow):
    """A prior that states nothing, and none at all: the same numbers; shares of nothing are zero."""
    y, u = follow(1, seconds=90.0)
    none, empty = fit(y, u, None), fit(y, u, Prior())
    for a, b in zip(none.channels, empty.channels, strict=True):
        assert (a.K, a.tau, a.dead_time, a.tau_plus_dead_time) == (
            b.K,
            b.tau,
            b.dead_time,
            b.tau_plus_dead_time,
        )
        assert a.prior_weights == {}
    assert none.posterior.weight.tobytes() == empty.posterior.weight.tobytes()
    assert none.posterior.K[0].tobytes() == empty.posterior.K[0].tobytes()


def test_a_prior_of_one_gain_narrows_it_and_says_its_share(follow):
    """The gain of headway in 40 s: narrower, nearer, quotable; the share falls as data come."""
    y, u = follow(1, seconds=40.0)
    prior = Prior(headway_error=ChannelPrior(K=5.0, K_sd=0.6))
    plain, known = fit(y, u, None).channels[0], fit(y, u, prior).channels[0]
    assert known.K.high - known.K.low < 0.7 * (plain.K.high - plain.K.low)
    assert known.prior_weights["K"] == known.prior_weight > 0.5
    assert known.status is not Identifiable.NOT
    y, u = follow(1, seconds=900.0)
    assert fit(y, u, prior).channels[0].prior_weights["K"] < 0.5


def test_a_driver_far_from_the_prior_is_left_to_the_data(follow):
    """The truth is 6 sd from a narrow prior of K of range rate, which 90 s of data know well: the interval holds it."""
    y, u = follow(2, seconds=90.0)
    plain = fit(y, u, None).channels[1]
    truth, width = plain.K.value, plain.K.high - plain.K.low
    sd = 1.5 * width
    off = Prior(range_rate=ChannelPrior(K=truth + 6.0 * sd, K_sd=sd))
    known = fit(y, u, off).channels[1]
    assert known.K.low < truth < known.K.high
    assert abs(known.K.value - truth) < 0.25 * width


def test_live_and_restored_states_give_the_numbers_of_one_fit(follow):
    """With a prior of gains, each estimate of the running estimator is that of a fit of its window alone."""
    y, u = follow(3, seconds=45.0)
    prior = Prior(
        headway_error=ChannelPrior(K=5.0, K_sd=1.0),
        range_rate=ChannelPrior(K=5.0, K_sd=1.0, tau_plus_dead_time=0.6, tau_plus_dead_time_factor=1.3),
        gain_correlation=0.4,
    )
    one = FOPDT.make(NAMES, DT, FopdtSettings(prior=prior, refit=5.0))
    state, made = one.init(), []
    for k, (out, inputs) in enumerate(zip(y.tolist(), u.tolist(), strict=True)):
        state, due = one.advance(state, Sample(k * DT, out, tuple(inputs), LearnGate.OPEN, True, 0, {}))
        if due:
            before = state
            state, found = one.estimate(state, state_sample(k, out, inputs))
            made.append((before, k, out, inputs, found))
    reported = [m for m in made if m[0].reported and m[-1].channels["range_rate"].K.value > 0.0]
    assert reported
    for before, k, out, inputs, found in reported:
        _, again = one.estimate(before._replace(start=None), state_sample(k, out, inputs))
        assert again.channels == found.channels
    assert 0.0 < made[-1][-1].channels["headway_error"].prior_weights["K"] < 1.0


def state_sample(k, out, inputs):
    """The sample of row k."""
    return Sample(k * DT, out, tuple(inputs), LearnGate.OPEN, True, 0, {})


@pytest.mark.parametrize(
    ("prior", "says"),
    [
        (Prior(range_rate=ChannelPrior(K=5.0)), "prior.range_rate: K and K_sd belong together"),
        (Prior(range_rate=ChannelPrior(K=5.0, K_sd=0.0)), "prior.range_rate: K_sd = 0 must be above 0"),
        (Prior(range_rate=ChannelPrior(K=math.inf, K_sd=1.0)), "K = inf must be finite"),
        (Prior(gain_correlation=0.5), "gain_correlation needs K and K_sd of two channels"),
        (Prior(tau=0.3, tau_factor=2.0, atypical=0.1), "atypical needs a channel's own prior"),
        (
            Prior(
                headway_error=ChannelPrior(K=5.0, K_sd=1.0),
                range_rate=ChannelPrior(K=5.0, K_sd=1.0),
                gain_correlation=1.0,
            ),
            "gain_correlation = 1 must lie between",
        ),
        (
            Prior(range_rate=ChannelPrior(0.0, 1.0, 0.3, 2.0, 0.3, 0.1, 0.6, 1.2)),
            "give two of them, the third follows",
        ),
    ],
)
def test_a_prior_that_makes_no_sense_is_refused(prior, says):
    """At once, with its place."""
    with pytest.raises(ValueError, match=says):
        check_prior(prior)


def test_a_prior_of_a_channel_needs_the_names():
    """Without names nobody could say whose gain it is."""
    with pytest.raises(ValueError, match="need names"):
        for_inputs(Prior(range_rate=ChannelPrior(K=5.0, K_sd=1.0)), ())


@pytest.mark.slow("fits many drives")
@pytest.mark.parametrize(
    "own",
    [
        ChannelPrior(K=1e6, K_sd=1e-6),
        ChannelPrior(K=-1e6, K_sd=1e6),
        ChannelPrior(K=5.0, K_sd=1e-6, tau_plus_dead_time=100.0, tau_plus_dead_time_factor=1.001),
        ChannelPrior(tau=100.0, tau_factor=1.001, dead_time=10.0, dead_time_sd=1e-3),
        ChannelPrior(tau=1e-3, tau_factor=1.001, tau_plus_dead_time=1e-3, tau_plus_dead_time_factor=100.0),
    ],
)
@pytest.mark.parametrize("atypical", [0.0, 0.5])
def test_absurd_priors_give_ordered_numbers(own, atypical, follow):
    """Whatever a vehicle file may state: no warning, no exception, finite or absent intervals, in order."""
    y, u = follow(1, seconds=40.0)
    prior = Prior(headway_error=own, range_rate=own, atypical=atypical)
    if own.K_sd > 0.0:
        prior = prior._replace(gain_correlation=0.95)
    check_prior(prior)
    for channel in fit(y, u, prior).channels:
        for iv in channel[:4]:
            assert not iv.value < iv.low
            assert not iv.value > iv.high
        assert all(0.0 <= share <= 1.0 for share in channel.prior_weights.values())


def test_where_all_is_declared_the_interval_is_that_of_the_posterior(follow):
    """Ends of both gains' intervals: the 2.5 and 97.5 % points of the mixture over all cells and components."""
    y, u = follow(4, seconds=60.0)
    own = ChannelPrior(K=5.0, K_sd=1.0, tau_plus_dead_time=0.6, tau_plus_dead_time_factor=1.3)
    found = fit(y, u, Prior(headway_error=own, range_rate=own))
    posterior = found.posterior
    weight = (posterior.gains.share * posterior.weight).ravel()
    for i, channel in enumerate(found.channels):
        mean, sd = posterior.gains.mean[i].ravel(), np.sqrt(posterior.gains.variance[i].ravel())
        for end in (channel.K.low, channel.K.high):
            share = float(weight @ norm.cdf((end - mean) / sd))
            # 41 points for a Gaussian, in 32 bins of means: the ends are right to an eighth of a standard deviation
            assert 0.018 < min(share, 1.0 - share) < 0.034
    # the delays of headway are left to the box: the union over all lags that the data allow is wider
    open_delays = Prior(headway_error=ChannelPrior(K=5.0, K_sd=1.0), range_rate=own)
    assert not states_all(for_inputs(open_delays, NAMES))
    assert states_all(for_inputs(open_delays._replace(same_tau=0.5, same_dead_time=0.5), NAMES))
