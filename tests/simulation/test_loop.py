import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from canid.models.simulation import LEADS, NOISES, DriverTruth, simulate
from canid.models.simulation.driver import answer
from canid.models.simulation.noise import unit_noise


def test_the_same_seed_is_the_same_drive():
    """A seed gives one drive, to the bit; another seed gives another one."""
    one, two, other = simulate(0.5, 4), simulate(0.5, 4), simulate(0.5, 5)
    assert one.truth == two.truth
    for role, column in one.columns.items():
        np.testing.assert_array_equal(column, two.columns[role])
    assert not np.allclose(one.columns["lead_speed"], other.columns["lead_speed"])


def test_the_noise_does_not_change_the_road():
    """Lead, slope and driver depend on the seed alone, not on the kind of the driver's noise."""
    drives = [simulate(0.5, 4, noise=kind) for kind in NOISES]
    for drive in drives[1:]:
        np.testing.assert_array_equal(drive.columns["lead_speed"], drives[0].columns["lead_speed"])
        np.testing.assert_array_equal(drive.columns["grade"], drives[0].columns["grade"])
        assert drive.truth["channels"] == drives[0].truth["channels"]
    assert not np.allclose(drives[0].columns["noise"], drives[1].columns["noise"])


@pytest.mark.slow("drives in closed loop")
@pytest.mark.parametrize("profile", list(LEADS))
def test_the_loop_keeps_its_distance(profile):
    """Drawn drivers neither run into the lead nor lose it, on every road, with every kind of noise."""
    for seed, kind in enumerate(NOISES):
        columns = simulate(5, seed, profile, kind).columns
        assert columns["gap"].min() > 2.5, seed
        assert columns["gap"].max() < 130.0, seed
        assert columns["speed"].min() > 2.5, seed  # headway means something all the time
        assert columns["headway"].min() > 0.5, seed
        assert np.abs(columns["accel"]).max() < 4.0, seed
        assert (columns["demand"] < 0).mean() < 0.3, seed
        assert columns["range_rate"].std() > 0.4, seed


@pytest.mark.slow("drives in closed loop")
@pytest.mark.parametrize("kind", ["none", "ar1", "state"])
def test_the_truth_makes_the_pedal(kind):
    """The driver's equation, integrated anew at any step with the stated truth, gives the pedal again."""
    drive = simulate(1.0, 6, "mixed", kind)
    columns, truth = drive.columns, drive.truth
    t = columns["t"]
    demand = np.full(len(t), truth["offset"])
    for name, x in (
        ("headway_error", columns["headway"] - truth["headway_desired"]),
        ("range_rate", columns["range_rate"]),
    ):
        channel = truth["channels"][name]

        def slope(now, y, x=x, channel=channel):
            return (np.interp(now - channel["dead_time"], t, x) - y) / channel["tau"]

        assert abs(x[0]) < 1e-9  # the drive starts in balance
        y = solve_ivp(slope, (0, t[-1]), [x[0]], t_eval=t, max_step=0.005, rtol=1e-9, atol=1e-9).y[0]
        demand += channel["K"] * y
    np.testing.assert_allclose(columns["demand"], demand + columns["noise"], atol=2e-4)
    np.testing.assert_array_equal(columns["pedal"], np.clip(columns["demand"], 0, 100))


def test_the_car_obeys_its_equation():
    """Speed is the integral of acceleration, the gap that of range rate, headway is gap over speed."""
    columns = simulate(2.0, 7).columns
    dt = 0.01
    np.testing.assert_allclose(np.diff(columns["speed"]) / dt, columns["accel"][:-1], atol=1e-9)
    rate = columns["range_rate"]
    np.testing.assert_allclose(np.diff(columns["gap"]) / dt, (rate[:-1] + rate[1:]) / 2, atol=1e-6)
    np.testing.assert_allclose(rate, columns["lead_speed"] - columns["speed"], atol=1e-12)
    np.testing.assert_allclose(columns["headway"], columns["gap"] / columns["speed"], rtol=1e-12)


