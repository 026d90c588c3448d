"""UD factors follow the plain covariance, stay definite, and directional forgetting does not wind up."""

import numpy as np
import pytest

from canid.identification import ud


def plain(P, psi, forgetting):
    """Directional forgetting written with matrices (Bittanti, Bolzern & Campi 1990)."""
    r = psi @ P @ psi
    gain = P @ psi / (1 + r)
    weight = forgetting - (1 - forgetting) / r
    return P - np.outer(P @ psi, P @ psi) / (1 / weight + r), gain


def test_equals_the_plain_update():
    """Two hundred updates of six parameters agree with the matrix formula, with and without forgetting."""
    for forgetting in (1.0, 0.98):
        rng = np.random.default_rng(0)
        A = rng.normal(size=(6, 6))
        P = A @ A.T + np.eye(6)
        state = ud.factor(P)
        assert np.allclose(ud.matrix(state), P, rtol=1e-12)
        for _ in range(200):
            psi = rng.normal(size=6) * rng.choice([0.03, 1.0])
            state, gain = ud.update(state, psi.tolist(), forgetting)
            P, want = plain(P, psi, forgetting)
            assert np.allclose(gain, want, rtol=1e-7, atol=1e-10)
            assert np.allclose(ud.matrix(state), P, rtol=1e-7, atol=1e-10)


def test_equals_least_squares_without_forgetting():
    """After n samples P is the inverse of the prior's information plus all psi psi'."""
    rng = np.random.default_rng(1)
    X = rng.normal(size=(300, 4))
    state = ud.factor(100.0 * np.eye(4))
    for psi in X.tolist():
        state, _ = ud.update(state, psi, 1.0)
    assert np.allclose(ud.matrix(state), np.linalg.inv(X.T @ X + np.eye(4) / 100), rtol=1e-9)


def test_twenty_minutes_in_one_direction_leave_the_others_alone():
    """What was known of other directions stays known, P stays positive and bounded, at any forgetting."""
    for forgetting in (0.9, 0.99, 0.998):
        state = ud.factor(np.diag([1e-3, 2e-3, 3e-3]))
        for _ in range(12_000):
            state, _ = ud.update(state, [1.0, 0.0, 0.0], forgetting)
        P = ud.matrix(state)
        assert np.allclose(np.diag(P)[1:], [2e-3, 3e-3], rtol=1e-9)
        # the direction itself settles where as much comes as goes
        assert np.isclose(P[0, 0], (1 - forgetting) / forgetting, rtol=1e-6)


def test_noise_as_only_excitation_neither_blows_up_nor_turns_negative():
    """Tiny random regressors for 20 minutes: all factors positive, growth stopped at the bound."""
    rng = np.random.default_rng(2)
    state = ud.factor(np.diag([1e-3] * 4))
    for _ in range(12_000):
        state, gain = ud.update(state, (1e-4 * rng.normal(size=4)).tolist(), 0.99, most=10.0)
        assert min(state.d) > 0.0
    assert max(state.d) <= 11.0
    assert np.isfinite(gain).all()


def test_an_indefinite_matrix_is_a_wrong_call():
    """Factoring what is no covariance raises and says what to do."""
    with pytest.raises(ValueError, match="positive definite"):
        ud.factor(np.diag([1.0, -1.0]))
