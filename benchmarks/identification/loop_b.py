"""Closed loop B, reference/diagnosis.md section 8: written apart from loop A, and like it in nothing but the physics.

50 Hz, Heun; a lead that wants another speed every so often; both answers share one lag after their sum; engine and
brake with lags, drag, engine braking; below 0 % the pedal is released and the brake works; 0.4 % quantisation.
"""

from __future__ import annotations

import math

import numpy as np

from benchmarks.identification.bounds import Lag
from benchmarks.identification.loops import NORMAL, Drive, Gain, Lead, constant

STEP = 0.02
GAIN_HEADWAY, GAIN_RATE = 6.2, 6.0  # % per s, % per m/s
DELAY_HEADWAY, DELAY_RATE, LAG = 0.40, 0.24, 0.36  # s
WANTED = 1.6  # s
LSB = 0.4  # %, of an 8-bit pedal
# m; waves of 1 % (0.1 m/s²), reference/diagnosis.md 2.3
HILLS = 1500.0
# %; below a demand of this the driver changes from the accelerator to the brake
BRAKES = -4.0


class _Car:
    """Acceleration by pedal and speed: engine 0.35 s, brake 0.15 s, drag, rolling, engine braking."""

    def __init__(self, v: float) -> None:
        self.engine = self.balance(v)
        self.brake = 0.0

    @staticmethod
    def balance(v: float) -> float:
        """Pedal in % that holds the speed v."""
        return (0.12 + 3.5e-4 * v * v) / 0.045

    def accelerate(self, throttle: float, brake: float, v: float, h: float) -> float:
        self.engine += (throttle - self.engine) * (1.0 - math.exp(-h / 0.35))
        self.brake += (brake - self.brake) * (1.0 - math.exp(-h / 0.15))
        drive = 0.045 * self.engine - (0.25 * math.exp(-self.engine) if self.engine < 5.0 else 0.0)
        return drive - 0.06 * self.brake - 0.12 - 3.5e-4 * v * v


def _ahead(n: int, lead: Lead, middle: float, rng: np.random.Generator) -> np.ndarray:
    """Speed of a vehicle that picks a new speed now and then, and whose driver is never quite steady."""
    hold = 1.0 / (4.0 * lead.cut)
    aim, v, a, unrest, until = middle, middle, 0.0, 0.0, 0.0
    out = np.empty(n)
    for k in range(n):
        if k * STEP >= until:
            aim = middle + lead.sd * 2.2 * rng.uniform(-1.0, 1.0)
            until = k * STEP + hold * rng.uniform(0.5, 1.5)
        unrest += -unrest * STEP / 1.5 + 0.25 * lead.sd * math.sqrt(2.0 * STEP / 1.5) * rng.standard_normal()
        want = min(max(4.0 * lead.cut * 2.0 * (aim - v), -2.5), 1.6) + unrest * lead.cut * 8.0
        a += (want - a) * STEP / 0.5
        v = max(v + a * STEP, 3.0)
        out[k] = v
    return out


def drive(
    seed: int,
    seconds: float,
    remnant: float = 1.0,
    lead: Lead = NORMAL,
    middle: float = 22.0,
    shift: float = 8.0,
    gain: Gain = constant,
) -> Drive:
    """Draw one drive.

    Args:
        seed: of the run.
        seconds: how long.
        remnant: sd of the noise in the demand, %.
        lead: of the vehicle ahead.
        middle: m/s, about which the lead drives.
        shift: % by which the pedal stands above what level road at `middle` needs (an ascent); less brings the floor.
        gain: factor on both gains over the drive.
    """
    rng = np.random.default_rng([seed, 4])
    lost = 80.0
    n, first = round((seconds + lost) / STEP), round(lost / STEP)
    ahead = _ahead(n, lead, middle, rng)
    rest = _Car.balance(middle) + shift
    slope = 0.045 * shift  # m/s² of the ascent that needs it
    way = rng.uniform(0.0, HILLS)  # m along the road
    v, gap = float(ahead[0]), WANTED * float(ahead[0])
    car = _Car(v)
    car.engine = rest
    headways, rates = np.full(n, gap / v), np.zeros(n)
    lag, noise, wind = 0.0, 0.0, 0.0
    keep, fresh = math.exp(-STEP), remnant * math.sqrt(1.0 - math.exp(-2.0 * STEP))
    columns = np.empty((n, 6))
    i, j = round(DELAY_HEADWAY / STEP), round(DELAY_RATE / STEP)
    alpha = math.exp(-STEP / LAG)
    gamma = 1.0 - LAG / STEP * (1.0 - alpha)
    before = 0.0
    factor = gain(np.arange(n) * STEP - lost).tolist()
    for k in range(n):
        headways[k], rates[k] = gap / v, ahead[k] - v
        now = GAIN_HEADWAY * (headways[max(k - i, 0)] - WANTED) + GAIN_RATE * rates[max(k - j, 0)]
        lag = alpha * lag + (1.0 - alpha) * before + gamma * (now - before)
        before = now
        noise = keep * noise + fresh * rng.standard_normal()
        wind = (
            math.exp(-STEP / 3.0) * wind
            + 0.06 * math.sqrt(1 - math.exp(-2 * STEP / 3.0)) * rng.standard_normal()
        )
        demand = rest + factor[k] * lag + noise
        throttle = LSB * round(max(demand, 0.0) / LSB)
        braking = max(BRAKES - demand, 0.0)
        columns[k] = throttle, braking > 0.0, v, gap, rates[k], demand > 0.0
        # Heun: the mean of the slopes at both ends
        way += STEP * v
        road = wind - slope - 0.1 * math.sin(2.0 * math.pi * way / HILLS)
        first_slope = car.accelerate(throttle, braking, v, 0.5 * STEP) + road
        second_slope = car.accelerate(throttle, braking, v + STEP * first_slope, 0.5 * STEP) + road
        faster = max(v + 0.5 * STEP * (first_slope + second_slope), 1.0)
        after = float(ahead[min(k + 1, n - 1)])
        gap = max(gap + 0.5 * STEP * (rates[k] + after - faster), 2.0)
        v = faster
    pedal, brake, speed, gaps, relative, free = columns[first:].T
    channels = (Lag(GAIN_HEADWAY, LAG, DELAY_HEADWAY), Lag(GAIN_RATE, LAG, DELAY_RATE))
    return Drive(STEP, pedal, brake > 0.5, speed, gaps, relative, WANTED, channels, remnant, True, free > 0.5)
