"""The printed numbers of Grover 2021 and of Chen & Ulsoy 2001, each with its reference; no result of a check.

The data of both papers are not public, and the texts hold no curves.
"""

from __future__ import annotations

from typing import NamedTuple


class TransferFunction(NamedTuple):
    """An identified transfer function num(s) / den(s) with its printed percentage of fit."""

    equation: str
    num: tuple[float, ...]  # falling powers of s
    den: tuple[float, ...]
    fit_percent: float


class FirstOrder(NamedTuple):
    """A reduced model K / (1 + tau s)."""

    equation: str
    K: float
    tau: float  # s


class Driver(NamedTuple):
    """A car-following driver of Grover's tables: % of pedal per s of headway error, and per m/s of range rate."""

    name: str
    K1: float
    tau1: float  # s
    K2: float
    tau2: float  # s
    road: str


class SteeringTable(NamedTuple):
    """Mean and standard deviation of a1, a2, b1, b2 over one-minute segments (Chen & Ulsoy, Tables 1, 2)."""

    name: str
    table: int
    part: str  # "estimation" (odd segments), "validation" (even segments)
    drivers: int
    mean: tuple[float, float, float, float]
    sd: tuple[float, float, float, float]


# --- Grover 2021 -----------------------------------------------------------------------------------------------

# eq. 2.4 and Fig. 12: headway error to pedal
EQ_2_4 = TransferFunction("2.4", (-3.559, 458.5, 8749.0, 2.494e4), (1.0, 4.926, 432.5, 617.5, 1.076e4), 95.39)
# eq. 2.5 and Fig. 13: relative speed to pedal
EQ_2_5 = TransferFunction(
    "2.5",
    (-4.292e8, 5.753e8, -5.67e11, 6.339e11, -2.182e14, -2.119e14, -1.618e16),
    (1.0, 47.59, 5411.0, 1.414e5, 8.355e6, 1.267e8, 4.518e9, 3.758e9, 8.245e11, 3.037e12, 3.331e12, 1.565e13),
    91.06,
)
EQ_2_8 = FirstOrder("2.8", 7.8095, 0.141)  # said to be the reduction of 2.4
EQ_2_9 = FirstOrder("2.9", 6.654, 0.144)  # said to be the reduction of 2.5
# sec. 4.5, Fig. 14 and 15: two inputs, of high order and reduced
MISO_FIT_PERCENT, REDUCED_FIT_PERCENT = 96.36, 89.76
# sec. 4.2: a model that fits less is rejected
SELECTION_PERCENT = 90.0
# Table 1, and the three rows of Table 2
GROVER_DRIVERS = (
    Driver("Table 1", 7.8095, 0.141, 6.654, 0.144, "not stated"),
    Driver("Table 2, case 1", 4.3671, 0.685, 5.6303, 0.401, "straight"),
    Driver("Table 2, case 2", 11.408, 0.1857, 4.867, 0.0262, "slightly curved"),
    Driver("Table 2, case 3", 4.1461, 0.734, 4.3372, 0.0362, "straight"),
)
GROVER_RATE_HZ = 100.0  # sec. 4.3
# sec. 2.1: a headway of 2 to 2.5 s is wanted
THW_DESIRED_S = (2.0, 2.5)
# sec. 4.1, of Fig. 10: the headway error falls from 0.5 s to 0 while the pedal goes on rising from about 60 %
FIG_10_ERROR_S, FIG_10_PEDAL_PERCENT = (0.5, 0.0), (52.0, 60.0)

# --- Chen & Ulsoy 2001 -----------------------------------------------------------------------------------------

STEERING_TABLES = (
    SteeringTable(
        "Table 1, estimation",
        1,
        "estimation",
        1,
        (-1.2623, 0.3697, 4.1340, -4.0337),
        (0.1485, 0.1379, 2.2013, 2.1557),
    ),
    SteeringTable(
        "Table 1, validation",
        1,
        "validation",
        1,
        (-1.2537, 0.3564, 4.2202, -4.1244),
        (0.1264, 0.1295, 2.1071, 2.0766),
    ),
    SteeringTable(
        "Table 2, estimation",
        2,
        "estimation",
        12,
        (-1.3149, 0.3979, 3.7540, -3.6736),
        (0.1232, 0.1233, 1.7326, 1.7031),
    ),
    SteeringTable(
        "Table 2, validation",
        2,
        "validation",
        12,
        (-1.3162, 0.4014, 3.7334, -3.6520),
        (0.1222, 0.1155, 1.8401, 1.8056),
    ),
)
STEERING_INTERVAL_S = 0.1  # sec. 2.1: 20 Hz, resampled
SEGMENT_SAMPLES = 600  # N of eq. 2: one minute
SEGMENTS = 119  # sec. 3: 120, of which the first is left out
SUBJECTS = 12
# eq. 5: the bound of |Delta|, (5 s + 0.5) / (s + 2.5), reliable to 1 Hz
EQ_5_NUM, EQ_5_DEN, RELIABLE_HZ = (5.0, 0.5), (1.0, 2.5), 1.0
DC_GAIN_RANGE = (0.2, 2.0)  # sec. 4.1, of Fig. 12
ZERO_RANGE = (-1.0, 0.0)  # 1/s, sec. 4.1, of Fig. 12
STATIONARY_SHARE = 0.95  # sec. 2.1
FALL_AT_NYQUIST_DB = 200.0  # sec. 2.1, "almost"
FPE_PARAMETERS, FPE_INCREASE = 20, 0.07  # sec. 2.2
EXCITATION_ORDER = 4  # sec. 2.3
