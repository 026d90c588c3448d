"""A vehicle type behind a recorded lead in SUMO: several replicates side by side, each on its own road."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from canid.values.types import Array

# s of SUMO's step
STEP_S = 0.1
# m
LENGTH_M, CAR_M = 200_000.0, 4.5
FIRST_M = 100.0

LEAD = (
    f'<vType id="lead" length="{CAR_M}" carFollowModel="Krauss" maxSpeed="90" accel="50" decel="4.5" '
    'emergencyDecel="50" sigma="0" speedDev="0"/>'
)


class Run(NamedTuple):
    """A stretch of the drive behind one lead, at steps of `STEP_S`."""

    gap: Array  # (n,) m
    speed: Array  # (n,) m/s
    lead: Array  # (n,) m/s


def drive(types: str, name: str, run: Run, replicates: int, seed: int) -> tuple[Array, Array]:
    """Simulate from the measured first state.

    Args:
        types: `vType` elements.
        name: id of the one that drives.
        run: its lead.
        replicates: with different random numbers.
        seed: of SUMO.

    Returns:
        gap m and speed m/s, (n, replicates) each.
    """
    import libsumo

    with tempfile.TemporaryDirectory() as folder:
        net, cars = Path(folder, "roads.net.xml"), Path(folder, "cars.rou.xml")
        net.write_text(network(replicates), encoding="utf-8")
        cars.write_text(routes(types, name, replicates, run), encoding="utf-8")
        words = [
            "sumo",
            "-n",
            str(net),
            "-r",
            str(cars),
            "--step-length",
            f"{STEP_S:g}",
            "--seed",
            str(seed),
        ]
        words += ["--no-step-log", "--no-warnings", "--collision.action", "none", "--time-to-teleport", "-1"]
        words += ["--xml-validation", "never", "--device.driverstate.probability", "0"]
        libsumo.start(words)
        try:
            return _driven(libsumo.vehicle, libsumo.simulationStep, run, replicates)
        finally:
            libsumo.close()


def _driven(cars, step, run: Run, replicates: int) -> tuple[Array, Array]:  # type: ignore[no-untyped-def]
    step()
    for k in range(replicates):
        cars.setSpeedMode(f"lead{k}", 0)
    gap, speed = np.empty((2, run.lead.size, replicates))
    for n, wanted in enumerate(run.lead.tolist()):
        if n:
            for k in range(replicates):
                cars.setSpeed(f"lead{k}", wanted)
            step()
        for k in range(replicates):
            own = cars.getLanePosition(f"own{k}")
            gap[n, k] = cars.getLanePosition(f"lead{k}") - CAR_M - own
            speed[n, k] = cars.getSpeed(f"own{k}")
    return gap, speed


def network(roads: int) -> str:
    """Text of a network of straight roads of one lane."""
    out = [
        '<net version="1.20">',
        f'<location netOffset="0,0" convBoundary="0,0,{LENGTH_M},{20 * roads}" '
        f'origBoundary="0,0,{LENGTH_M},{20 * roads}" projParameter="!"/>',
    ]
    for k in range(roads):
        y = 20 * k
        out.append(
            f'<edge id="road{k}" from="a{k}" to="b{k}" priority="1"><lane id="road{k}_0" index="0" speed="90" '
            f'length="{LENGTH_M}" shape="0,{y} {LENGTH_M},{y}"/></edge>'
        )
    for k in range(roads):
        y = 20 * k
        out.append(
            f'<junction id="a{k}" type="dead_end" x="0" y="{y}" incLanes="" intLanes="" shape="0,{y} 0,{y - 3}"/>'
            f'<junction id="b{k}" type="dead_end" x="{LENGTH_M}" y="{y}" incLanes="road{k}_0" intLanes="" '
            f'shape="{LENGTH_M},{y - 3} {LENGTH_M},{y}"/>'
        )
    return "\n".join([*out, "</net>"])


def routes(types: str, name: str, replicates: int, run: Run) -> str:
    """Text of the vehicles: own0 behind lead0, ..., each pair on a road of `network`."""
    ahead = FIRST_M + float(run.gap[0]) + CAR_M
    out = ["<routes>", LEAD, types]
    for k in range(replicates):
        begin = 'depart="0" departLane="0" insertionChecks="none"'
        out += [
            f'<route id="r{k}" edges="road{k}"/>',
            f'<vehicle id="lead{k}" type="lead" route="r{k}" {begin} departPos="{ahead}" departSpeed="{run.lead[0]}"/>',
            f'<vehicle id="own{k}" type="{name}" route="r{k}" {begin} departPos="{FIRST_M}" '
            f'departSpeed="{run.speed[0]}"/>',
        ]
    return "\n".join([*out, "</routes>"])


def pooled(runs: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Columns of several runs below each other, (n, replicates) each."""
    return np.concatenate([gap for gap, _ in runs]), np.concatenate([speed for _, speed in runs])
