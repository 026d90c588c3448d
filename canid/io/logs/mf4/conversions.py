"""Conversions of raw values to physical ones, from a closed list (ASAM MDF 4.1, CCBLOCK); a formula is never evaluated.

Applied here: none, linear, rational, value tables with and without interpolation, value ranges, and tables from or to texts,
with conversions within them. A formula (`cc_type` 3) is text of the file that other programs give to an interpreter; it, bit
field tables and types of later versions are named to the user instead.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

# cc_type
(
    _NONE,
    _LINEAR,
    _RATIONAL,
    _FORMULA,
    _INTERPOLATED,
    _NEAREST,
    _RANGES,
    _VALUE_TO_TEXT,
    _RANGE_TO_TEXT,
    _TEXT_TO_VALUE,
    _TEXT_TO_TEXT,
    _BIT_FIELDS,
) = range(12)
_TO_TEXT = (_VALUE_TO_TEXT, _RANGE_TO_TEXT, _TEXT_TO_TEXT, _BIT_FIELDS)
# conversions within conversions; the standard has tables whose default is a linear one, which is one
_MAX_DEPTH = 4
# characters of a channel's name that a message quotes
_QUOTED = 100

_Floats = npt.NDArray[np.float64]


class ConversionError(ValueError):
    """A conversion that canid does not apply; the text is a sentence for the user."""


def physical(raw: Any, conversion: Any, channel: str) -> Any:
    """Physical values.

    Args:
        raw: (n,) numbers or texts as the file has them.
        conversion: asammdf's `ChannelConversion`, read for its parameters alone; None: there is none.
        channel: its name, for messages.

    Returns:
        (n,) numbers; or an array of texts, where all are. Beside numbers a text is NaN.

    Raises:
        ConversionError: it is a formula, or of a type that is not in the list.
        ValueError: values and parameters do not fit.

    Example:
        >>> from types import SimpleNamespace as Conversion
        >>> physical(np.array([1, 2]), Conversion(conversion_type=1, a=0.5, b=1.0), "speed").tolist()
        [1.5, 2.0]
        >>> physical(np.array([1, 2]), Conversion(conversion_type=3, formula="X1 * 2"), "v")
        Traceback (most recent call last):
        canid.io.logs.mf4.conversions.ConversionError: channel v has a formula as its conversion; canid does not evaluate it
    """
    with np.errstate(all="ignore"):
        return _converted(np.asarray(raw), conversion, channel, 0)


def number(raw: Any, conversion: Any, channel: str) -> Any:
    """Values of a channel that holds a number or bytes, as an id: what a text would stand for is the number itself.

    Raises what `physical` does.

    Example:
        >>> from types import SimpleNamespace as Conversion
        >>> number(np.array([1, 2]), Conversion(conversion_type=7), "CAN_DataFrame.Dir").tolist()
        [1, 2]
    """
    values = np.asarray(raw)
    kind = _kind(conversion)
    plain = values.ndim == 1 and values.dtype.kind in "biuf"
    if kind in _TO_TEXT or (kind not in (_FORMULA, _TEXT_TO_VALUE) and not plain):
        return values
    return physical(values, conversion, channel)


def _kind(conversion: Any) -> int:
    return _NONE if conversion is None else int(conversion.conversion_type)


def _converted(raw: Any, conversion: Any, channel: str, depth: int) -> Any:
    kind = _kind(conversion)
    if kind == _NONE:
        return raw
    if kind == _FORMULA:
        raise ConversionError(
            f"channel {channel[:_QUOTED]} has a formula as its conversion; canid does not evaluate it"
        )
    if kind == _TEXT_TO_VALUE:
        return _text_to_value(_texts(raw), conversion)
    if kind == _TEXT_TO_TEXT:
        return _text_to_text(_texts(raw), conversion)
    if raw.dtype.kind not in "biuf":
        raise ValueError("its conversion is one of numbers, and its values are none")
    if kind in (_VALUE_TO_TEXT, _RANGE_TO_TEXT):
        return _to_text(raw, conversion, channel, depth)
    if kind == _LINEAR:
        a, b = float(conversion.a), float(conversion.b)
        return raw if (a, b) == (1.0, 0.0) else raw.astype(float) * a + b
    if kind == _RATIONAL:
        return _rational(raw, conversion)
    if kind in (_INTERPOLATED, _NEAREST):
        return _value_table(raw.astype(float), conversion, interpolated=kind == _INTERPOLATED)
    if kind == _RANGES:
        return _value_ranges(raw, conversion)
    what = "a table of bit fields" if kind == _BIT_FIELDS else f"type {kind}"
    raise ConversionError(
        f"channel {channel[:_QUOTED]} has {what} as its conversion; canid does not apply it"
    )


def _rational(raw: Any, conversion: Any) -> Any:
    """(P1 x² + P2 x + P3) / (P4 x² + P5 x + P6)."""
    p = [float(getattr(conversion, f"P{k}")) for k in range(1, 7)]
    if p[1] == p[5] != 0.0 and not any((p[0], p[2], p[3], p[4])):
        return raw
    x = raw.astype(float)
    return (p[0] * x**2 + p[1] * x + p[2]) / (p[3] * x**2 + p[4] * x + p[5])


def _value_table(x: _Floats, conversion: Any, *, interpolated: bool) -> _Floats:
    keys, values = (
        _column(conversion, "raw", int(conversion.val_param_nr) // 2),
        _column(conversion, "phys", int(conversion.val_param_nr) // 2),
    )
    order = np.argsort(keys, kind="stable")
    keys, values = keys[order], values[order]
    if interpolated:
        return np.interp(x, keys, values)
    above = np.minimum(np.searchsorted(keys, x), len(keys) - 1)
    below = np.maximum(above - 1, 0)
    # in the middle the lower key counts
    nearest: _Floats = np.where(x - keys[below] <= keys[above] - x, values[below], values[above])
    return np.where(x >= keys[-1], values[-1], nearest)


def _value_ranges(raw: Any, conversion: Any) -> _Floats:
    n = (int(conversion.val_param_nr) - 1) // 3
    at = _range_of(raw, _column(conversion, "lower", n), _column(conversion, "upper", n))
    values = np.append(_column(conversion, "phys", n), float(conversion.default))
    return values[at]


def _to_text(raw: Any, conversion: Any, channel: str, depth: int) -> Any:
    """A table from values or ranges to texts or further conversions; what no row has goes to its default."""
    if depth >= _MAX_DEPTH:
        raise ValueError("its conversions are nested too deeply")
    if _kind(conversion) == _VALUE_TO_TEXT:
        n = int(conversion.val_param_nr)
        keys = _column(conversion, "val", n)
        at = _range_of(raw, keys, keys)
    else:
        n = int(conversion.val_param_nr) // 2
        at = _range_of(raw, _column(conversion, "lower", n), _column(conversion, "upper", n))
    rows = [conversion.referenced_blocks.get(f"text_{k}") for k in range(n)]
    rows.append(conversion.referenced_blocks.get("default_addr"))
    numbers = np.full(len(raw), np.nan)
    texts = np.full(len(raw), "", object)
    is_text = np.full(len(raw), False)
    for k in np.unique(at).tolist():
        here = at == k
        row = rows[k]
        converted = (
            _text(row)
            if row is None or isinstance(row, bytes | str)
            else _converted(raw[here], row, channel, depth + 1)
        )
        if isinstance(converted, str) or converted.dtype.kind not in "biuf":
            texts[here], is_text[here] = converted, True
        else:
            numbers[here] = converted
    return texts if len(raw) and is_text.all() else numbers


def _text_to_value(raw: list[str], conversion: Any) -> _Floats:
    n = int(conversion.val_param_nr) - 1
    known = {
        _text(conversion.referenced_blocks.get(f"text_{k}")): float(getattr(conversion, f"val_{k}"))
        for k in range(n)
    }
    default = float(conversion.val_default)
    return np.array([known.get(text, default) for text in raw], float)


def _text_to_text(raw: list[str], conversion: Any) -> Any:
    blocks = conversion.referenced_blocks
    n = sum(key.startswith("input_") for key in blocks)
    known = {_text(blocks.get(f"input_{k}_addr")): _text(blocks.get(f"output_{k}_addr")) for k in range(n)}
    default = _text(blocks.get("default_addr"))
    return np.array([known.get(text, default or text) for text in raw], object)


def _range_of(raw: Any, lower: _Floats, upper: _Floats) -> npt.NDArray[np.intp]:
    """The row of each value; the number of rows where none has it. The upper end is outside for numbers with fractions."""
    order = np.argsort(lower, kind="stable")
    x = raw.astype(float)
    place = np.searchsorted(lower[order], x, "right") - 1
    if not len(order):
        return np.zeros(len(x), np.intp)
    row = order[np.maximum(place, 0)]
    inside = x < upper[row] if raw.dtype.kind == "f" else x <= upper[row]
    inside |= x == lower[row]
    return np.where((place >= 0) & inside, row, len(order))


def _column(conversion: Any, name: str, n: int) -> _Floats:
    column = np.array([float(getattr(conversion, f"{name}_{k}")) for k in range(n)])
    if not n and name in ("raw", "phys"):
        raise ValueError("the table of its conversion is empty")
    return column


def _texts(raw: Any) -> list[str]:
    if raw.dtype.kind not in "SUO":
        raise ValueError("its conversion is one of texts, and its values are none")
    return [_text(cell) for cell in raw.tolist()]


def _text(cell: Any) -> str:
    text = cell.decode("utf-8", "replace") if isinstance(cell, bytes) else str(cell or "")
    return text.rstrip("\0")
