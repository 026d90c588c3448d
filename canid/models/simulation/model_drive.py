"""An identified model in closed loop behind a lead: that of a log, or a drawn one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from canid.mathematics.identification.closed_loop_stability import unstable_roots
from canid.models.effects import CATALOGUE, wanted_gap
from canid.models.effects.effect import Effect, Seen
from canid.models.effects.wanted_gap import Form
from canid.models.simulation import planted_effects, remnant
from canid.models.simulation.car import Car
from canid.models.simulation.driver import DriverTruth
from canid.models.simulation.following import DT, Simulation, close_loop, further_signals
from canid.models.simulation.leads import LEADS, speed_profile
from canid.signals.signal_checks.drive_time import behind_a_lead
from canid.values.errors import ConfigError
from canid.values.identified_model import IdentifiedModel, NoiseLaw
from canid.values.runs import runs
from canid.values.text.model_json import to_json
from canid.values.types import NAN, Array, Trace

# s; in a shorter stretch gap and speed hardly leave their initial values
MIN_STRETCH_S = 12.0
# a car that does what it is asked for at once: of a driver whose output is the acceleration
OBEDIENT = Car(power=1.0, brake=1.0, lag=1e-6, rolling=0.0, drag=0.0)


class Lead(NamedTuple):
    """A lead, and how the driver behind it begins."""

    speed: Array  # (n,) m/s at 100 Hz
    gap: float  # m
    own_speed: float  # m/s


class ModelRun(NamedTuple):
    """A model's drive on the grid of a trace, NaN where it does not follow a lead: (n,) each."""

    t: Array  # s
    output: Array  # output unit
    speed: Array  # m/s
    gap: Array  # m
    range_rate: Array  # m/s


def simulate_model(model: IdentifiedModel, trace: Trace, *, noise: bool = False, seed: int = 1) -> ModelRun:
    """Drive an identified model in closed loop behind the lead of another drive.

    Each stretch behind one and the same vehicle begins from the measured gap and speed.

    Args:
        model: from `read_model`, or `diagnose(...).model`.
        trace: of the drive with the lead.
        noise: with the driver's noise; else the mean law alone.
        seed: of noise and of effects that happen at random.

    Returns:
        (n,) columns on the trace's grid.

    Raises:
        ConfigError: an effect of the model is not in the catalogue.

    Example:
        >>> import canid
        >>> trace = canid.read_trace("replay_logs/following_urban.blf", "generic")
        >>> model = canid.diagnose(trace).model
        >>> run = canid.simulate_model(model, trace)
        >>> bool(np.nanstd(run.gap - trace.signals["gap"]) < np.nanstd(trace.signals["gap"]))
        True
    """
    out = ModelRun(trace.t, *(np.full(trace.t.size, NAN) for _ in range(4)))
    for start, stop in stretches(trace):
        columns = drive(model, lead_of(trace, start, stop), seed, noise=noise).columns
        at = trace.t[start:stop] - trace.t[start]
        for role, column in zip((model.output, "speed", "gap", "range_rate"), out[1:], strict=True):
            column[start:stop] = np.interp(at, columns["t"], columns[role])
    return out


def stretches(trace: Trace) -> list[tuple[int, int]]:
    """Runs of samples behind one vehicle, of MIN_STRETCH_S and more, as [start, stop)."""
    known = behind_a_lead(trace.gate)
    for role in ("gap", "range_rate", "speed"):
        known = known & np.isfinite(trace.signals.get(role, np.full(trace.t.size, NAN)))
    pieces = []
    for start, stop in runs(known):
        cuts = 1 + start + np.flatnonzero(np.diff(trace.segment[start:stop]))
        pieces += list(zip([start, *cuts.tolist()], [*cuts.tolist(), stop], strict=True))
    return [(start, stop) for start, stop in pieces if (stop - start) * trace.dt >= MIN_STRETCH_S]


def longest_lead(trace: Trace) -> Lead:
    """Return the lead that the drive follows longest without a break.

    Raises:
        ConfigError: none for MIN_STRETCH_S.
    """
    pieces = stretches(trace)
    if not pieces:
        raise ConfigError(f"no vehicle ahead for {MIN_STRETCH_S:g} s without a break: choose another log")
    return lead_of(trace, *max(pieces, key=lambda piece: piece[1] - piece[0]))


def lead_of(trace: Trace, start: int, stop: int) -> Lead:
    """Return the lead of the samples [start, stop)."""
    speed, rate, gap = (trace.signals[role][start:stop] for role in ("speed", "range_rate", "gap"))
    t = trace.t[start:stop] - trace.t[start]
    fine = np.arange(round(t[-1] / DT) + 1) * DT
    return Lead(np.maximum(np.interp(fine, t, speed + rate), 0.0), float(gap[0]), float(speed[0]))


