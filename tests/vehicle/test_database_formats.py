"""KCD, SYM and ARXML, pages within pages, container frames: the values of cantools for random frames."""

from __future__ import annotations

import random
from pathlib import Path

import cantools
import numpy as np
import pytest
from cantools.database.can import Message as CantoolsMessage

from canid.analysis.drive.drive_reader import read_signals
from canid.analysis.drive.signal_columns import MessageFrames, decode, frames_by_message
from canid.io.logs import open_log, write_log
from canid.signals.dbc_text.parsing import Message, Parser
from canid.signals.vehicle import read_vehicle
from canid.signals.vehicle.containers import wrapped
from canid.signals.vehicle.database import load
from canid.values.types import Frame

KCD = """<?xml version="1.0" encoding="UTF-8"?>
<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0">
  <Document name="d" version="1" author="a" company="c" date="2026"/>
  <Bus name="B">
    <Message id="0x101" name="PLAIN" length="8">
      <Signal name="Intel" offset="3" length="11"><Value slope="0.5" intercept="-4" unit="km/h"/></Signal>
      <Signal name="Motorola" offset="24" length="12" endianess="big"><Value type="signed" slope="0.1"/></Signal>
      <Signal name="Single" offset="32" length="32"><Value type="single"/></Signal>
    </Message>
    <Message id="0x102" name="PAGES" length="8">
      <Multiplex name="Page" offset="0" length="2">
        <MuxGroup count="0"><Signal name="A" offset="8" length="16"/></MuxGroup>
        <MuxGroup count="1"><Signal name="B" offset="8" length="8"><Value type="signed"/></Signal></MuxGroup>
      </Multiplex>
    </Message>
  </Bus>
</NetworkDefinition>
"""
SYM = """FormatVersion=6.0 // written by hand
Title="T"

{SIGNALS}
Sig=Intel unsigned 11 /f:0.5 /o:-4 /u:km/h
Sig=Motorola signed 12 -m /f:0.1
Sig=A unsigned 16
Sig=B signed 8

{SENDRECEIVE}

[PLAIN]
ID=101h
Len=8
Sig=Intel 3
Sig=Motorola 24

[PAGES]
ID=102h
Len=8
Mux=One 0,2 0
Sig=A 8

[PAGES]
Len=8
Mux=Two 0,2 1
Sig=B 8
"""
DBC = """BO_ 257 PLAIN: 8 X
 SG_ Intel : 3|11@1+ (0.5,-4) [0|0] "km/h" X
 SG_ Motorola : 31|12@0- (0.1,0) [0|0] "" X
 SG_ Single : 32|32@1- (1,0) [0|0] "" X
BO_ 258 PAGES: 8 X
 SG_ Page M : 0|2@1+ (1,0) [0|0] "" X
 SG_ Inner m0M : 2|2@1+ (1,0) [0|0] "" X
 SG_ A m1 : 8|16@0- (0.25,1) [0|0] "" X
 SG_ B m2 : 16|8@1- (1,0) [0|0] "" X
 SG_ C m3 : 24|16@1+ (1,0) [0|0] "" X
SIG_VALTYPE_ 257 Single : 1;
SG_MUL_VAL_ 258 Inner Page 0-1;
SG_MUL_VAL_ 258 A Inner 1-1;
SG_MUL_VAL_ 258 B Inner 2-3, 0-0;
SG_MUL_VAL_ 258 C Page 2-3;
"""
PDU = """<I-SIGNAL-I-PDU><SHORT-NAME>{name}</SHORT-NAME><LENGTH>{length}</LENGTH><CONTAINED-I-PDU-PROPS>
<HEADER-ID-{header}>{id}</HEADER-ID-{header}></CONTAINED-I-PDU-PROPS><I-SIGNAL-TO-PDU-MAPPINGS>
<I-SIGNAL-TO-I-PDU-MAPPING><SHORT-NAME>M</SHORT-NAME><I-SIGNAL-REF DEST="I-SIGNAL">/P/{signal}</I-SIGNAL-REF>
<PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-{order}</PACKING-BYTE-ORDER><START-POSITION>{start}</START-POSITION>
</I-SIGNAL-TO-I-PDU-MAPPING></I-SIGNAL-TO-PDU-MAPPINGS></I-SIGNAL-I-PDU>"""
SIGNAL = """<I-SIGNAL><SHORT-NAME>{name}</SHORT-NAME><LENGTH>{bits}</LENGTH>
<SYSTEM-SIGNAL-REF DEST="SYSTEM-SIGNAL">/P/S_{name}</SYSTEM-SIGNAL-REF></I-SIGNAL>
<SYSTEM-SIGNAL><SHORT-NAME>S_{name}</SHORT-NAME></SYSTEM-SIGNAL>"""
TRIGGER = """<PDU-TRIGGERING><SHORT-NAME>T_{name}</SHORT-NAME>
<I-PDU-REF DEST="{kind}">/P/{name}</I-PDU-REF></PDU-TRIGGERING>"""


