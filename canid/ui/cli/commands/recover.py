"""`canid recover LOG`: a clean copy of a damaged log."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple

from canid.io.logs.recovery import Recovered
from canid.ui.cli.options import options
from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info
from canid.ui.terminal.progress import Progress
from canid.values.errors import DAMAGED, DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    options.time_zone(parser)
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="the copy: .blf, .asc or .log; an existing file is never overwritten; default: LOG with .recovered before "
        "its suffix, as .blf if canid does not write the format of LOG",
    )
    options.json_file(parser)
    parser.epilog = (
        "exit codes: 0 nothing was damaged, the copy is complete; 2 LOG is no log; 4 something was damaged, the copy has "
        "everything else, or no frame could be read and there is no copy"
    )


def results() -> dict[str, Any]:
    """Name of a schema -> type of what --json writes."""
    return {"recover": Recovery}


def run(args: argparse.Namespace) -> int:
    """Recover."""
    from canid.io.logs.input_file import regular_file
    from canid.io.logs.recovery import recover, recovered_path
    from canid.values.text import json_values

    json = options.json_output(args)
    regular_file(Path(args.log))  # before the copy's name is judged, which is made of it
    copy = Output("-o", args.output or str(recovered_path(args.log)), output_kinds.RECORDING)
    outputs.check([json, copy], options.read_by(args))
    with complete_files.opened(json) as sink:
        with Progress(f"reading {args.log}") as bar:
            recovered = recover(args.log, args.output, bar.to)
        info(
            recovered.damage.says
            if recovered.damage
            else f"read {recovered.frames:,} frames, nothing damaged"
        )
        events = f", {recovered.events} of the recorder's events" if recovered.events else ""
        info(f"{recovered.path}: {recovered.frames:,} frames{events}")
        for remark in recovered.remarks:
            info(remark)
        if recovered.others:
            info(f"not in the copy: {recovered.others_says}")
        if sink is not None:
            sink.write(json_values.document("recover", document(args.log, recovered)) + "\n")
    return DAMAGED if recovered.damage else DONE


class Recovery(NamedTuple):
    """The object of --json."""

    log: str
    path: str  # of the copy
    frames: int
    events: int
    others: int  # lines or objects without a CAN frame
    start_utc: float
    read: int  # objects
    total: int | None  # objects that the log should hold; None: nobody knows
    damaged: tuple[tuple[int, int], ...]  # first and last byte
    says: str


def document(log: str, copy: Recovered) -> Recovery:
    """What --json writes."""
    damage = copy.damage
    return Recovery(
        log,
        str(copy.path),
        copy.frames,
        copy.events,
        copy.others,
        copy.start_utc,
        copy.read,
        copy.read if not damage else damage.total if damage.total >= 0 else None,
        damage.spans if damage else (),
        damage.says if damage else "",
    )
