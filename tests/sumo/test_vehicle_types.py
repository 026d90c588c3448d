"""The written file: valid by SUMO's own schema, for any names, with each parameter where SUMO reads it."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canid.analysis.sumo.driver_ids import driver_ids
from canid.analysis.sumo.sumo_models import BY_NAME, MODELS
from canid.analysis.sumo.vehicle_types import AWARENESS, additional, vehicle_type
from canid.values.types import Interval
from tests.sumo.planted_models import driver

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


def test_ids_are_unique_and_safe() -> None:
    ids = driver_ids(HOSTILE)
    assert len({one.lower() for one in ids}) == len(HOSTILE)
    assert all(re.fullmatch(r"driver_[A-Za-z0-9_.-]+", one) for one in ids)


@pytest.mark.slow("fits traffic models")
@given(st.lists(st.text(max_size=20), min_size=1, max_size=6))
def test_any_names_give_xml_with_one_type_each(names: list[str]) -> None:
    text = additional([driver("IDM", name) for name in names], "x--y", "canid")
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
    one_driver = driver(model)
    q = {name: x.value for name, x in one_driver.parameters.items()}
    one = vehicle_type("x", one_driver)
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
    noise, error_of = one_driver.noise, BY_NAME[model].error_of
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
        one_driver = driver(model)
        quiet = one_driver._replace(noise=one_driver.noise._replace(sd=Interval(0.0, 0.0), time=Interval()))
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
    drivers = [driver(list(BY_NAME)[k % len(BY_NAME)], name) for k, name in enumerate(HOSTILE)]
    root = etree.fromstring(additional(drivers, "fleet", "canid").encode())
    checked = etree.XMLSchema(etree.parse(str(schema)))
    assert checked.validate(root), checked.error_log


def test_every_model_has_a_place_in_the_file() -> None:
    """A model that is added to the list is written, too."""
    for one in MODELS:
        assert vehicle_type("x", driver(one.name)).attributes["carFollowModel"] == one.name
