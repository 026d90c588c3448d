"""The driver within an FMU: what an FMI 3 tool steps. This file is copied into the FMU and imports nothing of canid.

Each input passes K e^(-θs) / (τs + 1), exactly for inputs that are held during a step; the sum above `level` is the output.
`driver.json` next to it, which `driver_fmu` writes, holds the values.
"""

from __future__ import annotations

import json
import math
from collections import deque
from pathlib import Path
from typing import Any

from pythonfmu3 import Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability, Unit

PARAMETERS_FILE = "driver.json"


class Lag:
    """What one input passes: gain, lag and dead time. The attributes are the FMU's parameters."""

    def __init__(self, K: float, tau: float, dead_time: float) -> None:
        self.K, self.tau, self.dead_time = K, tau, dead_time
        self._state = 0.0
        # (time from which on, value) of the input, the oldest first; what was before the first is 0
        self._past: deque[tuple[float, float]] = deque()

    def step(self, t: float, dt: float, u: float) -> float:
        """The output at t + dt, of an input that is `u` from t on."""
        self._past.append((t, u))
        begin, end = t - self.dead_time, t + dt - self.dead_time
        now, value = begin, 0.0
        passed = 0
        for since, following in self._past:
            if since >= end:
                break
            if since > now:
                self._relax(value, since - now)
                now = since
            value = following
            passed += 1
        self._relax(value, end - now)
        # the last value that has arrived still holds
        for _ in range(passed - 1):
            self._past.popleft()
        return self.K * self._state

    def _relax(self, value: float, dt: float) -> None:
        held = math.exp(-dt / self.tau) if self.tau > 0.0 else 0.0
        self._state = held * self._state + (1.0 - held) * value


class CanidDriver(Fmi3Slave):  # type: ignore[misc]
    """The identified driver: inputs by their names, one output."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        read = json.loads((Path(self.resources) / PARAMETERS_FILE).read_text(encoding="utf-8"))
        self.description = read["description"]
        self.register_units([Unit(unit) for unit in read["units"]])
        time = Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous)
        self.time = 0.0
        self.register_variable(time)
        self._channels: dict[str, Lag] = {}
        for name, each in read["inputs"].items():
            setattr(self, name, 0.0)
            self._variable(name, Fmi3Causality.input, each["unit"], each["description"])
            parameters = each["parameters"]
            channel = Lag(*(parameters[field]["value"] for field in ("K", "tau", "dead_time")))
            self._channels[name] = channel
            setattr(self, f"{name}_model", channel)
            for field, parameter in parameters.items():
                self._variable(
                    f"{name}_model.{field}",
                    Fmi3Causality.parameter,
                    parameter["unit"],
                    parameter["description"],
                )
        self.level = 0.0
        self._variable("level", Fmi3Causality.parameter, read["unit"], "the output while all inputs are 0")
        self._output = read["output"]
        setattr(self, self._output, 0.0)
        self._variable(self._output, Fmi3Causality.output, read["unit"], "what the driver does")

    def _variable(self, name: str, causality: Any, unit: str, description: str) -> None:
        tunable = causality == Fmi3Causality.parameter
        self.register_variable(
            Float64(
                name, causality=causality, unit=unit, description=description,
                variability=Fmi3Variability.tunable if tunable else Fmi3Variability.continuous,
            )
        )  # fmt: skip

    def do_step(self, current_time: float, step_size: float) -> bool:
        """One step of the simulation, as FMI calls it."""
        parts = [
            channel.step(current_time, step_size, getattr(self, name))
            for name, channel in self._channels.items()
        ]
        setattr(self, self._output, self.level + sum(parts))
        self.time = current_time + step_size
        return True
