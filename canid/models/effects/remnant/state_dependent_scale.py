"""Noise whose scale follows own and lead acceleration (multiplicative heteroscedasticity: Harvey 1976)."""

from __future__ import annotations

from canid.models.effects.effect import Effect, Kind, Parameter, Remnant, ScaleFeature

EFFECT = Effect(
    id="state_dependent_scale",
    says="The scale of the driver's noise follows the absolute acceleration: log sd changes by {own} per standard deviation "
    "of the own one, and by {lead} per standard deviation of the lead's.",
    where="remnant",
    kind=Kind.REMNANT,
    parameters=(
        Parameter("own", "1", -1.5, 1.5, (0.0,), 0.3),
        Parameter("lead", "1", -1.5, 1.5, (0.0,), 0.3),
    ),
    needs=("gap", "range_rate", "speed"),
    source="AstaZero platoons of OpenACC (Makridis et al. 2021): log variance rises by 0.2 to 0.7 per sd of the own one",
    decides="a longer drive behind a lead that accelerates and brakes",
    remnant=Remnant(scale=(ScaleFeature.OWN_ACCELERATION, ScaleFeature.LEAD_ACCELERATION)),
    # either of the two slopes may be the one that is not 0: the evidence decides
    unusual=lambda estimate, features: True,
    found_at=((0.35, 0.15), (0.25, 0.25)),
    silent_at=((0.01, 0.01),),
)
