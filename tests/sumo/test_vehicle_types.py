"""The written file: valid by SUMO's own schema, loaded by SUMO, and driven there as by canid's formulas."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from canid.sumo import krauss
from canid.sumo.driver_ids import driver_ids
from canid.sumo.pooled_driver import Drive, PooledDriver, pooled
from canid.sumo.sumo_models import BY_NAME, MODELS
from canid.sumo.vehicle_types import AWARENESS, additional, vehicle_type
from canid.types import Interval
from tests.sumo.test_pooled_driver import X, drive

HOSTILE = [
    "Zoë",
    "a b",
    "a;b",
    "A B",
    "山田",
    "",
    "<&\"'>--",
    "--x--",
    "\x00\x1b",
    "a\nb",
    "../../etc",
    "\ud800",
    "x" * 500,
]


def of(model: str, name: str = "a") -> PooledDriver:
    """A driver with this model."""
    return pooled(name, [Drive("a.blf", drive(X, 1e-3).model._replace(model=model))])


def test_ids_are_unique_and_safe() -> None:
    ids = driver_ids(HOSTILE)
    assert len({one.lower() for one in ids}) == len(HOSTILE)
    assert all(re.fullmatch(r"driver_[A-Za-z0-9_.-]+", one) for one in ids)


@given(st.lists(st.text(max_size=20), min_size=1, max_size=6))
def test_any_names_give_xml_with_one_type_each(names: list[str]) -> None:
    text = additional([of("IDM", name) for name in names], "x--y", "canid")
    root = ElementTree.fromstring(text.encode())
    types = [one.get("id") for one in root.iter("vType")]
    spread = root.find("vTypeDistribution")
    assert spread is not None
    assert len(set(types)) == len(names)
    assert spread.get("vTypes", "").split() == types
    shares = [float(x) for x in spread.get("probabilities", "").split()]
    assert sum(shares) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("model", list(BY_NAME))
def test_parameters_are_those_of_the_driver(model: str) -> None:
    """Each of them in the attribute that SUMO reads it from, and the noise in what SUMO has for it."""
    driver = of(model)
    q = {name: x.value for name, x in driver.parameters.items()}
    one = vehicle_type("x", driver)
    has = one.attributes
    where = {
        "T": "tau",
        "s0": "minGap",
        "a": "accel",
        "b": "decel",
        "v0": "maxSpeed",
        "k1": "gapControlGainSpace",
    }
    for name, x in q.items():
        assert float(has[where.get(name, "gapControlGainSpeed")]) == pytest.approx(x, abs=1e-4), name
    noise, error_of = driver.noise, BY_NAME[model].error_of
    if error_of == "accel":
        assert float(has["sigmaerror"]) * q["a"] == pytest.approx(noise.sd.value, abs=1e-4)
        assert float(has["tPersDrive"]) == pytest.approx(noise.time.value)
        assert "has.driverstate.device" not in one.params
        return
    device = {key.rpartition(".")[2]: x for key, x in one.params.items()}
    assert float(device["errorTimeScaleCoefficient"]) * AWARENESS == pytest.approx(noise.time.value)
    assert float(device["errorNoiseIntensityCoefficient"]) * (1 - AWARENESS) == pytest.approx(1.0)
    size = device["headwayErrorCoefficient" if error_of == "gap" else "speedDifferenceErrorCoefficient"]
    assert float(size) * noise.sensitivity == pytest.approx(noise.sd.value, abs=1e-4)


def test_a_driver_without_noise_has_none() -> None:
    for model in BY_NAME:
        driver = of(model)
        quiet = driver._replace(noise=driver.noise._replace(sd=Interval(0.0, 0.0), time=Interval()))
        one = vehicle_type("x", quiet)
        assert "has.driverstate.device" not in one.params
        assert float(one.attributes.get("sigmaerror", "0")) == 0.0
        assert all(re.fullmatch(r"-?[0-9.]+|IDM|EIDM|ACC|Krauss", x) for x in one.attributes.values())


def test_the_file_is_valid_by_the_schema_of_sumo() -> None:
    etree = pytest.importorskip("lxml.etree")
    found = importlib.util.find_spec("sumo_data")
    if found is None or not found.submodule_search_locations:
        pytest.skip("pip install 'canid[bench]': SUMO's schema is in sumo-data")
    schema = Path(found.submodule_search_locations[0]) / "data" / "xsd" / "additional_file.xsd"
    drivers = [of(list(BY_NAME)[k % len(BY_NAME)], name) for k, name in enumerate(HOSTILE)]
    root = etree.fromstring(additional(drivers, "fleet", "canid").encode())
    checked = etree.XMLSchema(etree.parse(str(schema)))
    assert checked.validate(root), checked.error_log


@pytest.mark.skipif(sys.platform == "win32", reason="libsumo's wheel is tried on Linux")
@pytest.mark.parametrize("model", list(BY_NAME))
def test_sumo_loads_the_file_and_drives_by_canids_formula(model: str, tmp_path: Path) -> None:
    """SUMO's own car-following function at states drawn at random, against the formula that was calibrated."""
    libsumo = pytest.importorskip("libsumo", reason="pip install 'canid[bench]'")
    from benchmarks.sumo.vehicle_type_drive import Run, network, routes

    step = krauss.STEP_S if model == "Krauss" else 0.1
    driver = of(model)
    file, net, cars = tmp_path / "drivers.add.xml", tmp_path / "n.net.xml", tmp_path / "r.rou.xml"
    file.write_text(additional([driver], "x", "canid"), encoding="utf-8")
    net.write_text(network(1), encoding="utf-8")
    run = Run(np.array([60.0]), np.array([20.0]), np.array([20.0]))
    cars.write_text(routes("", "driver_a", 1, run), encoding="utf-8")
    words = ["sumo", "-n", str(net), "-a", str(file), "-r", str(cars), "--step-length", str(step)]
    libsumo.start([*words, "--no-step-log", "--no-warnings"])
    try:
        libsumo.simulationStep()
        of_sumo = libsumo.vehicle
        rest = of_sumo.getMinGap("own0")
        q = np.array([x.value for x in driver.parameters.values()])
        rng = np.random.default_rng(1)
        for _ in range(30):
            speed = float(rng.uniform(3.0, 0.9 * (q[0] if model != "ACC" else 30.0)))
            gap, lead = (
                rest + 1.0 + speed * float(rng.uniform(0.7, 2.5)),
                speed + float(rng.uniform(-2.0, 2.0)),
            )
            formula = float(BY_NAME[model].rival.acceleration(q, *(np.array(x) for x in (gap, speed, lead))))
            wanted = of_sumo.getFollowSpeed("own0", speed, gap - rest, max(lead, 0.0), 4.5, "lead0")
            if model == "Krauss":
                # SUMO counts whole steps of braking: within one of them
                assert wanted == pytest.approx(speed + formula * step, abs=q[4] * step), (gap, speed, lead)
            elif formula > -4.0:  # what brakes harder is bounded by SUMO
                # the driver's error is there from the first step on, and is small: sd 0.3 m/s²
                assert (wanted - speed) / step == pytest.approx(formula, abs=0.35 + 0.1 * abs(formula))
    finally:
        libsumo.close()


def test_every_model_has_a_place_in_the_file() -> None:
    """A model that is added to the list is written, too."""
    for one in MODELS:
        assert vehicle_type("x", of(one.name)).attributes["carFollowModel"] == one.name
