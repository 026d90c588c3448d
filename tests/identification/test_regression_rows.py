"""Rows are the same however the samples come, and what they cannot know they do not say."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.mathematics.identification.fopdt import reduced_basis, regression_rows
from tests.exact import exact
from tests.identification.first_order_response import response

BASIS = reduced_basis.basis(reduced_basis.Box(reduced_basis.TAU_MIN, 3.0, 1.5))
SETTLE = 4.5


def stream(seed, n, dt, holes=(), cuts=()):
    """(n, 5) samples of two inputs; holes (start, length) in the inputs, segments that begin at cuts."""
    rng = np.random.default_rng(seed)
    u = np.column_stack([np.cumsum(rng.normal(size=n)) * 0.05 for _ in range(2)])
    for start, length in holes:
        u[start : start + length] = math.nan
    segment = np.searchsorted(sorted(cuts), np.arange(n), side="right")
    return np.column_stack([rng.normal(size=n), rng.random(n) > 0.1, segment, u])


holes = st.lists(st.tuples(st.integers(0, 480), st.integers(1, 30)), max_size=5)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 99),
    dt=st.sampled_from([0.1, 0.05, 0.02]),
    holes=holes,
    cuts=st.lists(st.integers(1, 499), max_size=3, unique=True),
    pieces=st.lists(st.integers(1, 90), min_size=1, max_size=60),
)
def test_a_stream_in_pieces_gives_the_rows_of_the_whole_at_every_prefix(seed, dt, holes, cuts, pieces):
    """Gaps, breaks and cuts anywhere: the rows of a prefix are the first rows of the whole, to rounding."""
    layout, samples = regression_rows.make_layout(BASIS, 2, dt), stream(seed, 500, dt, holes, cuts)
    _, whole = regression_rows.put(layout, regression_rows.State(), samples, SETTLE)
    state, made, at = regression_rows.State(), np.zeros((0, layout.width)), 0
    for k in [*pieces, 500]:
        state, more = regression_rows.put(layout, state, samples[at : at + k], SETTLE)
        made, at = np.concatenate([made, more]), min(at + k, 500)
        n = min(len(made), len(whole))
        assert np.array_equal(made[:n, 1], whole[:n, 1])
        good = made[:n, 1] > 0
        assert np.allclose(made[:n][good], whole[:n][good], rtol=0, atol=1e-9)
    assert len(made) == len(whole)


@pytest.mark.long("many fits")
@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    dt=st.sampled_from([0.1, 0.05, 0.02]),
    holes=holes,
    cuts=st.lists(st.integers(1, 499), max_size=3, unique=True),
    pieces=st.lists(st.integers(1, 64), min_size=1, max_size=60),
)
def test_what_is_made_of_a_prefix_does_not_depend_on_its_pieces(seed, dt, holes, cuts, pieces):
    """To the last bit, of the state as well: live, rows are made at every estimate, of a recorded drive every 64 samples."""
    layout, samples = regression_rows.make_layout(BASIS, 2, dt), stream(seed, 500, dt, holes, cuts)
    state, one, at = regression_rows.State(), regression_rows.State(), 0
    for k in pieces:
        state, together = regression_rows.put(layout, state, samples[at : at + k], SETTLE)
        parts = [np.zeros((0, layout.width))]
        for row in samples[at : at + k]:
            one, more = regression_rows.put(layout, one, row[None], SETTLE)
            parts.append(more)
        at += k
        np.testing.assert_array_equal(together, np.concatenate(parts))
        assert exact(state) == exact(one)


def test_rows_hold_the_exact_answers():
    """At 10 Hz each node's column is first_order.response; at 100 Hz the mean of ten of its samples."""
    for dt, per in ((0.1, 1), (0.01, 10)):
        layout, samples = regression_rows.make_layout(BASIS, 2, dt), stream(3, 900, dt)
        samples[:, 1] = 1.0
        _, made = regression_rows.put(layout, regression_rows.State(), samples, SETTLE)
        for i, j in ((0, 3), (1, 17)):
            truth = response(samples[:, 3 + i], dt, BASIS.tau[j], BASIS.dead_time[j]).x
            good = made[:, 1] > 0
            column = made[:, 4 + i * BASIS.size + j]
            assert good.sum() > 20
            assert np.allclose(column[good], truth.reshape(-1, per).mean(axis=1)[good], atol=1e-9)


def test_a_short_gap_is_bridged_and_a_long_one_begins_anew():
    """0.5 s of missing inputs cost their own rows; 0.7 s cost the settling time as well."""
    layout = regression_rows.make_layout(BASIS, 2, 0.1)
    for length, cost in ((5, 5), (7, 7 + 45)):
        samples = stream(1, 400, 0.1, holes=[(200, length)])
        samples[:, 1] = 1.0
        _, made = regression_rows.put(layout, regression_rows.State(), samples, SETTLE)
        assert made[:, 1].sum() == 400 - 45 - cost


def test_a_new_segment_begins_anew():
    """Another lead has another past."""
    layout = regression_rows.make_layout(BASIS, 2, 0.1)
    samples = stream(1, 400, 0.1, cuts=[200])
    samples[:, 1] = 1.0
    other = samples.copy()
    other[:200, 3:] += 50.0
    _, a = regression_rows.put(layout, regression_rows.State(), samples, SETTLE)
    _, b = regression_rows.put(layout, regression_rows.State(), other, SETTLE)
    assert a[:, 1].sum() == 400 - 90
    assert np.array_equal(a[245:], b[245:])


def test_nothing_later_than_a_row_enters_it():
    """Whatever comes after, a row that was made stays as it is: the loop's future must not get into an input."""
    layout = regression_rows.make_layout(BASIS, 2, 0.05)
    samples = stream(2, 600, 0.05)
    other = samples.copy()
    other[301:, 3:] += 10.0
    _, a = regression_rows.put(layout, regression_rows.State(), samples, SETTLE)
    _, b = regression_rows.put(layout, regression_rows.State(), other, SETTLE)
    assert np.array_equal(a[:150], b[:150], equal_nan=True)
    assert not np.array_equal(a[152:], b[152:], equal_nan=True)
