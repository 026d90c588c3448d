"""`canid fleet export DIR --to sumo`: the drivers of a fleet as vehicle types of the traffic simulator SUMO."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

from canid import __version__
from canid.ui.cli.options import options
from canid.ui.cli.output import complete_files, output_kinds, outputs
from canid.ui.cli.output.outputs import Output
from canid.ui.terminal.messages import info, print_text
from canid.values.errors import DONE, ConfigError

if TYPE_CHECKING:
    from canid.analysis.sumo.pooled_driver import Drive, PooledDriver

FORMATS = ("sumo",)
# reasons why drives have no model, in words
MAX_REASONS = 5
# drives with numbers; a duplicate has none, so nothing counts twice
DRIVES = (
    "SELECT log, driver, traffic_json FROM drives WHERE key IS NOT NULL AND status <> 'failed' ORDER BY log"
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("folder", metavar="DIR", help="folder of canid fleet")
    parser.add_argument("--to", choices=FORMATS, default="sumo", help="traffic simulator; default: sumo")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE.add.xml",
        help="additional file for SUMO, with a vType per driver and a distribution over all; default: standard output",
    )
    parser.add_argument(
        "--driver", metavar="NAME", nargs="+", default=[], help="these drivers alone; default: all"
    )
    options.force(parser)


def run(args: argparse.Namespace) -> int:
    """Pool each driver's drives, write the file.

    Raises:
        ConfigError: no folder of canid fleet, no such driver, or no drive that has a model.
    """
    from canid.analysis.fleet.storage import mirror
    from canid.analysis.fleet.storage.database import opened, rows
    from canid.analysis.sumo.pooled_driver import pooled
    from canid.analysis.sumo.vehicle_types import additional
    from canid.ui.cli.exporting.export_driver import said

    file = Output("-o", args.output, output_kinds.SUMO, replace=args.force) if args.output else None
    folder = mirror.local(args.folder)
    outputs.check([file], sorted(Path(folder).glob("*.parquet")))
    with opened(folder) as db:
        by_driver, reasons = _models(rows(db, DRIVES), args.driver, args.folder)
    drivers: list[PooledDriver] = [pooled(name, drives) for name, drives in by_driver.items()]
    text = additional(drivers, Path(folder).resolve().name, f"canid {__version__}")
    complete_files.write(file, lambda: text)
    if file is None:
        print_text(text)
    for driver in drivers:
        info(said(driver))
    for line in reasons[:MAX_REASONS]:
        info(line)
    if len(reasons) > MAX_REASONS:
        info(f"{len(reasons) - MAX_REASONS} more drives have no model")
    if file is not None:
        info(
            f"{args.output}: {len(drivers)} vehicle types from {sum(len(x) for x in by_driver.values())} drives"
        )
    return DONE


def _models(
    drives: Sequence[Mapping[str, Any]], wanted: Sequence[str], folder: str
) -> tuple[dict[str, list[Drive]], list[str]]:
    """Drives with a model by driver, and why the others have none. Raises ConfigError."""
    from canid.analysis.sumo.driver_model import NoModel, from_json
    from canid.analysis.sumo.pooled_driver import Drive

    names = sorted({str(row["driver"] or "") for row in drives})
    for name in wanted:
        if name not in names:
            close = get_close_matches(name, names, n=1)
            hint = (
                f"did you mean {close[0]}?" if close else f"`canid fleet query {folder} drivers` lists them"
            )
            raise ConfigError(f'fleet export: {folder} has no driver "{name}"; {hint}')
    by_driver: dict[str, list[Drive]] = {}
    reasons = []
    for row in drives:
        driver, log = str(row["driver"] or ""), str(row["log"])
        if wanted and driver not in wanted:
            continue
        if row["traffic_json"] is None:
            reasons.append(
                f"{log}: was analysed without models for traffic simulators (--no-traffic), or failed in them"
            )
            continue
        try:
            model = from_json(json.loads(row["traffic_json"]))
        except ValueError as error:
            reasons.append(f"{log}: {error}")
            continue
        if isinstance(model, NoModel):
            reasons.append(f"{log}: {model.reason}")
        else:
            by_driver.setdefault(driver, []).append(Drive(Path(log).name, model))
    if not by_driver:
        why = f": {reasons[0]}" if reasons else ""
        raise ConfigError(f"fleet export: no drive of {folder} has a model for SUMO{why}")
    return by_driver, reasons
