"""`canid study`: the two papers behind canid, checked by their own numbers, reproduced on logs and corrected."""

from __future__ import annotations

import argparse
import math
import os
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from canid.cli import drive_source, options, reading, study_runs
from canid.cli.output import output_kinds, outputs
from canid.cli.output.messages import info, line_printer
from canid.cli.output.outputs import Output
from canid.errors import CHECK_FAILED, DONE, ConfigError, OutputError

if TYPE_CHECKING:
    from canid.findings import Provenance
    from canid.study.artifact import Study

PAPERS = ("grover", "chen-ulsoy")
# vehicle files of the simulated drives
SIMULATED = {"grover": "generic", "chen-ulsoy": "generic_lane"}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    verbs = parser.add_subparsers(
        dest="what", required=True, metavar="prints|grover|chen-ulsoy", help="what to study"
    )
    prints = verbs.add_parser("prints", help="what follows from the papers' own numbers; needs no log")
    prints.add_argument("paper", nargs="?", choices=PAPERS, help="one of them; default: both")
    prints.add_argument(
        "--deep", action="store_true", help="search the misprints that would repair an equation as well"
    )
    _common(prints)
    grover = verbs.add_parser(
        "grover", help="car following: Grover's method and canid's on the same episodes"
    )
    grover.add_argument(
        "--min-episode", type=options.seconds, metavar="S", help="shortest episode in s; default: 20"
    )
    grover.add_argument(
        "--gate-fit",
        type=float,
        metavar="PERCENT",
        help="leave out episodes where a transfer function fits less; default: 0, none",
    )
    _of_logs(grover, "1,10")
    chen = verbs.add_parser(
        "chen-ulsoy", help="lane keeping: Chen & Ulsoy's method and canid's on the same segments"
    )
    chen.add_argument(
        "--segment", type=options.above_zero, metavar="S", help="length of a segment in s; default: 60"
    )
    chen.add_argument(
        "--by",
        choices=("file", "folder"),
        default="folder",
        help="what is one driver's; default: a folder of logs",
    )
    chen.add_argument("--bootstraps", type=int, metavar="N", help="replicates for null bands and intervals")
    chen.add_argument("--drivers", type=int, metavar="N", help="with --reproduce: drivers; default: 12")
    chen.add_argument(
        "--c1", type=float, metavar="C", help="with --reproduce: moving average of the driver's noise"
    )
    chen.add_argument(
        "--push", type=float, metavar="A", help="with --reproduce: disturbance of the road in m/s²"
    )
    _of_logs(chen, "120")


def _of_logs(parser: argparse.ArgumentParser, minutes: str) -> None:
    """Options of a study of logs."""
    parser.add_argument("logs", metavar="LOG", nargs="*", help=options.LOGS)
    options.vehicle(parser, required=False)
    drive_source.arguments(parser)
    options.part(parser)
    parser.add_argument(
        "--reproduce",
        action="store_true",
        help="simulate the paper's drivers through DBC and .blf, and study those",
    )
    parser.add_argument(
        "--seed", type=int, default=1, metavar="N", help="with --reproduce: random seed; default: 1"
    )
    parser.add_argument(
        "--minutes",
        default=minutes,
        metavar="M",
        help=f"with --reproduce: length of the drives; default: {minutes}",
    )
    parser.add_argument(
        "--seeds", type=int, metavar="N", help="with --reproduce: drives of each driver and length"
    )
    parser.add_argument(
        "--check", action="store_true", help="exit with 1 if a figure of --reproduce is missed (for CI)"
    )
    parser.add_argument("--jobs", type=int, metavar="N", help="processes; default: one per core")
    _common(parser)


def _common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-o",
        "--out",
        metavar="DIR",
        help="write study.html, study.json, tables/*.csv and figures/*.svg into a folder",
    )
    options.json_file(parser)


def run(args: argparse.Namespace) -> int:
    """Study, and show what came of it."""
    from canid.views import json_values
    from canid.views.study import study_files

    json = options.json_output(args)
    outputs.check([json], options.read_by(args))
    folder = None if args.out is None else _folder(args.out)
    made, damaged = _studied(args)
    show = line_printer(args.json)
    for study in made:
        for line in study_files.text(study):
            show(line)
    line = command(args)
    with outputs.opened(json) as sink:
        if sink is not None:
            objects = [study_files.to_json(study, line) for study in made]
            sink.write(json_values.document("study", objects[0] if len(objects) == 1 else objects) + "\n")
    if folder is not None:
        _write(folder, made, _provenance(args))
        info(f"{folder / 'study.html'} written")
    missed = any(study.failed for study in made)
    empty = args.what != "prints" and not any(study.artifacts for study in made)
    return damaged or (CHECK_FAILED if empty or (missed and args.check) else DONE)


