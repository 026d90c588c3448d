"""Filter with a finite impulse response: a short one row by row, a longer one as products of matrices.

Blocks of samples times a Toeplitz matrix take a third of the time of a convolution per row at the higher orders of a noise
model.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from canid.types import Array

# coefficients up to which numpy's convolution is the faster one
SHORT = 12
# samples per block; a longer filter than this is applied sample by sample
BLOCK = 32
# coefficient of the sample of a column in that of a row, in the same block
LAG = np.arange(BLOCK)[:, None] - np.arange(BLOCK)


def filtered(A: Array, rows: Array) -> Array:
    """Filter each row (k, n) by A (p + 1,); before its first sample it was 0.

    Example:
        >>> filtered(np.array([1.0, -0.5]), np.array([[2.0, 2.0, 4.0]]))
        array([[2., 1., 3.]])
    """
    (k, n), p = rows.shape, A.size - 1
    if p < SHORT:
        return np.stack([np.convolve(row, A)[:n] for row in rows])
    if p > BLOCK:
        return np.asarray(lfilter(A, [1.0], rows, axis=1))
    blocks = -(-n // BLOCK)
    padded = np.zeros((k, blocks * BLOCK))
    padded[:, :n] = rows
    by_lag = np.r_[A, np.zeros(2 * BLOCK - A.size)]
    # a lag below 0 takes one of the zeros
    whole = padded.reshape(-1, BLOCK) @ by_lag[LAG].T
    before = padded.reshape(k, blocks, BLOCK)[:, :-1, BLOCK - p :]
    of_before = by_lag[np.minimum(LAG[:, BLOCK - p :] + BLOCK, 2 * BLOCK - 1)]
    whole.reshape(k, blocks, BLOCK)[:, 1:] += before @ of_before.T
    out: Array = whole.reshape(k, -1)[:, :n]
    return out
