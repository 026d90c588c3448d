"""DBC texts in the encodings of all countries: nothing of a file is lost for a byte of a text, and texts are shown right."""

from __future__ import annotations

import random

import pytest

from canid.signals.dbc_text import decoded
from canid.signals.dbc_text.parsing import Content, Parser
from tests.fixtures import measured_logs

# words as they stand in DBC files; each list has characters whose second byte is a backslash, where the encoding has such
_WORDS = {
    "utf-8": ["停止", "车速", "Größe", "不可能"],
    "cp932": [
        "停止",
        "走行",
        "無効",
        "可能",
        "不可能",
        "表示",
        "予約",
        "機能",
        "ソナー",
        "車速が有効です",
        "表",
        "能",
        "先行車なし",
        "噂",
    ],
    "gbk": [
        "关闭提醒",
        "触发提醒",
        "无效",
        "车速",
        "转向灯",
        "制动踏板状态",
        "故障",
        "目标距离",
        "不可用",
        "打开",
    ],
    "cp950": ["車速", "開啟", "無效", "煞車", "功能", "許可", "故障", "目標距離", "方向盤角度"],
    "cp949": ["꺼짐", "켜짐", "무효", "차속", "조향각", "브레이크", "가능", "고장"],
    "cp1251": ["выкл", "вкл", "нет", "Скорость", "тормоз", "Дистанция до цели"],
    "cp1252": [
        "Größe",
        "geöffnet",
        "C:\\logs\\",
        "café",
        "D:\\Daten\\Fahrt 3\\",
        "Türschließer",
        "größer als 5 m",
    ],
}


def _text(rng: random.Random, words: list[str]) -> str:
    return " ".join(rng.sample(words, rng.randint(1, 2)))


def _file(encoding: str, rng: random.Random, end: str) -> tuple[bytes, dict[int, str], str]:
    """A DBC, the texts of its value table, and a unit."""
    words = _WORDS[encoding]
    texts = {
        0: _text(rng, words),
        1: _text(rng, words),
        2: rng.choice(words),
        65534: rng.choice(words),
        65535: "SNA",
    }
    rng_order = list(texts.items())
    rng.shuffle(rng_order)
    table = " ".join(f'{raw} "{text}"' for raw, text in rng_order)
    unit = rng.choice(words) if rng.random() < 0.5 else "m"
    comments = [
        f'CM_ "{_text(rng, words)}";',
        f'CM_ BO_ 256 "{_text(rng, words)}";',
        f'CM_ SG_ 256 Gap "{_text(rng, words)}{end}{_text(rng, words)}";',
        f'BA_DEF_ "Folder" STRING ;{end}BA_DEF_DEF_ "Folder" "{rng.choice(words)}";{end}BA_ "Folder" "{rng.choice(words)}";',
    ]
    rng.shuffle(comments)
    sort = [f'BA_DEF_ "Sort" ENUM "{rng.choice(words)}","{rng.choice(words)}";', 'BA_DEF_DEF_ "Sort" "a";']
    # the definitions of attributes stand before their values, and several statements in one line are as good
    between = rng.choice((end, end, " "))
    lines = [
        'VERSION ""',
        "BU_: A",
        "BO_ 256 RADAR: 8 A",
        f' SG_ Gap : 0|16@1+ (0.01,0) [0|655.35] "{unit}" A',
        ' SG_ State : 16|8@1+ (1,0) [0|255] "" A',
        "BO_ 257 OTHER: 8 A",
        ' SG_ Speed : 0|16@1+ (0.01,0) [0|300] "km/h" A',
        *sort,
        between.join(comments),
        f'VAL_ 256 Gap {table} ;{between}VAL_ 256 State 0 "{texts[0]}" 1 "x";',
        'VAL_ 257 Speed 0 "off" ;',
    ]
    return (end.join(lines) + end).encode(encoding), texts, unit


