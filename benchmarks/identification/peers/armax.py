"""ARMAX(2,2,1) and ARX(2,2) of other toolboxes: functions of (y, u) that return a1 a2 b1 b2 c1, NaN where there is none."""

from __future__ import annotations

import contextlib
import io

import numpy as np

from benchmarks.identification.peers import octave
from benchmarks.identification.peers.peer import Peer
from benchmarks.identification.peers.regressors import lagged
from benchmarks.identification.peers.tracking import Steps, filterpy_steps, padasip_steps, river_steps

NEEDS_OLD_NUMPY = "needs numpy < 2.4: give --peers-python an interpreter that has it"


def sippy(y: np.ndarray, u: np.ndarray, mode: str) -> np.ndarray:
    """SIPPY's ARMAX; its delay counts from one sample on."""
    from sippy_unipi import system_identification

    with contextlib.redirect_stdout(io.StringIO()):
        model = system_identification(y, u, "ARMAX", ARMAX_orders=[2, 2, 1, 0], ARMAX_mod=mode, tsample=0.1)
    den, num, noise = (np.ravel(x) for x in (model.DENOMINATOR, model.NUMERATOR, model.NUMERATOR_H))
    return (
        np.array([den[1], den[2], *num[-2:], noise[1]])
        if len(num) == 2
        else np.array([*den[1:3], *num[1:3], noise[1]])
    )


def sippy_opt(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    return sippy(y, u, "OPT")


def sippy_ills(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    return sippy(y, u, "ILLS")


def sippy_rlls(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    return sippy(y, u, "RLLS")


def sysidentpy(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """SysIdentPy's FROLS with all five linear terms and extended least squares."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    model = FROLS(
        order_selection=False,
        n_terms=5,
        ylag=2,
        xlag=2,
        elag=1,
        basis_function=Polynomial(degree=1),
        estimator=LeastSquares(unbiased=True),
    )
    model.fit(X=u[:, None], y=y[:, None])
    term = {
        int(np.max(code)): float(value)
        for code, value in zip(model.final_model, np.ravel(model.theta), strict=False)
    }
    return np.array([-term[1001], -term[1002], term[2001], term[2002], np.nan])


def least_squares(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    X = np.column_stack([-lagged(y, range(1, 3)), lagged(u, range(1, 3))])[2:]
    return np.append(np.linalg.lstsq(X, y[2:], rcond=None)[0], np.nan)


def statsmodels(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    from statsmodels.regression.recursive_ls import RecursiveLS

    X = np.column_stack([-lagged(y, range(1, 3)), lagged(u, range(1, 3))])[2:]
    return np.append(RecursiveLS(y[2:], X).fit().params, np.nan)


def _last(steps: Steps) -> np.ndarray:
    *_, (_, theta) = steps
    return np.append(theta, np.nan)


def padasip(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    return _last(padasip_steps(y, u, 1.0))


def river(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    return _last(river_steps(y, u, None))


def filterpy(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    return _last(filterpy_steps(y, u, 0.0))


def octave_arx(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    return octave.polynomials(y, u, "arx(dat, 'na', 2, 'nb', 2)")


def octave_n4sid(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    return octave.polynomials(y, u, "n4sid(dat, 2)")


def octave_armax(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    return octave.polynomials(y, u, "armax(dat, 'na', 2, 'nb', 2, 'nc', 1)")


ARMAX = (
    Peer("SIPPY ARMAX, OPT (CasADi)", sippy_opt, "sippy_unipi"),
    Peer("SIPPY ARMAX, ILLS", sippy_ills, "sippy_unipi"),
    Peer("SIPPY ARMAX, RLLS", sippy_rlls, "sippy_unipi", old=NEEDS_OLD_NUMPY),
    Peer("SysIdentPy, FROLS + ELS", sysidentpy, "sysidentpy", old=NEEDS_OLD_NUMPY),
    Peer("numpy least squares, ARX", least_squares),
    Peer("statsmodels RecursiveLS, ARX", statsmodels, "statsmodels"),
    Peer("padasip RLS, ARX", padasip, "padasip"),
    Peer("river BayesianLinearRegression, ARX", river, "river"),
    Peer("filterpy KalmanFilter as RLS, ARX", filterpy, "filterpy"),
    Peer("Octave-control arx", octave_arx, "octave-cli", program=True),
    Peer("Octave-control n4sid", octave_n4sid, "octave-cli", program=True),
    Peer("Octave-control armax", octave_armax, "octave-cli", program=True),
)
