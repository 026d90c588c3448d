"""[fopdt.prior] in a vehicle file: what is stated arrives, all mistakes are said at once, each with its key."""

from __future__ import annotations

from pathlib import Path

import pytest

from canid.mathematics.identification.fopdt.prior import ChannelPrior, Prior
from canid.signals.vehicle import Vehicle, read_vehicle
from canid.values.errors import ConfigError
from canid.values.shipped_files import shipped


def with_prior(folder: Path, section: str, vehicle: str = "generic") -> Vehicle:
    """A shipped vehicle with a prior."""
    for dbc in shipped().glob("*.dbc"):
        (folder / dbc.name).write_bytes(dbc.read_bytes())
    file = folder / "car.toml"
    text = (shipped() / f"{vehicle}.toml").read_text(encoding="utf-8")
    file.write_text(f"{text}\n{section}\n", encoding="utf-8")
    return read_vehicle(file)


def test_what_is_stated_arrives(tmp_path: Path) -> None:
    """Both old lines and tables of channels; whole numbers count as numbers."""
    read = with_prior(
        tmp_path,
        "[fopdt.prior]\nsame_tau = 0.25\ngain_correlation = 0.4\natypical = 0\n"
        "[fopdt.prior.range_rate]\nK = 5.6\nK_sd = 1\ntau_plus_dead_time = 0.8\ntau_plus_dead_time_factor = 1.3\n"
        "[fopdt.prior.headway_error]\nK = 6\nK_sd = 1.5",
    ).estimators["fopdt"]
    own = ChannelPrior(K=5.6, K_sd=1.0, tau_plus_dead_time=0.8, tau_plus_dead_time_factor=1.3)
    expected = Prior(
        same_tau=0.25,
        headway_error=ChannelPrior(K=6.0, K_sd=1.5),
        range_rate=own,
        gain_correlation=0.4,
        atypical=0.0,
    )
    assert repr(read.prior) == repr(expected)


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(
    ("section", "says"),
    [
        (
            "range_rate = { K = 5.6, K_sdd = 1.1 }",
            'fopdt.prior.range_rate.K_sdd: unknown key (did you mean "K_sd"?)',
        ),
        (
            "range_rat = { K = 5.6, K_sd = 1.1 }",
            'fopdt.prior.range_rat: unknown key (did you mean "range_rate"?)',
        ),
        ("tua = 0.3", 'fopdt.prior.tua: unknown key (did you mean "tau"?)'),
        ("range_rate = { K = 5.6 }", "range_rate: K and K_sd belong together"),
        ("range_rate = {}", "range_rate is empty"),
        ("range_rate = { K = nan, K_sd = 1.0 }", "fopdt.prior.range_rate.K: must be a finite number"),
        ("range_rate = { K = 5.6, K_sd = 1e-300 }", "fopdt.prior.range_rate.K_sd: must be greater"),
        ("gain_correlation = 0.4", "gain_correlation needs K and K_sd of two channels"),
        (
            "lateral_offset = { K = 5.6, K_sd = 1.1 }",
            "fopdt.prior.lateral_offset: car_following has no such input",
        ),
        (
            "range_rate = { tau = 0.3, tau_factor = 2.0, dead_time = 0.3, dead_time_sd = 0.1, "
            "tau_plus_dead_time = 0.6, tau_plus_dead_time_factor = 1.2 }",
            "give two of them, the third follows",
        ),
    ],
)
def test_a_mistake_is_said_with_its_key(section: str, says: str, tmp_path: Path) -> None:
    """One line each."""
    with pytest.raises(ConfigError) as error:
        with_prior(tmp_path, f"[fopdt.prior]\n{section}")
    assert says in str(error.value)


def test_all_mistakes_are_said_at_once(tmp_path: Path) -> None:
    """Of both channels and of the section itself."""
    with pytest.raises(ConfigError) as error:
        with_prior(
            tmp_path, "[fopdt.prior]\ntau = 0.3\nrange_rate = { K = 5.0 }\nheadway_error = { K_sd = 2.0 }"
        )
    for says in ("tau and tau_factor", "range_rate: K and K_sd", "headway_error: K and K_sd"):
        assert says in str(error.value)


def test_a_driver_who_keeps_the_lane_has_a_channel_of_his_own(tmp_path: Path) -> None:
    """`lateral_offset` there, and neither of the others."""
    read = with_prior(tmp_path, "[fopdt.prior.lateral_offset]\nK = -3.0\nK_sd = 1.0", "generic_lane")
    assert read.estimators["fopdt"].prior.lateral_offset.K == -3.0
    with pytest.raises(ConfigError, match="lane_keeping has no such input"):
        with_prior(tmp_path, "[fopdt.prior.range_rate]\nK = 3.0\nK_sd = 1.0", "generic_lane")
