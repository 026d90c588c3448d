"""A folder of logs as one pandas table, and a drive from arrays: `python examples/batch.py FOLDER VEHICLE`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

import canid


def table(folder: Path, vehicle: str) -> pd.DataFrame:
    """One row per log and parameter; logs that cannot be used are named on standard error, and left out."""
    car, frames = canid.read_vehicle(vehicle), []
    for log in sorted(folder.glob("*.blf")):
        try:
            found = canid.identify(log, car, select_orders=False, sliding=False)
        except canid.CanidError as error:
            print(error, file=sys.stderr)
            continue
        frames.append(found.to_frame("pandas").assign(log=log.name, fit=found.fit_percent))
    if not frames:
        sys.exit(f"{folder}: no log could be used")
    return pd.concat(frames, ignore_index=True)


def own_data() -> canid.Trace:
    """A drive that is no CAN log: here a first-order driver, simulated in four lines."""
    t = np.arange(0.0, 400.0, 0.1)
    rng = np.random.default_rng(1)
    speed = 15.0 + 2.0 * np.sin(0.11 * t) + np.sin(0.37 * t + 1.0)
    range_rate = 1.2 * np.sin(0.23 * t) + 0.8 * np.sin(0.61 * t) + 0.4 * np.sin(1.3 * t)
    gap = 30.0 + 0.1 * (np.cumsum(range_rate) - 0.5 * range_rate)  # trapezoidal rule
    heard = np.interp(t - 0.5, t, 3.0 * (gap / speed - 2.0) + 6.0 * range_rate)
    pedal = np.zeros_like(t)
    noise = 0.0
    for k in range(1, len(t)):
        pedal[k] = pedal[k - 1] + 0.1 / 0.4 * (heard[k] - pedal[k - 1])
    for k in range(len(t)):
        noise = 0.9 * noise + rng.normal(0.0, 0.25)
        pedal[k] += 25.0 + noise
    return canid.from_arrays(time=t, pedal=pedal, speed=speed, gap=gap, range_rate=range_rate)


def main(folder: str, vehicle: str) -> None:
    """Print both."""
    found = table(Path(folder), vehicle)
    print(found[found.quotable].to_string(index=False, float_format="%.2f"))
    print(canid.identify(own_data(), sliding=False))


if __name__ == "__main__":
    main(*sys.argv[1:3])
