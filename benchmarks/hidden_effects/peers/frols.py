"""SysIdentPy's FROLS on the library: forward regression by error reduction ratio (Chen, Billings & Luo, 1989).

It needs numpy < 2.4, and so it may run in an interpreter of its own: nothing of canid is imported here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# the code of input i (from 1) at lag 1 is 1000 (i + 1) + 1
INPUT = 1000


class Settings(NamedTuple):
    """What its user has to choose."""

    ratio: float  # error reduction below which a term is none; 0: the criterion alone
    criterion: str  # "bic", "aic", ...; "": the ratio alone
    memory: int  # samples of the past in addition to the columns


def select(X: Array, y: Array, ratio: float, criterion: str, most: int) -> list[tuple[int, float]]:
    """Fit; returns the columns that are kept, in their order, and their error reduction ratios.

    Args:
        X: (m, k) columns.
        y: (m,) target.
        ratio: see `Settings`.
        criterion: see `Settings`.
        most: terms at most.
    """
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    k = X.shape[1]
    if not k:
        return []
    terms = min(most, k)
    model = FROLS(
        order_selection=bool(criterion),
        info_criteria=criterion or "bic",
        n_info_values=terms,
        n_terms=None if criterion else terms,
        xlag=[[1]] * k if k > 1 else 1,
        ylag=1,
        model_type="NFIR",
        basis_function=Polynomial(degree=1),
        estimator=LeastSquares(),
    )
    # its inputs act one sample later: the columns are put one sample back
    model.fit(X=np.vstack([X, X[-1:]]), y=np.concatenate([y[:1], y])[:, None])
    codes = np.max(np.atleast_2d(model.final_model), axis=1)
    return [
        (int(code) // INPUT - 2, float(err))
        for code, err in zip(codes, np.ravel(model.err), strict=False)
        if code and err >= ratio
    ]
