"""Identify the driver of a log: `python examples/identify_log.py LOG VEHICLE`."""

from __future__ import annotations

import sys

import canid


def main(log: str, vehicle: str) -> None:
    """Print K, τ and θ of every input, as far as this drive determines them."""
    found = canid.identify(log, vehicle)
    print(found.summary())
    for name, channel in found.channels.items():
        # K has value, low and high; the status says what may be quoted
        print(f"{name}: K = {channel.K} ({channel.status.value})")


if __name__ == "__main__":
    try:
        main(*sys.argv[1:3])
    except canid.CanidError as error:  # a log or a vehicle file that cannot be used: one line
        sys.exit(str(error))
