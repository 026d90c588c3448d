"""`canid export --to sumo` and `canid fleet export`: the file, what is refused, and reasons in one line."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import duckdb
import pytest

from canid.analysis.sumo.driver_model import NoModel, to_json
from canid.ui.cli import main
from tests.sumo.planted_models import X, drive

LOG = Path(__file__).parents[2] / "replay_logs" / "following_urban.blf"


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    capsys.readouterr()
    code = main([str(word) for word in words])
    return (code, *capsys.readouterr())


def types(file: Path) -> list[str | None]:
    return [one.get("id") for one in ElementTree.parse(file).getroot().iter("vType")]


@pytest.mark.slow("fits traffic models")
def test_a_log_becomes_a_vehicle_type(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Written under the name with its ending; not over an earlier one without --force, and never over another kind."""
    words = ("export", LOG, "--vehicle", "generic", "--to", "sumo", "-o")
    code, out, _ = run(capsys, *words, tmp_path / "x", "--json", "-")
    assert code == 0
    file = tmp_path / "x.add.xml"
    assert json.loads(out)[0]["path"] == str(file)
    assert types(file) == ["driver_following_urban"]
    code, _, err = run(capsys, *words, tmp_path / "x")
    assert (code, err.count("\n")) == (5, 1)
    other = tmp_path / "own.add.xml"
    other.write_text("<additional/>", encoding="utf-8")
    assert run(capsys, *words, other, "--force")[0] == 5
    assert other.read_text(encoding="utf-8") == "<additional/>"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--vehicle", "generic", "--stop", "60"), "drive longer"),
        (("--vehicle", "generic", "--signals"), "has no --signals"),
        (("--dbc", "x.dbc"), "needs --vehicle"),
    ],
)
def test_what_cannot_be_exported_is_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: tuple[str, ...], says: str
) -> None:
    code, _, err = run(capsys, "export", LOG, *words, "--to", "sumo", "-o", tmp_path / "x")
    assert code == (1 if says == "drive longer" else 2)
    assert says in err
    assert "Traceback" not in err
    assert not list(tmp_path.iterdir())


@pytest.fixture
def fleet(tmp_path: Path) -> Path:
    """A folder with four drives of two drivers, one of which is too short, and one that failed."""
    good = to_json(drive(X, 1e-3).model)
    rows: list[Mapping[str, object]] = [
        {"log": "a/1.blf", "driver": "Zoë", "status": "ok", "key": "1", "traffic_json": json.dumps(good)},
        {"log": "a/2.blf", "driver": "Zoë", "status": "damaged", "key": "2", "traffic_json": json.dumps(good)},
        {"log": "b/3.blf", "driver": "b;b", "status": "ok", "key": "3", "traffic_json": json.dumps(good)},
        {"log": "b/4.blf", "driver": "b;b", "status": "ok", "key": "4",
         "traffic_json": json.dumps(to_json(NoModel("drive longer")))},
        {"log": "c/5.blf", "driver": "c", "status": "failed", "key": None, "traffic_json": None},
    ]  # fmt: skip
    lines = tmp_path / "rows.jsonl"
    lines.write_text("\n".join(json.dumps(row) for row in rows), encoding="utf-8")
    folder = tmp_path / "fleet"
    folder.mkdir()
    with duckdb.connect() as db:
        for name in ("drives", "logs"):
            columns = ", ".join(f"{column}: 'VARCHAR'" for column in rows[0])
            db.execute(
                f"COPY (SELECT * FROM read_json('{lines}', format = 'newline_delimited', columns = {{{columns}}})) "
                f"TO '{folder}/{name}.parquet'"
            )
    return folder


def test_a_fleet_becomes_one_type_per_driver(
    capsys: pytest.CaptureFixture[str], fleet: Path, tmp_path: Path
) -> None:
    """Weighted by their time; a drive without a model is said, a driver by name is taken alone."""
    file = tmp_path / "drivers.add.xml"
    code, _, err = run(capsys, "fleet", "export", fleet, "--to", "sumo", "-o", file)
    assert code == 0
    assert types(file) == ["driver_Zoe", "driver_b_b"]
    spread = ElementTree.parse(file).getroot().find("vTypeDistribution")
    assert spread is not None
    assert spread.get("probabilities") == "0.66667 0.33333"
    assert "b/4.blf: drive longer" in err
    code, out, _ = run(capsys, "fleet", "export", fleet, "--driver", "b;b")
    assert code == 0
    assert "driver_b_b" in out
    assert "driver_Zoe" not in out


def test_no_such_driver_and_no_model_are_one_line(capsys: pytest.CaptureFixture[str], fleet: Path) -> None:
    code, _, err = run(capsys, "fleet", "export", fleet, "--driver", "Zoe")
    assert code == 2
    assert "did you mean Zoë?" in err
    code, _, err = run(capsys, "fleet", "export", fleet.parent)
    assert (code, err.count("\n")) == (2, 1)
