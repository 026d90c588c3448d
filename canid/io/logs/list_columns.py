"""What the columns of a list of CAN frames are called: the role of each, and the unit or base that its name states."""

from __future__ import annotations

import re

# names in lower case, without blanks, points, hyphens, underscores and what is in brackets; those of byte columns are
# in `_BYTE`
ROLES = {
    "time": (
        "time timestamp timestamps timestampepoch abstime absolutetime timeabs systemtime reltime relativetime timeoffset "
        "timeofday timeepoch timerelative stamp secs headerstampsec t ts zeit zeitstempel temps tiempo tempo czas čas tid "
        "tijd hosttime devicetime sensortime epoch epochms epochus epochns unixtime datetime date/time aika ido zaman "
        "时间标识 时间戳 时间 系统时间 時刻 время"
    ),
    "date": "date datum 日期",
    "rest": "nsecs nanosec nsec ns usecs usec us micros microseconds msecs msec ms millis milliseconds",
    "id": (
        "id aid canid arbitrationid arbid identifier messageid msgid frameid canidentifier addr address kennung idhex iddec "
        "id号 帧id 报文id 識別子 идентификатор identifiant identificador identificatore"
    ),
    "data": (
        "data datafield databytes payload message msgdata framedata candata rawdata datahex databytehex daten 数据 データ "
        "данные données datos dados dati dane"
    ),
    "length": "dlc len length datalength datalen dl bytes size msglen messagelength lange länge 长度 数据长度 長さ длина "
    "longueur longitud comprimento lunghezza długość",
    "extended": (
        "ide ext extended xtd ex isextended extendedid isextendedid format frameformat idformat idtype 帧格式"
    ),
    "way": "dir direction rxtx txrx 传输方向 方向 richtung sens dirección direção direzione kierunek направление",
    "bus": "bus busid buschannel channel chan chn ch canchannel canbus interface port network can通道 通道 通道号 "
    "kanal canal canale kanał kanaal канал チャンネル チャネル",
    "remote": "rtr rt remote isremote remoteframe isremoteframe",
    "error": "error err iserror errorframe iserrorframe er",
    "fd": "fd edl fdf isfd canfd",
    "brs": "brs bitrateswitch",
    "esi": "esi errorstateindicator",
    "sent": "tx",
    "type": "type frametype msgtype messagetype cantype protocol flags flag 帧类型 can类型",
}  # fmt: skip
_ROLE = {name: role for role, names in ROLES.items() for name in names.split()}
# a column of one byte, and which
_BYTE = re.compile(r"(?:d|b|db|data|byte|databyte|数据)_?[\[(]?(\d{1,2})[\])]?")
# what is in brackets or behind a stroke, and the path of a field before its name: in MDF, ROS messages, Wireshark's fields
_BRACKETS = re.compile(r"[(\[].*?[)\]]|/.*$")
_PATH = re.compile(
    r"^%?(?:(?:can_dataframe|can|frame|flags|data|field|msg|header|stamp)\.)+(?!frame_id)(?=\w)"
)
_UNITS = {
    "ns": 1, "us": 1_000, "µs": 1_000, "μs": 1_000, "micros": 1_000, "microseconds": 1_000, "ms": 1_000_000,
    "millis": 1_000_000, "milliseconds": 1_000_000, "0.1ms": 100_000, "s": 1_000_000_000, "sec": 1_000_000_000,
    "secs": 1_000_000_000, "seconds": 1_000_000_000,
}  # fmt: skip
_UNIT = re.compile(r"[(\[/_ ]([\w.µμ]+)[)\]]?$")
_BASES = {"hex": 16, "hexadecimal": 16, "dec": 10, "decimal": 10}


def decoded(text: str) -> str:
    """A line that was read as Latin-1 in its own encoding: UTF-8, or that of Windows in Chinese.

    >>> decoded("数据帧".encode().decode("latin-1")), decoded("数据帧".encode("gbk").decode("latin-1")), decoded("数据")
    ('数据帧', '数据帧', '数据')
    """
    if text.isascii():
        return text
    try:
        octets = text.encode("latin-1")
    except UnicodeEncodeError:
        return text  # it is decoded
    for name in ("utf-8", "gbk"):
        try:
            return octets.decode(name)
        except UnicodeDecodeError:
            continue
    return text


def role_of(cell: str) -> str:
    """The role of a column by its name; "" where it has none.

    >>> [role_of(name) for name in ("Identifier (hex)", "CAN_DataFrame.DataBytes", "时间标识", "Time/ms", "Gap")]
    ['id', 'data', 'time', 'time', '']
    >>> [role_of(name) for name in ("can.id", "field.header.stamp", "field.header.frame_id", "lead.id", "speed.data")]
    ['id', 'time', '', '', '']
    """
    whole = _BRACKETS.sub("", cell.strip(" \"'\t").lower())
    plain = _PATH.sub("", whole)
    name = re.sub(r"[\s._-]", "", plain)
    role = _ROLE.get(re.sub(r"[\s._-]", "", whole), "") or _ROLE.get(name, "")
    if (
        not role
        and (stem := re.fullmatch(r"(\D+?)_?([a-zµμ]+)", plain.strip()))
        and stem[2] in _UNITS | _BASES
    ):
        return _ROLE.get(re.sub(r"[\s._-]", "", stem[1]), "")
    return role


def byte_of(cell: str) -> int | None:
    """Which byte a column of one holds, by its name; None: it is no such column.

    >>> byte_of("Data[3]"), byte_of("field.data0"), byte_of("D 7"), byte_of("Data")
    (3, 0, 7, None)
    """
    match = _BYTE.fullmatch(_PATH.sub("", cell.lower().replace(" ", "")))
    return int(match[1]) if match else None


def unit_of(cell: str) -> int:
    """The ns of the unit that the name of a column of times states; 0: none.

    >>> unit_of("Time [ms]"), unit_of("Time/ms"), unit_of("timestamp_us"), unit_of("TimestampEpoch"), unit_of("Time (abs)")
    (1000000, 1000000, 1000, 1000000000, 0)
    """
    text = cell.strip(" \"'\t").lower()
    if text == "timestampepoch" or re.fullmatch(
        r"(.*\.)?(secs|stamp\.sec|frame\.time_(epoch|relative))", text
    ):
        return _UNITS["s"]  # of CSS Electronics, ROS and Wireshark
    match = _UNIT.search(text)
    return _UNITS.get(match[1] if match else text, 0)


def rest_of(cell: str) -> int:
    """The ns of the unit of a column with the rest of whole seconds, by its name.

    >>> rest_of("usec"), rest_of("header.stamp.nanosec"), rest_of("ms")
    (1000, 1, 1000000)
    """
    name = cell.strip(" \"'\t").lower().rpartition(".")[2]
    return {"n": 1, "u": 1_000}.get(name[:1], 1_000 if name.startswith("mic") else 1_000_000)


def base_of(cell: str) -> int:
    """The base that the name of a column states; 0: none.

    >>> base_of("ID (hex)"), base_of("id_dec"), base_of("ID")
    (16, 10, 0)
    """
    match = re.search(r"[(\[/_ ](\w+)[)\]]?$", cell.strip(" \"'\t").lower())
    return _BASES.get(match[1], 0) if match else 0