def _studied(args: argparse.Namespace) -> tuple[Sequence[Study], int]:
    """Make the studies; the exit code of damaged logs."""
    if args.what == "prints":
        from canid.study.prints import prints

        return [prints.study(args.paper or "both", deep=args.deep)], DONE
    if bool(args.logs) == args.reproduce:
        raise ConfigError(
            f"study {args.what}: name logs, or use --reproduce, which simulates the paper's drivers"
            if not args.logs
            else f"study {args.what}: --reproduce makes its own logs: leave out {args.logs[0]}"
        )
    if args.logs and args.vehicle is None and not any(map(drive_source.is_table, args.logs)):
        raise ConfigError(
            f"study {args.what}: --vehicle V.toml is missing; generic and generic_lane are built in"
        )
    if args.reproduce:
        vehicle = reading.read_vehicle(args.vehicle or SIMULATED[args.what])
        return [study_runs.reproduced(args, vehicle)], DONE
    return study_runs.of_logs(args, drive_source.car(args, f"study {args.what}"))


def _folder(name: str) -> Path:
    """The folder of the results, made if it is not there. Raises OutputError."""
    folder = Path(name)
    try:
        for part in (folder, folder / "tables", folder / "figures"):
            part.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{name}: cannot be made a folder ({error.strerror})") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"{name}: cannot be written (Permission denied)")
    return folder


def command(args: argparse.Namespace) -> str:
    """The command that gives the same study again.

    Example:
        >>> command(argparse.Namespace(what="prints", paper="grover", deep=False, out=None, json=None))
        'canid study prints grover'
    """
    shown = {
        key: value for key, value in vars(args).items() if key not in ("what", "paper", "logs", "out", "json")
    }
    words = [
        "canid",
        "study",
        args.what,
        *filter(None, [getattr(args, "paper", None)]),
        *getattr(args, "logs", []),
    ]
    for key, value in shown.items():
        if value is True:
            words.append(f"--{key.replace('_', '-')}")
        elif isinstance(value, list):
            words += [word for one in value for word in (f"--{key}", one)]
        elif value not in (None, False, DEFAULTS.get(key)):
            words += [f"--{key.replace('_', '-')}", str(value)]
    return shlex.join(words)


# options that are left out of the command where they have these values
DEFAULTS = {"start": 0.0, "stop": math.inf, "seed": 1, "by": "folder"}


def _provenance(args: argparse.Namespace) -> Provenance:
    from canid.cli import provenance
    from canid.findings import Provenance

    logs = getattr(args, "logs", [])
    if not logs:
        return Provenance(command=command(args), versions=provenance.versions())
    vehicle = drive_source.car(args, "study").vehicle
    return provenance.provenance(logs, vehicle, command(args))


def _write(folder: Path, made: Sequence[Study], of: Provenance) -> None:
    """All files of the studies. Raises OutputError."""
    from canid.views import json_values
    from canid.views.study import figure_svg, study_files, study_page

    objects = [study_files.to_json(study, of.command) for study in made]
    drawings = {(study.paper, f.name): figure_svg.drawn(f) for study in made for f in study.figures}
    texts = {
        "study.json": (
            json_values.document("study", objects[0] if len(objects) == 1 else objects) + "\n",
            output_kinds.JSON,
        ),
        "study.html": (study_page.page(made, of, drawings), output_kinds.STUDY_PAGE),
    }
    for study in made:
        for table in study.tables:
            text = study_files.to_csv(table)
            texts[f"tables/{table.name}.csv"] = text, output_kinds.study_table(text.partition("\n")[0])
    for (_, name), drawing in drawings.items():
        texts[f"figures/{name}.svg"] = figure_svg.svg(drawing), output_kinds.STUDY_FIGURE
    files = [Output("-o", str(folder / name), kind) for name, (_, kind) in texts.items()]
    outputs.check(files, [])
    for file, (text, _) in zip(files, texts.values(), strict=True):
        with outputs.opened_file(file) as sink:
            sink.write(text)
