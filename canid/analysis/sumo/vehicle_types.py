"""Drivers as SUMO vehicle types: the text of an additional file, with one `vType` per driver and a distribution over all.

Attributes and their units are those of SUMO 1.28 (its `data/xsd/types/route.xsd` and "Definition of Vehicles, Vehicle Types,
and Routes").
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from canid.analysis.sumo.driver_ids import driver_ids
from canid.analysis.sumo.krauss import LEAD_DECEL
from canid.analysis.sumo.pooled_driver import PooledDriver
from canid.analysis.sumo.sumo_models import BY_NAME
from canid.values.interval_text import interval_text

# by which canid recognises its own file
MARK = "<!-- canid export: drivers as SUMO vehicle types -->"
# id of the distribution over all drivers; ids of drivers begin with driver_
DISTRIBUTION = "drivers"
# m/s²; what tyres can do, as in the calibration
EMERGENCY_DECEL = 9.0
# m/s²; an ACC's limits are those that were driven, but no less: a calm drive does not show what the car can do
LEAST_ACCEL, LEAST_DECEL = 1.0, 2.0
# m/s³; EIDM limits the jerk, which the calibrated model does not
NO_JERK_LIMIT = 100.0
# s; EIDM's default, where there is no error that could persist
ANY_TIME = 3.0
# share; SUMO's error process stands still at an awareness of 0 and 1
AWARENESS = 0.5


class VehicleType(NamedTuple):
    """A `vType` element."""

    id: str
    attributes: dict[str, str]
    params: dict[str, str]
    comments: tuple[str, ...]
    seconds: float  # of following: its weight


def vehicle_type(name: str, driver: PooledDriver) -> VehicleType:
    """Write a driver as a vehicle type.

    Args:
        name: its id, see `driver_ids`.
        driver: the drives of one driver, pooled.
    """
    q = {key: interval.value for key, interval in driver.parameters.items()}
    attributes = {
        "carFollowModel": driver.model,
        "minGap": _text(q["s0"]),
        "tau": _text(q["T"]),
        **_own(driver, q),
        "emergencyDecel": _text(EMERGENCY_DECEL),
        # what Krauss's model assumes of a lead: the same in calibration and simulation
        "apparentDecel": _text(LEAD_DECEL),
        # each driver's own wanted speed is in maxSpeed: no draw from SUMO's default distribution
        "speedFactor": "1",
        "speedDev": "0",
    }
    params = {"canid.driver": driver.name, **_error_params(driver)}
    return VehicleType(name, attributes, params, _comments(driver), driver.seconds)


def _own(driver: PooledDriver, q: dict[str, float]) -> dict[str, str]:
    if driver.model == "ACC":
        slowest, fastest = driver.accel
        gains: dict[str, str] = {}
        for mode in ("gapControl", "gapClosingControl", "collisionAvoidance"):
            gains |= {f"{mode}GainSpeed": _text(q["k2"]), f"{mode}GainSpace": _text(q["k1"])}
        return {
            "accel": _text(max(fastest, LEAST_ACCEL) if math.isfinite(fastest) else LEAST_ACCEL),
            "decel": _text(max(-slowest, LEAST_DECEL) if math.isfinite(slowest) else LEAST_DECEL),
            **gains,
            # else SUMO's ACC sees gap and range rate without error
            "applyDriverState": "1",
        }
    out = {"accel": _text(q["a"]), "decel": _text(q["b"]), "maxSpeed": _text(q["v0"])}
    if driver.model == "Krauss":
        out["sigma"] = "0"
    if driver.model == "EIDM":
        sd, time = driver.noise.sd.value, driver.noise.time.value
        noisy = sd > 0.0 and math.isfinite(time)
        out |= {
            # EIDM's error of the acceleration is sigmaerror times accel
            "sigmaerror": _text(sd / q["a"] if noisy else 0.0),
            "tPersDrive": _text(time if noisy else ANY_TIME),
            "sigmagap": "0",
            "sigmaleader": "0",
            "treaction": "0",
            "ccoolness": "0",
            "jerkmax": _text(NO_JERK_LIMIT),
        }
    return out


def _error_params(driver: PooledDriver) -> dict[str, str]:
    """Settings of SUMO's driver state device; {}: the model needs none."""
    error_of, noise = BY_NAME[driver.model].error_of, driver.noise
    known = noise.sd.value > 0.0 and math.isfinite(noise.time.value) and noise.sensitivity > 0.0
    if error_of == "accel" or not known:
        return {}
    size = noise.sd.value / noise.sensitivity
    device = {
        "initialAwareness": AWARENESS,
        # time scale is this times awareness, noise intensity that times 1 - awareness: a process of sd 1
        "errorTimeScaleCoefficient": noise.time.value / AWARENESS,
        "errorNoiseIntensityCoefficient": 1.0 / (1.0 - AWARENESS),
        "headwayErrorCoefficient": size if error_of == "gap" else 0.0,
        "speedDifferenceErrorCoefficient": size if error_of == "range_rate" else 0.0,
        "headwayChangePerceptionThreshold": 0.0,
        "speedDifferenceChangePerceptionThreshold": 0.0,
    }
    out = {"has.driverstate.device": "true"}
    return out | {f"device.driverstate.{key}": _text(x) for key, x in device.items()}


