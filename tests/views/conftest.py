"""Reports like those of a diagnosis, built from a simulated drive of a few lines, to test the views without the engine."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import pytest
from scipy.signal import coherence, lfilter, welch

from canid.values.findings import (
    Blocked,
    Check,
    Finding,
    Fit,
    Flags,
    Masked,
    NotTestable,
    OperatingMap,
    Provenance,
    Report,
    Spectra,
    Trajectory,
    Tried,
    Verdict,
    Window,
    no_fit,
)
from canid.values.types import NAN, Array, Channel, Identifiable, Interval

DT = 0.1
NOT = Interval()


class Drive(NamedTuple):
    """A drive, its simulation by two models, and the samples left out."""

    t: Array
    inputs: Mapping[str, Array]  # by role
    pedal: Array
    before: Array
    after: Array
    used: Flags


def lag(x: Array, tau: float, dead_time: float) -> Array:
    """First order plus dead time."""
    a = DT / (tau + DT)
    late = np.r_[np.full(round(dead_time / DT), x[0]), x][: len(x)]
    return lfilter([a], [1, a - 1], late)


def drive(minutes: float, seed: int = 1) -> Drive:
    """A driver with a headway dead zone, a model without it, and one with it."""
    n = round(minutes * 600)
    rng = np.random.default_rng(seed)

    def random_signal(sd: float, tau: float) -> Array:
        a = np.exp(-DT / tau)
        return lfilter([sd * np.sqrt(1 - a * a)], [1, -a], rng.standard_normal(n))

    range_rate = random_signal(1.4, 4.0)
    error = random_signal(0.45, 9.0)
    speed = np.clip(20 + random_signal(6.0, 40.0), 3.0, 33.0)
    dead = error - np.clip(error, -0.35, 0.35)
    noise = random_signal(1.9, 1.2)
    true = 14 + 7.8 * lag(dead, 0.5, 0.5) + 6.6 * lag(range_rate, 0.35, 0.6)
    before = 14 + 4.4 * lag(error, 1.1, 0.3) + 6.9 * lag(range_rate, 0.5, 0.6)
    t = DT * np.arange(n)
    used = np.ones(n, dtype=bool)
    used[(t > 0.31 * t[-1]) & (t < 0.36 * t[-1])] = False
    used[(t > 0.72 * t[-1]) & (t < 0.73 * t[-1])] = False
    headway = np.clip(2.0 + error, 0.5, None)
    inputs = {"headway_error": error, "range_rate": range_rate, "speed": speed, "headway": headway}
    inputs["gap"] = headway * speed
    pedal = np.round(np.clip(true + noise, 0, None) / 0.4) * 0.4
    seen = np.where(used, 1.0, NAN)
    return Drive(t, inputs, pedal, np.clip(before, 0, None) * seen, np.clip(true, 0, None) * seen, used)


def fit(d: Drive, simulated: Array, channels: Mapping[str, Channel]) -> Fit:
    """Fit of a simulation."""
    error = (d.pedal - simulated)[d.used]
    spread = np.std(d.pedal[d.used])
    sd = float(np.sqrt(np.mean(error**2)))
    return Fit(channels, float(100 * (1 - sd / spread)), simulated, sd)


def channel(K: Interval, tau: Interval, dead_time: Interval) -> Channel:
    both = Interval(*(a + b for a, b in zip(tau, dead_time, strict=True)))
    return Channel(K, tau, dead_time, both, Identifiable.OK)


def worst(d: Drive, seconds: float = 30.0, how_many: int = 5) -> tuple[Window, ...]:
    """The windows with the largest residual."""
    k = round(seconds / DT)
    found = []
    for start in range(0, len(d.t) - k + 1, k):
        at = slice(start, start + k)
        use = d.used[at]
        if use.sum() < k / 2:
            continue
        before, after = ((d.pedal[at] - s[at])[use] for s in (d.before, d.after))
        rms = [float(np.sqrt(np.mean(x**2))) for x in (before, after)]
        found.append(Window(float(d.t[start]), float(d.t[start]) + seconds, *rms))
    return tuple(sorted(found, key=lambda w: -w.before)[:how_many])


def operating_map(d: Drive, x: str, y: str) -> OperatingMap:
    """The mean residual over two roles."""
    edges = [np.linspace(*np.percentile(d.inputs[role], (1, 99)), 8) for role in (x, y)]
    at = (d.inputs[x][d.used], d.inputs[y][d.used])
    count, *_ = np.histogram2d(*at, bins=edges)
    with np.errstate(invalid="ignore"):
        before, after = (
            np.histogram2d(*at, bins=edges, weights=(d.pedal - s)[d.used])[0]
            / np.where(count >= 30, count, NAN)
            for s in (d.before, d.after)
        )
    return OperatingMap(x, y, *edges, before, after, count * DT)


def spectra(d: Drive) -> Spectra:
    """Spectra of the residual."""
    residuals = [np.nan_to_num(d.pedal - s) for s in (d.before, d.after)]
    of = {"fs": 1 / DT, "nperseg": min(256, len(d.t))}
    f, before = welch(residuals[0], **of)
    after = welch(residuals[1], **of)[1]
    both = [
        {name: coherence(r, d.inputs[name], **of)[1] for name in ("headway_error", "range_rate")}
        for r in residuals
    ]
    windows = 2 * len(d.t) / of["nperseg"]
    return Spectra(f, before, after, *both, float(1 - 0.01 ** (1 / max(windows - 1, 1))))


CANDIDATES = [
    "headway_dead_zone", "speed_gain", "looming_threshold", "asymmetric_gain", "looming_gain", "relative_speed_dead_zone",
    "gain_change", "gain_drift", "headway_drift", "attention_gap", "pedal_ceiling", "act_and_wait", "standstill_gap",
    "comfort_speed", "lead_acceleration", "backlash", "periodic_task", "delay_drift", "second_lag", "range_offset",
    "radar_latency", "clock_skew", "road_grade", "headwind", "engine_braking", "power_limit", "gear_ratio", "turbo_lag",
    "pedal_map", "actuator_lag",
]  # fmt: skip
SENSING = ("range_offset", "radar_latency", "clock_skew")
VEHICLE = CANDIDATES[CANDIDATES.index("road_grade") :]


def where(effect: str) -> str:
    return "sensing" if effect in SENSING else "vehicle" if effect in VEHICLE else "driver"


def tried(named: tuple[str, ...], rivals: tuple[str, ...]) -> tuple[Tried, ...]:
    """Two steps of a search: the first accepts, the second finds nothing more."""
    rng = np.random.default_rng(2)
    rows = []
    for step in (1, 2) if named else (1,):
        for effect in CANDIDATES:
            expected = float(np.round(10 ** rng.uniform(0.2, 2.6), 1))
            evidence = float(np.round(rng.chisquare(1) * 2, 2))
            outcome, why = "rejected", "the evidence stays below what chance alone gives one candidate of 30"
            if expected < 15 and effect not in (*named, *rivals):
                evidence, outcome, why = (
                    NAN,
                    "not_testable",
                    "a typical strength would leave no trace on this drive",
                )
            elif step == 1 and effect in named:
                evidence, expected, outcome, why = (
                    96.4,
                    140.2,
                    "accepted",
                    "the largest evidence, and it passes the gate",
                )
            elif step == 1 and effect in rivals:
                evidence, expected, outcome, why = (
                    92.1,
                    88.0,
                    "rival",
                    "explains the same data within 6 of the best",
                )
            elif step == 2 and effect in (*named, *rivals):
                continue
            elif step == 1 and effect in ("speed_gain", "asymmetric_gain"):
                evidence, why = (
                    41.3,
                    "above the threshold, but nothing of it is left once the dead zone is in the model",
                )
            rows.append(Tried(effect, where(effect), step, evidence, 15.8, expected, outcome, why))
    return tuple(rows)


def checks(failed: bool) -> tuple[Check, ...]:
    return (
        Check(
            "kinematic consistency",
            True,
            0.991,
            0.9,
            "slope of d(gap)/dt over range rate is 1 within 10 %",
            "",
        ),
        Check(
            "stale signals",
            not failed,
            3.4 if failed else 0.2,
            1.0,
            "share of exact repeats of a signal that moves",
            "%",
        ),
        Check("clock", None, NAN, 20.0, "no second clock in this log: own acceleration is not mapped", "ms"),
        Check("floor", True, 7.0, 50.0, "share of the time with the pedal at 0 %", "%"),
        Check("whiteness", True, 31.2, 41.6, "Ljung–Box of the innovations, 99 %", "", gate=True),
        Check(
            "left-over structure",
            not failed,
            88.0 if failed else 44.0,
            65.0,
            "41 generic regressors, p < 0.001",
            "",
            gate=True,
        ),
    )


def made(verdict: Verdict = Verdict.NAMED, minutes: float = 10.0, seed: int = 1) -> Report:
    """A report with this verdict."""
    if verdict is Verdict.NOT_ENOUGH_DATA:
        return nothing(minutes)
    d = drive(minutes, seed)
    named = verdict in (Verdict.NAMED, Verdict.ONE_OF)
    if not named:
        d = d._replace(after=d.before)
    rivals = ("speed_gain",) if verdict is Verdict.ONE_OF else ()
    effect = "headway_dead_zone"
    plain = {
        "headway_error": channel(
            Interval(4.42, 3.58, 5.21), Interval(1.12, 0.4, 1.9), Interval(0.31, 0.1, 0.8)
        ),
        "range_rate": channel(
            Interval(6.91, 6.52, 7.3), Interval(0.52, 0.38, 0.69), Interval(0.61, 0.52, 0.7)
        ),
    }
    freed = {
        "headway_error": channel(
            Interval(7.71, 6.6, 8.8), Interval(0.56, 0.2, 0.95), Interval(0.47, 0.2, 0.8)
        ),
        "range_rate": channel(
            Interval(6.63, 6.31, 6.96), Interval(0.36, 0.27, 0.47), Interval(0.6, 0.53, 0.67)
        ),
    }
    after = freed if named else plain
    finding = Finding(
        effect,
        "driver",
        rivals,
        verdict is Verdict.UNEXPLAINED,
        {"width": Interval(0.34, 0.28, 0.41)},
        {"width": "s"},
        Interval(0.31, 0.24, 0.37),
        "The driver does not react while the headway is within ±0.34 [0.28, 0.41] s of the one that he wants.",
        96.4,
        15.8,
    )
    says = {
        Verdict.ADEQUATE: "nothing that this drive can show is wrong with the simulation (30 causes tried)",
        Verdict.NAMED: "the driver does not react to small headway errors (±0.34 [0.28, 0.41] s); "
        "the simulation's error variance falls by 31 % [24, 37] on data that chose nothing",
        Verdict.ONE_OF: "headway dead zone or speed gain: not distinguishable on this drive",
        Verdict.UNEXPLAINED: "something is wrong that no known cause explains; "
        "headway dead zone helps and leaves structure behind",
    }[verdict]
    found = () if verdict is Verdict.ADEQUATE else (finding,)
    shifts = {
        f"{name} {what}": (getattr(plain[name], what), getattr(after[name], what))
        for name in plain
        for what in ("K", "tau", "dead_time")
    }
    closed = tuple(
        Trajectory(
            role, d.inputs[role], d.inputs[role] + off, d.inputs[role] + 0.6 * off, Interval(0.22, 0.09, 0.33)
        )
        for role, off in (
            ("gap", 3.0 * np.sin(d.t / 23) * np.cos(d.t / 7)),
            ("speed", 0.5 * np.sin(d.t / 19)),
        )
    )
    return Report(
        verdict,
        says,
        "pedal",
        d.t,
        d.pedal,
        d.used,
        fit(d, d.before, plain),
        fit(d, d.after, after),
        found,
        Interval(0.19, 0.08, 0.31) if verdict is Verdict.UNEXPLAINED else Interval(0.02, 0.0, 0.06),
        Interval(0.31, 0.24, 0.37) if found else Interval(0.0, -0.02, 0.02),
        (
            NotTestable(
                ("standstill_gap", "range_offset"),
                "same shape: a stop behind the lead, or a second range sensor, decides",
            ),
            NotTestable(("second_lag",), "below 0.5 Hz not distinguishable from dead time"),
            NotTestable(("power_limit",), "the pedal never went above 60 %: full load on a slope would show it"),
        ),
        len(CANDIDATES),
        tried((effect,) if found else (), rivals),
        checks(verdict is Verdict.UNEXPLAINED),
        (
            Masked("cruise_control", float(0.31 * d.t[-1]), float(0.36 * d.t[-1])),
            Masked("gear_shift", float(0.72 * d.t[-1]), float(0.73 * d.t[-1])),
        ),
        (
            Blocked(
                "driver",
                "wrong" if named else "unexplained" if found else "adequate",
                "the residual follows the headway error",
            ),
            Blocked("vehicle", "adequate", "pedal to speed: no structure left"),
            Blocked("sensing", "not_testable", "no redundant signal for range"),
        ),
        worst(d),
        (operating_map(d, "speed", "headway"), operating_map(d, "range_rate", "gap")),
        spectra(d),
        closed,
        shifts,
        ("10 min of urban following (3 to 14 m/s) distinguishes standstill gap from range offset",),
        (
            "5 % of the drive left out: cruise control",
            "baseline fitted jointly with AR(8) noise: residual 2.6 % pedal",
            "30 causes tried one by one; headway dead zone has the largest evidence, 96.4 (needed 15.8)",
            "refitted jointly; adequacy gate passed; no second cause above 15.8",
        ),
        Provenance(
            "drives/urban 7.blf",
            "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
            "dbc/generic.toml",
            "60303ae22b998861bce3b28f33eec1be758a213c86c93c076dbe9f558c11c752",
            "canid diagnose 'drives/urban 7.blf' --vehicle generic",
            {"canid": "0.1.0", "numpy": "2.4.6", "python": "3.11.7"},
            {"dbc/generic.dbc": "fd61a03af4f77d870fc21e05e7e80678095c92d808cfb3b5c279ee04c74aca13"},
            "2026-05-04 08:00:00 UTC",
        ),
    )  # fmt: skip


def nothing(minutes: float) -> Report:
    """The report of a drive that is too short for any result."""
    n = max(round(minutes * 600), 1)
    return Report(
        Verdict.NOT_ENOUGH_DATA,
        "41 s of driving behind a lead; at least 120 s are needed: drive 5 min behind a vehicle that changes its speed",
        "pedal",
        DT * np.arange(n),
        np.full(n, 12.4),
        np.zeros(n, dtype=bool),
        no_fit(n),
        no_fit(n),
        (),
        NOT,
        NOT,
        (),
        0,
        (),
        (Check("usable driving", False, 41.0, 120.0, "driving behind a lead, no mask", "s"),),
        (),
        (),
        (),
        (),
        None,
        (),
        {},
        ("5 min behind a vehicle that changes its speed",),
        ("gates judged: 41 s are usable",),
    )


@pytest.fixture(scope="session")
def report_of() -> Callable[..., Report]:
    """Makes a report of a verdict, of so many minutes."""
    return made


@pytest.fixture(scope="session")
def named() -> Report:
    """Ten minutes at 10 Hz with a cause; do not change its arrays."""
    return made()
