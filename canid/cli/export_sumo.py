"""`canid export LOG --to sumo`: the driver of a log as a vehicle type of the traffic simulator SUMO."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from canid import __version__
from canid.cli import options, reading
from canid.cli.output import output_kinds, outputs
from canid.cli.output.messages import info
from canid.cli.output.outputs import Output
from canid.cli.output.progress import Progress
from canid.errors import LogError

if TYPE_CHECKING:
    from canid.sumo.pooled_driver import PooledDriver

ENDING = ".add.xml"


def run(args: argparse.Namespace) -> int:
    """Read, calibrate, write.

    Raises:
        LogError: the log cannot be read, or shows too little of its driver.
    """
    from canid.sumo.driver_model import NoModel, fit
    from canid.sumo.pooled_driver import Drive, pooled
    from canid.sumo.vehicle_types import additional
    from canid.views import json_values

    vehicle = reading.read_vehicle(args.vehicle)
    json = options.json_output(args)
    output = Output("-o", _name(args), output_kinds.SUMO, replace=args.force)
    # before the log is read: that may take minutes
    outputs.check([output, json], options.read_by(args))
    drive = reading.read_drive(args.log, vehicle, args, dt=args.dt, estimating=False)
    with Progress(f"calibrating to {args.log}"):
        found = fit(drive.trace, vehicle.driver.output)
    if isinstance(found, NoModel):
        raise LogError(f"{args.log}: no vehicle type: {found.reason}")
    log = Path(args.log).name
    driver = pooled(Path(args.log).stem, [Drive(log, found)])
    with outputs.opened_file(output) as written:
        written.write(additional([driver], log, f"canid {__version__}"))
    info(f"{output.path}: {said(driver)}")
    if json is not None:
        with outputs.opened(json) as sink:
            assert sink is not None
            made = {"path": output.path, "rows": 1, "columns": list(driver.parameters)}
            sink.write(json_values.document("export", [made]) + "\n")
    return reading.report_health(drive.health)


def said(driver: PooledDriver) -> str:
    """A driver's model, as one line."""
    parameters = ", ".join(f"{name} {x}" for name, x in driver.parameters.items())
    return f"{driver.name}: {driver.model}, error of the gap {100 * driver.error.gap:.0f} % ({parameters})"


def _name(args: argparse.Namespace) -> str:
    """The file's name."""
    if args.output is None:
        return str(Path(args.log).with_suffix(ENDING))
    name: str = args.output
    return name if name.lower().endswith(".xml") else name + ENDING
