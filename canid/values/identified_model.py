"""A driver, and the car, as one drive identified them: all that a simulation of another drive needs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from canid.values.numbers import number
from canid.values.types import Array, Interval

# of the driver: u = offset + K1 L1[error] + K2 L2[range_rate] + noise; what the error is depends on the form
DRIVER = (
    "offset", "K1", "K2", "tau1", "tau2", "dead_time1", "dead_time2", "headway_desired", "standstill", "free_speed",
)  # fmt: skip


class NoiseLaw(NamedTuple):
    """n(t) = Σ coefficients[i] n(t − (i + 1) step) + sd e(t), e white with variance 1."""

    step: float  # s
    coefficients: tuple[float, ...]
    sd: float  # output unit


class CarLaw(NamedTuple):
    """a = strength · lag[pedal] − brake · lag[demand below 0] − rolling − drag · speed²."""

    strength: float  # m/s² per %
    lag: float  # s
    rolling: float  # m/s²
    drag: float  # 1/m
    brake: float  # m/s² per % of demand below 0


class IdentifiedModel(NamedTuple):
    """The model of one driver in one car.

    Example:
        >>> person = dict(zip(DRIVER, (0.1, 0.05, 0.4, 0.5, 0.5, 0.8, 0.6, 1.9, 0.0, 0.0)))
        >>> noise = NoiseLaw(0.1, (0.9,), 0.1)
        >>> model = IdentifiedModel("accel", "time_headway", person, np.zeros((10, 10)), DRIVER, {}, noise, None, {})
        >>> equation(model)
        'accel = 0.1 + 0.05·L(0.5 s, 0.8 s)[headway − 1.9 s] + 0.4·L(0.5 s, 0.6 s)[range rate] + n'
    """

    output: str  # role: "pedal", "accel"
    form: str  # of the baseline: "time_headway", "gap", "free_speed"
    driver: Mapping[str, float]  # DRIVER; of standstill and free_speed those count that the form has
    covariance: Array  # (k, k) of `names`, 95 % intervals are those of a normal; 0 where a parameter was held
    names: tuple[str, ...]  # DRIVER, and "effect.parameter" of what was fitted with them
    effects: Mapping[str, Mapping[str, float]]  # id -> parameter -> value; of driver, vehicle and remnant
    noise: NoiseLaw
    car: CarLaw | None  # None: the output is the acceleration itself
    driven: Mapping[str, Interval]  # role -> median, and the 5 and 95 % points of what was driven


def equation(model: IdentifiedModel) -> str:
    """The driver's law in one line; L(τ, θ) is e^(−θs)/(1 + τs)."""
    text = {name: number(value) for name, value in model.driver.items()}
    T, s0, v0 = text["headway_desired"], text["standstill"], text["free_speed"]
    error = {
        "time_headway": f"headway − {T} s",
        "gap": f"(gap − {s0} m − {T} s · speed) / (20 m/s)",
        "free_speed": f"headway − ({T} s + {s0} m / speed) / √(1 − (speed / {v0} m/s)⁴)",
    }[model.form]
    line = (
        f"{model.output} = {text['offset']} + {text['K1']}·L({text['tau1']} s, {text['dead_time1']} s)[{error}] + "
        f"{text['K2']}·L({text['tau2']} s, {text['dead_time2']} s)[range rate] + n"
    ).replace("+ -", "− ")
    added = [
        f"{name} ({', '.join(f'{parameter} {number(value)}' for parameter, value in values.items())})"
        for name, values in model.effects.items()
    ]
    return line + (f", with {', '.join(added)}" if added else "")


# --- as JSON -----------------------------------------------------------------------------------------------


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


def stationary(coefficients: Sequence[float]) -> bool:
    """Are all poles of an autoregressive noise inside the unit circle?

    Example:
        >>> stationary((0.9,)), stationary((1.2, -0.1)), stationary(())
        (True, False, True)
    """
    return not len(coefficients) or bool(np.all(np.abs(np.roots([1.0, *(-x for x in coefficients)])) < 1.0))


def _finite(x: Any) -> float:
    if not math.isfinite(value := float(x)):
        raise ValueError(f"{x} is not a number")
    return value


def _positive(x: Any) -> float:
    if not (value := _finite(x)) > 0:
        raise ValueError(f"{x} is not above 0")
    return value
