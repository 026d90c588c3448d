"""Noise that comes in bursts: its scale follows the innovations of the last seconds (volatility clustering: Engle 1982)."""

from __future__ import annotations

from canid.models.effects.effect import DriveFeatures, Effect, Kind, Parameter, Remnant, ScaleFeature
from canid.values.types import Interval


def surely_rising(slope: Interval, features: DriveFeatures) -> bool:
    """Does the scale surely rise after large innovations? A burst never makes the next seconds calmer.

    Example:
        >>> surely_rising(Interval(-0.06, -0.08, -0.04), DriveFeatures())
        False
    """
    return slope.low > 0


EFFECT = Effect(
    id="clustered_scale",
    says="The driver's noise comes in bursts: log sd changes by {slope} per standard deviation of the log size of the "
    "innovations of the last 4 s.",
    where="remnant",
    kind=Kind.REMNANT,
    parameters=(Parameter("slope", "1", -1.5, 1.5, (0.0,), 0.15),),
    needs=(),
    source="AstaZero platoons of OpenACC (Makridis et al. 2021): positive on four of four drives",
    decides="a longer drive",
    remnant=Remnant(scale=(ScaleFeature.PAST_INNOVATIONS,)),
    unusual=surely_rising,
    found_at=((0.2,), (0.15,)),
    silent_at=((0.005,),),
)
