"""Character encoding of a DBC: UTF-16 and UTF-8 where the bytes show it, else the one in which its bytes are words.

Files from Japan, China, Taiwan, Korea and Russia are in their country's encoding, and none says so. In the first three the
second byte of a character may be that of a backslash or of a letter, so a wrong guess changes more than what is shown.
"""

from __future__ import annotations

import codecs
import re
from typing import NamedTuple

# bytes that are enough to see UTF-16 without a byte order mark: every second byte of Latin text is 0
_SAMPLE_BYTES = 400
# bytes around which the encoding is judged: some thousand characters are enough
_JUDGED_BYTES = 20_000
_DECLARED = re.compile(rb"\A\s*<\?xml[^>]{0,200}encoding=[\"']([A-Za-z0-9_.:-]{1,40})[\"']")
_NOT_ASCII = re.compile(rb"[^\n]*[\x80-\xff][^\n]*")
# what is not decoded counts against an encoding, more than one character for it
_BROKEN = -3.0


class _Encoding(NamedTuple):
    name: str
    usual: re.Pattern[str]  # characters of ordinary texts
    frequent: frozenset[str]  # those of texts about vehicles


# Frequent characters of texts about vehicles: speed, gap, brake, steering, door, lamp, state, valid, error, on and off ...
_JAPANESE = "車速度距離間前後左右有無効可能表示要求信号状態値作動制御異常正常開閉時走行中停止故障予備未使用先目標角加減圧温"
_SIMPLIFIED = (
    "车速度距离间前后左右有无效可能表示请求信号状态值制动控制异常正常开关时行驶中停止故障预留未使用先目标角加减压力温转向灯门"
    "报警系统电机池充电流的不是在请激活关闭打档位油踏板方最大小雷达道线助激活轮传感器自诚"
)
_TRADITIONAL = (
    "車速度距離間前後左右有無效可能表示請求信號狀態值制動控制異常正常開關時行駛中停止故障預留未使用先目標角加減壓力溫轉向燈門"
    "報警系統電機池充流的不是在最大小雷達道線助輪傳感器自煞誠"
)
_KOREAN = (
    "차속도거리간전후좌우유무효가능표시요구신호상태값제동어이상정개폐시주행중지고장예비미사용목각감압력온조향등문방스위치브레크"
    "센서오류"
)
_ENCODINGS = (
    # kana and the kanji of level 1; half-width kana alone are what other encodings look like
    _Encoding("cp932", re.compile("[\u3041-\u30ff\uff01-\uff5e\u3001-\u3015]"), frozenset(_JAPANESE)),
    _Encoding("gbk", re.compile("[\u3001-\u3015\uff01-\uff5e\u2103]"), frozenset(_SIMPLIFIED)),
    _Encoding("cp950", re.compile("[\u3001-\u3015\uff01-\uff5e\u2103]"), frozenset(_TRADITIONAL)),
    _Encoding("cp949", re.compile("[\uac00-\ud7a3]"), frozenset(_KOREAN)),
)
# level 1 of each character set, the frequent half, by the first byte of a pair (JIS X 0208, GB 2312, Big5)
_LEVEL_1 = {"cp932": (0x88, 0x97), "gbk": (0xB0, 0xD7), "cp950": (0xA4, 0xC6), "cp949": (0xB0, 0xC8)}
# of a character of level 1, of a frequent one, of a usual one that is no ideograph, of any other
_LEVEL_1_SCORE, _FREQUENT_SCORE, _USUAL_SCORE, _OTHER_SCORE = 0.3, 1.0, 0.5, -0.5
# letters and signs of western European texts and units, and how a letter stands among others
_WESTERN = frozenset("äöüßÄÖÜéèêëàâáíóúçñãõåøæÅØÆîôûùïìòÉÈÀÇÑ°µ²³±·½×÷Ωω‰§«»’“”–…€®©¹¼")
_CYRILLIC = re.compile("[А-Яа-яЁё]")
_CYRILLIC_WORD = re.compile("[А-ЯЁ]?[а-яё]{2,}|[А-ЯЁ]{2,}")


