"""Hide causes in simulated drives and ask `diagnose`: how often is it right, silent, wrong?

    python -m benchmarks.hidden_effects [--logs 500] [--first-seed 90000] [--workers 2]

Two planting simulators, six noise kinds, three profiles, 10 to 30 min. Four logs of ten are clean. Strengths are drawn by
the simulators; `expected` prices each one as the likelihood ratio that an oracle would see.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import beta

from benchmarks.hidden_effects import plant_one, plant_two
from benchmarks.hidden_effects.expected import expected
from benchmarks.hidden_effects.sensed import trace
from canid.diagnosis.diagnosing import diagnose
from canid.effects import CATALOGUE
from canid.findings import Report, Verdict

PLANTS: dict[str, Callable[..., Any]] = {"one": plant_one.plant, "two": plant_two.plant}
NOISES = ("white", "ar1", "ar4", "resonant", "state", "mix")
PROFILES = ("mixed", "urban", "motorway")
IDS = tuple(e.id for e in CATALOGUE if e.where == "driver" and e.kind != "mask" and e.planted)
# what no file of the catalogue describes, under the names that both simulators know
MINUTES = (10.0, 10.0, 20.0, 30.0)
# parameters whose estimate is held against the planted one; moments and episodes are not numbers of this kind
COMPARED = ("width", "threshold", "exponent", "share", "rate", "distance", "gain", "level")


class Drive(NamedTuple):
    """One drive of the table."""

    simulator: str
    noise: str
    profile: str
    minutes: float
    seed: int
    hidden: str  # id; "" for a clean one; "-id": planted, but taken out of the catalogue


class Outcome(NamedTuple):
    """What came of it."""

    drive: Drive
    verdict: str
    named: tuple[str, ...]
    rivals: tuple[str, ...]
    surrogate: bool
    lr: float
    share: float
    ratio: float  # estimate / truth
    covered: float  # 1 the interval holds the truth, 0 it does not, NaN not asked
    gain_low: float
    gain_high: float
    k2_covered: float
    seconds: float


def drives(logs: int, first: int) -> list[Drive]:
    """Lay out the table's drives."""
    out = []
    rng = np.random.default_rng(first)
    for k in range(logs):
        simulator = ("one", "two")[k % 2]
        hidden = "" if k % 10 < 4 else IDS[int(rng.integers(len(IDS)))]
        if k % 10 == 9:
            hidden = "-" + hidden
        out.append(
            Drive(
                simulator,
                NOISES[int(rng.integers(6))],
                PROFILES[int(rng.integers(3))],
                MINUTES[int(rng.integers(4))],
                first + k,
                hidden,
            )
        )
    return out


def one(drive: Drive) -> Outcome:
    """Plant, encode, diagnose."""
    effect = drive.hidden.removeprefix("-")
    planted = PLANTS[drive.simulator](
        {effect: {}} if effect else {},
        seed=drive.seed,
        minutes=drive.minutes,
        noise=drive.noise,
        profile=drive.profile,
    )
    measured = trace(planted)
    catalogue = tuple(e for e in CATALOGUE if drive.hidden != f"-{e.id}")
    began = time.process_time()
    report = diagnose(measured, catalogue=catalogue)
    took = time.process_time() - began
    price = expected(planted) if effect else None
    ratio, covered = compared(report, effect, planted.truth)
    K2 = report.extended.channels["range_rate"].K if report.extended.channels else None
    truth = planted.truth["driver"]["K2"]
    return Outcome(
        drive,
        report.verdict.value,
        tuple(f.effect for f in report.findings),
        tuple(r for f in report.findings for r in f.rivals),
        any(f.surrogate for f in report.findings),
        price.lr if price else math.nan,
        price.share if price else math.nan,
        ratio,
        covered,
        report.gain.low,
        report.gain.high,
        float(K2.low <= truth <= K2.high) if K2 is not None else math.nan,
        took,
    )


def compared(report: Report, effect: str, truth: dict[str, Any]) -> tuple[float, float]:
    """Estimate over truth and coverage of the planted cause's first number."""
    for finding in report.findings:
        if finding.effect == effect:
            for name, value in truth["effects"][effect].items():
                if name in COMPARED and name in finding.parameters and value:
                    iv = finding.parameters[name]
                    return iv.value / value, float(iv.low <= value <= iv.high)
    return math.nan, math.nan


