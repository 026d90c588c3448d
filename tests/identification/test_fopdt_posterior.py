"""The grid posterior equals brute force, and finds its place by itself."""

import numpy as np
import pytest

from canid.mathematics.identification.fopdt import (
    fopdt_posterior,
    posterior_cells,
    posterior_region,
    reduced_basis,
    weighted_quantiles,
)
from tests.identification.first_order_response import response

DT = 0.1
BOX = reduced_basis.Box(reduced_basis.TAU_MIN, 3.0, 1.5)
BASIS = reduced_basis.basis(BOX)


def planted(n=400, seed=0, noise=0.1):
    rng = np.random.default_rng(seed)
    u = [response(rng.normal(size=n), DT, 0.4, 0.0).x for _ in range(2)]
    y = 2.0 + 3.0 * response(u[0], DT, 0.5, 0.3).x - 1.5 * response(u[1], DT, 0.3, 0.1).x
    return y + noise * rng.normal(size=n), u


def nodes(u):
    """(b, n): the input as the basis answers it."""
    return np.array(
        [response(u, DT, tau, theta).x for tau, theta in zip(BASIS.tau, BASIS.dead_time, strict=True)]
    )


def posterior(y, inputs, cells, Z=None):
    """The posterior on given cells, with white noise."""
    Z = np.ones((len(y), 1)) if Z is None else Z
    whitened = np.vstack([*(nodes(u) for u in inputs), y])
    W = [reduced_basis.weights(BASIS, c.tau, c.dead_time) for c in cells]
    known = fopdt_posterior.moments(fopdt_posterior.products(whitened, Z.T), len(inputs), whitened.shape[1])
    return fopdt_posterior.evaluate(known, W, cells)


def test_every_cell_is_a_least_squares_fit():
    """Gains, deviations and the sum of squares of each pair of cells are those of lstsq on that pair."""
    y, u = planted()
    Z = np.column_stack([np.ones(400), np.random.default_rng(1).normal(size=400)])
    cells = [posterior_cells.make_cells(posterior_cells.whole_box(BOX), BOX, 4) for _ in u]
    X = [reduced_basis.weights(BASIS, c.tau, c.dead_time) @ nodes(x) for x, c in zip(u, cells, strict=True)]
    grid = posterior(y, u, cells, Z)
    sums = np.empty((16, 16))
    for i in range(16):
        for j in range(16):
            A = np.column_stack([X[0][i], X[1][j], Z])
            theta, rss, *_ = np.linalg.lstsq(A, y, rcond=None)
            sums[i, j] = rss[0]
            cov = rss[0] / (400 - 4) * np.linalg.inv(A.T @ A)
            assert np.allclose([grid.K[0][i, j], grid.K[1][i, j]], theta[:2], rtol=1e-6)
            assert np.allclose([grid.K_sd[0][i, j], grid.K_sd[1][i, j]], np.sqrt(np.diag(cov))[:2], rtol=1e-6)
    prior = cells[0].weight[:, None] * cells[1].weight[None, :]
    weight = prior * (sums / sums.min()) ** (-(400 - 4) / 2)
    assert np.allclose(grid.weight, weight / weight.sum(), atol=1e-9)


def test_cells_stay_in_the_box_and_carry_the_prior():
    """A region that sticks out is cut off; prior mass is area / tau, falling to zero at dead_time_max."""
    cells = posterior_cells.make_cells(posterior_cells.Region(2.8, 0.1, 0.5, 0.2, -0.5), BOX)
    assert cells.tau.max() < 3.0
    assert cells.tau.min() > 0.02
    assert (cells.dead_time >= 0.0).all()
    assert (cells.dead_time <= 1.5).all()
    flat = posterior_cells.make_cells(posterior_cells.whole_box(BOX), BOX)
    assert np.allclose(flat.weight * flat.tau / (1 - flat.dead_time / 1.5), 1.5)
    assert (
        posterior_cells.make_cells(posterior_cells.Region(1.0, 1.8, 0.01, 0.01, 0.0), BOX).weight.max() == 0.0
    )


def test_a_grid_that_missed_walks_to_the_posterior():
    """From a small region far away the next regions reach the truth instead of shrinking where they are."""
    y, u = planted()
    regions = [
        posterior_cells.Region(2.5, 1.2, 0.02, 0.02, 0.0),
        posterior_cells.Region(2.5, 1.2, 0.02, 0.02, 0.0),
    ]
    for _ in range(25):
        cells = [posterior_cells.make_cells(r, BOX) for r in regions]
        grid = posterior(y, u, cells)
        regions = [posterior_region.gather(grid, i, BOX) for i in range(2)]
    assert abs(regions[0].tau - 0.5) < 0.1
    assert abs(regions[1].dead_time - 0.1) < 0.06


def test_marginals_equal_those_of_a_dense_grid():
    """Nine cells in the right place give the same intervals as 60 x 60 over the whole box."""
    y, u = planted(noise=1.0)
    region = posterior_cells.whole_box(BOX)
    for _ in range(6):
        cells = posterior_cells.make_cells(region, BOX)
        grid = posterior(y, u[:1], [cells])
        region = posterior_region.gather(grid, 0, BOX)
    dense_cells = posterior_cells.make_cells(
        posterior_cells.Region(0.75, 0.375, 0.75 / 4, 0.375 / 4, 0.0), BOX, 60
    )
    dense = posterior(y, u[:1], [dense_cells])
    for x, dense_x in ((cells.tau, dense_cells.tau), (cells.dead_time, dense_cells.dead_time)):
        got = weighted_quantiles.quantiles(x, fopdt_posterior.marginal(grid, 0))
        want = weighted_quantiles.quantiles(dense_x, fopdt_posterior.marginal(dense, 0))
        width = want.high - want.low
        assert np.allclose(got, want, atol=0.12 * width)


def test_three_inputs_are_a_wrong_call():
    """The joint grid is made for one or two inputs."""
    cells = posterior_cells.make_cells(posterior_cells.whole_box(BOX), BOX, 2)
    with pytest.raises(ValueError, match="one or two"):
        fopdt_posterior.evaluate(
            fopdt_posterior.moments(
                fopdt_posterior.products(np.random.default_rng(0).normal(size=(13, 40)), np.ones((1, 40))),
                3,
                40,
            ),
            [np.ones((4, 4))] * 3,
            [cells] * 3,
        )
