"""`canid identify LOG...`: the driver's parameters of a drive, as text and JSON."""

from __future__ import annotations

import argparse

from canid.cli import options, reading
from canid.cli.output import output_kinds, outputs
from canid.cli.output.messages import line_printer
from canid.cli.output.outputs import Output
from canid.errors import DONE, ConfigError


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("logs", metavar="LOG", nargs="+", help=options.LOGS)
    options.vehicle(parser)
    options.part(parser)
    parser.add_argument(
        "--plot",
        metavar="FILE.svg",
        help="of one log, draw the parameters over the drive; an existing file is replaced only if it is such a plot",
    )
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Identify."""
    from canid.drive_parameters import identify
    from canid.views import identification_json, identification_text, json_values, level_plot

    if args.plot and len(args.logs) > 1:
        raise ConfigError("identify: --plot takes one log; run identify for each")
    json = options.json_output(args)
    plot = Output("--plot", args.plot, output_kinds.PLOT) if args.plot else None
    outputs.check([json, plot], options.read_by(args))
    vehicle = reading.read_vehicle(args.vehicle)
    show = line_printer(args.json)
    objects = []
    code = DONE
    with outputs.opened(json) as sink:
        for path in args.logs:
            drive = reading.read_drive(path, vehicle, args, estimating=False)
            identified = identify(drive.trace, **vehicle.estimators)
            for line in identification_text.text(identified, path, vehicle.name):
                show(line)
            objects.append(identification_json.to_json(identified, path, vehicle.name))
            with outputs.opened(plot) as file:
                if file is not None:
                    file.write(level_plot.svg(identified, path, vehicle.name))
            code = reading.report_health(drive.health) or code
        if sink is not None:
            sink.write(json_values.line(objects[0] if len(objects) == 1 else objects) + "\n")
    return code
