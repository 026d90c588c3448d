"""Items of a session as JSON datagrams: nested numbers, each datagram with a numeric `timestamp`.

PlotJuggler's JSON parser makes a series of every number by its path, and takes the time from the field `timestamp`; a
datagram without one switches that off for good, so every datagram has it. What is not a number (NaN, null) is left out.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Any

from canid.values.text import json_values
from canid.values.types import (
    TASK_INPUTS,
    Estimate,
    Event,
    MonitorReport,
    Sample,
    SignalReport,
)

# bytes of one datagram: it fits into an Ethernet frame of 1,500 with its headers
MAX_BYTES = 1400
# characters of a text
_MAX_TEXT = 300
_INPUTS = {len(names): names for names in TASK_INPUTS.values()}

Item = Sample | Estimate | MonitorReport | SignalReport | Event


def code(member: Enum) -> int:
    """Number of a member of an enum, in the order of its definition: texts cannot be plotted.

    >>> from canid.values.types import Status
    >>> code(Status.OK), code(Status.NO_LEAD)
    (0, 3)
    """
    return list(type(member)).index(member)


def values_of(item: Item) -> dict[str, Any]:
    """The numbers of an item, under the name of its kind; the same as in --json.

    Example:
        >>> values_of(Event(3.0, "mark", "mark: left lane"))
        {'event': {'mark': 1, 'what': 'mark', 'says': 'mark: left lane'}}
    """
    if isinstance(item, Sample):
        return _sample(item)
    if isinstance(item, Estimate):
        return {"estimate": {item.estimator: _estimate(item)}}
    if isinstance(item, MonitorReport):
        return {"monitor": _monitor(item)}
    if isinstance(item, SignalReport):
        standing = [finding for finding in item.findings if finding.until != finding.until]
        return {
            "findings": {"standing": len(standing)}
            | {finding.name: int(finding in standing) for finding in item.findings}
        }
    return {"event": {item.what: 1, "what": item.what, "says": item.says[:_MAX_TEXT]}}


def _sample(s: Sample) -> dict[str, Any]:
    inputs = dict(zip(_INPUTS.get(len(s.inputs), ()), s.inputs, strict=False))
    values = {"output": s.output, "inputs": inputs, "learn": int(s.learn), "segment": s.segment}
    gate = {"gate": s.gate.name.lower(), "gate_code": code(s.gate)}
    return {"sample": values | gate, "signals": dict(s.signals)}


def _estimate(e: Estimate) -> dict[str, Any]:
    values = json_values.plain(e)
    channels = {
        name: {key: channel[key] for key in ("K", "tau", "dead_time", "tau_plus_dead_time", "status")}
        | {"status_code": code(e.channels[name].status)}
        for name, channel in values["channels"].items()
    }
    return {
        "status": e.status.value,
        "status_code": code(e.status),
        "headline": int(e.headline),
        "fit_percent": values["fit_percent"],
        "used": values["used"],
        "excitation": values["excitation"],
    } | channels


def _monitor(m: MonitorReport) -> dict[str, Any]:
    values = json_values.plain(m)
    blocks = {
        name: {"state": block.state.value, "state_code": code(block.state)}
        | {key: values["blocks"][name][key] for key in ("since", "evidence", "needed")}
        for name, block in m.blocks.items()
    }
    return {"fits": int(m.fits), "since": values["since"], "block": m.block} | blocks


def datagrams(timestamp: float, t: float, values: Mapping[str, Any]) -> list[bytes]:
    """Encode values, in several datagrams where one would be longer than `MAX_BYTES`.

    Args:
        timestamp: s since 1970, UTC.
        t: s of the session.
        values: nested; what is None or NaN is left out.

    Example:
        >>> datagrams(1e9, 2.5, {"signals": {"speed": 12.5, "gap": float("nan")}})
        [b'{"timestamp":1000000000.0,"t":2.5,"signals":{"speed":12.5}}']
    """
    head: dict[str, Any] = {"timestamp": timestamp, "t": t}
    leaves = [*_leaves(json_values.plain(dict(values)))]
    whole = _encoded(head, leaves)
    if len(whole) <= MAX_BYTES:
        return [whole] if leaves else []
    out, part = [], list[_Leaf]()
    for leaf in leaves:
        if part and len(_encoded(head, [*part, leaf])) > MAX_BYTES:
            out.append(_encoded(head, part))
            part = []
        part.append(leaf)
    return [*out, _encoded(head, part)]


_Leaf = tuple[tuple[str, ...], Any]


def _leaves(values: Any, path: tuple[str, ...] = ()) -> Iterator[_Leaf]:
    if isinstance(values, dict):
        for key, value in values.items():
            yield from _leaves(value, (*path, key))
    elif isinstance(values, list):
        for k, value in enumerate(values):
            yield from _leaves(value, (*path, str(k)))
    elif values is not None:
        yield path, values[:_MAX_TEXT] if isinstance(values, str) else values


def _encoded(head: dict[str, Any], leaves: list[_Leaf]) -> bytes:
    out = dict(head)
    for path, value in leaves:
        at = out
        for key in path[:-1]:
            at = at.setdefault(key, {})
        at[path[-1]] = value
    # a lone surrogate (an undecodable byte of a name) has no UTF-8
    text = json.dumps(out, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.encode("utf-8", "backslashreplace")
