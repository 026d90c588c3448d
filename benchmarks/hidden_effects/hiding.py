"""A drive of the table becomes a planted one, as strong as its row asks for: chosen by the oracle, never by the engine."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from benchmarks.hidden_effects.drives import FAINT, FOREIGN, REMOVED, SIMULATORS, TWO, Drive, another_pair
from benchmarks.hidden_effects.expected import Price, each, expected
from canid.values.types import Trace
from tests.plants.measurement import trace
from tests.plants.planted_drive import Planted

# expected likelihood ratio of each of two effects, and share of the residual variance of one outside the catalogue,
# that the table asks for
BOTH, SHARE = 60.0, 0.10
# where LR 30 to 50 is aimed at
FAINT_LR = (32.0, 48.0)
# other strengths, drivers and pairs are drawn so often; what is still too weak is planted as it is and no row counts it
ATTEMPTS = 6
# between one attempt's seed and the next; no table has as many drives
SEED_STEP = 10_000_000
# the number that a cause's size is, of those that have one; a price goes with its square
SIZE_PARAMETERS = (
    "width", "threshold", "exponent", "share", "rate", "sd", "per_minute", "interval", "distance", "gain", "amplitude",
)  # fmt: skip
# a strength may become at most so many times what people show
MAX_SCALE = 2.0


class Hidden(NamedTuple):
    """A drive with what it hides, and what that is worth."""

    planted: Planted
    prices: dict[str, Price]  # effect -> price given the others, for who reads the log
    trace: Trace  # as the log has it


def hide(drive: Drive) -> Hidden:
    """Plant a drive of the table.

    Example:
        >>> from benchmarks.hidden_effects.drives import Drive
        >>> hidden = hide(Drive(5, "one", "two", "ar1", "mixed", 2.0, ("looming_gain",)))
        >>> list(hidden.prices), hidden.prices["looming_gain"].lr > 1
        (['looming_gain'], True)
    """
    first = _planted(drive, drive.effects, {}, 0)
    if drive.kind == FAINT:
        return _faint(drive, first)
    if drive.kind == TWO:
        return _strongest(drive, first, lambda price: price.lr / BOTH)
    if drive.kind in (FOREIGN, REMOVED):
        return _strongest(drive, first, lambda price: price.share / SHARE)
    return first


def _planted(
    drive: Drive, effects: tuple[str, ...], strengths: dict[str, dict[str, float]], attempt: int
) -> Hidden:
    planted = SIMULATORS[drive.simulator](
        {name: strengths.get(name, {}) for name in effects},
        seed=drive.seed + SEED_STEP * attempt,
        minutes=drive.minutes,
        noise=drive.noise,
        profile=drive.profile,
    )
    seen = trace(planted)
    if len(effects) == 1:
        return Hidden(planted, {effects[0]: expected(planted, seen)}, seen)
    return Hidden(planted, each(planted, seen) if effects else {}, seen)


def _strongest(drive: Drive, first: Hidden, part_of_target: Callable[[Price], float]) -> Hidden:
    """Draw again until all effects are strong enough; else the best of all attempts."""

    def weakest(hidden: Hidden) -> float:
        parts = [part_of_target(price) for price in hidden.prices.values()]
        return -math.inf if any(map(math.isnan, parts)) else min(parts)

    best = first
    for attempt in range(1, ATTEMPTS):
        if weakest(best) >= 1.0:
            break
        effects = another_pair(drive.seed, attempt) if drive.kind == TWO else drive.effects
        best = max(best, _planted(drive, effects, {}, attempt), key=weakest)
    return best


def _faint(drive: Drive, first: Hidden) -> Hidden:
    """Turn the strength towards a price between 32 and 48, by secant steps of a price that goes with its square."""
    effect = drive.effects[0]
    name = next((n for n in SIZE_PARAMETERS if n in first.planted.truth["effects"][effect]), None)
    if name is None:
        return first
    drawn = float(first.planted.truth["effects"][effect][name])
    aim = FAINT_LR[0] + (FAINT_LR[1] - FAINT_LR[0]) * (drive.seed * 0.6180339887 % 1.0)
    at, now = drawn, first
    best, miss = first, _miss(first.prices[effect].lr, aim)
    for _ in range(ATTEMPTS):
        lr = now.prices[effect].lr
        if not lr > 0.0 or FAINT_LR[0] <= lr <= FAINT_LR[1]:
            break
        at *= min(max(math.sqrt(aim / lr), 0.3), 3.0)
        at = math.copysign(min(abs(at), MAX_SCALE * abs(drawn)), drawn)
        now = _planted(drive, drive.effects, {effect: {name: at}}, 0)
        if _miss(now.prices[effect].lr, aim) < miss:
            best, miss = now, _miss(now.prices[effect].lr, aim)
    return best


def _miss(lr: float, aim: float) -> float:
    return abs(math.log(lr / aim)) if lr > 0.0 else math.inf
