"""Which difference from `identify` a cause explains, by how sure the diagnosis is of it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from canid.mathematics.estimators import whole_drive
from canid.mathematics.estimators.estimator import WholeDrive
from canid.models.diagnosis import diagnose
from canid.values.types import Channel, Identifiable, Interval

NAME = "range_rate"
WITH, WITHOUT = (
    {NAME: Channel(Interval(K, K - 0.5, K + 0.5), status=Identifiable.GAIN_ONLY)} for K in (5.0, 2.5)
)


class _Report(SimpleNamespace):
    def _replace(self, **changed: Any) -> _Report:
        return _Report(**{**vars(self), **changed})


@pytest.mark.parametrize(
    ("rivals", "surrogate", "quoted"), [((), False, True), (("pedal_map",), False, False), ((), True, False)]
)
def test_only_a_cause_that_is_certain_explains_a_difference(
    monkeypatch: pytest.MonkeyPatch, rivals: tuple[str, ...], surrogate: bool, quoted: bool
) -> None:
    """Each cause moves the gain by another amount: with rivals, nobody knows by how much."""
    monkeypatch.setattr(whole_drive, "estimates", lambda *_: {"fopdt": WholeDrive(WITHOUT)})
    monkeypatch.setattr(diagnose, "fitted_trace", lambda trace: trace)
    monkeypatch.setattr(diagnose.output_stamps, "standing", lambda _: ())
    cause = SimpleNamespace(where="driver", rivals=rivals, surrogate=surrogate)
    baseline, extended = (_Report(channels=channels) for channels in (WITHOUT, WITH))
    report: Any = _Report(findings=(cause,), baseline=baseline, extended=extended)
    trace: Any = _Report(latency=None)
    made = diagnose._arbitrated(report, [trace], {})
    assert (made.extended.channels[NAME].status is Identifiable.GAIN_ONLY) is quoted
    assert bool(made.without_causes) is quoted
    assert bool(made.contradictions) is not quoted
