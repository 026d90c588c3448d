"""`canid recover LOG`: a clean copy of a damaged log."""

from __future__ import annotations

import argparse
import math
from typing import Any

from canid.cli import options, output_kinds, outputs, progress
from canid.cli.outputs import Output
from canid.cli.talk import talk
from canid.errors import DAMAGED, DONE
from canid.frames.recovery import Recovered


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help=options.LOGS)
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="the copy: .blf, .asc or .log, never over a file that exists; default: LOG with .recovered before its "
        "suffix, .blf where LOG has a format that canid does not write",
    )
    options.json_file(parser)
    parser.epilog = (
        "exit: 0 nothing was damaged and the copy is whole, 4 something was damaged and all the rest is in the copy, "
        "or not one frame could be read and there is no copy"
    )


def run(args: argparse.Namespace) -> int:
    """Recover."""
    from canid.frames.recovery import recover, recovered_path
    from canid.views import as_json

    json = options.json_output(args)
    copy = Output("-o", args.output or str(recovered_path(args.log)), output_kinds.RECORDING)
    outputs.check([json, copy], options.read_by(args))
    bar = progress.Progress(f"reading {args.log}")
    with outputs.opened(json) as sink:
        try:
            found = recover(args.log, args.output, bar.to)
        finally:
            bar.close()
        talk(found.damage.says if found.damage else f"read {found.frames} frames, nothing damaged")
        events = f", {found.events} of the recorder's events" if found.events else ""
        talk(f"{found.path}: {found.frames} frames{events}")
        if found.others:
            talk(f"not in the copy: {found.others_says}")
        if sink is not None:
            sink.write(as_json.line(told(args.log, found)) + "\n")
    return DAMAGED if found.damage else DONE


def told(log: str, found: Recovered) -> dict[str, Any]:
    """The same as JSON."""
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
