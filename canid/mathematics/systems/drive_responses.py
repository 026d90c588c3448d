"""Step and frequency responses of a whole drive: of every method that has a model of it, and as measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from canid.mathematics.estimators import pooling
from canid.mathematics.estimators.estimator import WholeDrive
from canid.mathematics.identification.armax.armax_batch import ArmaxFit
from canid.mathematics.identification.fopdt.grid_search import ProcessFit
from canid.mathematics.systems.driver_response import Response, armax_responses, fopdt_responses
from canid.mathematics.systems.measured_response import Measured, measured_responses
from canid.values.types import Trace


class DriveResponses(NamedTuple):
    """Of a whole drive; a method whose gains are not known has none."""

    methods: Mapping[str, Mapping[str, Response]] = {}  # estimator -> input name -> its answer
    measured: Mapping[str, Measured] = {}  # input name -> without a model

    def __repr__(self) -> str:
        return f"DriveResponses({', '.join(self.methods) or 'no method'}, {'measured' if self.measured else 'not measured'})"


def drive_responses(whole: Mapping[str, WholeDrive | None], trace: Trace) -> DriveResponses:
    """Make the responses of all methods.

    Args:
        whole: estimator -> its result.
        trace: that was identified.
    """
    rows = pooling.pooled(trace)
    methods = {}
    for name, identified in whole.items():
        if identified is None:
            continue
        if isinstance(identified.model, ProcessFit):
            made = fopdt_responses(identified.model, identified.channels, trace.dt, trace.latency)
        elif isinstance(identified.model, ArmaxFit):
            made = armax_responses(
                identified.model, identified.separate, identified.channels, rows.dt, trace.latency
            )
        else:
            made = {}
        if made:
            methods[name] = made
    return DriveResponses(methods, measured_responses(rows))
