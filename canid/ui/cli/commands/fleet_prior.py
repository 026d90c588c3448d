"""`canid fleet prior DIR [-o FILE.toml]`: what a fleet teaches on a new driver, as [fopdt.prior] of a vehicle file."""

from __future__ import annotations

import argparse
import datetime
from pathlib import Path

from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info, print_text
from canid.values.errors import DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", metavar="DIR", help="folder of canid fleet")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE.toml",
        help="the section as a file; replaces an earlier one; default: standard output, to be appended to a vehicle file",
    )
    parser.add_argument(
        "--role", metavar="ROLE", help="output whose drives count, where there are several: pedal, accel, ..."
    )
    parser.add_argument("--unit", metavar="UNIT", help="unit of the output, where there are several")
    parser.add_argument("--car", metavar="CAR", help="car whose drives count, where there are several")
    parser.add_argument(
        "--leave-out",
        metavar="DRIVER",
        action="append",
        default=[],
        help="driver who does not count, such as the one that it is to be used for; may be repeated",
    )


def run(args: argparse.Namespace) -> int:
    """Pool, make the prior, write it."""
    from canid.analysis.fleet.answers.prior_file import fleet_prior, toml_of
    from canid.analysis.fleet.storage import mirror

    file = Output("-o", args.output, output_kinds.PRIOR) if args.output else None
    folder = mirror.local(args.folder)
    outputs.check([file], sorted(Path(folder).glob("*.parquet")))
    prior = fleet_prior(folder, output=args.role, unit=args.unit, car=args.car, leave_out=args.leave_out)
    text = toml_of(prior, datetime.datetime.now(datetime.UTC).date().isoformat())
    complete_files.write(file, lambda: text)
    if file is None:
        print_text(text)
        return DONE
    info(f"{args.output} written: append it to the vehicle file of {prior.kind.text()}")
    return DONE
