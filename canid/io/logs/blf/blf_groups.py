"""The frames among the objects of a .blf's payload: groups of one layout, their sizes and numbers checked.

Every size is checked before it is used. A time of 2^63 ns or more is a negative one: canid 0.2.0 wrote frames so that were
stamped before the file's zero because a clock was set back.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from canid.io.logs.blf import blf_layout as blf
from canid.io.logs.blf.blf_dtypes import BODY, LAYOUTS, VERSIONS
from canid.io.logs.blf.blf_layout import Data
from canid.io.logs.blf.blf_object_chain import Broken, Chain, Ints
from canid.io.logs.text_lines import MAX_TIME_NS
from canid.values.frame_columns import FD_BYTES, MAX_STANDARD_ID, WantedIds

# ns: longer times are damage, and differences of shorter ones fit 64 bits
_MAX_NS = MAX_TIME_NS - 1
# an id's word: its highest bit says that it is extended, the next two have no meaning
_UNUSED_BITS = np.uint32(0x60000000)
_BEYOND_EXTENDED = np.uint32(blf.ID_EXTENDED + blf.ID_MASK + 1)
_TOO_SHORT = "an object is too short for what it holds"
WRONG = "a frame's time, id or length is none that can be"


_Whole = npt.NDArray[np.integer[Any]]


class Group(NamedTuple):
    """Frames of one kind and one header version."""

    kind: int
    rows: Ints | slice  # (m,) which objects of the payload
    begin: Ints  # (m,)
    items: npt.NDArray[Any]  # (m,) of a layout


def groups_of(data: Data, links: Chain) -> list[Group]:
    """Group the frames among the objects, their sizes checked. Raises Broken."""
    if links.step:
        # objects of one kind and size, evenly spaced: the usual log
        _, header_size, version, size, kind = blf.OBJECT.unpack_from(data, links.begin[0])
        if not blf.is_plausible(kind, size):
            raise Broken(f"an object of type {kind} claims a size of {size} bytes")
        if kind not in BODY:
            return []
        _check_sizes(kind, np.array([version]), np.array([header_size]), np.array([size]))
        items = np.ndarray(
            (len(links.begin),), LAYOUTS[kind, version], data, int(links.begin[0]), (links.step,)
        )
        return [Group(kind, slice(None), links.begin, _with_id(kind, items))]
    groups = []
    if links.kind.size and not 0 < links.kind.min() <= links.kind.max() < blf.MAX_TYPE:
        raise Broken(f"an object has the type {links.kind.max() if links.kind.min() else 0}")
    for kind in BODY:
        rows = np.flatnonzero(links.kind == kind)
        if not len(rows):
            continue
        begin, size = links.begin[rows], links.size[rows]
        if size.max() > blf.MAX_OBJECT_BYTES[kind]:
            raise Broken(f"an object of type {kind} claims a size of {size.max()} bytes")
        if size.min() < LAYOUTS[kind, 1].itemsize:
            raise Broken(_TOO_SHORT)
        heads = _items(data, begin, LAYOUTS[kind, 1])
        _check_sizes(kind, heads["version"], heads["header_size"], size)
        for version in VERSIONS:
            chosen = heads["version"] == version
            if chosen.any():
                items = heads[chosen] if version == 1 else _items(data, begin[chosen], LAYOUTS[kind, version])
                groups.append(Group(kind, rows[chosen], begin[chosen], _with_id(kind, items)))
    return groups


def _check_sizes(kind: int, version: _Whole, header_size: _Whole, size: _Whole) -> None:
    """Check that objects (m,) of one kind are as long as what they hold. Raises Broken."""
    if not np.isin(version, VERSIONS).all():
        raise Broken(_TOO_SHORT)
    least = np.array([LAYOUTS[kind, n].itemsize for n in VERSIONS])[version.astype(np.int64) - VERSIONS[0]]
    if (size < least).any() or (size < header_size).any():
        raise Broken(_TOO_SHORT)
    if kind == blf.CAN_ERROR and (size.astype(np.int64) - header_size > blf.CAN_ERROR_BYTES).any():
        raise Broken("an object is too long for what it holds")


def _with_id(kind: int, items: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Give error frames without an id the id 0 and no data."""
    if kind != blf.CAN_ERROR:
        return items
    kept = ("unit", "ns", "channel")
    out = np.zeros(
        len(items),
        [*((name, items.dtype[name]) for name in kept), ("dlc", "u1"), ("word", "<u4"), ("top", "u1")],
    )
    for name in kept:
        out[name] = items[name]
    return out


