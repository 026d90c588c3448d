"""--trigger, --pre and --post of `live` and `record`: record what is around triggers only."""

from __future__ import annotations

import argparse

from canid.signals.triggers import trigger as triggers
from canid.signals.triggers.trigger import Trigger
from canid.values import bounded_numbers
from canid.values.errors import ConfigError


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    group = parser.add_argument_group(
        "triggers", "record only what is around triggers; a mark always triggers as well (docs/triggers.md)"
    )
    group.add_argument(
        "--trigger",
        action="append",
        default=[],
        metavar="CONDITION",
        help='such as "brake > 0", "speed > 50 km/h and gap < 20", MESSAGE.SIGNAL == 3, misfit, mark, '
        '"event bus_lost"; given several times: any of them',
    )
    group.add_argument(
        "--pre",
        type=bounded_numbers.seconds,
        metavar="S",
        help=f"s before a trigger that are recorded, at most {triggers.MAX_PRE_S:g}; default: {triggers.PRE_S:g}",
    )
    group.add_argument(
        "--post",
        type=bounded_numbers.seconds,
        metavar="S",
        help=f"s after the last frame for which it is true; default: {triggers.POST_S:g}",
    )


def trigger_of(args: argparse.Namespace) -> Trigger | None:
    """The trigger; None: everything is recorded. Raises ConfigError, also for signals that the vehicle has not."""
    if not args.trigger:
        for name in ("pre", "post"):
            if getattr(args, name) is not None:
                raise ConfigError(f'--{name} belongs to a trigger: add one, such as --trigger "brake > 0"')
        return None
    pre = triggers.PRE_S if args.pre is None else args.pre
    post = triggers.POST_S if args.post is None else args.post
    trigger = triggers.checked(Trigger(tuple(args.trigger), pre, post))
    if not triggers.needs_vehicle(trigger):
        return trigger
    if args.vehicle is None:
        raise ConfigError(f'--trigger "{args.trigger[0]}" needs --vehicle V.toml, which maps its signals')
    # before the bus is opened: this takes half a second, once
    from canid.signals.triggers.resolution import resolve
    from canid.signals.vehicle import read_vehicle

    resolve(trigger, read_vehicle(args.vehicle))
    return trigger
