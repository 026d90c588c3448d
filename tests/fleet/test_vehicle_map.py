"""The mapping file gives each log its driver, car and vehicle file, and all its mistakes at once."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from canid.analysis.fleet.job import Failure
from canid.analysis.fleet.planning import sources
from canid.analysis.fleet.planning.plan import planned
from canid.analysis.fleet.planning.vehicle_map import of_table, read_map
from canid.values.errors import ConfigError

REPO = Path(__file__).parents[2]


def made(folder: Path, text: str) -> Path:
    path = folder / "map.toml"
    path.write_text(text, encoding="utf-8")
    return path


def logs(folder: Path, *names: str) -> str:
    for name in names:
        path = folder / "data" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x")
    return str(folder / "data")


def test_the_first_entry_that_matches_holds(tmp_path: Path) -> None:
    """Entries in their order, whole paths and patterns mixed; what an entry does not say comes from folders or --vehicle."""
    root = logs(tmp_path, "2019/a1.log", "2019/a2.log", "2020/a1.log", "ben/b.log", "c.asc", "d.csv")
    path = made(
        tmp_path,
        """
        vehicle = "generic"
        [[drives]]
        match = "2019/a2.log"
        driver = "first"
        [[drives]]
        match = "2019/a*.log"
        driver = "anna"
        car = "audi"
        group = "short"
        [[drives]]
        match = "2019/a1.log"
        driver = "never"
        [[drives]]
        match = "2020/**"
        driver = "anna"
        vehicle = "generic_lane"
        [[drives]]
        match = "b.log"
        [[drives]]
        match = "*.csv"
        driver = "tables"
        columns = "openacc"
        """,
    )
    plan = planned([root], vehicles=str(path))
    found = {one.log.removeprefix(f"{root}/"): one for one in plan.logs}
    assert {name: one.driver for name, one in found.items()} == {
        "2019/a1.log": "anna",
        "2019/a2.log": "first",
        "2020/a1.log": "anna",
        "ben/b.log": "ben",
        "c.asc": "c",
        "d.csv": "tables",
    }
    assert found["2019/a1.log"][5:7] == ("audi", "short")
    assert found["c.asc"].failure is Failure.UNMAPPED
    assert "c.asc" in found["c.asc"].reason
    assert {name: one.source for name, one in found.items() if name != "c.asc"} == {
        **dict.fromkeys(
            ("2019/a1.log", "2019/a2.log", "ben/b.log"), sources.read_source("generic").fingerprint
        ),
        "2020/a1.log": sources.read_source("generic_lane").fingerprint,
        "d.csv": sources.read_source("openacc").fingerprint,
    }
    assert found["d.csv"].car == "OpenACC"
    assert set(plan.sources) >= {one.source for one in plan.logs if one.source}


def test_all_mistakes_are_reported_at_once(tmp_path: Path) -> None:
    """Unknown keys with what was meant, wrong types, missing vehicle files and their own mistakes: a line each."""
    (tmp_path / "bad.toml").write_text('dbc = ["none.dbc"]\n[signals]\nspeeed = "A.B"\n')
    path = made(
        tmp_path,
        """
        drive = 1
        [[drives]]
        match = "a*"
        drivr = "anna"
        [[drives]]
        driver = "ben"
        [[drives]]
        match = "b"
        vehicle = "nothing.toml"
        [[drives]]
        match = "c"
        vehicle = "bad.toml"
        [[drives]]
        match = "d"
        vehicle = "generic"
        columns = "highd"
        [[drives]]
        match = "e"
        columns = "generic"
        [[drives]]
        match = "f"
        driver = 3
        """,
    )
    with pytest.raises(ConfigError) as refused:
        read_map(path)
    text = "\n".join(refused.value.mistakes)
    for says in (
        'map.toml: drive: unknown section (did you mean "drives"?)',
        'drives[0].drivr: unknown key (did you mean "driver"?)',
        "drives[1].match: is missing",
        "drives[2].vehicle: vehicle file nothing.toml does not exist",
        "drives[3].vehicle: bad.toml: signals.speeed: unknown role",
        "drives[3].vehicle: bad.toml: dbc: ",
        "drives[4]: names vehicle and columns",
        "drives[5].columns: generic is for vehicle =",
        "drives[6].driver: must be a valid string",
    ):
        assert says in text, text
    assert all("\n" not in line for line in refused.value.mistakes)


@pytest.mark.parametrize(
    "text",
    ["drives = 1", "drives = []", "", "drives = [1]", "[[drives]", "a" * 100, "[[drives]]\nmatch = ''\x00"],
)
def test_a_file_that_is_no_map_is_refused(tmp_path: Path, text: str) -> None:
    """Whatever it holds: ConfigError."""
    with pytest.raises(ConfigError):
        read_map(made(tmp_path, text))


def test_a_map_that_takes_too_long_to_parse_is_refused(tmp_path: Path) -> None:
    """The parser of TOML runs in a child with limits: nesting without end costs nothing but a line."""
    with pytest.raises(ConfigError):
        read_map(made(tmp_path, "a = " + "[" * 200_000))


def test_the_fingerprint_follows_contents_and_not_places(tmp_path: Path) -> None:
    """A vehicle file that is moved is the same source; one byte of its DBC makes another."""
    text = (REPO / "dbc/generic.toml").read_text()
    dbc = (REPO / "dbc/generic.dbc").read_text()
    made_of = []
    for name, more in (("one", ""), ("two", ""), ("three", "\n")):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "v.toml").write_text(text)
        (folder / "generic.dbc").write_text(dbc + more)
        made_of.append(sources.read_source(folder / "v.toml").fingerprint)
    assert made_of[0] == made_of[1] != made_of[2]


def test_a_name_that_a_vehicle_and_a_column_map_share(tmp_path: Path) -> None:
    """`vehicle = "openacc"` is the shipped vehicle, `columns = "openacc"` the shipped column map."""
    entries = [{"match": "*.blf", "vehicle": "openacc"}, {"match": "*.csv", "columns": "openacc"}]
    of = of_table({"drives": entries}, tmp_path / "map.toml")
    log, table = (of.sources[of.entries[k].source] for k in (0, 1))
    assert log.vehicle is not None
    assert log.columns is None
    assert table.columns is not None
    assert table.vehicle is None


def test_the_mapping_file_of_the_page_does_what_it_says(tmp_path: Path) -> None:
    """The example of docs/fleet.md as it stands, with a vehicle file next to it."""
    page = (REPO / "docs/fleet.md").read_text("utf-8")
    (block,) = re.findall(r"^```toml\n(.*?)^```$", page, flags=re.M | re.S)
    for suffix in ("toml", "dbc"):
        # the vehicle file names its DBC
        name = "tesla.toml" if suffix == "toml" else "generic.dbc"
        shutil.copyfile(REPO / f"dbc/generic.{suffix}", tmp_path / name)
    root = logs(tmp_path, "tesla/ben/week/a.blf", "ben/anna_long_1.blf", "ben/b.blf")
    plan = planned([root], vehicles=str(made(tmp_path, block)))
    found = {Path(one.log).name: (one.driver, one.car, one.group_name) for one in plan.logs}
    generic = "Generic car-following vehicle"
    assert found == {
        "a.blf": ("ben", "tesla 2020", ""),
        "anna_long_1.blf": ("anna", generic, "long"),
        "b.blf": ("ben", generic, ""),
    }
