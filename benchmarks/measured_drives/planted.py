"""Effects planted on measured drives: what canid finds where the noise is a person's, and what where nothing is planted.

    python -m benchmarks planted [--data ../shared/data] [--plant EFFECT ...] [--seed 1]

Each half of each AstaZero drive: the baseline fitted to it, with its own noise, follows the recorded lead in closed loop
with an effect; `diagnose` gets what the sensors would have had. One draw of the noise per half.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.measured_drives.__main__ import part
from canid import read_trace
from canid.models.diagnosis import corrections
from canid.models.diagnosis.diagnose import diagnose
from canid.models.diagnosis.null import replicates
from canid.models.diagnosis.null.replicates import Null, recorded_drive
from canid.models.diagnosis.prepared_drive import ready
from canid.models.effects import CATALOGUE
from canid.values.findings import Report
from canid.values.types import Interval, LearnGate, Trace

LOGS = ("asta_p10_f2_Audi_A6", "asta_p10_f4_Mercedes_AClass", "asta_p3_f2_Tesla_Model3", "asta_p3_f4_Audi_A6")
NOTHING = "nothing"
# effect -> strength; of an asymmetric gain, share 0.36 is 1.36 to 0.64, as 1.5 to 0.7
PLANTED: dict[str, tuple[float, ...]] = {
    NOTHING: (),
    "relative_speed_dead_zone": (0.4,),
    "asymmetric_gain": (0.36,),
    "looming_gain": (1.0,),
    "lead_acceleration": (0.5,),
}
HEAD = (
    "| planted | half | said of the driver | evidence of the planted, needed "
    "| log score, nats/min | gain of the simulation | null, 95 % |\n"
    "|---|---|---|---|---|---|---|"
)
# draws of the noise until the driver follows the lead to the end
TRIES = 4


def planted(trace: Trace, effect: str, seed: int) -> Trace | None:
    """The drive as its fitted driver with an effect drives it; None: he does not follow this lead."""
    context = corrections.diagnose_context(trace, CATALOGUE)
    prepared = ready(context.trace, context.usable)
    if prepared is None:
        return None
    drive = recorded_drive(prepared, context.usable, context.vehicle, trace.dt)
    noise = Null(drive, CATALOGUE, lambda _: None).noise(prepared.data, prepared.fitted)
    driver = prepared.fitted
    if effect != NOTHING:
        (one,) = (one for one in CATALOGUE if one.id == effect)
        q = np.r_[driver.q, PLANTED[effect]]
        driver = driver._replace(model=driver.model.with_effects((one,)), fitted=driver.fitted._replace(q=q))
    for attempt in range(TRIES):
        made = next(replicates.simulated(drive, driver, noise, 1, [seed, attempt]), None)
        if made is not None:
            gates = zip(made.trace.gate, made.usable.tolist(), strict=True)
            # where a stretch begins, the drive jumps
            gate = tuple(gate if fine else LearnGate.TARGET_CHANGE for gate, fine in gates)
            return made.trace._replace(gate=gate)
    return None


def said(report: Report) -> str:
    """Names of the driver, or the verdict."""
    names = [f for f in report.findings if f.where == "driver"]
    if not names:
        mean = {block.where: block.state for block in report.blocks}["driver"]
        return "–" if mean == "adequate" else mean
    return ", ".join(
        f"{f.effect}{' (surrogate)' * f.surrogate}{' or ' * bool(f.rivals)}{' or '.join(f.rivals)}"
        for f in names
    )


def shown(of: Interval) -> str:
    """A value with its interval; a dash where there is none."""
    return "–" if math.isnan(of.value) else f"{of.value:.2g} [{of.low:.2g}, {of.high:.2g}]"


def halves(data: Path) -> Iterator[tuple[str, Trace]]:
    """Each half of each drive."""
    for log in LOGS:
        trace = read_trace(data / "asta" / f"{log}.blf", "openacc_asta")
        for name, start, stop in (("first", 0.0, 0.5), ("second", 0.5, 1.0)):
            yield f"{log}, {name} half", part(trace, start, stop)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks planted",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--plant", nargs="+", choices=PLANTED, default=list(PLANTED))
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    print(HEAD)
    right = dict.fromkeys(args.plant, 0)
    drives = list(halves(args.data))
    for effect in args.plant:
        for name, trace in drives:
            made = planted(trace, effect, args.seed)
            if made is None:
                print(f"| {effect} | {name} | the fitted driver does not follow | | | | |", flush=True)
                continue
            report = diagnose(made)
            sure = {
                n
                for f in report.findings
                if f.where == "driver" and not f.surrogate
                for n in (f.effect, *f.rivals)
            }
            right[effect] += effect in sure or (effect == NOTHING and not sure)
            seen = max(
                (one for one in report.tried if one.effect == effect),
                key=lambda one: one.evidence,
                default=None,
            )
            evidence = "–" if seen is None else f"{seen.evidence:.0f}, {seen.needed:.0f}"
            score, gain = report.log_score_gain, report.gain
            null = report.null_gain.high
            print(
                f"| {effect} | {name} | {said(report)} | {evidence} | {shown(score)} | {shown(gain)} "
                f"| {'–' if math.isnan(null) else f'{null:.2g}'} |",
                flush=True,
            )
    print("\n" + "\n".join(f"{effect}: right in {n} of {len(drives)}" for effect, n in right.items()))


if __name__ == "__main__":
    main()
