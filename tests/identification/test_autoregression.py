"""The noise's spectrum is found through gaps, and whitening never runs away."""

import numpy as np
import pytest

from canid.mathematics.identification import autoregression


def series(phi, n, rng):
    r = np.zeros(n + 200)
    for k in range(len(phi), n + 200):
        r[k] = sum(p * r[k - 1 - i] for i, p in enumerate(phi)) + rng.normal()
    return r[200:]


def test_finds_a_resonance_through_gaps():
    """AR(2) coefficients come back although every fifth stretch is missing and holds nonsense."""
    rng = np.random.default_rng(0)
    r = series([1.6, -0.8], 4000, rng)
    usable = np.arange(4000) % 50 >= 10
    r[~usable] = 1e6
    found = autoregression.fit(r, usable, most=4, floor=0.0)
    assert np.allclose(np.pad(found, (0, 4 - len(found))), [1.6, -0.8, 0, 0], atol=0.08)


def test_white_noise_is_mostly_left_alone():
    """On white noise AIC picks few lags and small ones."""
    found = [
        autoregression.fit(np.random.default_rng(s).normal(size=600), np.full(600, True)) for s in range(20)
    ]
    assert sum(len(f) == 0 for f in found) >= 12
    assert max(np.abs(f).max(initial=0.0) for f in found) < 0.2


def test_a_smoothed_signal_does_not_make_whitening_singular():
    """Noise without content above 0.5 Hz is not amplified beyond what the floor allows."""
    n = 1200
    spectrum = np.fft.rfft(np.random.default_rng(2).normal(size=n))
    spectrum[np.fft.rfftfreq(n, 0.1) > 0.5] = 0.0
    r = np.fft.irfft(spectrum, n)
    found = autoregression.fit(r, np.full(n, True), most=5)
    gain = np.abs(
        1 - sum(p * np.exp(-1j * np.linspace(0, np.pi, 500) * (i + 1)) for i, p in enumerate(found))
    )
    assert np.isfinite(found).all()
    e = autoregression.whiten(r, found)[10:]
    # the largest gain over the typical gain in the band: weights of the empty band stay bounded
    assert gain.max() ** 2 * 0.003 * r.var() < 30 * e.var()


def test_whole_looks_at_every_predecessor():
    """A sample counts only if all p before it do: checked against the loop."""
    usable = np.random.default_rng(3).random(300) > 0.2
    for p in (0, 1, 4):
        loop = [k >= p and usable[k - p : k + 1].all() for k in range(300)]
        assert autoregression.whole(usable, p).tolist() == loop


def test_nothing_usable_gives_no_colour():
    """Too few or constant data give an empty model, not an error."""
    assert len(autoregression.fit(np.ones(50), np.full(50, False))) == 0
    assert len(autoregression.fit(np.zeros(500), np.full(500, True))) == 0


def test_a_stride_whitens_each_phase_by_itself(seed: int) -> None:
    """As every `stride`-th value alone, whatever the length; a value that is not known leaves those it predicts unknown."""
    rng = np.random.default_rng(seed)
    noise = np.array([0.6, -0.2, 0.1])
    for n in (2, 5, 60, 61):
        x = rng.normal(size=(2, n))
        for stride in (1, 2, 5, 40):
            white = autoregression.whiten(x, noise, stride)
            for phase in range(min(stride, n)):
                alone = autoregression.whiten(x[:, phase::stride], noise)
                assert white[:, phase::stride] == pytest.approx(alone, abs=1e-12)
    x = rng.normal(size=30)
    x[10] = np.nan
    for stride in (1, 4):
        unknown = np.isnan(autoregression.whiten(x, noise, stride))
        assert np.flatnonzero(unknown).tolist() == [10 + k * stride for k in range(4)], stride