def decoded(data: bytes) -> str:
    """Decode, with line ends as single line feeds, and without a byte order mark.

    Example:
        >>> decoded("unit °C".encode("cp1252")) == decoded("unit °C".encode()) == decoded("unit °C".encode("utf-16"))
        True
        >>> [decoded(text.encode(name)) for text, name in (("可能", "cp932"), ("车速", "gbk"), ("차속", "cp949"))]
        ['可能', '车速', '차속']
    """
    text = _text(data).lstrip("\ufeff")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _text(data: bytes) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    sample = data[:_SAMPLE_BYTES]
    for zeros, name in ((sample[1::2], "utf-16-le"), (sample[::2], "utf-16-be")):
        if len(zeros) > 1 and zeros.count(0) > 0.9 * len(zeros):
            return data.decode(name, errors="replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode(_declared(data) or _judged(data), errors="replace")


def _declared(data: bytes) -> str:
    """The encoding that an XML file states; "": none that is known."""
    match = _DECLARED.match(data)
    if match is None:
        return ""
    try:
        name = codecs.lookup(match[1].decode("ascii")).name
        data.decode(name)
    except (LookupError, UnicodeError):
        return ""
    return name


def _judged(data: bytes) -> str:
    """The encoding in which the bytes that are no ASCII are characters that stand in such files."""
    lines, size = [], 0
    for match in _NOT_ASCII.finditer(data):
        lines.append(match[0])
        size += len(match[0])
        if size > _JUDGED_BYTES:
            break
    sample = b"\n".join(lines)
    scores = {encoding.name: _score(sample, encoding) for encoding in _ENCODINGS}
    scores["cp1251"] = _cyrillic(sample)
    best = max(scores, key=lambda name: scores[name])
    return best if scores[best] > max(_western(sample), 0.0) else "cp1252"


def _score(sample: bytes, encoding: _Encoding) -> float:
    """The mean score of a byte that is no ASCII, or belongs to such a character."""
    text = sample.decode(encoding.name, errors="replace")
    first, last = _LEVEL_1[encoding.name]
    total, n = 0.0, 0
    for character in text:
        if character < "\x80":
            continue
        if character == "\ufffd":
            total, n = total + _BROKEN, n + 1
            continue
        code = character.encode(encoding.name, errors="replace")
        n += len(code)
        if character in encoding.frequent:
            total += _FREQUENT_SCORE * len(code)
        elif encoding.usual.match(character):
            total += _USUAL_SCORE * len(code)
        elif len(code) == 2 and first <= code[0] <= last:
            total += _LEVEL_1_SCORE * len(code)
        else:
            total += _OTHER_SCORE * len(code)
    return total / n if n else 0.0


def _cyrillic(sample: bytes) -> float:
    """The same of Windows-1251: letters that form words."""
    text = sample.decode("cp1251", errors="replace")
    high = [character for character in text if character >= "\x80"]
    words = sum(len(_CYRILLIC.findall(word)) for word in _CYRILLIC_WORD.findall(text))
    return (_FREQUENT_SCORE * words - (len(high) - words)) / len(high) * 0.6 if high else 0.0


def _western(sample: bytes) -> float:
    """The same of Windows-1252: signs of units, and single letters within words of ASCII."""
    text = sample.decode("cp1252", errors="replace")
    total, n = 0.0, 0
    for k, character in enumerate(text):
        if character < "\x80":
            continue
        n += 1
        # a sign before a backslash is half of a character
        alone = text[k - 1 : k] < "\x80" and text[k + 1 : k + 2] < "\x80" and text[k + 1 : k + 2] != "\\"
        total += (_FREQUENT_SCORE if alone else 0.0) if character in _WESTERN else _OTHER_SCORE
    return total / n if n else 0.0
