"""Car following by other ways: functions of (output, inputs, dt, settle) that return K1 K2 tau2 theta2, NaN where none."""

from __future__ import annotations

import contextlib
import io

import numpy as np

from benchmarks.identification.peers import octave, process
from benchmarks.identification.peers.armax import NEEDS_OLD_NUMPY
from benchmarks.identification.peers.peer import Peer


def _told(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    return np.array([one[0], two[0], two[1], two[2]])


def naive_arx(y: np.ndarray, inputs: np.ndarray, dt: float, settle: int) -> np.ndarray:
    return _told(*process.first_order(y, list(inputs.T), dt, settle))


def per_input(y: np.ndarray, inputs: np.ndarray, dt: float, settle: int) -> np.ndarray:
    return _told(*(process.recipe(y, u, dt, settle) for u in inputs.T))


def grover_per_input(y: np.ndarray, inputs: np.ndarray, dt: float, settle: int) -> np.ndarray:
    return _told(*(process.grover(y, u, dt, settle) for u in inputs.T))


def output_error(y: np.ndarray, inputs: np.ndarray, dt: float, settle: int) -> np.ndarray:
    found, _ = process.joint(y, list(inputs.T), dt, settle)
    return _told(found[:3], found[3:])


def sippy(y: np.ndarray, inputs: np.ndarray, dt: float, settle: int) -> np.ndarray:
    """Fit ARMAX(2,2,1) with two inputs; SIPPY gives no dead time below a sample, hence the gains alone."""
    from sippy_unipi import system_identification

    y, inputs = y[settle:] - y[settle:].mean(), inputs[settle:] - inputs[settle:].mean(axis=0)
    with contextlib.redirect_stdout(io.StringIO()):
        model = system_identification(
            y, inputs.T, "ARMAX", ARMAX_orders=[[2], [[2, 2]], [1], [[0, 0]]], ARMAX_mod="ILLS", tsample=dt
        )
    numerators, den = model.NUMERATOR[0], model.DENOMINATOR[0]
    gains = [float(np.sum(n) / np.sum(d)) for n, d in zip(numerators, den, strict=True)]
    return np.array([*gains, np.nan, np.nan])


def sysidentpy(y: np.ndarray, inputs: np.ndarray, dt: float, settle: int) -> np.ndarray:
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    y, inputs = y[settle:] - y[settle:].mean(), inputs[settle:] - inputs[settle:].mean(axis=0)
    model = FROLS(
        order_selection=False,
        n_terms=6,
        ylag=2,
        xlag=[[1, 2], [1, 2]],
        elag=1,
        basis_function=Polynomial(degree=1),
        estimator=LeastSquares(unbiased=True),
    )
    model.fit(X=inputs, y=y[:, None])
    term = {
        int(np.max(code)): float(value)
        for code, value in zip(model.final_model, np.ravel(model.theta), strict=False)
    }
    rest = 1.0 - term.get(1001, 0.0) - term.get(1002, 0.0)
    K1, K2 = ((term.get(c + 1, 0.0) + term.get(c + 2, 0.0)) / rest for c in (2000, 3000))
    return np.array([K1, K2, np.nan, np.nan])


def octave_n4sid(y: np.ndarray, inputs: np.ndarray, dt: float, settle: int) -> np.ndarray:
    y, inputs = y[settle:] - y[settle:].mean(), inputs[settle:] - inputs[settle:].mean(axis=0)
    return np.array([*octave.gains(y, inputs, "n4sid(dat, 3)"), np.nan, np.nan])


FOLLOWING = (
    Peer("naive least squares, ARX(1,1) + dead-time search", naive_arx),
    Peer("process fit per input (Grover)", per_input),
    Peer("ARX order 11 per input, then process fit (Grover)", grover_per_input),
    Peer("output error, both inputs (curve_fit)", output_error),
    Peer("SIPPY ARMAX(2,2,1), ILLS", sippy, "sippy_unipi"),
    Peer("SysIdentPy, FROLS + ELS", sysidentpy, "sysidentpy", old=NEEDS_OLD_NUMPY),
    Peer("Octave-control n4sid, order 3", octave_n4sid, "octave-cli", program=True),
)