def arxml(header: str) -> str:
    """A CAN FD frame that is a container of two PDUs."""
    pdus = [("SPEED", 0x111, 4, "Speed", 16, "LAST", 8), ("PEDAL", 0x112, 2, "Pedal", 12, "FIRST", 7)]
    inner = "".join(
        PDU.format(name=name, id=id_, length=n, signal=signal, order=order, start=start, header=header)
        + SIGNAL.format(name=signal, bits=bits)
        for name, id_, n, signal, bits, order, start in pdus
    )
    references = "".join(
        f'<CONTAINED-PDU-TRIGGERING-REF DEST="PDU-TRIGGERING">/P/C/CH/T_{name}</CONTAINED-PDU-TRIGGERING-REF>'
        for name, *_ in pdus
    )
    triggers = TRIGGER.format(name="BOX", kind="CONTAINER-I-PDU") + "".join(
        TRIGGER.format(name=name, kind="I-SIGNAL-I-PDU") for name, *_ in pdus
    )
    return f"""<?xml version="1.0" encoding="utf-8"?>
<AUTOSAR xmlns="http://autosar.org/schema/r4.0"><AR-PACKAGES><AR-PACKAGE><SHORT-NAME>P</SHORT-NAME><ELEMENTS>
<CAN-CLUSTER><SHORT-NAME>C</SHORT-NAME><CAN-CLUSTER-VARIANTS><CAN-CLUSTER-CONDITIONAL><PHYSICAL-CHANNELS>
<CAN-PHYSICAL-CHANNEL><SHORT-NAME>CH</SHORT-NAME><FRAME-TRIGGERINGS><CAN-FRAME-TRIGGERING><SHORT-NAME>F_T</SHORT-NAME>
<FRAME-REF DEST="CAN-FRAME">/P/FRAME</FRAME-REF><CAN-ADDRESSING-MODE>STANDARD</CAN-ADDRESSING-MODE>
<CAN-FRAME-TX-BEHAVIOR>CAN-FD</CAN-FRAME-TX-BEHAVIOR><IDENTIFIER>102</IDENTIFIER></CAN-FRAME-TRIGGERING>
</FRAME-TRIGGERINGS><PDU-TRIGGERINGS>{triggers}</PDU-TRIGGERINGS></CAN-PHYSICAL-CHANNEL></PHYSICAL-CHANNELS>
</CAN-CLUSTER-CONDITIONAL></CAN-CLUSTER-VARIANTS></CAN-CLUSTER>
<CAN-FRAME><SHORT-NAME>FRAME</SHORT-NAME><FRAME-LENGTH>64</FRAME-LENGTH><PDU-TO-FRAME-MAPPINGS><PDU-TO-FRAME-MAPPING>
<SHORT-NAME>M</SHORT-NAME><PDU-REF DEST="CONTAINER-I-PDU">/P/BOX</PDU-REF></PDU-TO-FRAME-MAPPING></PDU-TO-FRAME-MAPPINGS>
</CAN-FRAME><CONTAINER-I-PDU><SHORT-NAME>BOX</SHORT-NAME><LENGTH>64</LENGTH>
<CONTAINED-PDU-TRIGGERING-REFS>{references}</CONTAINED-PDU-TRIGGERING-REFS><HEADER-TYPE>{header}</HEADER-TYPE>
</CONTAINER-I-PDU>{inner}</ELEMENTS></AR-PACKAGE></AR-PACKAGES></AUTOSAR>"""


