"""JSON Schema (draft 2020-12) of what `json_values.plain` writes, from the annotations of the types."""

from __future__ import annotations

import types
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from typing import (
    Any,
    Literal,
    NamedTuple,
    NotRequired,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

import numpy as np

from canid.values.text.json_values import INLINE, fields, mark, null_if_empty

Schema = dict[str, Any]
BASIC: Mapping[Any, Schema] = {
    str: {"type": "string"},
    Path: {"type": "string"},
    bool: {"type": "boolean"},
    int: {"type": "integer"},
    float: {"type": ["number", "null"]},  # null: not known
    type(None): {"type": "null"},
    Any: {},
    object: {},
    dict: {"type": "object"},
    np.ndarray: {"type": "array"},
}


def json_schema(name: str, kind: Any) -> Schema:
    """The schema of one object, or one line.

    Args:
        name: of the schema, as in an object's `schema` field: "identify" of "canid/identify/1".
        kind: a NamedTuple or a TypedDict, or a union of such.

    Returns:
        a schema by which names may be added to an object at any time.

    Example:
        >>> from canid.values.types import Interval
        >>> made = json_schema("some", Interval)
        >>> made["required"], made["properties"]["low"]
        (['schema', 'value', 'low', 'high'], {'type': ['number', 'null']})
    """
    parts = _Parts()
    kinds = get_args(kind) if _is_union(kind) else (kind,)
    bodies = [parts.record(each) for each in kinds]
    body: Schema = bodies[0] if len(bodies) == 1 else {"type": "object", "anyOf": bodies}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": mark(name),
        **body,
        "properties": {"schema": {"const": mark(name)}, **body.get("properties", {})},
        "required": ["schema", *body.get("required", [])],
        "$defs": parts.records,
    }


class _Parts:
    """Objects that several others hold, by the names of their types."""

    def __init__(self) -> None:
        self.records: dict[str, Schema] = {}
        self._kinds: dict[str, Any] = {}

    def of(self, hint: Any) -> Schema:
        """The schema of an annotation. Raises TypeError for a type that JSON has no value of."""
        origin, arguments = get_origin(hint), get_args(hint)
        if _is_union(hint):
            return {"anyOf": [self.of(each) for each in arguments]}
        if origin is Literal:
            return {"enum": list(arguments)}
        if origin is not None and issubclass(origin, Mapping):
            return {"type": "object", "additionalProperties": self.of(arguments[1])}
        if origin is tuple and Ellipsis not in arguments:
            items = [self.of(each) for each in arguments]
            return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
        if origin is not None and issubclass(origin, Sequence):
            return {"type": "array", "items": self.of(arguments[0])}
        if hint in BASIC or origin in BASIC:
            return BASIC[hint if hint in BASIC else origin]
        if isinstance(hint, type) and issubclass(hint, Enum):
            return {"enum": [member.value for member in hint]}
        if hasattr(hint, "_fields") or is_typeddict(hint):
            return self._reference(hint)
        raise TypeError(f"no JSON Schema of {hint}")

    def _reference(self, kind: Any) -> Schema:
        name = kind.__name__
        if self._kinds.setdefault(name, kind) is not kind:
            raise TypeError(f"{kind.__module__}.{name}: another type of the document has this name")
        if name not in self.records:
            self.records[name] = {}  # a type may hold itself
            self.records[name] = self.record(kind)
        return {"$ref": f"#/$defs/{name}"}

    def record(self, kind: Any) -> Schema:
        """An object: its keys, and which of them are always there."""
        keys = _keys(kind)
        properties = {
            key: self.of(entry.hint | None if entry.nullable else entry.hint) for key, entry in keys.items()
        }
        required = [key for key, entry in keys.items() if entry.required]
        return {"type": "object", "properties": properties, "required": required}


class _Key(NamedTuple):
    """A key of an object."""

    hint: Any
    required: bool = True
    nullable: bool = False


def _keys(kind: Any) -> dict[str, _Key]:
    """The keys of what a type is written as; a later one replaces an earlier one of the same name."""
    hints = get_type_hints(kind)
    if is_typeddict(kind):
        # where annotations are texts, __required_keys__ does not know of NotRequired
        marked = get_type_hints(kind, include_extras=True)
        optional = {key for key, hint in marked.items() if get_origin(hint) is NotRequired}
        return {key: _Key(hint, key in kind.__required_keys__ - optional) for key, hint in hints.items()}
    keys: dict[str, _Key] = {}
    for name, field in zip(kind._fields, fields(kind), strict=True):
        if field is not None and field.key == INLINE:
            keys |= _keys(hints[name])
        elif field is not None:
            keys[field.key] = _Key(hints[name], True, field.write is null_if_empty)
    return keys


def _is_union(hint: Any) -> bool:
    return get_origin(hint) in (Union, types.UnionType)
