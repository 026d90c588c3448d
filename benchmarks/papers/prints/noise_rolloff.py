"""Fall of the driver's own noise model C/A from 0 to the Nyquist frequency (Chen & Ulsoy 2001, sec. 2.1, eq. 3)."""

from __future__ import annotations

import math

from canid_study.printed_numbers import SteeringTable

# c1 is not printed: at -0.5 sampling alone would make the whole printed scatter of a1 (claim C3), 0.3 is that of canid's
# own simulated driver
C1_RANGE = (-0.5, 0.3)


def fall_db(table: SteeringTable, c1: float) -> float:
    """20 log10 of |C/A| at 0 over |C/A| at 5 Hz, of the printed means.

    Args:
        table: of its means.
        c1: of C = 1 + c1 q^-1.

    Example:
        >>> from canid_study.printed_numbers import STEERING_TABLES
        >>> round(fall_db(STEERING_TABLES[0], -0.5), 1)
        18.2
    """
    a1, a2, _, _ = table.mean
    slow, fast = (1.0 + c1) / (1.0 + a1 + a2), (1.0 - c1) / (1.0 - a1 + a2)
    return 20.0 * math.log10(abs(slow / fast))
