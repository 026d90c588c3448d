"""`canid simulate OUT.blf`: a log with known truth; the truth stands in a .truth.json beside it."""

from __future__ import annotations

import argparse
import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from canid.cli import options, output_kinds, outputs
from canid.cli.outputs import Output
from canid.cli.talk import talk
from canid.errors import DONE, CanidError, OutputError

if TYPE_CHECKING:
    from canid.simulation import Simulation
    from canid.vehicle import Vehicle


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.simulation import NOISES, PROFILES

    parser.add_argument("out", metavar="OUT.blf", help="the log to write; the suffix chooses the format")
    options.vehicle(parser, required=False)
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="the same seed gives the same bytes")
    parser.add_argument(
        "--minutes", type=options.above_zero, default=3.0, metavar="M", help="length of the drive; default: 3"
    )
    parser.add_argument("--noise", choices=NOISES, default="ar1", help="colour of the driver's own noise")
    parser.add_argument(
        "--profile",
        choices=PROFILES,
        default="mixed",
        help="what the vehicle ahead does, or lane; default: mixed",
    )
    parser.add_argument(
        "--hide",
        action="append",
        type=hidden,
        default=[],
        metavar="EFFECT[=VALUE,...]",
        help="a cause that the driver carries, for `canid diagnose` to find; may be given several times",
    )
    options.force(parser)
    options.json_file(parser)


def hidden(text: str) -> tuple[str, tuple[float, ...]]:
    """Read EFFECT or EFFECT=VALUE,...

    Example:
        >>> hidden("gain_change=0.4,200")
        ('gain_change', (0.4, 200.0))
    """
    from canid.simulation.hidden import PLANTABLE

    name, _, numbers = text.partition("=")
    if name not in PLANTABLE:
        raise argparse.ArgumentTypeError(f"{name!r} cannot be hidden; choose from {', '.join(PLANTABLE)}")
    try:
        return name, tuple(float(x) for x in numbers.split(",") if x)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: what follows = must be numbers") from None


def run(args: argparse.Namespace) -> int:
    """Simulate, encode, write."""
    from canid.simulation import simulate
    from canid.vehicle import read_vehicle

    json = options.json_output(args)
    log, truth = declared(Path(args.out), force=args.force)
    outputs.check([json, log, truth], options.read_by(args))
    check_log(log)
    vehicle = read_vehicle(args.vehicle or ("generic_lane" if args.profile == "lane" else "generic"))
    simulation = simulate(
        minutes=args.minutes, seed=args.seed, profile=args.profile, noise=args.noise, hide=dict(args.hide)
    )
    text = write(log, truth, simulation, vehicle)
    with outputs.opened(json) as sink:
        if sink is not None:
            sink.write(text)
    talk(f"{log.path} written, its truth in {truth.path}")
    return DONE


def declared(out: Path, *, force: bool) -> tuple[Output, Output]:
    """The log and its truth, as outputs; `force`: those of an earlier simulation are replaced."""
    truth = out.with_name(out.name.removesuffix(out.suffix) + ".truth.json")
    log = Output("OUT.blf", str(out), output_kinds.SIMULATED, replace=force)
    return log, Output("OUT.blf", str(truth), output_kinds.TRUTH, replace=force)


def check_log(log: Output) -> None:
    """Refuse to replace anything but a simulated log, which begins at an instant of its own. Raises OutputError."""
    from canid.frames import open_log
    from canid.simulation import START_UTC

    path = Path(log.path)
    if not (path.exists() or path.is_symlink()):
        return
    try:
        simulated = (
            path.is_file() and not path.is_symlink() and abs(open_log(path).start_utc - START_UTC) < 1.0
        )
    except CanidError:
        simulated = False
    if not simulated:
        raise OutputError(f"{path}: exists and is no simulated log: it is left as it is; choose another name")
    if not log.replace:
        raise OutputError(f"{path}: exists already; choose another name or use --force")


def write(log: Output, truth: Output, simulation: Simulation, vehicle: Vehicle) -> str:
    """Write a simulated log and its truth, which is returned. Raises OutputError; an earlier log stands until then."""
    from canid.frames import write_log
    from canid.frames.disk import TakenError
    from canid.simulation import START_UTC, frames, truth_text

    out = Path(log.path)
    # under a name that nobody else has, in the same folder; only a whole log takes the place of an earlier one
    new = out.with_name(f".{out.name.removesuffix(out.suffix)}.{os.getpid()}.new{out.suffix}")
    try:
        write_log(new, frames(simulation, vehicle), START_UTC)
        check_log(log)
        os.replace(new, out)
    except TakenError:
        raise  # somebody else's file: it stays
    except BaseException as error:
        with suppress(OSError):
            os.unlink(new)
        if isinstance(error, OutputError):
            raise OutputError(str(error).replace(str(new), str(out))) from error
        if isinstance(error, OSError):
            raise OutputError(f"{out}: cannot be written ({error.strerror})") from error
        raise
    text = truth_text(simulation, vehicle)
    with outputs.opened_file(truth) as file:
        file.write(text)
    return text
