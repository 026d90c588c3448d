"""`canid simulate OUT.blf`: a simulated log with known parameters, which are written to a .truth.json next to it."""

from __future__ import annotations

import argparse
import math
import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from canid.io.files import derived_name
from canid.ui.cli.options import driver_options, options
from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info
from canid.values import bounded_numbers
from canid.values.errors import DONE, CanidError, ConfigError, OutputError

if TYPE_CHECKING:
    from canid.models.simulation import Simulation
    from canid.signals.vehicle import Vehicle


# share of the lead's time at speeds that the model was not identified at, from which on that is said
MAX_OUTSIDE = 0.2


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.models.simulation import MAX_MINUTES, MIN_MINUTES, NOISES, PROFILES

    parser.add_argument(
        "out", metavar="OUT.blf", help="log to write; the suffix (.blf, .asc, .log) selects the format"
    )
    options.vehicle(parser, required=False)
    parser.add_argument(
        "--seed",
        type=bounded_numbers.seed,
        default=1,
        metavar="N",
        help="random seed; the same seed gives the same log; default: 1",
    )
    parser.add_argument(
        "--minutes",
        type=bounded_numbers.number("a time in minutes (such as 3)", MIN_MINUTES, MAX_MINUTES),
        default=3.0,
        metavar="M",
        help="length of the drive in minutes; default: 3",
    )
    parser.add_argument(
        "--noise", choices=NOISES, default="ar1", help="noise model of the driver; default: ar1"
    )
    parser.add_argument(
        "--profile",
        choices=PROFILES,
        default="mixed",
        help="traffic of the vehicle ahead, or lane for lane keeping; default: mixed",
    )
    parser.add_argument(
        "--hide",
        action="append",
        type=hidden,
        default=[],
        metavar="EFFECT[=VALUE,...]",
        help="hide an effect in the drive, for `canid diagnose` to find; repeatable",
    )
    parser.add_argument(
        "--model",
        metavar="REPORT.json",
        help="drive the model that `canid diagnose LOG --json REPORT.json` identified, instead of a drawn driver",
    )
    parser.add_argument(
        "--lead",
        metavar="LOG",
        help="with --model: behind the vehicle ahead of this log, its longest stretch; default: one of --profile",
    )
    driver_options.arguments(parser)
    options.force(parser)
    options.json_file(parser)


def hidden(text: str) -> tuple[str, tuple[float, ...]]:
    """Parse EFFECT or EFFECT=VALUE,...

    Example:
        >>> from canid.models.effects import CATALOGUE
        >>> hidden(f"{CATALOGUE[0].id}=0.4")[1]
        (0.4,)
    """
    from canid.models.simulation.planted_effects import PLANTABLE, WITH_NUMBERS

    name, _, numbers = text.partition("=")
    if name not in (WITH_NUMBERS if numbers else PLANTABLE):
        raise argparse.ArgumentTypeError(f"{name!r} cannot be hidden; choose from {', '.join(PLANTABLE)}")
    try:
        values = tuple(float(x) for x in numbers.split(",") if x)
    except ValueError:
        values = (math.nan,)
    if not all(map(math.isfinite, values)):
        raise argparse.ArgumentTypeError(f"{text!r}: the values after = must be numbers")
    return name, values


def run(args: argparse.Namespace) -> int:
    """Simulate, encode, write."""
    from canid.models.simulation import simulate
    from canid.signals.vehicle import read_vehicle

    if args.lead is not None and args.model is None:
        raise ConfigError("simulate: --lead is followed by the driver of --model: add --model FILE.json")
    driver = driver_options.chosen(args)
    json = options.json_output(args)
    log, truth = declared(Path(args.out), force=args.force)
    outputs.check([json, log, truth], options.read_by(args))
    check_log(log)
    vehicle = read_vehicle(args.vehicle or ("generic_lane" if args.profile == "lane" else "generic"))
    try:
        simulation = (
            simulate(
                minutes=args.minutes,
                seed=args.seed,
                profile=args.profile,
                noise=args.noise,
                driver=driver,
                hide=dict(args.hide),
            )
            if args.model is None
            else of_model(args, vehicle)
        )
    except ValueError as error:
        raise ConfigError(f"simulate: {error}") from None
    if driver is not None and (why := driver_options.loses_it(driver, simulation)):
        info(why)
    text = write(log, truth, simulation, vehicle)
    complete_files.write(json, lambda: text)
    info(f"{log.path} written, its truth to {truth.path}")
    return DONE


