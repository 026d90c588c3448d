import pickle
import random
import re
import shutil
from pathlib import Path

import pytest

from canid.analysis.proposal import proposal
from canid.mathematics.estimators.armax import ArmaxSettings
from canid.mathematics.estimators.fopdt import FopdtSettings
from canid.signals.dbc_text.parsing import Parser
from canid.signals.vehicle import read_vehicle, vehicle_file
from canid.values.errors import ConfigError
from canid.values.types import OutputFilter

ROOT = Path(__file__).parents[2]
GENERIC = ROOT / "dbc" / "generic.dbc"


def write(folder: Path, text: str) -> Path:
    shutil.copy(GENERIC, folder / "generic.dbc")
    file = folder / "car.toml"
    file.write_text(text, encoding="utf-8")
    return file


GOOD = """
dbc = ["generic.dbc"]
[signals]
pedal = "ENGINE_DATA.PedalPosition"
speed = "EGO_SPEED.VehicleSpeed"
gap = "RADAR_LEAD.LeadDistance"
range_rate = "RADAR_LEAD.LeadRelSpeed"
"""


def mistakes(file: Path) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        read_vehicle(file)
    assert caught.value.exit_code == 2
    return str(caught.value).splitlines()


def test_all_mistakes_are_told_at_once(tmp_path):
    """One reading names every mistake of a file, each with its key, and what was probably meant."""
    file = write(
        tmp_path,
        """
dbc = ["generic.dbc", "nowhere.dbc"]
[signals]
pedl = "ENGINE_DATA.PedalPosition"
pedal = "ENGINE_DATA.PedalPos"
speed = { signal = "EGO_SPED.VehicleSpeed" }
gap = { signal = "RADAR_LEAD.LeadDistance", unit = "bananas" }
range_rate = { signal = "RADAR_LEAD.LeadRelSpeed", scal = 2 }
brake = 7
accel = "LongAccel"
yaw_rate = { signal = "CHASSIS_DATA.YawRate", valid = [3, -3] }
headway = "RADAR_LEAD.LeadDistance"
grade = { signal = "GNSS_DATA.Altitude" }
[drivr]
x = 1
[driver]
task = "car_folowing"
headway_desired = "2"
[armax]
na = 2.5
forgeting = 0.9
[fopdt]
window = -60
[lead]
distance = "LONG_DIST"
rate_sign = 2
""",
    )
    lines = mistakes(file)
    assert all(line.startswith("car.toml: ") for line in lines)
    text = "\n".join(lines)
    for part in (
        'drivr: unknown section (did you mean "driver"?)',
        "nowhere.dbc does not exist",
        'signals.pedl: unknown role (did you mean "pedal"?)',
        'signals.pedal: no signal "PedalPos" in message ENGINE_DATA (did you mean "PedalPosition"?)',
        'signals.speed: no message "EGO_SPED" in generic.dbc, nowhere.dbc (not read)',
        '(did you mean "EGO_SPEED"?)',
        'signals.gap.unit: "bananas" cannot be converted to m',
        'signals.range_rate.scal: unknown key (did you mean "scale"?)',
        "signals.brake: must be a table or a text, not 7",
        'signals.accel: must be "MESSAGE.SIGNAL", not "LongAccel"',
        "signals.yaw_rate.valid: the lower limit must come first",
        "signals.headway: is computed",
        'signals.grade: Altitude has the unit "m", which cannot be converted to %',
        "driver.task: must be 'car_following' or 'lane_keeping', not 'car_folowing'",
        '(did you mean "car_following"?)',
        "driver.headway_desired: ",
        "armax.na: ",
        'armax.forgeting: unknown key (did you mean "forgetting"?)',
        "fopdt.window: must be greater than or equal to 1",
        "lead.rate_sign: must be 1 or -1",
    ):
        assert part in text, f"{part!r} not in\n{text}"
    assert "pydantic" not in text


