"""The JSON Schema of a result, which comes from its type, describes what each verb writes, and not anything else."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

import canid
from canid.ui.cli import main
from canid.ui.cli.commands.schema import json_schema, names
from canid.ui.cli.verbs import VERBS
from canid.ui.views import json_schema as of_types
from canid.values.text.json_values import KEYS, NULL_IF_EMPTY, ROUNDED, mark

REPO = Path(__file__).parents[2]
LOGS = REPO / "replay_logs"
CAR, LANE = ("--vehicle", "generic"), ("--vehicle", "generic_lane")
URBAN, LOST, STEERING = (
    str(LOGS / f"{n}.blf") for n in ("following_urban", "following_lost_lead", "lane_keeping")
)
# of a fleet: whole drives alone
WHOLE = ("--no-diagnosis", "--no-windows", "--no-traffic")
# schema, words, expected exit code; good drives, a drive that is too short, no lead, steering, several logs
RUNS: list[tuple[str, tuple[str, ...], int]] = [
    ("replay", ("replay", LOST, *CAR, "--start", "60", "--stop", "100"), 0),
    ("replay", ("replay", STEERING, *LANE, "--stop", "8"), 0),
    ("identify", ("identify", URBAN, *CAR, "--stop", "90"), 0),
    ("identify", ("identify", URBAN, LOST, *CAR, "--stop", "4"), 0),
    ("identify", ("identify", STEERING, *LANE, "--stop", "60"), 0),
    ("diagnose", ("diagnose", URBAN, *CAR, "--stop", "5"), 0),
    ("diagnose", ("diagnose", URBAN, *CAR, "--stop", "90"), 0),
    ("check", ("check", URBAN, *CAR), 0),
    ("check", ("check", STEERING, *CAR), 1),
    ("check", ("check", URBAN), 0),
    ("look", ("look", URBAN, "--dbc", str(REPO / "dbc/generic.dbc")), 0),
    ("init", ("init", str(REPO / "dbc/generic.dbc")), 0),
    ("compare", ("compare", f"{URBAN}@0:90", f"{URBAN}@90:170", *CAR), 0),
    ("compare", ("compare", f"{URBAN}@0:4", f"{URBAN}@4:8", *CAR), 0),
    ("fleet", ("fleet", LOST, "damaged.blf", *CAR, *WHOLE, "-o", "results"), 4),
    ("export", ("export", URBAN, *CAR, "--stop", "5", "--to", "csv", "-o", "out"), 0),
    ("recover", ("recover", "damaged.blf"), 4),
    ("identify", ("identify", "damaged.blf", *CAR), 4),
]


def objects(file: Path) -> list[dict[str, Any]]:
    """Every object of a file: one, a list, or a line each."""
    found = [json.loads(line) for line in file.read_text().splitlines()]
    return [one for of in found for one in (of if isinstance(of, list) else [of])]


@pytest.mark.slow("every verb with --json")
@pytest.mark.parametrize(
    ("name", "words", "code"), RUNS, ids=lambda value: str(value)[:40] if isinstance(value, str) else ""
)
def test_what_a_verb_writes_is_what_its_schema_says(
    name: str, words: tuple[str, ...], code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The real output of every verb validates, that of short, damaged and leadless drives included."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "damaged.blf").write_bytes(Path(URBAN).read_bytes()[:100_000])
    assert main([*words, "--json", "out.json"]) == code
    validator = Draft202012Validator(canid.json_schema(name))
    written = objects(tmp_path / "out.json")
    assert written
    for one in written:
        validator.validate(one)
        assert one["schema"] == mark(name)
    # a name that is added is free, one that goes is not
    one = {**written[0], "windows": written[0].get("windows", [])[:1]}
    validator.validate({**one, "added later": 1})
    for key in validator.schema["required"]:
        assert not validator.is_valid({other: of for other, of in one.items() if other != key}), key
    assert not validator.is_valid({**one, "schema": "canid/another/1"})


def test_a_recordings_line_validates() -> None:
    """What `record --json` writes at its end, made of the recorder's own numbers."""
    from canid.analysis.session.session import SessionSettings, World, session
    from canid.io.buses.bus_opener import open_buses
    from canid.ui.cli.live_session import recorded
    from canid.values.text import json_values

    buses = open_buses([{"interface": "virtual", "channel": "schema"}])
    *_, last = session(buses, SessionSettings(duration=0.1))
    assert isinstance(last, World)
    Draft202012Validator(canid.json_schema("record")).validate(
        json.loads(json_values.document("record", recorded(last)))
    )


@pytest.mark.parametrize("name", names())
def test_every_schema_is_valid(name: str) -> None:
    Draft202012Validator.check_schema(json_schema(name))


def test_every_key_of_a_diagnosis_is_in_its_schema() -> None:
    """Also what only some diagnoses have."""
    keys = json_schema("diagnose")["properties"]
    assert {"differ", "drives", "maps", "recommended", "remarks", "rivals", "spectra", "worst"} <= set(keys)
    assert {"log", "used_time", "gains", "channels"} == set(
        json_schema("diagnose")["$defs"]["DriveShare"]["required"]
    )


def test_every_row_of_the_tables_of_keys_is_of_a_field(monkeypatch: pytest.MonkeyPatch) -> None:
    """A row for a type or a field that is no more, or that no verb writes, is found."""
    seen = set()

    def noted(kind: type) -> Any:
        seen.update(f"{kind.__name__}.{name}" for name in kind._fields)  # type: ignore[attr-defined]
        return fields(kind)

    fields = of_types.fields
    monkeypatch.setattr(of_types, "fields", noted)
    for verb in VERBS:
        for name in verb.results:
            json_schema(name)
    assert {*KEYS, *ROUNDED, *NULL_IF_EMPTY} - seen == {"Event.what", "Event.t"}  # of the live page


def test_the_verb_prints_a_schema_and_refuses_others(capfd: pytest.CaptureFixture[str]) -> None:
    """`canid schema identify` is JSON; a name that does not exist is one line with those that do."""
    assert main(["schema", "identify"]) == 0
    assert json.loads(capfd.readouterr().out) == canid.json_schema("identify")
    assert main(["schema"]) == 0
    assert len(capfd.readouterr().out.splitlines()) == len(names())
    assert main(["schema", "nothing"]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    assert "identify" in error
