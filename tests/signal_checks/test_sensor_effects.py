"""No transformation that a sensor can do turns an interval that covers the truth into a quoted one that does not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import binom

from tests import seeds
from tests.plants.outside_drives import SIMULATORS, drawn_drive
from tests.plants.quoted_intervals import Tried, identified, quoted, trace, tried, tried_lane
from tests.plants.sensor_effects import EFFECTS, OUTPUT, Effect, apart, drop, hold, limit, line, wrap

# drawn combinations of a run: some 3 s each, of which a slow test may take half a minute
COMBINATIONS = 10
# of a number whose interval is at 95 %
MISSED = 0.05
# K of two inputs, tau, dead time and the sum of both
NUMBERS = 5
# fewest misses of one of the numbers that speak against 95 %
TOO_MANY = int(binom.isf(seeds.CHANCE / NUMBERS, COMBINATIONS, MISSED)) + 1


@pytest.mark.slow
@pytest.mark.parametrize("one_tried", [tried, tried_lane])
@seeds.by_chance(NUMBERS * float(binom.sf(TOO_MANY - 1, COMBINATIONS, MISSED)))
def test_drawn_combinations_never_make_a_wrong_number_quotable(
    one_tried: Callable[[int], Tried], seed: int
) -> None:
    """Up to three effects: as few misses as 95 % intervals have, and none farther than two half widths outside.

    The other half of the claim: what is good is quoted, or no number would be wrong.
    """
    found = [one_tried((seed + k) % 10**7) for k in range(COMBINATIONS)]
    misses = [(one.seed, [*map(str, one.effects)], [*map(str, one.misses)]) for one in found if one.misses]
    print(*misses, sep="\n")
    assert not [one.seed for one in found if any(miss.gross for miss in one.misses)]
    counted = Counter((miss.channel, miss.parameter) for one in found for miss in one.misses)
    assert max(counted.values(), default=0) < TOO_MANY
    # of a lane keeper on a straight road K is not always known
    assert sum(bool(one.before) for one in found) >= (COMBINATIONS if one_tried is tried else 1)


@pytest.mark.slow
@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("periods", [(0.1, 0.1), (0.1, 1.0 / 14.0)])
@seeds.mostly(0.8)
def test_gap_and_range_rate_in_messages_of_their_own(
    periods: tuple[float, float], held: bool, seed: int
) -> None:
    """Nothing is found, and no delay of a noisy radar is wrong: of 0.1 s in a file of 20 Hz or 50 Hz.

    Held, tau held on 1 of 17 drives and the range rate was late; up to four delays of 95 %.
    """
    rng = np.random.default_rng(seed)
    drive = drawn_drive("Helly", seed, dt=float(rng.choice([0.02, 0.05])), noise=3.0)
    result = identified(apart(drive, periods, rng, held=held))
    assert result is not None
    assert not result.findings, result.findings
    delays = [each for each in quoted(result, drive.truth) if each.parameter != "K"]
    print(*delays, sep="\n")
    assert all(each.covers for each in delays)


@pytest.mark.slow
@pytest.mark.parametrize("simulator", SIMULATORS)
@seeds.mostly(0.8)
def test_the_simulators_agree_with_what_is_quoted_of_them(simulator: str, seed: int) -> None:
    """The truth of a drive that nothing was done to is in every interval: else its definition is wrong.

    95 % of each of up to four numbers.
    """
    drive = drawn_drive(simulator, seed)
    found = quoted(identified(drive), drive.truth)
    assert {"K"} <= {each.parameter for each in found}
    assert all(each.covers for each in found), [*map(str, found)]


@pytest.mark.slow
@pytest.mark.parametrize(("period", "delays"), [(0.3, True), (0.45, False), (0.5, True)])
@seeds.mostly(0.8)
def test_an_output_joined_by_lines_has_its_gains(period: float, delays: bool, seed: int) -> None:
    """And its delays, where its readings are samples. 95 % of each of up to four numbers; K was 2 % too large at 0.5 s."""
    drive = drawn_drive("Helly", seed)
    joined = line(drive, period, np.random.default_rng(seed), roles=(OUTPUT,))
    found = quoted(identified(joined), drive.truth)
    assert sum(each.parameter == "K" for each in found) == 2
    assert any(each.parameter != "K" for each in found) == delays
    assert all(each.covers for each in found), [*map(str, found)]


@pytest.mark.parametrize(("share", "named"), [(0.05, set()), (0.35, {"input_slow", "output_slow"})])
@seeds.mostly(0.9)
def test_lost_rows_of_a_table_leave_the_gains(share: float, named: set[str], seed: int) -> None:
    """One in twenty leaves everything; one in three withholds the delays, and no gain by the rate of any signal."""
    drive = drop(drawn_drive("Helly", seed, seconds=100.0), share, np.random.default_rng(seed))
    found = [one for one in trace(drive).findings if one.name in ("input_slow", "output_slow")]
    assert {one.name for one in found} == named
    assert all(one.withholds_delays and not one.withholds for one in found), found


@pytest.mark.parametrize("simulator", SIMULATORS)
@pytest.mark.parametrize("effect", EFFECTS, ids=lambda each: each.name)
def test_an_effect_changes_the_measurement_more_where_it_is_stronger(
    effect: Effect, simulator: str, seed: int
) -> None:
    """The truth stays; each strength differs from the drive as it is, and the strongest more than the weakest."""
    drive = drawn_drive(simulator, seed, seconds=60.0)

    def distance(strength: float) -> float:
        changed = effect.apply(drive, strength, np.random.default_rng(seed))
        assert changed.truth == drive.truth
        assert {len(x) for x in changed.columns.values()} == {len(changed.t)}
        if len(changed.t) < len(drive.t):
            return float(len(drive.t) - len(changed.t))
        if effect.apply is wrap:
            return float(np.count_nonzero(np.diff(changed.t) <= 0.0))
        apart = [np.sqrt(np.mean((changed.columns[k] - x) ** 2)) for k, x in drive.columns.items()]
        return float(sum(apart))

    distances = [distance(strength) for strength in effect.strengths]
    assert min(distances) > 0.0
    if effect.apply is wrap:
        assert set(distances) == {1.0}
    else:
        assert distances[0] < distances[-1]


def test_effects_have_the_properties_that_they_are_named_by(seed: int) -> None:
    """A limit is shared by as many samples as it says; a held output changes as often as its sender sends."""
    drive = drawn_drive("Helly", seed, seconds=120.0)
    rng = np.random.default_rng(seed)
    limited = limit(drive, 0.25, rng, role=OUTPUT, sides=(False, True)).columns["pedal"]
    assert np.mean(limited == limited.max()) == pytest.approx(0.25, abs=0.01)
    held = hold(drive, 0.5, rng, roles=(OUTPUT,))
    assert np.count_nonzero(np.diff(held.columns["pedal"])) == pytest.approx(240, abs=2)
    assert np.array_equal(held.columns["gap"], drive.columns["gap"])