@pytest.mark.parametrize(
    ("tau", "dead_time"), [(0.685, 0.3), (0.4, 0.2137), (0.03, 0.0), (0.0, 0.255), (2.5, 1.0049)]
)
def test_an_answer_to_a_ramp_is_exact(tau, dead_time):
    """First order plus dead time, also off the grid, answers a ramp as the textbook formula says."""
    dt, n = 0.01, 400
    t = np.arange(n) * dt
    # The ramp starts at sample 1: its knot lies on the grid, as the straight pieces assume.
    x = np.maximum(t - dt, 0.0)
    step = answer(1.0, tau, dead_time, dt)
    y, mine = 0.0, []
    for k in range(n):
        y = step.step(y, x.tolist(), k)
        mine.append(y)
    s = np.maximum(t - dt - dead_time, 0.0)
    book = s - tau * (1 - np.exp(-s / tau)) if tau else s
    np.testing.assert_allclose(mine, book, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "lag", "correlation"),
    [
        ("white", 0.1, 0.0),
        ("ar1", 1.0, math.exp(-1)),
        ("ar4", 4.0, math.exp(-1)),
        ("mix", 1.0, 0.7 * math.exp(-1)),
    ],
)
def test_noise_has_its_colour(kind, lag, correlation):
    """Each kind has variance 1 and the correlation over time that its name says."""
    x = unit_noise(kind, 2_000_000, 0.01, np.random.default_rng(1))
    shift = round(lag / 0.01)
    assert x.std() == pytest.approx(1.0, abs=0.03)
    assert np.corrcoef(x[:-shift], x[shift:])[0, 1] == pytest.approx(correlation, abs=0.03)


def test_resonant_noise_peaks_at_a_quarter_hertz():
    """The resonant kind has variance 1 and most power near 0.25 Hz."""
    x = unit_noise("resonant", 400_000, 0.01, np.random.default_rng(1))
    assert x.std() == pytest.approx(1.0, abs=0.05)
    power = np.abs(np.fft.rfft(x[:400_000].reshape(100, 4000))) ** 2
    peak = np.fft.rfftfreq(4000, 0.01)[power.mean(0)[1:].argmax() + 1]
    assert 0.15 < peak < 0.3


def test_a_given_driver_is_the_truth():
    """Parameters that are given are used and reported; only the unknown offset is filled in."""
    given = DriverTruth(4.367, 0.685, 0.30, 5.630, 0.401, 0.20, headway_desired=1.8)
    truth = simulate(0.5, 1, driver=given).truth
    assert truth["channels"]["headway_error"] == {"K": 4.367, "tau": 0.685, "dead_time": 0.30}
    assert truth["channels"]["range_rate"] == {"K": 5.630, "tau": 0.401, "dead_time": 0.20}
    assert math.isfinite(truth["offset"])
    assert truth["hidden"] is None


def test_a_cut_in_shortens_the_gap_at_once():
    """The gap jumps down at the cut-in and nowhere else."""
    columns = simulate(1.0, 2, cut_in=30.0).columns
    jumps = np.flatnonzero(np.abs(np.diff(columns["gap"])) > 1.0)
    assert (jumps + 1).tolist() == [3000]
    assert columns["gap"][3000] == pytest.approx(0.55 * columns["gap"][2999], rel=0.02)
    assert columns["gap"].min() > 2.0


@pytest.mark.parametrize(
    "wrong",
    [{"profile": "moon"}, {"noise": "pink"}, {"minutes": 0}, {"driver": DriverTruth(1, -1, 0, 1, 1, 0)}],
)
def test_wrong_calls_are_refused(wrong):
    """Unknown profiles and kinds, no time and negative lags are ValueErrors."""
    with pytest.raises(ValueError, match=r"must|is not one of"):
        simulate(**{"minutes": 0.1, **wrong})