def messages_of(file: Path) -> dict[str, Message]:
    with Parser() as parser:
        return load(file, None, parser)[0].messages


def frames_of(payloads: list[bytes]) -> MessageFrames:
    data = np.zeros((len(payloads), 64), np.uint8)
    for row, payload in zip(data, payloads, strict=True):
        row[: len(payload)] = np.frombuffer(payload, np.uint8)
    return MessageFrames(
        np.arange(float(len(payloads))), np.array([len(p) for p in payloads], np.uint8), data
    )


def check(message: Message, theirs: CantoolsMessage, frames: MessageFrames, payloads: list[bytes]) -> None:
    """Every signal of a message: in the frames in which cantools has it, with cantools' value."""
    expected = [theirs.decode(one, decode_choices=False) for one in payloads]
    for signal in message.signals:
        column = decode(message, signal, frames)
        assert column is not None
        rows = [(float(k), of[signal.name]) for k, of in enumerate(expected) if signal.name in of]
        assert column.t.tolist() == [t for t, _ in rows], signal.name
        np.testing.assert_allclose(
            column.value, [value for _, value in rows], rtol=1e-12, err_msg=signal.name
        )
        assert rows, signal.name


@pytest.mark.slow("parses hostile files in children")
@pytest.mark.parametrize(("suffix", "text"), [("kcd", KCD), ("sym", SYM), ("dbc", DBC)])
def test_values_are_cantools(suffix: str, text: str, tmp_path: Path, seed: int) -> None:
    """Intel, Motorola, signed, floating, multiplexed, pages within pages: the same values in the same frames."""
    file = tmp_path / f"x.{suffix}"
    file.write_text(text, encoding="utf-8")
    rng = random.Random(seed)
    for theirs in cantools.database.load_file(file, strict=False).messages:
        payloads = [bytes([k % 16, *rng.randbytes(7)]) for k in range(100)]
        if theirs.name == "PAGES":
            known = set()
            for one in payloads:
                try:
                    theirs.decode(one)
                except cantools.database.DecodeError:
                    continue  # a page that the file does not have
                known.add(one)
            payloads = [one for one in payloads if one in known]
        check(messages_of(file)[theirs.name], theirs, frames_of(payloads), payloads)


@pytest.mark.parametrize("header", ["SHORT-HEADER", "LONG-HEADER"])
def test_container_frames(header: str, tmp_path: Path, seed: int) -> None:
    """PDUs in container frames have the values of cantools, in whatever order they come; other frames have none."""
    file, short = tmp_path / "x.arxml", tmp_path / "short.arxml"
    file.write_text(arxml(header), encoding="utf-8")
    short.write_text(arxml("SHORT-HEADER"), encoding="utf-8")
    messages, rng = messages_of(file), random.Random(seed)
    box = cantools.database.load_file(short).messages[0]
    for theirs in box.contained_messages:
        message, other = messages[theirs.name], next(m for m in box.contained_messages if m is not theirs)
        assert message.container is not None
        assert message.id == 102
        assert message.container.long_header == (header == "LONG-HEADER")
        filler = messages[other.name].container
        assert filler is not None
        payloads = [rng.randbytes(theirs.length) for _ in range(50)]
        sent = [
            b"".join(
                rng.sample([wrapped(message.container, one), wrapped(filler, rng.randbytes(other.length))], 2)
            )
            for one in payloads
        ]
        check(message, theirs, frames_of(sent), payloads)
        nothing = decode(
            message, message.signals[0], frames_of([wrapped(filler, b"a"), b"", b"\0" * 7, b"\xff" * 64])
        )
        assert nothing is not None
        assert not len(nothing.value)
        if header == "SHORT-HEADER":
            unpacked = box.decode(sent[0], decode_containers=True, decode_choices=False)
            assert theirs.decode(payloads[0]) in [values for _, values in unpacked]


