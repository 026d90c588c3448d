"""`canid identify LOG...`: the drive's parameters, as a table and JSON."""

from __future__ import annotations

import argparse

from canid.cli import options, outputs, progress
from canid.cli.talk import talk, teller
from canid.errors import DAMAGED, DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("logs", metavar="LOG", nargs="+", help=options.LOGS)
    options.vehicle(parser)
    options.part(parser)
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Identify."""
    from canid import logs
    from canid.drive import identify
    from canid.frames import open_log
    from canid.vehicle import read_vehicle
    from canid.views import as_json, identified, summary

    json = options.json_output(args)
    outputs.check([json], options.read_by(args))
    vehicle = read_vehicle(args.vehicle)
    for warning in vehicle.warnings:
        talk(warning)
    tell = teller(args.json)
    objects = []
    code = DONE
    with outputs.opened(json) as sink:
        for path in args.logs:
            log = open_log(path)
            bar = progress.Progress(f"reading {path}")
            try:
                drive = logs.read_drive(
                    path,
                    vehicle,
                    estimating=False,
                    start=args.start,
                    stop=args.stop,
                    log=log,
                    progress=bar.to,
                )
            finally:
                bar.close()
            told = identify(drive.trace, armax=vehicle.armax, fopdt=vehicle.fopdt)
            for line in identified.text(told, path, vehicle.name):
                tell(line)
            objects.append(identified.to_json(told, path, vehicle.name))
            found = drive.health
            for line in summary.health(found.damage, found.back_in_time, found.counters, found.missing):
                talk(line)
            code = DAMAGED if found.damage or found.back_in_time else code
        if sink is not None:
            sink.write(as_json.line(objects[0] if len(objects) == 1 else objects) + "\n")
    return code
