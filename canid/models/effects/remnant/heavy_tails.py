"""Innovations with heavy tails: Student's t instead of a Gaussian (Lange, Little & Taylor 1989)."""

from __future__ import annotations

from canid.models.effects.effect import DriveFeatures, Effect, Kind, Parameter, Remnant
from canid.values.types import Interval

# With 12 degrees of freedom the kurtosis is 3.75. A Gaussian whose scale varies for reasons that nobody measures has as
# much: on simulated drives of state-dependent noise 13 to 21 degrees of freedom were fitted, on drives of people 6 to 9.
MAX_FREEDOM = 12.0


def surely_heavy(freedom: Interval, features: DriveFeatures) -> bool:
    """Whether there are surely fewer degrees of freedom than a Gaussian of varying scale seems to have.

    Example:
        >>> surely_heavy(Interval(4.0, 3.2, 5.5), DriveFeatures()), surely_heavy(Interval(14.0, 11.0, 18.0), DriveFeatures())
        (True, False)
    """
    return freedom.high < MAX_FREEDOM


EFFECT = Effect(
    id="heavy_tails",
    says="The driver's noise has heavy tails: Student's t with {freedom} degrees of freedom.",
    where="remnant",
    kind=Kind.REMNANT,
    parameters=(Parameter("freedom", "1", 2.08, 200.0, (10.0,), 4.0),),
    needs=(),
    source="AstaZero platoons of OpenACC (Makridis et al. 2021): 6 to 9 degrees of freedom on four of four drives",
    decides="a longer drive",
    remnant=Remnant(heavy_tailed=True),
    unusual=surely_heavy,
    found_at=((3.0,), (4.5,)),
    silent_at=((60.0,),),
)
