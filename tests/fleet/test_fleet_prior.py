"""`canid fleet prior`: what is written is read back equal, says what it rests on, and holds drivers that were left out."""

from __future__ import annotations

import argparse
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.fleet.answers.prior_file import MARK, FleetPrior, fleet_prior, toml_of
from canid.mathematics.identification.fopdt.prior import check_prior
from canid.mathematics.population.population_prior import SAME_DELAYS_SD_S
from canid.signals.vehicle import read_vehicle
from canid.ui.cli.commands import fleet_prior as verb
from canid.values.errors import ConfigError, OutputError
from canid.values.shipped_files import shipped
from tests import seeds
from tests.fixtures.fleet_folder import Planted, made, write


@pytest.fixture(scope="module")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Planted:
    """Twelve drivers of accelerations."""
    return made(tmp_path_factory.mktemp("fleet"), seeds.seed("fleet prior"), drivers=12, drives=2)


@pytest.fixture(scope="module")
def found(planted: Planted) -> FleetPrior:
    """Their prior."""
    return fleet_prior(planted.folder)


@pytest.fixture
def folder(planted: Planted, tmp_path: Path) -> Path:
    """A folder to be changed."""
    write(tmp_path / "changed", planted.rows)
    return tmp_path / "changed"


def asked(*words: str) -> int:
    """Run the verb."""
    parser = argparse.ArgumentParser()
    verb.arguments(parser)
    return verb.run(parser.parse_args(words))


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_what_is_written_is_read_back_equal(found: FleetPrior, tmp_path: Path) -> None:
    """The file, appended to a vehicle file of the same output, gives the prior to the last bit."""
    text = (shipped() / "openacc.toml").read_text(encoding="utf-8")
    for dbc in shipped().glob("*.dbc"):
        (tmp_path / dbc.name).write_bytes(dbc.read_bytes())
    car = tmp_path / "car.toml"
    car.write_text(text + "\n" + toml_of(found, "2026-01-06"), encoding="utf-8")
    read = read_vehicle(car).estimators["fopdt"].prior
    # NaN is not equal to itself
    assert repr(read) == repr(found.prior)
    check_prior(read)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_the_prior_is_the_population(planted: Planted, found: FleetPrior) -> None:
    """Means and spreads of a new drive of a new driver: those that were planted, to what twelve drivers show."""
    of = {"headway_error": found.prior.headway_error, "range_rate": found.prior.range_rate}
    truth = np.array(list(planted.drivers.values()))
    for k, own in enumerate(of.values()):
        assert own is not None
        # 0.045: errors of the estimates and spread within drivers, of one drive
        assert abs(own.K - truth[:, k].mean()) < 0.3 * own.K_sd + 4.0 * 0.045 / math.sqrt(24)
        assert 0.5 < own.K_sd / truth[:, k].std(ddof=1) < 2.5
        assert own.tau_plus_dead_time == pytest.approx(1.1, rel=0.25)
        assert math.isnan(own.dead_time)
        assert math.isnan(own.tau)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_comments_say_what_it_rests_on(found: FleetPrior) -> None:
    """Output, unit, date, and of each line drivers and drives; names of drivers cannot break out of a comment."""
    odd = 'x"\n[fopdt]\nwindow = 1'
    text = toml_of(found._replace(left_out=(odd,), folder=odd), "2026-01-06")
    assert text.startswith(f"{MARK}, 2026-01-06: of accel (m/s²).")
    assert text.count("# 12 drivers, 24 drives") == 4
    assert "Left out: x" in text
    assert tomllib.loads(text).keys() == {"fopdt"}
    assert tomllib.loads(text)["fopdt"].keys() == {"prior"}


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_a_driver_who_is_left_out_does_not_count(
    planted: Planted, folder: Path, found: FleetPrior, tmp_path: Path
) -> None:
    """A driver with absurd gains, left out: the prior is nearly that of all without the absurd driver."""
    rows = []
    for row in planted.rows:
        if row["driver"] == "driver 003":
            estimate = list(row["estimate"])
            estimate[1] += 5.0
            row = row | {"estimate": estimate, "range_rate_K": estimate[1]}
        rows.append(row)
    write(folder, rows)
    file = tmp_path / "prior.toml"
    file.write_text(f"{MARK}: an earlier one, which is replaced\n", encoding="utf-8")
    asked(str(folder), "--leave-out", "driver 003", "-o", str(file))
    text = file.read_text(encoding="utf-8")
    assert "Left out: driver 003." in text
    assert text.count("# 11 drivers, 22 drives") == 4
    own, before = tomllib.loads(text)["fopdt"]["prior"]["range_rate"], found.prior.range_rate
    assert before is not None
    assert abs(own["K"] - before.K) < before.K_sd
    assert 0.4 < own["K_sd"] / before.K_sd < 2.5


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_gains_that_may_not_be_quoted_count_and_unknown_delays_are_tied(
    planted: Planted, folder: Path, found: FleetPrior
) -> None:
    """No drive may quote anything of headway: its gains count with their errors, its delays are tied, which is said."""
    write(folder, [row | {"headway_error_status": "not_identifiable"} for row in planted.rows])
    without = fleet_prior(folder)
    own, before = without.prior.headway_error, found.prior.headway_error
    assert own is not None
    assert before is not None
    assert abs(own.K - before.K) < 0.5 * before.K_sd
    assert math.isnan(own.tau_plus_dead_time)
    assert without.prior.same_tau == without.prior.same_dead_time == SAME_DELAYS_SD_S
    assert "not from these drives" in toml_of(without, "2026-01-06")
    assert math.isnan(found.prior.same_tau)


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_what_cannot_be_made_is_refused(planted: Planted, folder: Path, tmp_path: Path) -> None:
    """One line each: no such driver, too few drivers, several outputs, drives that were made with a prior, other files."""
    with pytest.raises(ConfigError, match='did you mean "driver 003"'):
        fleet_prior(planted.folder, leave_out=["driver 03"])
    with pytest.raises(ConfigError, match="no folder of canid fleet"):
        fleet_prior(tmp_path)
    write(folder, [row for row in planted.rows if row["driver"] in ("driver 000", "driver 001")])
    with pytest.raises(ConfigError, match="needs 3 drivers whose gains are known; here are 2"):
        fleet_prior(folder)
    write(folder, [*planted.rows, planted.rows[0] | {"output": "pedal", "unit": "%"}])
    with pytest.raises(ConfigError, match=r"choose one with --role, --unit, --car; here are: accel"):
        fleet_prior(folder)
    write(folder, [row | {"identify_json": '{"prior_weight": 0.4}'} for row in planted.rows])
    with pytest.raises(ConfigError, match=r"identified with a declared \[fopdt.prior\]"):
        fleet_prior(folder)
    foreign = tmp_path / "car.toml"
    foreign.write_text('dbc = ["car.dbc"]\n', encoding="utf-8")
    with pytest.raises(OutputError, match=r"car\.toml"):
        asked(str(planted.folder), "-o", str(foreign))
    assert foreign.read_text(encoding="utf-8") == 'dbc = ["car.dbc"]\n'
