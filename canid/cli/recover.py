"""`canid recover LOG`: a clean copy of a damaged log."""

from __future__ import annotations

import argparse
import math
from typing import Any

from canid.cli import options
from canid.cli.output import output_kinds, outputs
from canid.cli.output.messages import info
from canid.cli.output.outputs import Output
from canid.cli.output.progress import Progress
from canid.errors import DAMAGED, DONE
from canid.logs.recovery import Recovered


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="the copy: .blf, .asc or .log; an existing file is never overwritten; default: LOG with .recovered before "
        "its suffix, as .blf if canid does not write the format of LOG",
    )
    options.json_file(parser)
    parser.epilog = (
        "exit codes: 0 nothing was damaged, the copy is complete; 4 something was damaged, the copy has everything else, "
        "or no frame could be read and there is no copy"
    )


def run(args: argparse.Namespace) -> int:
    """Recover."""
    from canid.logs.recovery import recover, recovered_path
    from canid.views import json_values

    json = options.json_output(args)
    copy = Output("-o", args.output or str(recovered_path(args.log)), output_kinds.RECORDING)
    outputs.check([json, copy], options.read_by(args))
    with outputs.opened(json) as sink:
        with Progress(f"reading {args.log}") as bar:
            found = recover(args.log, args.output, bar.to)
        info(found.damage.says if found.damage else f"read {found.frames} frames, nothing damaged")
        events = f", {found.events} of the recorder's events" if found.events else ""
        info(f"{found.path}: {found.frames} frames{events}")
        if found.others:
            info(f"not in the copy: {found.others_says}")
        if sink is not None:
            sink.write(json_values.document("recover", to_json(args.log, found)) + "\n")
    return DAMAGED if found.damage else DONE


def to_json(log: str, found: Recovered) -> dict[str, Any]:
    """The JSON object of a recovery."""
    damage = found.damage
    return {
        "log": log,
        "path": str(found.path),
        "frames": found.frames,
        "events": found.events,
        "others": found.others,
        "start_utc": None if math.isnan(found.start_utc) else found.start_utc,
        "read": found.read,
        "total": found.read if not damage else damage.total if damage.total >= 0 else None,
        "damaged": [list(span) for span in damage.spans] if damage else [],
        "says": damage.says if damage else "",
    }
