"""Verdicts of a study: each claim where it is true and where it is false, and never one that no data can change."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import binom, spearmanr

from canid.values.types import Interval
from canid_study import verdict_tests
from canid_study.artifact import ClaimVerdict
from canid_study.chen_ulsoy import between, claims, printed_drivers
from canid_study.chen_ulsoy.chen_ulsoy import ChenUlsoySettings
from canid_study.chen_ulsoy.driver_analysis import Aliasing, Driver, driver_of
from canid_study.chen_ulsoy.segment_fits import NAMES
from canid_study.chen_ulsoy.signals import excitation, left_spectra, spectra
from canid_study.chen_ulsoy.unstructured import FREQUENCIES, Excess, NullBand
from canid_study.grover import method_claims
from tests.study import test_chen_ulsoy

# untyped
drives: Any = test_chen_ulsoy
HOLDS, FAILS, UNDECIDED = ClaimVerdict.HOLDS, ClaimVerdict.FAILS, ClaimVerdict.UNDECIDED
TRIES = 200
# so many wrong verdicts of TRIES are reached once in 10,000 runs where each is as likely as the level
MOST_WRONG = int(binom.isf(1e-4, TRIES, verdict_tests.LEVEL))


def records(gains: Any, lags: Any) -> Any:
    """Episodes with a gain and a lag of each input."""
    return [
        SimpleNamespace(inputs=[SimpleNamespace(p1=SimpleNamespace(K=K, tau=tau))] * 2)
        for K, tau in zip(gains, lags, strict=True)
    ]


def test_a_rank_correlation_does_not_know_the_order_of_records(seed: int) -> None:
    """Ten of eleven lags are equal, as at the end of a search: scipy's value, whatever the order."""
    rng = np.random.default_rng(seed)
    gains, lags = rng.normal(size=11), np.array([*[0.0] * 10, 0.4])
    wanted = spearmanr(gains, lags).statistic
    for _ in range(5):
        order = rng.permutation(11)
        value = verdict_tests.rank_correlation(list(gains[order]), list(lags[order]))[0]
        assert value == pytest.approx(wanted)


def test_attention_holds_fails_or_is_not_decided_by_the_records(seed: int) -> None:
    """Gains that fall with the lag, that rise with it, and that know nothing of it."""
    rng = np.random.default_rng(seed)
    lags = rng.uniform(0.1, 0.7, 12)
    noise = 0.02 * rng.normal(size=12)
    assert method_claims.attention(records(5.0 - lags + noise, lags)).verdict is HOLDS
    assert method_claims.attention(records(5.0 + lags + noise, lags)).verdict is FAILS
    none = [
        method_claims.attention(records(rng.normal(size=8), rng.normal(size=8))).verdict for _ in range(TRIES)
    ]
    assert none.count(HOLDS) <= MOST_WRONG
    assert none.count(FAILS) <= MOST_WRONG


def test_a_verdict_is_wrong_no_more_often_than_its_level(seed: int) -> None:
    """Truth at the margin of each test, the worst case: of the two verdicts each is as rare as the level."""
    rng = np.random.default_rng(seed)
    made: dict[str, list[ClaimVerdict]] = {"above": [], "small": [], "within": [], "share": []}
    for _ in range(TRIES):
        made["above"].append(verdict_tests.decided(*verdict_tests.above(1.0 + rng.normal(size=12), 1.0)))
        value = np.array([1.0 + 0.1 * rng.normal()])
        made["small"].append(
            verdict_tests.decided(*verdict_tests.small(value, np.array([0.1]), np.array([1.0])))
        )
        K = 11.0 + 0.2 * rng.normal()
        found = Interval(K, K - 1.96 * 0.2, K + 1.96 * 0.2)
        made["within"].append(verdict_tests.decided(*verdict_tests.within(10.0, found, 0.1)))
        count = int(rng.binomial(40, 0.9))
        made["share"].append(
            verdict_tests.decided(
                verdict_tests.more_than(count, 40, 0.9), verdict_tests.fewer_than(count, 40, 0.9)
            )
        )
    for name, verdicts in made.items():
        assert verdicts.count(HOLDS) <= MOST_WRONG, name
        assert verdicts.count(FAILS) <= MOST_WRONG, name
        assert verdicts.count(UNDECIDED) > TRIES // 2, name


