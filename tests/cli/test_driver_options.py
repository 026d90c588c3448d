"""`canid simulate --driver` and `--steering`: what is given is driven, what is not keeps its default."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from canid.models.simulation import simulate
from tests.cli.conftest import Ran

Canid = Callable[..., Ran]


def truth(path: Path) -> dict:
    return json.loads(path.with_name("x.truth.json").read_text())


def test_given_keys_are_driven_and_the_others_are_those_of_the_seed(canid: Canid, tmp_path: Path) -> None:
    out, usual = tmp_path / "x.blf", simulate(minutes=0.1, seed=5).truth
    given = "K1=7.8095,tau1=0.141,theta1=0,noise=0.5,headway=2.5"
    assert canid("simulate", out, "--minutes", 0.1, "--seed", 5, "--driver", given).code == 0
    made = truth(out)
    assert made["channels"]["headway_error"] == {"K": 7.8095, "tau": 0.141, "dead_time": 0.0}
    assert made["channels"]["range_rate"] == usual["channels"]["range_rate"]
    assert made["headway_desired"] == 2.5
    assert made["noise"]["sd"] == 0.5


def test_the_defaults_of_a_seed_change_nothing(canid: Canid, tmp_path: Path) -> None:
    """A key at its default gives the same bytes as no key."""
    one, other = tmp_path / "x.blf", tmp_path / "y.blf"
    K2 = simulate(minutes=0.1, seed=7).truth["channels"]["range_rate"]["K"]
    assert canid("simulate", one, "--minutes", 0.1, "--seed", 7).code == 0
    assert canid("simulate", other, "--minutes", 0.1, "--seed", 7, "--driver", f"K2={K2!r}").code == 0
    assert one.read_bytes() == other.read_bytes()


def test_steering_is_driven(canid: Canid, tmp_path: Path) -> None:
    out = tmp_path / "x.blf"
    ran = canid(
        "simulate", out, "--minutes", 0.2, "--profile", "lane",
        "--steering", "a1=-1.3149,a2=0.3979,b1=-3.754,b2=3.6736,c1=0,sd=0.1",
    )  # fmt: skip
    assert ran.code == 0
    assert "leaves the lane" not in ran.err
    made = json.dumps(truth(out))
    assert "-1.3149" in made
    assert "3.6736" in made


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--driver", "K3=1"), "'K3' is not one of K1, tau1"),
        (("--driver", "K1=fast"), "write K1=NUMBER"),
        (("--driver", "K1"), "write K1=NUMBER"),
        (("--driver", "K1=nan"), "write K1=NUMBER"),
        (("--driver", "K1=1e9"), "K1 1e+09 is outside of"),
        (("--driver", "tau1=-0.1"), "tau1 -0.1 is outside of 0 to 60 s"),
        (("--driver", "theta2=-1"), "theta2 -1 is outside of 0 to 60 s"),
        (("--driver", "K1=1,K1=2"), "K1 is given twice"),
        (("--driver", ""), "'' is not one of"),
        (("--driver", "K1=5", "--profile", "lane"), "use --steering"),
        (("--steering", "a1=-1.2"), "add --profile lane"),
        (("--steering", "a1=-3", "--profile", "lane"), "a1 -3 is outside of -2 to 2"),
        (("--driver", "K1=5", "--steering", "a1=-1"), "give one of them"),
        (("--driver", "K1=5", "--model", "report.json"), "leave out --driver"),
        (("--steering", "a1=-1", "--profile", "lane", "--model", "report.json"), "leave out --steering"),
    ],
)
def test_one_line_says_what_is_wrong(
    canid: Canid, tmp_path: Path, options: tuple[str, ...], says: str
) -> None:
    ran = canid("simulate", tmp_path / "x.blf", "--minutes", 0.1, *options)
    assert ran.code == 2
    assert says in ran.line
    assert not list(tmp_path.iterdir())


def test_a_driver_who_holds_no_gap_is_named(canid: Canid, tmp_path: Path) -> None:
    options = ("--minutes", 0.2, "--driver", "K1=20,K2=80,theta2=1.5")
    ran = canid("simulate", tmp_path / "x.blf", *options)
    assert ran.code == 0
    assert "does not hold a gap" in ran.err


def test_a_driver_who_steers_the_wrong_way_is_named(canid: Canid, tmp_path: Path) -> None:
    """Chen & Ulsoy's printed signs, taken as canid's."""
    options = ("--minutes", 1, "--profile", "lane", "--steering", "b1=4.134,b2=-4.0337")
    ran = canid("simulate", tmp_path / "x.blf", *options)
    assert ran.code == 0
    assert "leaves the lane" in ran.err
