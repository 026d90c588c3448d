"""The four printed drivers (Grover 2021, Tables 1 and 2) as simulated drives with known truth.

tau is read as the lag of eq. 2.6 and 2.7, without a dead time. The paper's relative velocity is V_F - V_L with a positive
K2, which would accelerate towards the lead; here as everywhere in canid range_rate = V_L - V_F, with which the printed K2 is
that of a driver who follows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from canid.models.simulation import DriverTruth, Simulation, simulate
from canid_study.printed_numbers import GROVER_DRIVERS, Driver

# s; sec. 2.1 takes 2 to 2.5 s. With a free offset the choice moves no gain
HEADWAY_DESIRED_S = 2.0
# % of pedal, sd of the part of the pedal that the model does not give, as in simulated drives of canid
NOISE_SD = 1.5
# drives of each driver and length
SEEDS = 6


def truth_of(driver: Driver) -> DriverTruth:
    """The driver as the simulator takes it.

    >>> truth_of(GROVER_DRIVERS[0]).tau1, truth_of(GROVER_DRIVERS[0]).dead_time1
    (0.141, 0.0)
    """
    return DriverTruth(
        driver.K1, driver.tau1, 0.0, driver.K2, driver.tau2, 0.0, HEADWAY_DESIRED_S, noise_sd=NOISE_SD
    )


def drives(
    seed: int, minutes: Sequence[float] = (1.0, 10.0), seeds: int = SEEDS
) -> Iterator[tuple[str, Simulation]]:
    """Simulate the printed drivers behind a mixed lead, with autocorrelated noise.

    Args:
        seed: of the first drive of each driver; the next ones follow. The drivers are so behind the same leads.
        minutes: lengths.
        seeds: drives of each driver and length.

    Yields:
        A name and the drive; its truth names the driver under "printed_driver".

    Example:
        >>> name, drive = next(drives(1, (0.5,), seeds=1))
        >>> name, drive.truth["channels"]["range_rate"]["K"]
        ('Table 1, 0.5 min, drive 1', 6.654)
    """
    for length in minutes:
        for driver in GROVER_DRIVERS:
            for number in range(1, seeds + 1):
                made = simulate(
                    length, seed + number - 1, profile="mixed", noise="ar1", driver=truth_of(driver)
                )
                name = f"{driver.name}, {length:g} min, drive {number}"
                yield name, made._replace(truth={**made.truth, "printed_driver": driver.name})
