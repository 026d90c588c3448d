"""Innovations with heavy tails: Student's t instead of a Gaussian (Lange, Little & Taylor 1989)."""

from __future__ import annotations

from canid.effects.effect import DriveFeatures, Effect, Kind, Parameter, Remnant
from canid.types import Interval

# With 10 degrees of freedom the kurtosis is 4. A Gaussian whose scale varies by some tens of percent for reasons that
# nobody measures has as much: those are not the tails of a person, who has 3 to 8.
MAX_FREEDOM = 10.0


def surely_heavy(freedom: Interval, features: DriveFeatures) -> bool:
    """Are there surely fewer degrees of freedom than a Gaussian of slowly varying scale seems to have?

    Example:
        >>> surely_heavy(Interval(4.0, 3.2, 5.5), DriveFeatures()), surely_heavy(Interval(9.0, 7.0, 14.0), DriveFeatures())
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
    source="AstaZero platoons of OpenACC (Makridis et al. 2021): 3 to 8 degrees of freedom on four of four drives",
    decides="a longer drive",
    remnant=Remnant(heavy_tailed=True),
    unusual=surely_heavy,
    found_at=((3.0,), (4.5,)),
    silent_at=((60.0,),),
)
