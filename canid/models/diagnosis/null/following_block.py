"""Car following, as a search that is confirmed asks for it: cross-validated, and held against the same lead."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, partial
from typing import NamedTuple

from canid.models.diagnosis.driver import driver_search
from canid.models.diagnosis.driver.driver_data import DriverData
from canid.models.diagnosis.driver.driver_fit import FittedDriver
from canid.models.diagnosis.driver.driver_model import DriverModel
from canid.models.diagnosis.driver.driver_search import Search
from canid.models.diagnosis.driver.held_out import Fold
from canid.models.diagnosis.fitting.search import Named
from canid.models.diagnosis.null import bootstrap, confirmed_search, predictive_score, replicates, sequential
from canid.models.diagnosis.null.confirmed_search import Checked
from canid.models.diagnosis.null.noise_source import Source
from canid.models.diagnosis.null.replicates import Null
from canid.models.diagnosis.null.sequential import Statistics
from canid.models.effects.effect import Effect
from canid.values.types import Interval


class Margin(NamedTuple):
    """Of one replicate."""

    above: float  # effects that cannot reach it were not fitted
    largest: float


class Following:
    """A driver who follows a lead: `confirmed_search.Block`.

    Args:
        null: what findings are held against.
        fitted: the baseline.
        effects: all that are searched for.
    """

    where = "behind this lead"

    def __init__(self, null: Null, fitted: FittedDriver, effects: tuple[Effect, ...]) -> None:
        self._null, self._fitted = null, fitted
        self._effects = tuple(effect for effect in effects if bootstrap.testable(effect))
        # parameters of a baseline -> of its replicates, what was fitted above, and the largest margin
        self._margins: dict[bytes, list[Margin]] = {}

    @cached_property
    def _source(self) -> Source:
        return self._null.noise(self._null.drive.data, self._fitted)

    def search(self, effects: tuple[Effect, ...]) -> Checked[DriverData, DriverModel]:
        """Search, with cross-validation."""
        return confirmed_search.cross_validated(self._null.drive.data, effects, self._fitted)

    def scores(
        self, search: Search, folds: Sequence[Fold[DriverModel]]
    ) -> tuple[Interval, Mapping[str, Interval]]:
        """Gain in one-step log score."""
        data, scale = self._null.drive.data, self._source.scale
        whole = predictive_score.of_whole(data, search, folds, scale)
        return whole, predictive_score.of_each(data, search, folds, scale, whole)

    def replicates(self, search: Search, tested: Sequence[Named]) -> Iterator[Statistics]:
        """Simulate the baseline's driver again; what names before have shown of the same replicates is known."""
        null, driver = self._null, search.baseline
        above = min(map(sequential.margin, tested))
        known = self._margins.setdefault(driver.q.tobytes(), [])
        reached = [each.largest for each in known if each.largest >= above]
        if reached:
            yield Statistics(reached[0])
        count = 0
        for batch, size in enumerate(sequential.BATCHES):
            for replicate in replicates.simulated(
                null.drive, driver, self._source, size, [null.seed, 0, batch]
            ):
                made = bootstrap.refitted(replicate, driver)
                if made is None:
                    continue
                if count == len(known) or known[count].above > above:
                    largest = driver_search.largest_margin(*made, self._effects, len(search.among), above)
                    known[count : count + 1] = [Margin(above, largest)]
                gain = partial(bootstrap.gain, *made, tested) if null.gains else None
                yield Statistics(known[count].largest, gain)
                count += 1

    def testable(self, effect: Effect) -> bool:
        """Is it fitted to inputs that the loop feeds back?"""
        return bootstrap.testable(effect)