PAGES_SYM = """FormatVersion=6.0 // Do not edit this line!
Title="pages"

{SENDRECEIVE}
[Radar]
ID=700h
Len=4
Mux=First 0,8 1
Var=Gap unsigned 8,8 /f:0.5 /u:m
Var=Alert unsigned 16,1

[Radar]
Len=4
Mux=Second 0,8 2
Var=Gap unsigned 8,8 /f:0.5 /u:m
Var=Alert unsigned 17,1

[Radar]
Len=4
Mux=Third 0,8 3
Var=Gap unsigned 16,16 /f:0.1 /o:5 /u:m
"""
PAGES_KCD = """<?xml version="1.0" encoding="UTF-8"?>
<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0"><Document/><Bus name="B">
<Message id="0x700" length="4" name="Radar"><Multiplex name="Page" offset="0" length="8">
<MuxGroup count="1"><Signal name="Gap" offset="8" length="8"><Value slope="0.5" unit="m"/></Signal>
<Signal name="Alert" offset="16" length="1"/></MuxGroup>
<MuxGroup count="2"><Signal name="Gap" offset="8" length="8"><Value slope="0.5" unit="m"/></Signal>
<Signal name="Alert" offset="17" length="1"/></MuxGroup>
<MuxGroup count="3"><Signal name="Gap" offset="16" length="16"><Value slope="0.1" intercept="5" unit="m"/></Signal>
</MuxGroup></Multiplex></Message></Bus></NetworkDefinition>
"""


@pytest.mark.parametrize(("suffix", "text"), [("sym", PAGES_SYM), ("kcd", PAGES_KCD)])
def test_one_name_on_several_pages_is_one_signal(suffix: str, text: str, tmp_path: Path) -> None:
    """Wherever a signal lies and however it is scaled on each page: one signal, in columns, as a role and in `look`."""
    path = tmp_path / f"radar.{suffix}"
    path.write_text(text, encoding="utf-8")
    with Parser() as parser:
        dbc, warnings, _ = load(path, None, parser)
    assert not warnings
    message = dbc.messages["Radar"]
    names = [signal.name for signal in message.signals]
    assert {"Alert", "Gap"} < {*names}
    assert len(names) == 3
    log = tmp_path / "drive.log"
    rows = [(k % 4, (7 * k) % 200, (13 * k) % 250, k % 3) for k in range(60)]
    frames = [Frame(0.1 * k, 0, 0x700, bytes(row)) for k, row in enumerate(rows)]
    write_log(log, frames)
    gap = [
        (0.1 * k, 0.5 * a if page < 3 else 0.1 * (b | c << 8) + 5)
        for k, (page, a, b, c) in enumerate(rows)
        if page
    ]
    alert = [(0.1 * k, b >> (page - 1) & 1) for k, (page, _, b, _) in enumerate(rows) if page in (1, 2)]
    columns = frames_by_message(open_log(log))
    for name, expected in (("Gap", gap), ("Alert", alert)):
        signal = next(one for one in message.signals if one.name == name)
        found = decode(message, signal, next(iter(columns.values())))
        assert found is not None
        np.testing.assert_allclose(found.t, [t for t, _ in expected])
        np.testing.assert_allclose(found.value, [value for _, value in expected])
    vehicle = tmp_path / "v.toml"
    vehicle.write_text(
        f'name = "v"\ndbc = ["radar.{suffix}"]\n[signals]\ngap = "Radar.Gap"\n'
        'speed = { signal = "Radar.Gap", unit = "m/s" }\n'
        'range_rate = { signal = "Radar.Gap", unit = "m/s" }\npedal = { signal = "Radar.Gap", unit = "%" }\n'
        '[driver]\noutput = "pedal"\n',
        encoding="utf-8",
    )
    read = read_signals(log, read_vehicle(vehicle))["gap"]
    np.testing.assert_allclose(read.value, [value for _, value in gap])


def test_reported_pages_are_one_signal(measured: Path) -> None:
    """The reported .sym: alert1 to alert3 on both pages, without a warning."""
    with Parser() as parser:
        dbc, warnings, _ = load(measured / "reports" / "19-dbc-mux" / "alert.sym", None, parser)
    assert not warnings
    alerts = [one for one in dbc.messages["TestAlert"].signals if one.name.startswith("alert")]
    pages = {
        one.name: sorted(page for each in (one, *one.elsewhere) for page in each.pages) for one in alerts
    }
    assert pages == {"alert1": [1, 2], "alert2": [1, 2], "alert3": [1, 2]}
