"""Simulate the logs of this folder, reproducible to the byte: python replay_logs/make.py [FOLDER]."""

from __future__ import annotations

import sys
from pathlib import Path

from canid.logs import write_log
from canid.simulation import START_UTC, Simulation, frames, simulate, truth_text
from canid.vehicle import read_vehicle


def drives() -> dict[str, Simulation]:
    """Return log name -> drive; "lane_..." on the vehicle "generic_lane", the others on "generic"."""
    return {
        "following_mixed.blf": simulate(3, seed=1, profile="mixed"),
        "following_urban.blf": simulate(3, seed=6, profile="urban", noise="mix"),
        "following_motorway.asc": simulate(1.5, seed=4, profile="motorway"),
        # The radar loses the lead twice (3 s and 12 s), and another vehicle cuts in after 100 s.
        "following_lost_lead.blf": simulate(3, seed=3, lost=[(40.0, 43.0), (130.0, 142.0)], cut_in=100.0),
        "lane_keeping.blf": simulate(2, seed=1, profile="lane"),
    }


def main(folder: Path) -> None:
    """Write all logs, each with a file of its true parameters."""
    for name, drive in drives().items():
        vehicle = read_vehicle("generic_lane" if name.startswith("lane") else "generic")
        path = folder / name
        path.unlink(missing_ok=True)
        write_log(path, frames(drive, vehicle), START_UTC)
        path.with_suffix(".truth.json").write_text(truth_text(drive, vehicle), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
