"""One drive in SUMO: a follower behind a lead that is moved by a given speed, on a straight road of one lane."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.sumo.sumo_drivers import STEP_S, SumoDriver
from canid.models.simulation import Simulation
from canid.values.types import Array

LENGTH_M = 200_000.0
# m; of both vehicles, and s of headway at the begin
CAR_M, FIRST_HEADWAY_S = 4.5, 1.8
# s behind a lead of constant speed before the drive begins
SETTLING_S = 30.0
# steps of gap and lead's speed for the model's derivatives: m, m/s
GAP_STEP, SPEED_STEP = 0.2, 0.05
# steps from one instant at which they are taken to the next
SLOPE_EVERY = 20

NET = """<net version="1.20">
<location netOffset="0,0" convBoundary="0,0,{end},0" origBoundary="0,0,{end},0" projParameter="!"/>
<edge id="road" from="a" to="b" priority="1">
<lane id="road_0" index="0" speed="90" length="{end}" shape="0,-1.6 {end},-1.6"/></edge>
<junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0 0,-3.2"/>
<junction id="b" type="dead_end" x="{end}" y="0" incLanes="road_0" intLanes="" shape="{end},-3.2 {end},0"/>
</net>
"""
ROUTES = """<routes>
<vType id="lead" length="{car}" carFollowModel="Krauss" maxSpeed="80" decel="4.5" sigma="0" speedDev="0"/>
<vType id="own" length="{car}" carFollowModel="{model}" speedDev="0" {settings}/>
<route id="along" edges="road"/>
<vehicle id="lead" type="lead" route="along" depart="0" departPos="{ahead}" departSpeed="{speed}"/>
<vehicle id="own" type="own" route="along" depart="0" departPos="{behind}" departSpeed="{speed}" insertionChecks="none"/>
</routes>
"""


class Derivatives(NamedTuple):
    """Of the model's acceleration: medians over the drive of small steps of SUMO's own car-following function."""

    gap: float  # ∂a/∂gap, 1/s²
    range_rate: float  # ∂a/∂(lead's speed), 1/s


class Driven(NamedTuple):
    """A drive, and its driver at the operating point."""

    simulation: Simulation
    derivatives: Derivatives


def drive(of: SumoDriver, lead_speed: Array) -> Driven:
    """Simulate.

    Args:
        of: the driver.
        lead_speed: (n,) m/s at steps of `STEP_S`.
    """
    import libsumo

    with tempfile.TemporaryDirectory() as folder:
        net, routes = Path(folder, "road.net.xml"), Path(folder, "cars.rou.xml")
        net.write_text(NET.format(end=LENGTH_M))
        settings = " ".join(f'{name}="{value}"' for name, value in of.settings.items())
        behind, first = 10.0, float(lead_speed[0])
        ahead = behind + FIRST_HEADWAY_S * first + 5.0 + CAR_M
        routes.write_text(
            ROUTES.format(
                car=CAR_M,
                model=of.model,
                settings=f'{settings} actionStepLength="{of.action_step:g}"',
                ahead=ahead,
                behind=behind,
                speed=first,
            )
        )
        words = ["sumo", "-n", str(net), "-r", str(routes), "--step-length", f"{STEP_S:g}"]
        words += ["--seed", str(of.seed % 2**31), "--xml-validation", "never"]
        words += ["--no-step-log", "--no-warnings", "--collision.action", "none", "--time-to-teleport", "-1"]
        words += ["--default.speeddev", "0", "--lanechange.duration", "0"]
        libsumo.start(words)
        try:
            columns, derivatives = _driven(libsumo, lead_speed)
        finally:
            libsumo.close()
    truth = {"model": of.model, "settings": dict(of.settings), "action_step": of.action_step, "seed": of.seed}
    return Driven(Simulation(STEP_S, columns, truth, of.seed), derivatives)


def _driven(libsumo: Any, lead_speed: Array) -> tuple[dict[str, Array], Derivatives]:
    cars = libsumo.vehicle
    n = lead_speed.size
    gap, speed, accel, lead = np.empty((4, n))
    slopes = []
    libsumo.simulationStep()
    cars.setSpeedMode("lead", 0)
    for k in range(-round(SETTLING_S / STEP_S), n):
        cars.setSpeed("lead", float(lead_speed[max(k, 0)]))
        libsumo.simulationStep()
        if k < 0:
            continue
        gap[k] = cars.getLanePosition("lead") - CAR_M - cars.getLanePosition("own")
        if k % SLOPE_EVERY == 0:
            slopes.append(_slopes(cars, gap[k], cars.getSpeed("own"), cars.getSpeed("lead")))
        speed[k], accel[k], lead[k] = cars.getSpeed("own"), cars.getAcceleration("own"), cars.getSpeed("lead")
    columns = {
        "t": STEP_S * np.arange(n),
        "gap": gap,
        "speed": speed,
        "accel": accel,
        "lead_speed": lead,
        "range_rate": lead - speed,
        "lead_valid": np.ones(n),
    }
    return columns, Derivatives(*(float(x) for x in np.median(slopes, axis=0)))


def _slopes(cars: Any, gap: float, speed: float, lead: float) -> tuple[float, float]:
    """∂a/∂gap and ∂a/∂(lead's speed) by SUMO's own car-following function, at the present state."""
    strongest = cars.getDecel("lead")
    # SUMO's gap is without the one that the vehicle keeps at rest
    free = gap - cars.getMinGap("own")

    def accel(more_gap: float, faster: float) -> float:
        wanted = cars.getFollowSpeed("own", speed, free + more_gap, lead + faster, strongest, "lead")
        return (wanted - speed) / STEP_S

    return (
        (accel(GAP_STEP, 0.0) - accel(-GAP_STEP, 0.0)) / (2 * GAP_STEP),
        (accel(0.0, SPEED_STEP) - accel(0.0, -SPEED_STEP)) / (2 * SPEED_STEP),
    )
