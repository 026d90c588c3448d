"""Preview of the road's curvature: the driver steers into a curve before the car is in it (MacAdam 1980; Donges 1978)."""

from __future__ import annotations

from collections.abc import Callable

from canid.models.effects.effect import Effect, Kind, LaneHooks, Parameter, Params, Value

# s; of a curve that is nearer the lateral offset and its rate show as much, and a lag that the model has not looks like it
MIN_AHEAD_S = 0.2


def act(p: Params, road: Callable[[float], Value]) -> Value:
    """Return the angle that is added to the demand, °.

    Example:
        >>> act((2.0, 0.5), lambda ahead: 1e-3 * ahead)
        1.0
    """
    return 1e3 * p[0] * road(p[1])


EFFECT = Effect(
    id="curvature_preview",
    says="The driver steers {gain} °·km of the curvature that the car reaches {ahead} s later.",
    where="driver",
    kind=Kind.PARAMETRIC,
    parameters=(
        Parameter("gain", "°·km", -10.0, 10.0, (1.0,), 1.0),
        Parameter("ahead", "s", MIN_AHEAD_S, 4.0, (0.5, 1.2, 2.0), 1.0),
    ),
    needs=("curvature",),
    source="Donges 1978; MacAdam 1980",
    decides="a road with curves, and a camera or map that measures their curvature",
    lane=LaneHooks(curvature=act),
    found_at=((1.5, 1.0), (2.0, 0.6)),
    silent_at=((0.02, 0.8),),
)
