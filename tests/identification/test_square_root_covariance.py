"""Square roots follow the plain covariance, forget only what is renewed, and stay definite in float32 too."""

import numpy as np
import pytest

from canid.mathematics.identification.armax import square_root_covariance


def covariances(root):
    return root @ root.swapaxes(1, 2)


def test_equals_the_plain_update():
    """Two hundred updates of three stacked covariances agree with the matrix formula, gains and spreads too."""
    rng = np.random.default_rng(0)
    A = rng.normal(size=(3, 6, 6))
    P = A @ A.swapaxes(1, 2) + np.eye(6)
    root = np.array([square_root_covariance.factor(p) for p in P])
    assert np.allclose(covariances(root), P, rtol=1e-12)
    for _ in range(200):
        psi = rng.normal(size=(3, 1, 6)) * rng.choice([0.0, 0.03, 1.0])
        done = square_root_covariance.update(root, psi)
        root = done.root
        for i in range(3):
            x = psi[i, 0]
            spread = 1.0 + x @ P[i] @ x
            gain = P[i] @ x / spread
            assert np.allclose(done.spread[i], spread, rtol=1e-9)
            assert np.allclose(done.gain[i, 0], gain, rtol=1e-7, atol=1e-12)
            P[i] = P[i] - np.outer(gain, gain) * spread
    assert np.allclose(covariances(root), P, rtol=1e-7, atol=1e-12)


def test_equals_least_squares_without_forgetting():
    """After n samples P is the inverse of the prior's information plus all psi psi'."""
    X = np.random.default_rng(1).normal(size=(300, 4))
    root = 10.0 * np.eye(4)[None]
    for psi in X:
        root = square_root_covariance.update(root, psi[None, None]).root
    assert np.allclose(covariances(root)[0], np.linalg.inv(X.T @ X + np.eye(4) / 100), rtol=1e-9)


@pytest.mark.parametrize("forgetting", [0.9, 0.99, 1.0])
def test_forgets_exponentially_where_everything_is_excited(forgetting):
    """With white regressors the information is the exponentially weighted sum of all blocks."""
    rng = np.random.default_rng(2)
    root, information = 0.1 * np.eye(4)[None], 100.0 * np.eye(4)
    for _ in range(100):
        X = rng.normal(size=(20, 4))
        for psi in X:
            root = square_root_covariance.update(root, psi[None, None]).root
        root = square_root_covariance.forget(root, X[None], np.array([forgetting]))
        information = forgetting**20 * (information + X.T @ X)
    assert np.allclose(np.linalg.inv(covariances(root)[0]), information, rtol=1e-6)


def test_twenty_minutes_in_one_direction_leave_the_others_alone():
    """What was known of other directions stays known, at any forgetting; the renewed direction forgets."""
    for forgetting in (0.9, 0.99, 0.998):
        root = np.diag(np.sqrt([1e-3, 2e-3, 3e-3]))[None]
        psi = np.array([[[1.0, 0.0, 0.0]]])
        for _ in range(600):
            for _ in range(20):
                root = square_root_covariance.update(root, psi).root
            root = square_root_covariance.forget(root, np.repeat(psi, 20, axis=1), np.array([forgetting]))
        P = covariances(root)[0]
        assert np.allclose(np.diag(P)[1:], [2e-3, 3e-3], rtol=1e-6)
        kept = forgetting**20
        assert np.isclose(P[0, 0], (1.0 - kept) / (20.0 * kept), rtol=1e-6)


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_what_only_trembles_is_not_forgotten(kind):
    """Tiny random regressors for 20 min: at most RENEWAL times what they brought is gone, and P stays definite."""
    rng = np.random.default_rng(3)
    root = (1e-3**0.5 * np.eye(4)[None]).astype(kind)
    for _ in range(600):
        X = (1e-2 * rng.normal(size=(1, 20, 4))).astype(kind)
        for k in range(20):
            root = square_root_covariance.update(root, X[:, k : k + 1]).root
        root = square_root_covariance.forget(root, X, np.array([0.98], kind))
        assert root.dtype == kind
    P = covariances(root.astype(float))[0]
    brought = 12_000 * 1e-4
    assert np.linalg.eigvalsh(P).min() > 0.0
    assert np.linalg.eigvalsh(np.linalg.inv(P)).min() > 1e3 - 1.2 * square_root_covariance.RENEWAL * brought


def test_an_indefinite_matrix_is_a_wrong_call():
    """Factoring what is no covariance raises and says what to do."""
    with pytest.raises(ValueError, match="positive definite"):
        square_root_covariance.factor(np.diag([1.0, -1.0]))
