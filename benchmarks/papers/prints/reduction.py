"""Reduction of eq. 2.4 and 2.5 to first order for a whole set of input spectra, where eq. 2.8 and 2.9 may be anywhere.

An output-error fit of K e^(-theta s) / (1 + tau s) to noise-free records of another system tends to the least squares
of the difference, weighted by the input's spectrum (Ljung 1999, sec. 8.5). The paper does not print the spectra of its
records, so the reduction is made for many.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from canid.values.types import Array
from canid_study.printed_numbers import FirstOrder
from canid_study.systems.control_systems import Complex

# rad/s: from a period of 100 min, longer than any record, to 48 Hz, the Nyquist frequency of 100 Hz. Twice the points
# change K by 0.1 % at most, tau by 0.4 ms and a fit by 0.04 %
OMEGA = np.geomspace(1e-3, 300.0, 6000)
# Hz: band limits of the inputs, from a slow following to the whole range of the sampling
BANDS_HZ = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 50.0)
# Hz: a detrended record of 20 s holds nothing slower
DETRENDED_HZ = 0.05
# s: of lag and dead time; a pedal is faster
LARGEST_S = 10.0
# points of the grid of starting values: the criterion has up to three minima where G has resonances
LAGS = np.concatenate([[0.0], np.geomspace(1e-3, LARGEST_S, 30)])
DELAYS = np.concatenate([[0.0], np.geomspace(5e-3, 2.0, 16)])


class Spectrum(NamedTuple):
    """An input's power over `OMEGA`, times the spacing of the frequencies."""

    name: str
    band_hz: float  # to which it reaches; of a step or a ramp, from which
    shape: str  # "flat", "low-pass", "step", "ramp"
    weight: Array  # (6000,)


class Reduction(NamedTuple):
    """The nearest first-order model for one input."""

    spectrum: Spectrum
    K: float
    tau: float  # s
    dead_time: float  # s; 0 of a P1
    fit_percent: float


def spectra() -> tuple[Spectrum, ...]:
    """22 input spectra: flat and second-order low-pass of ten bands, a step and a ramp.

    >>> len(spectra())
    22
    """
    spacing = np.gradient(OMEGA)
    out = []
    for f in BANDS_HZ:
        corner = 2.0 * math.pi * f
        low = spacing / (1.0 + (OMEGA / corner) ** 4)  # power behind a Butterworth filter of second order
        out.append(Spectrum(f"2nd-order low-pass {f:g} Hz", f, "low-pass", low))
        out.append(Spectrum(f"flat to {f:g} Hz", f, "flat", spacing * (corner >= OMEGA)))
    above = spacing * (2.0 * math.pi * DETRENDED_HZ <= OMEGA)
    out.append(Spectrum("step, above 0.05 Hz", DETRENDED_HZ, "step", above / OMEGA**2))
    out.append(Spectrum("ramp, above 0.05 Hz", DETRENDED_HZ, "ramp", above / OMEGA**4))
    return tuple(out)


def reductions(response: Complex, inputs: tuple[Spectrum, ...], dead_time: bool) -> tuple[Reduction, ...]:
    """Nearest first-order model for every input: P1, or with a dead time P1D.

    Args:
        response: (6000,) of the system over `OMEGA`.
        inputs: spectra.
        dead_time: P1D.

    Example: a first-order system is its own reduction.
        >>> g = 4.0 / (1.0 + 0.5j * OMEGA)
        >>> r = reductions(g, spectra()[5:6], False)[0]
        >>> round(r.K, 6), round(r.tau, 6), round(r.fit_percent, 3)
        (4.0, 0.5, 100.0)
    """
    delays = DELAYS if dead_time else np.zeros(1)
    lags = LAGS[::2] if dead_time else LAGS
    grid = np.array([(tau, theta) for tau in lags for theta in delays])
    weights = np.array([s.weight for s in inputs])  # (m, n)
    power = weights @ np.abs(response) ** 2
    share = np.empty((len(inputs), len(grid)))
    for j, (tau, theta) in enumerate(grid):
        shape = _shape(OMEGA, tau, theta)
        inner = weights @ (np.conj(shape) * response).real
        share[:, j] = inner**2 / (weights @ np.abs(shape) ** 2)
    return tuple(
        _refined(response, s, grid[np.argsort(share[i])[::-1]], float(power[i]), dead_time)
        for i, s in enumerate(inputs)
    )


def fit_of(response: Complex, model: FirstOrder, spectrum: Spectrum) -> float:
    """Percentage of fit of a given first-order model to the system's output for an input.

    >>> round(fit_of(1.0 / (1.0 + 1j * OMEGA), FirstOrder("", 1.0, 1.0), spectra()[0]), 6)
    100.0
    """
    return _fit(response, model.K * _shape(OMEGA, model.tau, 0.0), spectrum.weight)


def _shape(omega: Array, tau: float, theta: float) -> Complex:
    out: Complex = np.asarray(1.0 / (1.0 + 1j * omega * tau), dtype=np.complex128)
    return out * np.exp(-1j * omega * theta) if theta else out


def _fit(response: Complex, model: Complex, weight: Array) -> float:
    error = float(weight @ np.abs(response - model) ** 2)
    return 100.0 * (1.0 - math.sqrt(error / float(weight @ np.abs(response) ** 2)))


def _refined(
    response: Complex, spectrum: Spectrum, starts: Array, power: float, dead_time: bool
) -> Reduction:
    """Quasi-Newton from the best points of the grid, K by projection (Golub & Pereyra 1973)."""
    # past the weight's last thousandth of a millionth nothing changes a digit
    used = spectrum.weight > 1e-9 * spectrum.weight.max()
    s, root = 1j * OMEGA[used], np.sqrt(spectrum.weight[used] / power)
    whole = root * response[used]

    def at(x: Array) -> Complex:
        out: Complex = root * _shape(OMEGA[used], x[0], x[1] if dead_time else 0.0)
        return out

    def missed(x: Array) -> tuple[float, Array]:
        """Share of the output's power that is missed, and its slope."""
        shape = at(x)
        slopes = [-s / (1.0 + s * x[0]) * shape, -s * shape][: len(x)]
        inner, norm = _inner(shape, whole), _inner(shape, shape)
        K = inner / norm
        slope = np.array([2.0 * K * (K * _inner(d, shape) - _inner(d, whole)) for d in slopes])
        return 1.0 - K * inner, slope

    free = 2 if dead_time else 1
    # the two best that are apart: neighbours on the grid lead to one minimum
    apart = next((x for x in starts if abs(x[0] - starts[0][0]) > 0.5 * starts[0][0]), starts[1])
    found = min(
        (
            minimize(
                missed,
                start[:free],
                jac=True,
                method="L-BFGS-B",
                bounds=[(0.0, LARGEST_S)] * free,
                options={"ftol": 1e-15, "gtol": 1e-10, "maxcor": 4},
            )
            for start in (starts[0], apart)
        ),
        key=lambda result: float(result.fun),
    )
    shape = at(found.x)
    return Reduction(
        spectrum,
        _inner(shape, whole) / _inner(shape, shape),
        float(found.x[0]),
        float(found.x[1]) if dead_time else 0.0,
        100.0 * (1.0 - math.sqrt(max(float(found.fun), 0.0))),
    )


def _inner(x: Complex, y: Complex) -> float:
    return float(np.vdot(x, y).real)