def test_a_coherence_holds_where_the_wheel_follows_the_error_and_fails_where_not(seed: int) -> None:
    """An angle that is the error and little noise; one of noise alone; one that follows below 0.5 Hz only."""
    rng = np.random.default_rng(seed)
    error, noise = rng.normal(size=(2, 20, 600))
    low = np.fft.irfft(np.fft.rfft(error) * (np.fft.rfftfreq(600, 0.1) < 0.5), 600)
    for angle, wanted in ((error + 0.2 * noise, HOLDS), (noise, FAILS), (low + 0.2 * noise, FAILS)):
        assert verdict_tests.decided(*claims._coherent(spectra(error, angle, 0.1))) is wanted


def test_a_remainder_is_called_coherent_only_where_it_is_a_response_to_the_error(seed: int) -> None:
    """n that is a response to the error; n of noise; and half of each, far from unity."""
    rng = np.random.default_rng(seed)
    error, noise = rng.normal(size=(2, 20, 600))
    response = error + 0.5 * np.roll(error, 1, axis=1)
    for n, wanted in ((response + 0.05 * noise, HOLDS), (noise, FAILS), (response + noise, FAILS)):
        left = left_spectra(error, n, 0.1, 3.0)
        assert left is not None
        assert verdict_tests.decided(*claims._coherent(left, claims._NEAR_UNITY)) is wanted
    assert left_spectra(error, np.full_like(noise, np.nan), 0.1, 3.0) is None


def test_excitation_beyond_rounding_is_a_matter_of_the_data(seed: int) -> None:
    """Two waves excite order 4; one wave does order 2, and the rest is its rounding."""
    rng = np.random.default_rng(seed)
    t = np.arange(600) * 0.1
    phase = rng.uniform(0.0, 6.3, (2, 12, 1))
    one_wave = np.sin(t + phase[0])
    two_waves = one_wave + 0.5 * np.sin(7.0 * t + phase[1])
    for error, wanted in ((two_waves, HOLDS), (one_wave, FAILS)):
        found = excitation(np.round(error, 2), 4)
        assert verdict_tests.decided(*verdict_tests.above(found, 1.0)) is wanted


@pytest.fixture(scope="module")
def one() -> Driver:
    """A constant driver of nine minutes."""
    return driver_of(("S1", [("a.blf", drives.lane(7))], ChenUlsoySettings(constant_repetitions=3)))


def verdict_of(driver: Driver, name: str) -> ClaimVerdict:
    pooled = between.split(NAMES, [driver.group])
    return next(a.verdict for a in claims.claims([driver], pooled, {}) if name in a.name)


@pytest.mark.slow("fits the drive of a fixture")
def test_the_bias_of_the_means_is_a_matter_of_the_data(one: Driver) -> None:
    """Repetitions without a bias, with a large one, and with one that is not known."""
    assert one.repeated is not None
    sd = one.model.std(axis=0, ddof=1) / len(one.model) ** 0.5
    cases = ((0.0, 0.05, HOLDS), (3.0, 0.05, FAILS), (1.0, 0.5, UNDECIDED))
    for bias, error, wanted in cases:
        repeated = one.repeated._replace(bias=bias * sd, bias_sd=error * sd)
        assert verdict_of(one._replace(repeated=repeated), "means of the fits") is wanted


