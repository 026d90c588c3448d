"""Headings in the words of several languages: understood where every word is, and never instead of a usual name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from canid.analysis.tables.heading_words import role_in_words
from canid.analysis.tables.headings import ALIASES, closing, heading, role_of
from canid.analysis.tables.table import Table, open_table

# roles of headings in five languages
SAID = {
    "speed, vehicle [km/h]": "speed",
    "Host velocity": "speed",
    "egoSpeed": "speed",
    "Fahrzeuggeschwindigkeit [km/h]": "speed",
    "Vitesse du véhicule (km/h)": "speed",
    "Velocidad propia": "speed",
    "Velocità": "speed",
    "Speed of the lead vehicle": "lead_speed",
    "Geschwindigkeit des Vordermanns": "lead_speed",
    "vitesse du véhicule précédent": "lead_speed",
    "Relativgeschwindigkeit [m/s]": "range_rate",
    "lead vehicle relative velocity": "range_rate",
    "velocidad relativa": "range_rate",
    "Annäherungsgeschwindigkeit": "range_rate",
    "distance to preceding vehicle": "gap",
    "Abstand zum Vordermann [m]": "gap",
    "Distance de l'avant": None,
    "Zeitlücke [s]": "headway",
    "Zeit [s]": "time",
    "Temps": "time",
    "Tempo (s)": "time",
    "Fahrpedalstellung [%]": "pedal",
    "position de la pédale d'accélérateur": "pedal",
    "pedale acceleratore": "pedal",
    "Längsbeschleunigung [m/s²]": "accel",
    "Bremse": "brake",
    "Lenkradwinkel": "steering_angle",
    "швидкість автомобіля (км/год)": "speed",
    "відносна швидкість (м/с)": "range_rate",
    "педаль газу (%)": "pedal",
    "brzina vozila [km/h]": "speed",
    "relativna brzina [m/s]": "range_rate",
    "udaljenost do vozila ispred [m]": "gap",
    "papučica gasa [%]": "pedal",
    "Ajonopeus (km/h)": "speed",
    "相对车速(米/秒)": "range_rate",
    "Speed in kilometers per hour": "speed",
}
# each holds words of a role and one that changes the meaning
OTHER = (
    "speed limit", "set speed", "average speed", "cruise speed", "max velocity", "wheel speed front left",
    "lead acceleration", "lateral acceleration", "brake pressure", "throttle position", "pedal raw", "distance",
    "lead distance filtered", "Lenkradwinkelgeschwindigkeit", "Sollgeschwindigkeit", "time to collision",
    "relative acceleration", "speed error", "vehicle", "steering torque", "delta v", "vitesse limite",
    "front-to-front distance [m]", "radar speed", "lidar velocity [m/s]", "radar acceleration",
    "rear to rear distance", "distance front to front of the lead vehicle",
)  # fmt: skip
# by their words an acceleration and a gap; the usual names say otherwise
AMBIGUOUS = {"acc", "spacing"}


@pytest.mark.parametrize("text", SAID)
def test_the_words_say_the_role(text: str) -> None:
    """Case, accents, units and joined words make no difference."""
    assert role_of(heading(text)) == SAID[text]
    assert role_of(heading(text.upper() if text.islower() else text)) == SAID[text]
    assert closing(heading(text)) == text.startswith("Ann")


@pytest.mark.parametrize("text", OTHER)
def test_a_word_that_is_not_known_leaves_the_heading_alone(text: str) -> None:
    """A wrong role would give wrong numbers; none asks the user."""
    assert role_of(heading(text)) is None


def test_usual_names_and_words_do_not_contradict_each_other() -> None:
    """Of each usual name the words say the same role, or none."""
    for role, names in ALIASES.items():
        for name in set(names) - AMBIGUOUS:
            assert role_in_words(name) in (role, None), name


@given(st.text(alphabet="abcdefghijklmnoprstuvwz_ ", max_size=24))
def test_drawn_letters_are_no_headings(text: str) -> None:
    """What is read is made of whole known words: any other letter before it is another word."""
    if role_in_words(heading(text).name):
        assert role_in_words(f"q{heading(text).name}") is None


N = 300
T = 0.1 * np.arange(N)


def _table(folder: Path, headings: str, *columns: np.ndarray) -> Table:
    path = folder / "x.csv"
    rows = [";".join(f"{x:.3f}".replace(".", ",") for x in row) for row in zip(T, *columns, strict=True)]
    path.write_text("\n".join([headings, *rows]) + "\n", encoding="utf-8")
    return open_table(path)


def test_a_german_export_is_read(tmp_path: Path) -> None:
    """Decimal commas, km/h, and the first line says what was taken for what."""
    titles = "Zeit [s];Geschwindigkeit [km/h];Abstand [m];Annäherungsgeschwindigkeit [m/s];Fahrpedal [%]"
    rate = np.cos(T)
    table = _table(tmp_path, titles, 72.0 + np.sin(T), 30.0 + rate, rate, 20.0 + rate)
    assert "speed = Geschwindigkeit [km/h]" in table.columns
    assert "range_rate = Annäherungsgeschwindigkeit [m/s]" in table.columns


def test_a_usual_name_comes_before_words(tmp_path: Path) -> None:
    """A table that was read before its words were understood is read the same way."""
    rate = np.cos(T)
    table = _table(
        tmp_path, "t;v_ego;actual speed;d_rel;v_rel;gas", *[20.0 + rate] * 2, 30.0 + rate, rate, 9.0 + rate
    )
    assert "speed = v_ego" in table.columns


def test_what_may_be_the_pedal_is_named(tmp_path: Path) -> None:
    """Without a pedal the output is made of the speed: the user learns of the column that may be one."""
    rate = np.cos(T)
    table = _table(
        tmp_path, "t;speed;gap;range_rate;throttle", 20.0 + rate, 30.0 + rate, rate, 0.2 + 0.01 * rate
    )
    assert any("throttle: not used" in note and 'pedal = "throttle"' in note for note in table.notes)