def test_what_the_task_needs_is_asked_for(tmp_path):
    """A file without the signals that car following needs says which, and that radar tracks would do."""
    lines = mistakes(write(tmp_path, 'dbc = "generic.dbc"\n[signals]\n[driver]\noutput = "pedall"\n'))
    text = "\n".join(lines)
    assert 'driver.output: "pedall" is not one of' in text
    assert 'did you mean "pedal"?' in text
    assert "signals.speed: is missing; car_following needs it" in text
    assert "signals.gap: is missing; car_following needs it, or radar tracks in [lead]" in text
    lines = mistakes(
        write(tmp_path, 'dbc = "generic.dbc"\n[driver]\ntask = "lane_keeping"\noutput = "steering_angle"\n')
    )
    assert [line.split(": ", 1)[1].split(";")[0] for line in lines] == [
        "signals.steering_angle: is missing",
        "signals.lateral_offset: is missing",
    ]


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (
            lambda d: (d / "generic.dbc").unlink(),
            r"car.toml: dbc: .*generic.dbc does not exist; canid's own .*\"shipped:generic.dbc\"",
        ),
        (
            lambda d: (d / "generic.dbc").write_text("this is a letter"),
            r"generic.dbc cannot be parsed as a DBC: ",
        ),
        (lambda d: (d / "generic.dbc").write_bytes(b""), r"cannot be parsed as a DBC|defines no messages"),
        (
            lambda d: (d / "generic.dbc").write_bytes(bytes(range(256)) * 40),
            r"generic.dbc cannot be parsed as a DBC",
        ),
        (
            lambda d: (d / "generic.dbc").write_text('VERSION ""\nBU_: A\n'),
            r"generic.dbc defines no messages",
        ),
        (lambda d: (d / "car.toml").write_text("dbc = ]\n"), r"car.toml is not valid TOML: .*line 1"),
        (lambda d: (d / "car.toml").write_bytes(b"\xff\xfe\x00"), r"car.toml cannot be read"),
        (lambda d: (d / "car.toml").write_text(""), r"dbc: is missing"),
    ],
)
def test_broken_files_give_one_clear_line(tmp_path, spoil, says):
    """A missing or broken DBC or TOML is one ConfigError line, whatever the bytes are."""
    file = write(tmp_path, GOOD)
    spoil(tmp_path)
    with pytest.raises(ConfigError) as caught:
        read_vehicle(file)
    assert re.search(says, str(caught.value))
    assert all(len(line) < 400 for line in str(caught.value).splitlines())


def test_a_vehicle_that_does_not_exist_names_those_that_do(tmp_path):
    """A wrong name is answered with the near one and the list of shipped vehicles."""
    with pytest.raises(ConfigError, match=r'did you mean "generic"') as caught:
        read_vehicle("genric")
    assert "\n" not in str(caught.value)
    with pytest.raises(ConfigError, match=r"nothing.toml does not exist"):
        read_vehicle(tmp_path / "nothing.toml")


def test_defaults_and_settings_arrive(tmp_path):
    """Sections left out give the defaults of the types; given ones arrive, and integers do for numbers."""
    vehicle = read_vehicle(write(tmp_path, GOOD))
    none = OutputFilter("none")
    assert vehicle.estimators == {
        "armax": ArmaxSettings(output_filter=none),
        "fopdt": FopdtSettings(output="pedal", output_filter=none),
    }
    assert vehicle.lead.tracks is None
    assert vehicle.warnings == ()
    vehicle = read_vehicle(
        write(tmp_path, GOOD + "[armax]\nna = 3\nstart = 20\n[fopdt]\nwindow = 30\n[lead]\ngap_noise = 1\n")
    )
    armax, fopdt = vehicle.estimators["armax"], vehicle.estimators["fopdt"]
    assert (armax.na, armax.start, fopdt.window, vehicle.lead.gap_noise) == (3, 20, 30, 1)
    assert pickle.loads(pickle.dumps(vehicle)) == vehicle


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(
    ("written", "meant"),
    [("0.99", (0.99,)), ("1", (1.0,)), ("[0.98, 1]", (0.98, 1.0)), ("[0.999]", (0.999,))],
)
def test_forgetting_is_one_number_or_several(tmp_path, written, meant):
    """A single number is one memory, a list several."""
    vehicle = read_vehicle(write(tmp_path, f"{GOOD}[armax]\nforgetting = {written}\n"))
    assert vehicle.estimators["armax"].forgetting == meant


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(
    ("written", "says"),
    [
        ("[]", "armax.forgetting: "),
        ("[1.0, 0.98]", "armax.forgetting: must ascend, the longest memory last"),
        ("[0.98, 0.98]", "armax.forgetting: must ascend"),
        ("[0.3, 1.0]", "armax.forgetting.0: must be greater than 0.5"),
        ("1.5", "armax.forgetting.0: must be less than or equal to 1"),
        ('"long"', "armax.forgetting: "),
        ("true", "armax.forgetting"),
    ],
)
def test_forgetting_that_makes_no_sense_is_named(tmp_path, written, says):
    """Empty, descending, out of range or no numbers: one line each."""
    assert any(
        line.startswith(f"car.toml: {says}")
        for line in mistakes(write(tmp_path, f"{GOOD}[armax]\nforgetting = {written}\n"))
    )