def sound(groups: list[Group], *, checked: bool) -> tuple[list[Group], int]:
    """The groups without frames whose time, id or length cannot be, and how many these were."""
    out, wrong = [], 0
    for group in groups:
        items = group.items
        word, ns, dlc = items["word"].astype(np.uint32), items["ns"], items["dlc"]
        # ids: of 29 bits below the highest one, which says extended; else of 11, but an error frame's is any
        bad = (word >= _BEYOND_EXTENDED) | (dlc > 15)
        if group.kind in blf.ERRORS:
            bad |= (word & _UNUSED_BITS) != 0
        else:
            large = word - np.uint32(MAX_STANDARD_ID + 1) < np.uint32(blf.ID_EXTENDED - MAX_STANDARD_ID - 1)
            if large.any():
                meant = _unmarked(word, checked=checked)
                group = _marked(group, meant)
                large &= ~meant
            bad |= large
        if group.kind in (blf.CAN_FD_MESSAGE, blf.CAN_FD_MESSAGE_64):
            bad |= items["valid"] > FD_BYTES
        bad |= (ns > _MAX_NS) | (ns < -_MAX_NS)
        coarse = items["unit"] == blf.TEN_MICROSECONDS
        if coarse.any():
            bad |= coarse & ((ns > _MAX_NS // 10_000) | (ns < -_MAX_NS // 10_000))
        if bad.any():
            kept = np.flatnonzero(~bad)
            wrong += len(items) - len(kept)
            group = _chosen(group, kept)
        if len(group.items):
            out.append(group)
    return out, wrong


def _unmarked(word: npt.NDArray[np.uint32], *, checked: bool) -> npt.NDArray[np.bool_]:
    """Which ids have 29 bits without the mark: some writers leave it out.

    In data without a checksum an id that no other frame has may be damage, and is none of them.
    """
    unmarked = word - np.uint32(MAX_STANDARD_ID + 1) < np.uint32(blf.ID_MASK - MAX_STANDARD_ID)
    if not checked:
        _, inverse, counts = np.unique(word, return_inverse=True, return_counts=True)
        unmarked &= counts[inverse] > 1
    return unmarked


def _marked(group: Group, rows: npt.NDArray[np.bool_]) -> Group:
    """The group with the mark of 29 bits in these rows."""
    items = group.items.copy()
    items["word"][rows] |= np.uint32(blf.ID_EXTENDED)
    return group._replace(items=items)


def without_requests(groups: list[Group]) -> tuple[list[Group], Ints]:
    """The groups without transmit requests, and which objects these are."""
    out, requests = [], [np.zeros(0, np.int64)]
    for group in groups:
        items = group.items
        # the usual log has no directions but 0 and 1, and no flags: one pass shows that
        if group.kind in blf.ERRORS or (
            group.kind != blf.CAN_FD_MESSAGE_64 and items["how"].max(initial=0) < blf.REQUEST
        ):
            out.append(group)
            continue
        if group.kind == blf.CAN_FD_MESSAGE_64:
            asked = (items["sent"] == blf.REQUEST) | ((items["fd"] & blf.FD64_REQUEST) != 0)
        else:
            asked = (items["how"] & blf.DIRECTION_MASK) == blf.REQUEST
        if asked.any():
            rows = np.arange(len(items)) if isinstance(group.rows, slice) else group.rows
            requests.append(rows[asked])
            group = _chosen(group, np.flatnonzero(~asked))
        if len(group.items):
            out.append(group)
    return out, np.concatenate(requests)


def last_time(groups: list[Group]) -> int | None:
    """Ns of the last frame."""
    ends = [
        (len(group.items) if isinstance(group.rows, slice) else int(group.rows[-1]), group.items[-1])
        for group in groups
    ]
    if not ends:
        return None
    _, item = max(ends, key=lambda end: end[0])
    return int(item["ns"]) * (10_000 if item["unit"] == blf.TEN_MICROSECONDS else 1)


def only(group: Group, wanted: WantedIds) -> Group:
    """Keep the frames that are wanted."""
    return _chosen(group, wanted.rows(group.items["word"]))


def _chosen(group: Group, rows: Ints) -> Group:
    items = group.items
    number = rows if isinstance(group.rows, slice) else group.rows[rows]
    # as plain bytes: numpy copies structures field by field
    chosen = items.view(f"V{items.dtype.itemsize}")[rows].view(items.dtype)
    return group._replace(rows=number, begin=group.begin[rows], items=chosen)


def _items(data: Data, begin: Ints, layout: np.dtype[Any]) -> npt.NDArray[Any]:
    """Copy the structures at `begin`, out of a view of overlapping ones: one for every byte."""
    size = layout.itemsize
    overlapping: npt.NDArray[Any] = np.ndarray((len(data) - size + 1,), f"V{size}", data, 0, (1,))
    return overlapping[begin].view(layout)
