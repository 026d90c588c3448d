"""The equation of an identified driver, in one line."""

from __future__ import annotations

from canid.values.identified_model import IdentifiedModel
from canid.values.text.numbers import number


def equation(model: IdentifiedModel) -> str:
    """The driver's law in one line; L(τ, θ) is e^(−θs)/(1 + τs).

    Example:
        >>> import numpy as np
        >>> from canid.values.identified_model import DRIVER, NoiseLaw
        >>> person = dict(zip(DRIVER, (0.1, 0.05, 0.4, 0.5, 0.5, 0.8, 0.6, 1.9, 0.0, 0.0)))
        >>> noise = NoiseLaw(0.1, (0.9,), 0.1)
        >>> model = IdentifiedModel("accel", "time_headway", person, np.zeros((10, 10)), DRIVER, {}, noise, None, {})
        >>> equation(model)
        'accel = 0.1 + 0.05·L(0.5 s, 0.8 s)[headway − 1.9 s] + 0.4·L(0.5 s, 0.6 s)[range rate] + n'
    """
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
