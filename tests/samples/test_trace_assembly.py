"""A trace is the same however the samples were cut into parts, also where a part lacks what another has."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from canid.signals.samples import trace_assembly
from canid.values.types import Driver, LearnGate, Sample, Trace

WIDTH = 3


@st.composite
def samples(draw: st.DrawFn) -> list[Sample]:
    """Samples of a drive: the radar, and with it the variances, come and go."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    seen = [
        kind
        for kind, n in draw(st.lists(st.tuples(st.integers(0, 2), st.integers(1, 9)), min_size=1))
        for _ in range(n)
    ]
    return [
        Sample(
            0.1 * k,
            *(float(rng.normal()), tuple(rng.normal(size=WIDTH - 1).tolist())),
            LearnGate.OPEN if kind else LearnGate.NO_LEAD,
            bool(kind),
            int(rng.integers(3)),
            {"speed": float(rng.normal())} | ({"gap": float(rng.normal())} if kind else {}),
            variance=tuple(rng.random(WIDTH).tolist()) if kind == 2 else (),
        )
        for k, kind in enumerate(seen)
    ]


def same(a: Trace, b: Trace) -> None:
    for name, ours, theirs in zip(a._fields, a, b, strict=True):
        if isinstance(ours, dict):
            assert list(ours) == list(theirs)
            pairs = [(ours[role], theirs[role]) for role in ours]
        else:
            pairs = [(ours, theirs)]
        for x, y in pairs:
            if isinstance(x, np.ndarray):
                np.testing.assert_array_equal(x, y, err_msg=name)
            else:
                assert x == y, name


@given(samples(), st.data())
def test_cuts_change_nothing(drive: list[Sample], data: st.DataObject) -> None:
    """Parts of any lengths, empty ones as well."""
    cuts = sorted(data.draw(st.lists(st.integers(0, len(drive)), max_size=6)))
    parts = [drive[a:b] for a, b in zip([0, *cuts], [*cuts, len(drive)], strict=True)]
    whole = trace_assembly.trace(drive, Driver(), 0.1)
    same(trace_assembly.joined([trace_assembly.trace(part, Driver(), 0.1) for part in parts]), whole)


def test_a_radar_that_begins_late_keeps_its_variances() -> None:
    """A first part without a target takes nothing from those after it."""
    far = Sample(0.0, 1.0, (np.nan, np.nan), LearnGate.NO_LEAD, False, 0, {})
    near = far._replace(t=0.1, inputs=(1.0, 2.0), variance=(0.1, 0.2, 0.3))
    parts = [trace_assembly.trace([sample], Driver(), 0.1) for sample in (far, near)]
    assert trace_assembly.joined(parts).variance[1] == pytest.approx([0.1, 0.2, 0.3])