def test_a_range_that_cannot_be_meant_is_ignored_with_a_warning(tmp_path):
    """A DBC range in raw numbers would reject good data: it is ignored, and said once, with the remedy."""
    file = write(tmp_path, GOOD)
    dbc = tmp_path / "generic.dbc"
    text = dbc.read_text().replace('(0.01,0) [0|300] "km/h"', '(0.01,-100) [0|65535] "km/h"')
    dbc.write_text(text)
    vehicle = read_vehicle(file)
    assert len(vehicle.warnings) == 1
    assert "signals.speed" in vehicle.warnings[0]
    assert "valid = [low, high]" in vehicle.warnings[0]
    assert vehicle.roles["speed"].valid == (-float("inf"), float("inf"))


def test_rav4_reads_with_one_warning(tmp_path, measured):
    """A real DBC that fails the strict check is read, with one warning that names the message."""
    text = (ROOT / "dbc/toyota_rav4_2017.toml").read_text(encoding="utf-8")
    text = text.replace('"toyota_rav4_2017.dbc"', f'"{measured / "rav4/toyota_pt.dbc"}"')
    text = text.replace('"toyota_rav4_2017_radar.dbc"', f'"{measured / "rav4/toyota_radar.dbc"}"')
    (tmp_path / "car.toml").write_text(text, encoding="utf-8")
    vehicle = read_vehicle(tmp_path / "car.toml")
    assert len(vehicle.warnings) == 1
    assert "PCS_HUD" in vehicle.warnings[0]
    assert vehicle.lead.tracks is not None
    assert [track.message for track in vehicle.lead.tracks] == [f"TRACK_A_{i}" for i in range(16)]
    assert {track.bus for track in vehicle.lead.tracks} == {1}


@pytest.mark.slow("parses hostile files in children")
def test_proposal_of_a_dbc_can_be_read(tmp_path, measured):
    """What `canid init` proposes for a DBC is a valid vehicle file with the signals that a person chose."""
    for name, dbc in (("openacc", measured / "openacc/car_following.dbc"), ("generic", GENERIC)):
        file = tmp_path / f"{name}.toml"
        file.write_text(proposal([dbc], tmp_path).text, encoding="utf-8")
        proposed, ours = read_vehicle(file), read_vehicle(name)
        assert {r: (m.message, m.signal) for r, m in proposed.roles.items()} == {
            r: (m.message, m.signal) for r, m in ours.roles.items()
        }
        assert proposed.driver.output == ours.driver.output


def test_proposal_finds_radar_tracks(tmp_path, measured):
    """A radar DBC without a lead signal gives a [lead] section with its numbered messages."""
    text = proposal([measured / "rav4/toyota_radar.dbc"], tmp_path).text
    assert 'tracks = "TRACK_A_{0..15}"' in text
    assert 'distance = "LONG_DIST"' in text
    assert 'rate = "REL_SPEED"' in text
    assert "not found, but needed" in text


class KeptParser(Parser):
    """A parser that goes on when a vehicle was read: a process for each would take longer than all of them."""

    def __exit__(self, *_):
        pass

    def end(self):
        super().__exit__(None, None, None)