def share(hits: list[bool]) -> str:
    """Share with its count and 95 % bounds (Clopper & Pearson 1934)."""
    n, k = len(hits), sum(hits)
    if not n:
        return "– (0)"
    low = beta.ppf(0.025, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
    return f"{100 * k / n:.1f} % [{100 * low:.0f}, {100 * high:.0f}] ({k}/{n})"


def lines(outcomes: list[Outcome]) -> list[str]:
    """The table, one line per figure; all drives and per simulator."""
    bad = {Verdict.NAMED.value, Verdict.ONE_OF.value}
    out = ["| figure | all | simulator one | simulator two |", "|---|---|---|---|"]

    def row(name: str, of: Callable[[Outcome], bool], hit: Callable[[Outcome], bool]) -> None:
        cells = []
        for simulator in ("", "one", "two"):
            chosen = [o for o in outcomes if of(o) and simulator in ("", o.drive.simulator)]
            cells.append(share([hit(o) for o in chosen]))
        out.append(f"| {name} | " + " | ".join(cells) + " |")

    def right(o: Outcome) -> bool:
        return o.verdict in bad and o.drive.hidden in (*o.named, *o.rivals)

    clean = [o for o in outcomes if not o.drive.hidden]
    row("false names on clean logs", lambda o: not o.drive.hidden, lambda o: o.verdict in bad)
    for noise in NOISES:
        row(
            f"· {noise}",
            lambda o, n=noise: not o.drive.hidden and o.drive.noise == n,
            lambda o: o.verdict in bad,
        )
    row(
        "false “unexplained” on clean logs",
        lambda o: not o.drive.hidden,
        lambda o: o.verdict == "unexplained",
    )
    known = lambda o: o.drive.hidden in IDS  # noqa: E731
    row("right name or in its rivals, LR ≥ 50", lambda o: known(o) and o.lr >= 50, right)
    row("· exactly one finding", lambda o: known(o) and o.lr >= 50, lambda o: right(o) and len(o.named) == 1)
    row("LR 30–50: something named", lambda o: known(o) and 30 <= o.lr < 50, lambda o: o.verdict in bad)
    row("LR 30–50: right", lambda o: known(o) and 30 <= o.lr < 50, right)
    out_of = lambda o: o.drive.hidden.startswith("-") and o.share >= 0.1  # noqa: E731
    row(
        "taken out of the catalogue, share ≥ 10 %: unexplained or surrogate",
        out_of,
        lambda o: o.verdict == "unexplained",
    )
    row("parameter's interval holds the truth", lambda o: o.covered == o.covered, lambda o: o.covered > 0)
    row(
        "K2's interval holds the truth, cause named",
        lambda o: known(o) and right(o),
        lambda o: o.k2_covered > 0,
    )
    row(
        "gain's interval above 0, share ≥ 20 %",
        lambda o: right(o) and o.share >= 0.2,
        lambda o: o.gain_low > 0,
    )
    sizes = [1 + len(o.rivals) for o in outcomes if known(o) and right(o)]
    ratios = [o.ratio for o in outcomes if o.ratio == o.ratio]
    took = [o.seconds for o in outcomes if o.drive.minutes == 10]
    out += [
        "",
        f"- mean size of cause and rivals: {np.mean(sizes):.2f} over {len(sizes)} drives" if sizes else "",
        f"- estimate / truth, median: {np.median(ratios):.2f} over {len(ratios)}" if ratios else "",
        f"- CPU time of `diagnose`, 10 min: median {np.median(took):.1f} s, worst {max(took):.1f} s"
        if took
        else "",
        f"- {len(outcomes)} drives, {len(clean)} of them clean",
    ]
    return out


def main() -> None:
    """Run the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--logs", type=int, default=500)
    parser.add_argument("--first-seed", type=int, default=90_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--wrong", action="store_true", help="list the drives that went wrong")
    args = parser.parse_args()
    with ProcessPoolExecutor(args.workers) as pool:
        outcomes = list(pool.map(one, drives(args.logs, args.first_seed)))
    print("\n".join(lines(outcomes)))
    if args.wrong:
        for o in outcomes:
            d = o.drive
            fine = o.verdict == "adequate" if not d.hidden else d.hidden in (*o.named, *o.rivals)
            if not fine and not (d.hidden and o.lr < 50):
                print(f"{d.simulator} {d.noise} {d.profile} {d.minutes:g} min seed {d.seed} {d.hidden or 'clean'}: "
                      f"{o.verdict} {o.named} LR {o.lr:.0f} share {o.share:.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