def unstable(model: IdentifiedModel) -> bool:
    """Do gap and speed run away behind a lead that keeps its speed, about what was mostly driven?

    The car's lag counts as dead time: a little pessimistic.

    Example:
        >>> from canid.values.identified_model import DRIVER
        >>> from canid.values.types import Interval
        >>> person = dict(zip(DRIVER, (0.1, -0.05, 0.4, 0.5, 0.5, 0.8, 0.6, 1.9, 0.0, 0.0)))
        >>> driven = {"speed": Interval(20.0), "headway": Interval(1.9)}
        >>> noise = NoiseLaw(0.1, (), 0.1)
        >>> unstable(IdentifiedModel("accel", "time_headway", person, np.zeros((10, 10)), (), {}, noise, None, driven))
        True
    """
    driver, car = model.driver, model.car
    strength, lag = (1.0, 0.0) if car is None else (car.strength, car.lag)
    gains = strength * np.array([[driver["K1"], driver["K2"]]])
    delays = np.array([[driver["dead_time1"] + lag, driver["dead_time2"] + lag]])
    lags = np.array([[driver["tau1"], driver["tau2"]]])
    speed, headway = (model.driven[role].value for role in ("speed", "headway"))
    return bool(unstable_roots(gains, lags, delays, speed, headway)[0] > 0)


def drawn_lead(model: IdentifiedModel, profile: str, minutes: float, seed: int) -> Lead:
    """Draw a lead, and begin behind it at the wanted headway."""
    rng = np.random.default_rng([seed, 1])
    speed = speed_profile(LEADS[profile], round(minutes * 60 / DT), DT, rng)
    first = float(speed[0])
    return Lead(speed, model.driver["headway_desired"] * first, first)


def drive(
    model: IdentifiedModel,
    lead: Lead,
    seed: int = 1,
    *,
    noise: bool = True,
    catalogue: tuple[Effect, ...] = CATALOGUE,
) -> Simulation:
    """Drive a model behind one lead.

    Args:
        model: of driver and car.
        lead: speed, and where the driver begins.
        seed: of noise and of effects that happen at random.
        noise: with the driver's noise.
        catalogue: effects that the model may name.

    Raises:
        ConfigError: an effect of the model is not among them.
    """
    n = lead.speed.size
    car = OBEDIENT
    if model.car is not None:
        strength, lag, rolling, drag, brake = model.car
        car = Car(power=strength, brake=brake, lag=lag, rolling=rolling, drag=drag)
    planted = planted_effects.plant(
        _strengths(model, catalogue),
        n * DT,
        float(lead.speed.mean()),
        car.hold(float(lead.speed.mean())),
        np.random.default_rng([seed, 9]),
        catalogue,
    )
    bursts = [
        (placement.effect.remnant, placement.params)
        for placement in planted.of("remnant")
        if placement.effect.remnant
    ]
    law = model.noise if noise else NoiseLaw(model.noise.step, (), 0.0)
    driver = model.driver
    truth = DriverTruth(
        driver["K1"], driver["tau1"], driver["dead_time1"], driver["K2"], driver["tau2"], driver["dead_time2"],
        driver["headway_desired"], driver["offset"], law.sd,
    )  # fmt: skip
    stepwise = remnant.stepper(law, n, DT, np.random.default_rng([seed, 8]), bursts)
    level = np.zeros(n)
    begin = lead.gap, lead.own_speed
    form = Form(model.form)

    def away(seen: Seen) -> float:
        return float(
            wanted_gap.error(
                form, driver["headway_desired"], driver["standstill"], driver["free_speed"], seen
            )
        )

    error = None if form is Form.TIME_HEADWAY else away
    columns = close_loop(lead.speed, level, level, truth, car, planted, stepwise, begin=begin, error=error)
    columns |= further_signals(columns, level, np.random.default_rng([seed, 3]))
    columns["lead_valid"] = np.ones(n)
    if model.car is None:
        # who asks for an acceleration has no pedal and no brake switch
        columns["accel"] = columns["demand"]
        columns["brake"] = np.zeros(n)
        del columns["pedal"]
    truths = {
        "task": "car_following",
        "channels": {
            "headway_error": {"K": driver["K1"], "tau": driver["tau1"], "dead_time": driver["dead_time1"]},
            "range_rate": {"K": driver["K2"], "tau": driver["tau2"], "dead_time": driver["dead_time2"]},
        },
        "headway_desired": driver["headway_desired"],
        "offset": driver["offset"],
        "noise": law._asdict() | {"coefficients": list(law.coefficients)},
        "seed": seed,
        "minutes": n * DT / 60,
        "car": car._asdict(),
        "hidden": planted.truth or None,
        "model": to_json(model),
    }
    return Simulation(DT, columns, truths, seed)


def _strengths(model: IdentifiedModel, catalogue: tuple[Effect, ...]) -> dict[str, tuple[float, ...]]:
    by_id = {effect.id: effect for effect in catalogue}
    out = {}
    for name, values in model.effects.items():
        if name not in by_id or set(values) != {p.name for p in by_id[name].parameters}:
            raise ConfigError(
                f"effect {name!r} of the model is not one of this canid's: diagnose the log again"
            )
        out[name] = tuple(values[p.name] for p in by_id[name].parameters)
    return out
