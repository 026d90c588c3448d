"""Changes of the driver: false ones on constant drives, and steps of both gains that are found, by kind of noise."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from canid.mathematics.estimators.fopdt import FOPDT, FopdtSettings
from tests.plants.outside_form import draw, drive
from tests.plants.outside_form_sensors import seen

NOISES = ("drift", "ar", "steps")
FACTORS = (1.0, 1.0, 1.5)
# s; a change that is reported so far from a true one is another
NEAR_S = 60.0


def table(runs: int, minutes: list[float], first_seed: int) -> str:
    """One row for each kind of noise and factor: drives, those with a change, and those with the true one.

    Args:
        runs: drives.
        minutes: lengths, in turn.
        first_seed: of the first drive.
    """
    rows: dict[tuple[str, float], list[tuple[bool, bool, float]]] = defaultdict(list)
    for run in range(runs):
        noise, factor = NOISES[run % 3], FACTORS[run // 3 % 3]
        long = minutes[run // 9 % len(minutes)]
        at = 60.0 * long * (0.35 + 0.3 * float(np.random.default_rng([first_seed + run, 3]).uniform()))
        world = draw(first_seed + run, long, noise)._replace(change=(at, factor))
        trace = seen(world, drive(world))
        assert FOPDT.identify is not None
        found = FOPDT.identify(trace, FopdtSettings(output_filter=trace.output_filter))
        assert found is not None
        times = [change.t.value for change in found.details.get("changes", ())]
        least = found.details["visible_change"]["factor"]
        near = factor > 1.0 and any(abs(t - at) < NEAR_S for t in times)
        rows[noise, factor].append((bool(times), near, least))
        said = ", ".join(f"{t:.0f}" for t in times) or "none"
        print(
            f"{world.seed} {long:g} {noise} x{factor} at {at:.0f} s: {said}; power x{least:.2f}", flush=True
        )
    lines = [
        "| noise, factor | drives | a change reported | the true one | would be seen from, median |",
        "|---|---|---|---|---|",
    ]
    for (noise, factor), of in sorted(rows.items()):
        some, near, least = np.array(of, float).T
        true = f"{int(near.sum())}" if factor > 1.0 else ""
        lines.append(
            f"| {noise}, x{factor:g} | {len(of)} | {int(some.sum())} | {true} | x{np.nanmedian(least):.2f} |"
        )
    return "\n".join(lines)
