"""`canid export LOG --to sumo|control|idtf|latex|fmu`: the driver of a log for a traffic simulator, a toolbox or a paper."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from canid import __version__
from canid.io.files.derived_name import sibling
from canid.ui.cli.inputs import reading
from canid.ui.cli.options import options
from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info
from canid.ui.terminal.progress import Progress
from canid.values.errors import CHECK_FAILED

if TYPE_CHECKING:
    from canid.analysis.sumo.pooled_driver import PooledDriver

ENDING = ".add.xml"
# of the driver's model: format -> ending
MODELS = {"control": ".driver.py", "idtf": ".driver.mat", "latex": ".driver.tex", "fmu": ".driver.fmu"}


def run(args: argparse.Namespace) -> int:
    """Export the driver. Raises LogError: the log cannot be read."""
    return _sumo(args) if args.to == "sumo" else _model(args)


def _model(args: argparse.Namespace) -> int:
    """Read, identify, write. A log from which no gain is known is a check that failed."""
    from canid.analysis.drive.drive_parameters import identify
    from canid.analysis.export import driver_fmu, driver_models

    vehicle = reading.read_vehicle(args.vehicle)
    json = options.json_output(args)
    ending = MODELS[args.to]
    kind, render = {
        "control": (output_kinds.CONTROL, driver_models.python),
        "idtf": (output_kinds.IDTF, driver_models.matlab),
        "latex": (output_kinds.LATEX, driver_models.latex),
        "fmu": (output_kinds.FMU, driver_fmu.fmu),
    }[args.to]
    output = Output("-o", _name(args, ending), kind, replace=args.force)
    outputs.check([output, json], options.read_by(args))
    drive = reading.read_drive(args.log, vehicle, args, dt=args.dt, estimating=False)
    with Progress(f"identifying {args.log}"):
        identified = identify(drive.trace, select_orders=False, sliding=False)
    known: Mapping[str, Iterable[str]] = driver_models.models(identified)
    if args.to == "fmu":
        known = {method: names for method, names in driver_fmu.known_inputs(identified).items() if names}
    if not known:
        what = "FOPDT knows no gain, lag and dead time" if args.to == "fmu" else "no gain is known"
        info(f"{args.log}: no model: {what}; `canid identify` says what is missing")
        return CHECK_FAILED
    log = Path(args.log).name
    content = render(identified, f"{log}, vehicle {vehicle.name}, canid {__version__}")
    with complete_files.complete_files() as files:
        files.begin(output).file.write(content)
        files.commit()
    columns = [f"{method} {name}" for method, inputs in known.items() for name in inputs]
    info(f"{output.path}: {', '.join(columns)}")
    _list(json, output, len(columns), columns)
    return reading.report_health(drive.health)


def _sumo(args: argparse.Namespace) -> int:
    """Read, calibrate, write. A log that shows too little of its driver is a check that failed.

    Raises:
        LogError: the log cannot be read.
    """
    from canid.analysis.sumo.driver_model import NoModel, fit
    from canid.analysis.sumo.pooled_driver import Drive, pooled
    from canid.analysis.sumo.vehicle_types import additional

    vehicle = reading.read_vehicle(args.vehicle)
    json = options.json_output(args)
    output = Output("-o", _name(args, ENDING), output_kinds.SUMO, replace=args.force)
    # before the log is read: that may take minutes
    outputs.check([output, json], options.read_by(args))
    drive = reading.read_drive(args.log, vehicle, args, dt=args.dt, estimating=False)
    with Progress(f"calibrating to {args.log}"):
        model = fit(drive.trace, vehicle.driver.output)
    if isinstance(model, NoModel):
        info(f"{args.log}: no vehicle type: {model.reason}")
        return CHECK_FAILED
    log = Path(args.log).name
    driver = pooled(Path(args.log).stem, [Drive(log, model)])
    complete_files.write(output, lambda: additional([driver], log, f"canid {__version__}"))
    info(f"{output.path}: {said(driver)}")
    _list(json, output, 1, list(driver.parameters))
    return reading.report_health(drive.health)


def _list(json: Output | None, output: Output, rows: int, columns: list[str]) -> None:
    """Write what was exported as JSON, where that is wanted."""
    from canid.values.text import json_values

    made = {"path": output.path, "rows": rows, "columns": columns}
    complete_files.write(json, lambda: json_values.document("export", [made]) + "\n")


def said(driver: PooledDriver) -> str:
    """A driver's model, as one line."""
    parameters = ", ".join(f"{name} {x}" for name, x in driver.parameters.items())
    return f"{driver.name}: {driver.model}, error of the gap {100 * driver.error.gap:.0f} % ({parameters})"


def _name(args: argparse.Namespace, ending: str) -> str:
    """The file's name."""
    if args.output is None:
        return str(sibling(Path(args.log), Path(args.log).stem, ending))
    name: str = args.output
    return name if name.lower().endswith(Path(ending).suffix) else name + ending
