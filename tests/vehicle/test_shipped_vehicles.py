"""The vehicles that are shipped with canid: they load wherever they lie, and mean what the complete DBC files mean."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from canid.analysis.drive.drive_reader import read_signals
from canid.io.logs import open_log
from canid.signals.vehicle import decoder, read_vehicle
from canid.values.frame_columns import chunks
from tests.fixtures import measured_logs

ROOT = Path(__file__).parents[2]
# each vehicle, with a log of replay_logs that has its messages
LOGS = {
    "generic": "following_mixed",
    "generic_lane": "lane_keeping",
    "openacc": "openacc_simulated",
    "openacc_asta": "openacc_asta_simulated",
    "toyota_rav4_2017": "toyota_rav4_2017_simulated",
}
# the DBC files of other authors that the shipped ones stand for
ORIGINALS = {
    "openacc.dbc": "openacc/car_following.dbc",
    "toyota_rav4_2017.dbc": "rav4/toyota_pt.dbc",
    "toyota_rav4_2017_radar.dbc": "rav4/toyota_radar.dbc",
}


def test_every_shipped_vehicle_is_here() -> None:
    """A vehicle that is added to dbc/ has a log too."""
    assert {path.stem for path in (ROOT / "dbc").glob("*.toml")} == set(LOGS)


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize("name", LOGS)
def test_a_copy_in_another_folder_is_the_same_vehicle(name: str, tmp_path: Path) -> None:
    """The TOML and the DBC files that it names are all that is needed, and they give no warning."""
    text = (ROOT / "dbc" / f"{name}.toml").read_text(encoding="utf-8")
    files = [one if isinstance(one, str) else one["file"] for one in tomllib.loads(text)["dbc"]]
    for file in [f"{name}.toml", *files]:
        assert "/" not in file
        shutil.copy(ROOT / "dbc" / file, tmp_path)
    copy, ours = read_vehicle(tmp_path / f"{name}.toml"), read_vehicle(name)
    assert copy.warnings == ()
    assert (copy.roles, copy.lead, copy.driver) == (ours.roles, ours.lead, ours.driver)


@pytest.mark.slow("parses hostile files in children")
def test_an_installed_canid_has_vehicles_and_logs(tmp_path: Path) -> None:
    """In the layout of the wheel, outside of the repository: check and identify work for each vehicle and its log."""
    shutil.copytree(ROOT / "canid", tmp_path / "canid", ignore=shutil.ignore_patterns("__pycache__"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    for source, place in project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"].items():
        if (ROOT / source).is_dir():
            shutil.copytree(ROOT / source, tmp_path / place)
    code = f"""
import canid.ui.cli
from canid.values.shipped_files import shipped
assert shipped().parts[-2:] == ("_data", "dbc"), shipped()
for name, log in {LOGS!r}.items():
    path = str(shipped().parent / "replay_logs" / (log + ".blf"))
    for words in (["check", path], ["identify", path, "--stop", "30"]):
        assert canid.ui.cli.main([*words, "--vehicle", name]) == 0, (words, name)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("the vehicle file fits") == len(LOGS)


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(
    ("name", "folder"), [("openacc", "openacc"), ("openacc_asta", "asta"), ("toyota_rav4_2017", "rav4")]
)
def test_measured_logs_mean_what_the_original_dbc_says(
    measured: Path, tmp_path: Path, name: str, folder: str
) -> None:
    """Every mapped signal and radar track of whole logs, to the last bit, as with the complete DBC files of others."""
    text = (ROOT / "dbc" / f"{name}.toml").read_text(encoding="utf-8")
    for ours, theirs in ORIGINALS.items():
        text = text.replace(f'"{ours}"', f'"{measured / theirs}"')
    (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    original, ours = read_vehicle(tmp_path / f"{name}.toml"), read_vehicle(name)
    assert set(ours.roles) == set(original.roles)
    for log in measured_logs.files(f"{folder}/*.blf"):
        expected, found = read_signals(log, original), read_signals(log, ours)
        assert set(found) == set(expected) == set(ours.roles)
        for role, (t, value) in expected.items():
            np.testing.assert_array_equal(found[role].t, t)
            np.testing.assert_array_equal(found[role].value, value)
    if ours.lead.tracks is not None:
        columns = [chunk for chunk in chunks(open_log(log)) if len(chunk.t)]
        decoded = []
        for vehicle in (original, ours):
            init, step = decoder(vehicle)
            state, rows = init(), []
            for chunk in columns:
                state, of = step(state, chunk)
                rows += [np.column_stack([track.row, *track[2:]]) for track in of.tracks]
            decoded.append(np.concatenate(rows))
        assert len(decoded[0]) > 10_000
        np.testing.assert_array_equal(*decoded)
