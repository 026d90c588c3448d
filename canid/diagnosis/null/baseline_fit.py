"""Does a baseline's simulation fit as badly as it would if the baseline were true?

Behind a lead the driver's own noise comes back through headway and range rate, and his answers work against it: with much
noise the answer to the measured inputs alone varies more than the output does, and the true model's simulation fits worse
than the mean. A poor fit speaks against a baseline only where replicates of its own driver fit better.
"""

from __future__ import annotations

from canid.diagnosis.driver.baseline_check import fit_percent
from canid.diagnosis.driver.driver_fit import FittedDriver
from canid.diagnosis.null import bootstrap, replicates, sequential
from canid.diagnosis.null.noise_source import Source
from canid.diagnosis.null.replicates import Drive
from canid.diagnosis.null.sequential import Answer


def usual(drive: Drive, fitted: FittedDriver, noise: Source, seed: int) -> bool:
    """Is the fit of the simulation one that replicates of the same driver have too? No, where he cannot be simulated.

    Args:
        drive: the recorded one.
        fitted: the baseline.
        noise: of its driver.
        seed: of the draws.
    """
    observed = -fit_percent(drive.data, fitted)
    null: list[float] = []
    for batch in range(sequential.BATCHES):
        for one in replicates.simulated(drive, fitted, noise, sequential.BATCH, [seed, 2, batch]):
            made = bootstrap.refitted(one, fitted)
            if made is None:
                continue
            null.append(-fit_percent(*made))
            answer = sequential.answer(observed, null)
            if answer is not Answer.OPEN:
                return answer is Answer.NULL
        if not null:
            return False
    return False
