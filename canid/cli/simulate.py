"""`canid simulate OUT.blf`: a log with known truth; the truth stands in a .truth.json beside it."""

from __future__ import annotations

import argparse
from pathlib import Path

from canid.cli import options
from canid.errors import DONE, OutputError


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
    from canid.frames import write_log
    from canid.simulation import START_UTC, frames, simulate, truth_text
    from canid.vehicle import read_vehicle

    vehicle = read_vehicle(args.vehicle or ("generic_lane" if args.profile == "lane" else "generic"))
    simulation = simulate(
        minutes=args.minutes, seed=args.seed, profile=args.profile, noise=args.noise, hide=dict(args.hide)
    )
    out = Path(args.out)
    beside = out.with_name(out.name.removesuffix(out.suffix) + ".truth.json")
    for path in (out, beside):
        options.refuse_to_overwrite(path, force=args.force)
    write_log(out, frames(simulation, vehicle), START_UTC, overwrite=args.force)
    truth = truth_text(simulation, vehicle)
    try:
        beside.write_text(truth, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{beside}: cannot be written ({error.strerror})") from error
    with options.sink(args.json) as sink:
        if sink is not None:
            sink.write(truth)
    options.talk(f"{out} written, its truth in {beside}")
    return DONE
