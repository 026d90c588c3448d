"""Frames of a simulated drive: message periods, radar noise, the DBC's resolution."""

from __future__ import annotations

import heapq
import json
import math
from collections.abc import Iterator

import numpy as np

from canid.models.simulation.following import Simulation
from canid.signals.samples import lead, report_noise
from canid.signals.vehicle import Vehicle, encoder
from canid.signals.vehicle.mapping import carried
from canid.values.types import NAN, Array, Frame

# s since the epoch; Monday, 5 January 2026, 08:00 UTC: any fixed time, so that a seed gives the same bytes
START_UTC = 1767600000.0
# s; where a DBC gives no cycle time: radars report at 20 Hz, control messages come at 50 Hz
_RADAR_PERIOD, _PERIOD = 0.05, 0.02
# Share of a period by which a frame is late: it waits for others on the bus, some 0.2 ms at 500 kbit/s
_JITTER = 0.01
_SWITCHES = {"brake", "cruise_active", "clutch", "lead_valid", "gear"}
_LEAD = {"gap", "range_rate", "lead_speed", "headway"}


def frames(simulation: Simulation, vehicle: Vehicle, *, radar_noise: bool = True) -> list[Frame]:
    """Encode a simulated drive.

    Args:
        simulation: from `simulate`.
        vehicle: which messages, with what periods, resolutions and noise of the radar.
        radar_noise: False leaves gap and range rate exact up to the DBC's resolution.

    Returns:
        Frames in the order of their times, the first one at t = 0. The same drive gives the same frames.

    Example:
        >>> from canid.models.simulation import simulate
        >>> from canid.signals.vehicle import read_vehicle
        >>> drive = frames(simulate(minutes=0.1, seed=1), read_vehicle("generic"))
        >>> drive[0].t, len({frame.id for frame in drive})
        (0.0, 7)
    """
    columns = simulation.columns
    encode = encoder(vehicle)
    duration = float(columns["t"][-1])
    streams, prepared = [], {}
    for index, message in enumerate(vehicle.messages):
        tracked = any(track.message == message.name for track in vehicle.lead.tracks or ())
        roles = [
            r.role
            for r in carried(vehicle.roles.values())
            if (r.message, r.bus) == (message.name, message.bus)
        ]
        roles += ["gap", "range_rate", "lead_valid"] if tracked else []
        usual = _RADAR_PERIOD if {"gap", "gap.headway"} & {*roles} else _PERIOD
        period = usual if math.isnan(message.period) else message.period
        rng = np.random.default_rng([simulation.seed, 100 + index])
        t = _times(period, duration, index, rng)
        values = {role: _sensed(role, t, simulation) for role in roles if _column(role) in columns}
        if radar_noise:
            for role, sd in zip(("gap", "range_rate"), radar_noise_of(vehicle), strict=True):
                if role in values:
                    values[role] = values[role] + sd * rng.standard_normal(len(t))
        prepared[index] = (message.name, {role: column.tolist() for role, column in values.items()})
        streams.append([(time, index, k) for k, time in enumerate(t.tolist())])

    def made() -> Iterator[Frame]:
        for time, index, k in heapq.merge(*streams):
            name, values = prepared[index]
            yield from encode(time, {role: column[k] for role, column in values.items()}, {name: k})

    return list(made())


def radar_noise_of(vehicle: Vehicle) -> report_noise.Noise:
    """Return the standard deviations of the reports, as stated or as usual: m, m/s."""
    return report_noise.noise(report_noise.State(), lead.stated_noise(vehicle))


def truth_text(simulation: Simulation, vehicle: Vehicle) -> str:
    """Return the truth that goes with a log: JSON, the same bytes for the same drive.

    Example:
        >>> from canid.models.simulation import simulate
        >>> from canid.signals.vehicle import read_vehicle
        >>> text = truth_text(simulate(minutes=0.1, seed=1), read_vehicle("generic"))
        >>> json.loads(text)["vehicle"]
        'Generic car-following vehicle'
    """
    radar = dict(zip(("gap_sd", "range_rate_sd"), radar_noise_of(vehicle), strict=True))
    facts = {"vehicle": vehicle.name, **simulation.truth, "radar_noise": radar}
    return json.dumps(facts, indent=2, allow_nan=False) + "\n"


def _times(period: float, duration: float, index: int, rng: np.random.Generator) -> Array:
    """Draw when a message is sent: (n,) s, in whole ns as logs keep them. The first message starts at 0."""
    n = int((duration - period) / period)
    phase = 0.0 if index == 0 else rng.uniform(0, 1)
    late = rng.uniform(0, _JITTER, n)
    if index == 0:
        late[0] = 0.0
    times: Array = np.round((np.arange(n) + phase + late) * period * 1e9) * 1e-9
    return times


def _column(role: str) -> str:
    """The column of a role, or of a part of one: "speed.1" is a speed, "gap.headway" a headway."""
    whole, _, part = role.partition(".")
    return part if part and not part.isdigit() else whole


def _sensed(role: str, t: Array, simulation: Simulation) -> Array:
    """Sample a role at the times (n,) of its message; NaN where the radar has no target."""
    role = _column(role)
    column = simulation.measured.get(role, simulation.columns[role])
    grid = simulation.columns["t"]
    latest = np.minimum((t / simulation.dt + 1e-6).astype(int), len(grid) - 1)
    if role in _SWITCHES:
        state: Array = column[latest]
        return state
    value: Array = np.interp(t, grid, column)
    if role in _LEAD:
        value = np.where(simulation.columns["lead_valid"][latest] == 1.0, value, NAN)
    return value