def of_model(args: argparse.Namespace, vehicle: Vehicle) -> Simulation:
    """Drive an identified model.

    Raises:
        ConfigError: no model, no lead, or an option that a model leaves no room for.
        LogError: the lead's log cannot be read.
    """
    from canid.analysis.drive.drive_reader import read_trace
    from canid.io.files.model_file import read_model
    from canid.models.simulation import model_drive

    if args.hide or args.profile == "lane":
        raise ConfigError("simulate: --model brings its own driver: leave out --hide and --profile lane")
    model = read_model(args.model)
    needed = {"gap", "range_rate", "speed", model.output}
    if absent := sorted(needed - set(vehicle.roles) - {"gap", "range_rate"}):
        raise ConfigError(
            f"simulate: {vehicle.name} has no {', '.join(absent)}, which the model needs: choose --vehicle"
        )
    lead = (
        model_drive.drawn_lead(model, args.profile, args.minutes, args.seed)
        if args.lead is None
        else model_drive.longest_lead(read_trace(args.lead, vehicle))
    )
    simulation = model_drive.drive(model, lead, args.seed, noise=args.noise != "none")
    if model_drive.unstable(model):
        info(
            "the model does not hold a gap: behind a steady vehicle gap and speed run away; its gains are not a driver's"
        )
    low, high = model.driven["speed"].low, model.driven["speed"].high
    outside = float(((lead.speed < low) | (lead.speed > high)).mean())
    if outside > MAX_OUTSIDE:
        info(
            f"{100 * outside:.0f} % of the lead's speeds are outside of {low:.0f} to {high:.0f} m/s, which the model was "
            "identified at"
        )
    return simulation


def declared(out: Path, *, force: bool) -> tuple[Output, Output]:
    """The log and its truth, as outputs; `force`: replace those of an earlier simulation."""
    truth = derived_name.sibling(out, out.stem, ".truth.json")
    log = Output("OUT.blf", str(out), output_kinds.SIMULATED, replace=force)
    return log, Output("OUT.blf", str(truth), output_kinds.TRUTH, replace=force)


def check_log(log: Output) -> None:
    """Refuse to replace anything but a simulated log, recognised by its fixed start time. Raises OutputError."""
    from canid.io.logs import open_log
    from canid.models.simulation import START_UTC

    path = Path(log.path)
    if not (os.path.exists(path) or path.is_symlink()):
        return
    try:
        simulated = (
            os.path.isfile(path) and not path.is_symlink() and abs(open_log(path).start_utc - START_UTC) < 1.0
        )
    except CanidError:
        simulated = False
    if not simulated:
        raise OutputError(
            f"{path}: exists and is not a simulated log: it is left as it is; choose another name"
        )
    if not log.replace:
        raise OutputError(f"{path}: exists already; choose another name or use --force")


def write(log: Output, truth: Output, simulation: Simulation, vehicle: Vehicle) -> str:
    """Write a simulated log and its truth, and return the truth. Only a whole log replaces an earlier one.

    Raises:
        OutputError: the log or its truth cannot be written.
    """
    from canid.io.files import opening
    from canid.io.files.new_file import TakenError
    from canid.io.logs import write_log
    from canid.models.simulation import START_UTC, frames, truth_text

    out = Path(log.path)
    new = opening.temporary_name(out, out.suffix)  # only a whole log replaces an earlier one
    try:
        write_log(new, frames(simulation, vehicle), START_UTC)
        check_log(log)
        os.replace(new, out)
    except TakenError:
        raise  # another program's file: it stays
    except BaseException as error:
        with suppress(OSError):
            os.unlink(new)
        if isinstance(error, OutputError):
            raise OutputError(str(error).replace(str(new), str(out))) from error
        if isinstance(error, OSError):
            raise OutputError(f"{out}: cannot be written ({error.strerror})") from error
        raise
    text = truth_text(simulation, vehicle)
    with complete_files.opened_file(truth) as file:
        file.write(text)
    return text
