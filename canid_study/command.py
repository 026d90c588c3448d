"""`canid study`: the studies that its options ask for, shown and written as files."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from canid.ui.cli import provenance
from canid.ui.cli.command_line import reproducing
from canid.ui.cli.inputs import drive_source, reading
from canid.ui.cli.options import options
from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info, line_printer
from canid.values.errors import CHECK_FAILED, DONE, ConfigError, OutputError
from canid.values.findings import Provenance
from canid.values.text import json_values
from canid_study import prints, runs
from canid_study.artifact import Study
from canid_study.views import figure_svg, study_files, study_page

# vehicle files of the simulated drives
SIMULATED = {"grover": "generic", "chen-ulsoy": "generic_lane"}
# options that are left out of the command where they have these values


def run(args: argparse.Namespace) -> int:
    """Study, and show and write the results."""
    json = options.json_output(args)
    outputs.check([json], options.read_by(args))
    folder = None if args.out is None else _folder(args.out)
    made, damaged = _studied(args)
    show = line_printer(args.json)
    for study in made:
        for line in study_files.text(study):
            show(line)
    line = command(args)
    with complete_files.opened(json) as sink:
        if sink is not None:
            objects = [study_files.document(study, line) for study in made]
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
        return [runs.reproduced(args, vehicle)], DONE
    return runs.of_logs(args, drive_source.car(args, f"study {args.what}"))


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
    operands = [*filter(None, [getattr(args, "paper", None)]), *getattr(args, "logs", [])]
    fields = [key for key in vars(args) if key not in ("what", "paper", "logs", "out", "json")]
    options = [f"--{key.replace('_', '-')}" for key in fields]
    return reproducing(args, f"study {args.what}", *operands, options=options)


def _provenance(args: argparse.Namespace) -> Provenance:
    logs = getattr(args, "logs", [])
    if not logs:
        return Provenance(command=command(args), versions=provenance.versions())
    vehicle = drive_source.car(args, "study").vehicle
    return provenance.provenance(logs, vehicle, command(args))


def _write(folder: Path, made: Sequence[Study], origin: Provenance) -> None:
    """All files of the studies. Raises OutputError."""
    objects = [study_files.document(study, origin.command) for study in made]
    drawings = {(study.paper, f.name): figure_svg.drawn(f) for study in made for f in study.figures}
    texts = {
        "study.json": (
            json_values.document("study", objects[0] if len(objects) == 1 else objects) + "\n",
            output_kinds.JSON,
        ),
        "study.html": (study_page.page(made, origin, drawings), output_kinds.STUDY_PAGE),
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
        with complete_files.opened_file(file) as sink:
            sink.write(text)
