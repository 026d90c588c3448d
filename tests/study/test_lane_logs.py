"""Lane logs of a user: short ones, folders of them, and whose they are."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from canid.models.diagnosis import masks
from canid.values.errors import ConfigError
from canid.values.types import LearnGate
from canid_study import runs
from canid_study.chen_ulsoy.segments import ASSISTED, fitting_length, planar_trace, segments_of
from canid_study.chen_ulsoy.settings import ChenUlsoySettings

RECORDED = ChenUlsoySettings(warm_up=0)


@pytest.mark.parametrize(("length", "wanted"), [(60.0, 10.0), (95.0, 15.0), (240.0, 30.0), (3600.0, 60.0)])
def test_a_log_of_a_minute_and_more_has_enough_segments(length: float, wanted: float) -> None:
    """Nothing is left out at its beginning, and the segments are as long as the log allows."""
    logs = [("a.blf", planar_trace(np.arange(0.0, length - 0.05, 0.1)))]
    assert fitting_length({"S1": logs}, RECORDED) == wanted
    found = segments_of(logs, RECORDED._replace(segment=wanted))
    assert len(found.segments.number) == int(length // wanted) >= 6
    assert found.segments.number[0] == 0
    assert found.skipped == ()


def test_segments_begin_at_the_first_usable_sample() -> None:
    """Two seconds without a lane at the start of a log cost two seconds, not a segment."""
    trace = planar_trace(np.arange(0.0, 62.05, 0.1))
    late = trace.inputs.copy()
    late[:20] = np.nan
    found = segments_of([("a.blf", trace._replace(inputs=late))], RECORDED._replace(segment=10.0))
    assert len(found.segments.number) == 6
    assert found.segments.angle[0] == pytest.approx(trace.output[20:120])


def test_segments_in_which_an_assistant_steers_are_left_out_and_said() -> None:
    """By the role of the vehicle file; where there is none, the result says that nobody knows."""
    trace = planar_trace(np.arange(0.0, 600.0, 0.1))
    on = (trace.t >= 100.0) & (trace.t < 220.0)
    gate = tuple(LearnGate.ASSIST if x else LearnGate.OPEN for x in on)
    signals = {**trace.signals, "steering_assist": on.astype(float)}
    assisted = trace._replace(gate=gate, learn=~on, signals=signals)
    found = segments_of([("a.blf", assisted)], RECORDED)
    assert found.segments.number.tolist() == [0, 4, 5, 6, 7, 8, 9]
    assert [(one.what, one.why) for one in found.skipped] == [("3 segments (1, 2, 3) of 60 s", ASSISTED)]
    unknown = "No signal says whether an assistant steers"
    assert not any(unknown in says for says in runs._limits({"S1": [("a.blf", assisted)]}, RECORDED, "file"))
    assert any(unknown in says for says in runs._limits({"S1": [("a.blf", trace)]}, RECORDED, "file"))
    stretches = masks.recognise(assisted)[1]
    assert [(round(one.start), round(one.stop)) for one in stretches] == [(100, 220)]


def test_a_driver_has_a_name_wherever_the_log_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A log in the current folder is not the driver "."; nor is one in the folder above ".."."""
    inner = tmp_path / "anna" / "inner"
    inner.mkdir(parents=True)
    monkeypatch.chdir(inner)
    assert runs.driver_names(["a.blf"], "folder") == {"a.blf": "inner"}
    assert runs.driver_names([os.path.join("..", "a.blf")], "folder") == {"../a.blf": "anna"}
    assert runs.driver_names(["a.blf", "b.blf"], "file") == {"a.blf": "a", "b.blf": "b"}
    assert runs.driver_names([str(inner / "a.blf")], "folder") == {str(inner / "a.blf"): "inner"}


def test_two_drivers_never_have_one_name() -> None:
    """Of logs with the same name in different folders, of folders with the same name, of one name with two suffixes."""
    logs = ["s1/day/a.blf", "s2/day/a.blf", "s2/day/a.asc"]
    assert list(runs.driver_names(logs, "folder").values()) == ["s1/day", "s2/day", "s2/day"]
    assert list(runs.driver_names(logs[:2], "file").values()) == ["s1/day/a", "s2/day/a"]
    assert list(runs.driver_names(logs, "file").values()) == ["s1/day/a.blf", "s2/day/a.blf", "s2/day/a.asc"]
    assert list(runs.driver_names(["a.blf", "a.blf"], "file").values()) == ["a"]


def test_a_mapping_file_names_the_driver_of_each_log(tmp_path: Path) -> None:
    """By patterns of file names; a log of none or of two is one clear line."""
    file = tmp_path / "drivers.toml"
    file.write_text('[drivers]\nAnna = ["a_*.blf"]\n"Bo B." = ["b.blf", "c*"]\n', encoding="utf-8")
    logs = ["x/a_1.blf", "y/a_2.blf", "b.blf", "c7.blf"]
    assert list(runs.driver_names(logs, str(file)).values()) == ["Anna", "Anna", "Bo B.", "Bo B."]
    with pytest.raises(ConfigError, match=r"no driver of the log d\.blf"):
        runs.driver_names(["d.blf"], str(file))
    file.write_text('[drivers]\nAnna = ["a*"]\nBo = ["*.blf"]\n', encoding="utf-8")
    with pytest.raises(ConfigError, match="2 drivers"):
        runs.driver_names(["a.blf"], str(file))


@pytest.mark.parametrize(
    "text", ["", "[drivers]", "drivers = 3", '[drivers]\nAnna = "a.blf"', "[drivers]\nAnna = [1]", "[["]
)
def test_a_wrong_mapping_file_is_one_clear_line(text: str, tmp_path: Path) -> None:
    file = tmp_path / "drivers.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as wrong:
        runs.driver_names(["a.blf"], str(file))
    assert "\n" not in str(wrong.value)
    assert "drivers.toml" in str(wrong.value)
    with pytest.raises(ConfigError, match="nowhere"):
        runs.driver_names(["a.blf"], "nowhere.toml")