@pytest.mark.slow("parses hostile files in children")
def test_no_spoiled_file_breaks_the_reader(tmp_path, monkeypatch):
    """However a vehicle file or its DBC is spoiled, there is a vehicle or a ConfigError, nothing else."""
    chance = random.Random(5)
    good = (ROOT / "dbc" / "generic.toml").read_text(
        encoding="utf-8"
    ) + "[armax]\nna = 2\n[lead]\nin_path = 1.8\n"
    dbc = GENERIC.read_bytes()
    values = [
        "7",
        "-1",
        "nan",
        "inf",
        "true",
        "[]",
        "[1]",
        "{}",
        '""',
        '"."',
        '"a.b.c"',
        "1979-05-27",
        "[[1]]",
        "{x=1}",
    ]
    read, said = 0, []
    parser = KeptParser()
    monkeypatch.setattr(vehicle_file, "Parser", lambda: parser)
    for turn in range(200):
        if turn % 25 == 24:  # a few seconds of processor time are all that a parser has
            parser.end()
            parser = KeptParser()
        file = write(tmp_path, "")
        text, raw = good, dbc
        if turn % 4:
            lines = text.splitlines()
            for index in chance.sample([i for i, line in enumerate(lines) if " = " in line], 3):
                lines[index] = lines[index].split(" = ")[0] + " = " + chance.choice(values)
            text = "\n".join(lines)
        else:
            where = chance.randrange(len(raw))
            raw = raw[:where] + chance.randbytes(chance.randint(0, 3)) + raw[where + chance.randint(0, 20) :]
        file.write_text(text, encoding="utf-8")
        (tmp_path / "generic.dbc").write_bytes(raw)
        try:
            read_vehicle(file)
            read += 1
        except ConfigError as error:
            said += str(error).splitlines()
    parser.end()
    assert read > 0
    assert len(said) > 100
    assert all(line.startswith("car.toml: ") for line in said)


ACCEL = """
dbc = ["generic.dbc"]
[signals]
accel = "EGO_SPEED.LongAccel"
speed = "EGO_SPEED.VehicleSpeed"
gap = "RADAR_LEAD.LeadDistance"
range_rate = "RADAR_LEAD.LeadRelSpeed"
[driver]
output = "accel"
"""


@pytest.mark.slow("parses hostile files in children")
def test_the_filter_of_the_output_reaches_the_estimator(tmp_path):
    """Stated as it is; an acceleration of which nothing is said was smoothed somehow, a pedal was not."""
    stated = ACCEL + 'output_filter = { kind = "savitzky_golay", width = 1.1 }\n'
    for text, expected in (
        (stated, OutputFilter("savitzky_golay", 1.1)),
        (ACCEL + 'output_filter = { kind = "none" }\n', OutputFilter("none")),
        (ACCEL, OutputFilter("unknown")),
        (GOOD, OutputFilter("none")),
    ):
        car = read_vehicle(write(tmp_path, text))
        assert car.driver.output_filter == expected
        assert car.estimators["fopdt"].output_filter == expected


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('output_filter = { kind = "savgol", width = 1.1 }', "driver.output_filter.kind"),
        ('output_filter = { kind = "moving_average" }', "needs a width"),
        ('output_filter = { kind = "none", width = 1.0 }', "needs a width"),
        ('output_filter = { kind = "first_order", width = -1.0 }', "driver.output_filter.width"),
        ('output_filter = { kind = "first_order", width = 1000.0 }', "driver.output_filter.width"),
        ('output_filter = { kind = "first_order", width = 1.0, order = 2 }', "order"),
        ('output_filter = "savitzky_golay"', "driver.output_filter"),
        ('[fopdt]\noutput_filter = { kind = "none" }', "fopdt.output_filter"),
    ],
)
def test_a_wrong_filter_is_one_line(tmp_path, line, says):
    """Kind, width and place are checked with the rest of the file."""
    found = mistakes(write(tmp_path, ACCEL + line + "\n"))
    assert len(found) == 1
    assert says in found[0]