def _comments(driver: PooledDriver) -> tuple[str, ...]:
    drives = ", ".join(drive.name for drive in driver.drives)
    parameters = ", ".join(
        f"{key} {interval_text(*interval)}{_unit(driver.units[key])}"
        for key, interval in driver.parameters.items()
    )
    out = [
        f"driver {driver.name}; drives: {drives}; {driver.seconds:.0f} s of following",
        f"{driver.model}: {parameters}",
        f"{driver.why}; error of {driver.model} in closed loop on held-out data, rms over rms: gap {driver.error.gap:.3f}, "
        f"speed {driver.error.speed:.3f}",
    ]
    if driver.spread:
        between = ", ".join(f"{key} {x:.2f}" for key, x in driver.spread.items())
        out.append(f"standard deviation between drives, of the calibrated range: {between}")
    noise = BY_NAME[driver.model].noise_of
    if driver.noise.sd.value > 0.0:
        unit = "m/s" if noise == "speed" else "m/s²"
        what = {"accel": noise, "gap": f"{noise}, by errors of the perceived gap"}.get(
            BY_NAME[driver.model].error_of, f"{noise}, by errors of the perceived range rate"
        )
        out.append(
            f"noise of the {what}: {interval_text(*driver.noise.sd)} {unit}, correlation time "
            f"{interval_text(*driver.noise.time)} s"
        )
    return tuple(out)


def additional(drivers: Sequence[PooledDriver], source: str, version: str) -> str:
    """Write the text of an additional file for SUMO (`--additional-files`).

    Args:
        drivers: one at least.
        source: what they were exported from.
        version: canid's.

    Raises:
        ValueError: no driver.
    """
    if not drivers:
        raise ValueError("no driver to export")
    types = [
        vehicle_type(name, driver)
        for name, driver in zip(driver_ids([driver.name for driver in drivers]), drivers, strict=True)
    ]
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', MARK]
    lines += [
        _comment(
            f"{version}, from {source}; for SUMO 1.28 and later, with steps (step-length) of 0.1 to 0.5 s"
        ),
        _comment(
            "units: minGap m, tau s, maxSpeed m/s, accel, decel, emergencyDecel, apparentDecel m/s²; intervals are of 95 %"
        ),
        "<additional>",
    ]
    for type_ in types:
        lines += element(type_)
    total = sum(type_.seconds for type_ in types)
    names = " ".join(type_.id for type_ in types)
    shares = " ".join(_text(type_.seconds / total) for type_ in types)
    lines += [
        f"    {_comment('all drivers, weighted by their time of following')}",
        f'    <vTypeDistribution id="{DISTRIBUTION}" vTypes="{names}" probabilities="{shares}"/>',
        "</additional>",
    ]
    return "\n".join(lines) + "\n"


def element(type_: VehicleType) -> list[str]:
    """The lines of a `vType` with its comments."""
    attributes = " ".join(f"{key}={quoteattr(_clean(x))}" for key, x in type_.attributes.items())
    params = [
        f"        <param key={quoteattr(key)} value={quoteattr(_clean(x))}/>"
        for key, x in type_.params.items()
    ]
    return [
        *(f"    {_comment(comment)}" for comment in type_.comments),
        f'    <vType id="{type_.id}" {attributes}>',
        *params,
        "    </vType>",
    ]


def _comment(text: str) -> str:
    # XML 1.0, section 2.5: no -- within, and no - at the end
    return f"<!-- {re.sub('-(?=-)', '- ', _clean(text))} -->"


def _clean(text: str) -> str:
    """Without what XML 1.0 cannot hold (section 2.2), nor line ends."""
    return re.sub("[^\x20-\x7e\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "\ufffd", text)


def _unit(unit: str) -> str:
    return "" if unit in ("", "1") else f" {unit}"


def _text(x: float) -> str:
    # SUMO reads no exponents everywhere
    return f"{x:.5f}".rstrip("0").rstrip(".") or "0"