def _read(data: bytes) -> Content:
    with Parser() as parser:
        return parser.dbc(".dbc", data)


@pytest.mark.parametrize("encoding", _WORDS)
def test_texts_of_every_encoding_are_read(encoding: str, seed: int) -> None:
    """Thirty files: messages, signals, value tables and units as written, and no repair is needed."""
    rng = random.Random(seed)
    with Parser() as parser:
        for k in range(30):
            data, texts, unit = _file(encoding, rng, rng.choice(("\n", "\r\n")))
            print(k, data.decode(encoding))
            content = parser.dbc(".dbc", data)
            assert [message.name for message in content.messages] == ["RADAR", "OTHER"]
            gap, state = content.messages[0].signals
            assert (gap.choices, gap.unit) == (texts, unit)
            assert state.choices == {0: texts[0], 1: "x"}
            assert content.messages[1].signals[0].choices == {0: "off"}
            assert not content.left_out


@pytest.mark.slow("whole drives through the pipeline")
def test_files_that_decide_nothing_keep_their_structure(seed: int) -> None:
    """Random bytes of two-byte characters: whatever is shown, numbers and the number of texts are those of the file."""
    rng = random.Random(seed)
    for _ in range(20):
        texts = [
            bytes([rng.choice((0x83, 0x94, 0x95, 0x97, 0xE0)), 0x5C]) * rng.randint(1, 3) for _ in range(3)
        ]
        table = b" ".join(b'%d "%s"' % (k, text) for k, text in enumerate(texts))
        data = b'BO_ 256 M: 8 A\n SG_ S : 0|8@1+ (1,0) [0|255] "" A\nVAL_ 256 S ' + table + b' 255 "SNA" ;\n'
        (message,) = _read(data).messages
        assert sorted(message.signals[0].choices) == [0, 1, 2, 255]
        assert message.signals[0].choices[255] == "SNA"


@pytest.mark.parametrize(
    ("text", "comment"),
    [
        ('say \\"hi\\" now', True),
        ('ends \\"quoted\\"', True),
        ('first \\"quoted\\"\nsecond line', True),
        ('a \\"b\\";\nmore of the text', True),
        ('0 \\"zero\\", 1 \\"one\\"', True),
        ('he said \\"yes\\"', False),
    ],
)
def test_escaped_quotes_stay_quotes(text: str, comment: bool) -> None:
    """A backslash before a quote within a text is no end of it, as cantools reads it."""
    of = f'CM_ "{text}";\n' if comment else f'VAL_ 256 S 0 "{text}" 1 "b" ;\n'
    data = f'BO_ 256 M: 8 A\n SG_ S : 0|8@1+ (1,0) [0|255] "" A\n{of}VAL_ 256 S 7 "seven" ;\n'
    content = _read(data.encode())
    assert content.messages[0].signals[0].choices[7] == "seven"
    assert not content.left_out
    assert not content.repairs


def test_an_xml_file_is_read_as_it_declares() -> None:
    """Bytes that could be Chinese are Latin letters where the file says so."""
    text = '<?xml version="1.0" encoding="ISO-8859-1"?><a>ÄÖÜ °C</a>'
    assert decoded(text.encode("latin-1")) == text


@measured_logs.needs_measured
def test_reported_files_are_read_right() -> None:
    """The reported files: a value table each, and a number that says "no target" is no distance."""
    with Parser() as parser:
        for path in measured_logs.files("reports/18-dbc-encodings/*.dbc*"):
            content = parser.dbc(".dbc", path.read_bytes())
            assert not content.left_out, path.name
            if path.name.startswith("sna"):
                choices = content.messages[0].signals[0].choices
                assert choices[65535] == "SNA", path.name
            else:
                of = {one.name: one for message in content.messages for one in message.signals}
                assert (sorted(of["State"].choices), sorted(of["Wahl"].choices)) == ([0, 1, 2], [0, 1])
                assert len(of) == 5