@pytest.mark.slow("fits the drive of a fixture")
def test_passes_of_the_stationarity_test_are_compared_with_a_constant_drivers(one: Driver) -> None:
    """As many as he passes of many segments: holds. Half as many: fails. Of six segments: not decided."""
    assert one.stationary is not None
    assert one.constant is not None
    constant = one.constant._replace(stationary_angle=0.93, stationary_error=0.93)
    for share, segments, wanted in ((0.93, 119, HOLDS), (0.5, 119, FAILS), (1.0, 6, UNDECIDED)):
        driver = one._replace(
            stationary=one.stationary._replace(angle=share, error=share),
            constant=constant,
            rejected=segments - len(one.number),
        )
        assert verdict_of(driver, "stationary segments") is wanted


@pytest.mark.slow("fits the drive of a fixture")
def test_rows_of_excitation_and_of_the_remainder_are_there(one: Driver) -> None:
    """A driver with noise of his own: his error excites, and what the model leaves is noise as well."""
    assert verdict_of(one, "excitation") is HOLDS
    assert verdict_of(one, "error and remainder") is not HOLDS


@pytest.mark.slow("fits the drive of a fixture")
def test_the_need_of_a_filter_is_a_matter_of_the_data(one: Driver) -> None:
    """A difference of nothing, of three standard errors of a segment, one that is not known; no finer grid."""
    own = np.sqrt(np.diag(one.sampling))
    for away, error, wanted in ((0.0, 0.05, HOLDS), (3.0, 0.05, FAILS), (1.0, 0.5, UNDECIDED)):
        driver = one._replace(aliasing=Aliasing(away * own, error * own))
        assert verdict_of(driver, "anti-aliasing") is wanted
    assert verdict_of(one._replace(aliasing=None), "anti-aliasing") is ClaimVerdict.NOT_CHECKABLE


@pytest.mark.slow("fits the drive of a fixture")
def test_unmodeled_dynamics_are_a_matter_of_the_null_band(one: Driver) -> None:
    """Beyond the band: holds. Within a narrow one: fails. Within one as wide as Delta itself: not decided. None: unknown."""
    F = len(FREQUENCIES)
    size = float(np.nanmedian(np.abs(one.delta), axis=0).min())
    for radius, share, wanted in ((0.1, 0.3, HOLDS), (0.1, 0.0, FAILS), (2.0, 0.0, UNDECIDED)):
        precision = np.tile(np.eye(2) / (radius * size) ** 2, (F, 1, 1))
        band = NullBand(np.abs(one.delta), np.zeros(F, np.complex128), precision, 1.0, 0)
        excess = Excess(0.05, np.zeros(F), share, np.zeros(F))
        assert verdict_of(one._replace(band=band, excess=excess), "|Delta| is") is wanted
    assert verdict_of(one._replace(band=None, excess=None), "|Delta| is") is ClaimVerdict.NOT_CHECKABLE


@pytest.mark.slow("simulates and fits 45 minutes of two drivers")
def test_change_and_structure_on_simulated_drives(seed: int) -> None:
    """A driver who is another one each minute, and one who never changes: what is true of one is never said of the other."""
    settings = ChenUlsoySettings(constant_repetitions=3)
    said = {}
    for kind in ("minutes", "constant"):
        name, drive = next(iter(printed_drivers.drives(seed % 1000, 1, 45.0, kind=cast(Any, kind))))
        driver = driver_of((name, [("a.blf", drives.trace_of(drive))], settings))
        said[kind] = verdict_of(driver, "structured")
    assert said["minutes"] is not FAILS
    assert said["constant"] is not HOLDS
    assert said["constant"] is not said["minutes"] or said["constant"] is UNDECIDED


def test_a_change_over_several_logs_is_not_decided(one: Driver) -> None:
    """The logs of one driver differ by more than the driver: no verdict, whatever the p value."""
    assert one.drift is not None
    changed = one._replace(drift=one.drift._replace(p_value=0.005))
    assert verdict_of(changed, "changes with time") is HOLDS
    assert verdict_of(changed._replace(logs=3), "changes with time") is UNDECIDED
