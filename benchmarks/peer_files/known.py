"""Differences from peers that are known: on which file, who is right, and why."""

from __future__ import annotations

from typing import NamedTuple


class Known(NamedTuple):
    """One of them."""

    file: str  # name
    right: str  # "canid", "peer", or "both" where the file contradicts itself
    why: str


KNOWN = (
    Known(
        "single_frame.asc",
        "canid",
        "a classic line with 64 bytes: no bus carries it; python-can takes DLC 0x40",
    ),
    Known(
        "test_CanFdMessage.asc",
        "both",
        "the column BRS and the flags 0x303000 contradict each other; canid takes the flags, python-can the column",
    ),
    Known(
        "test_CanFdRemoteMessage.asc",
        "canid",
        "flags without EDL: a classic remote frame; CAN FD has no remote frames",
    ),
    Known("logfile.asc", "canid", "line 34: as test_CanFdRemoteMessage.asc"),
    Known("test_CanMessage.blf", "canid", "direction 2: transmit requests, which are no frames on the bus"),
    Known("test_CanMessage2.blf", "canid", "as test_CanMessage.blf"),
    Known("test_CanFdMessage.blf", "canid", "as test_CanMessage.blf"),
    Known(
        "test_CanFdMessage64.blf",
        "canid",
        "a DLC of more than 15: no bus carries it; python-can takes it for 15",
    ),
    Known("fd.csv", "both", "the format has no mark of CAN FD; canid infers it from more than eight bytes"),
    Known(
        "variable_dlc.dbc",
        "canid",
        "J1939: reserved numbers are no measurements, cantools gives them as values",
    ),
    Known("issue_63.dbc", "canid", "a unit in UTF-8 that cantools reads as another encoding"),
    Known("the_homer.kcd", "both", "a signal of one name on pages that are not exclusive"),
    Known(
        "jopp-6.0.sym",
        "both",
        "a message name twice: canid gives the second another name, cantools drops one",
    ),
    Known("test_multiline_enum.sym", "both", "as jopp-6.0.sym"),
    Known("j1939.dbc", "canid", "reserved numbers of J1939; a name twice"),
    Known("almost-J1939.dbc", "canid", "reserved numbers of J1939; a name twice"),
    Known("aa.dbc", "both", "a message name twice"),
)


def known(name: str) -> Known | None:
    """The known difference of a file.

    >>> known("fd.csv").right, known("drive.blf")
    ('both', None)
    """
    return next((one for one in KNOWN if one.file == name), None)
