"""An identified model as JSON and back: the key `model` of a diagnosis, and the file of `canid simulate --model`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from canid.values.identified_model import DRIVER, CarLaw, IdentifiedModel, NoiseLaw, stationary
from canid.values.text.model_equation import equation
from canid.values.types import Interval


def to_json(model: IdentifiedModel) -> dict[str, Any]:
    """The model as the key `model` of a diagnosis has it."""
    return {
        "equation": equation(model),
        "output": model.output,
        "form": model.form,
        "driver": dict(model.driver),
        "names": list(model.names),
        "covariance": [[float(x) for x in row] for row in model.covariance],
        "effects": {name: dict(values) for name, values in model.effects.items()},
        "noise": model.noise._asdict() | {"coefficients": list(model.noise.coefficients)},
        "car": None if model.car is None else model.car._asdict(),
        "driven": {role: interval._asdict() for role, interval in model.driven.items()},
    }


def from_json(values: Mapping[str, Any]) -> IdentifiedModel:
    """The model that `to_json` wrote.

    Raises:
        KeyError, TypeError, ValueError, AttributeError: it is not one.
    """
    names = tuple(str(name) for name in values["names"])
    covariance = np.array(values["covariance"], dtype=np.float64).reshape(len(names), len(names))
    car, noise = values["car"], values["noise"]
    model = IdentifiedModel(
        output=str(values["output"]),
        form=str(values["form"]),
        driver={name: _finite(values["driver"][name]) for name in DRIVER},
        covariance=covariance,
        names=names,
        effects={str(i): {str(p): _finite(x) for p, x in v.items()} for i, v in values["effects"].items()},
        noise=NoiseLaw(
            _positive(noise["step"]), tuple(map(_finite, noise["coefficients"])), _finite(noise["sd"])
        ),
        car=None if car is None else CarLaw(*(_finite(car[name]) for name in CarLaw._fields)),
        driven={
            str(role): Interval(*(_finite(x[k]) for k in Interval._fields))
            for role, x in values["driven"].items()
        },
    )
    equation(model)
    if not stationary(model.noise.coefficients):
        raise ValueError("its noise grows without bound")
    return model


def _finite(x: Any) -> float:
    if not math.isfinite(value := float(x)):
        raise ValueError(f"{x} is not a number")
    return value


def _positive(x: Any) -> float:
    if not (value := _finite(x)) > 0:
        raise ValueError(f"{x} is not above 0")
    return value
