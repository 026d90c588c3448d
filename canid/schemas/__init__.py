"""JSON Schema of what `canid VERB --json` writes; `NAME.json` in this folder is the same as a file.

`python -m canid.schemas` writes the files; a test keeps them current.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

from canid.errors import ConfigError
from canid.schemas.parts import PARTS
from canid.schemas.results import RESULTS
from canid.views.json_values import SCHEMA_VERSIONS

# names that are another schema's: the lines of live are those of replay
ALIASES = {"live": "replay"}


def names() -> list[str]:
    """The schemas that there are."""
    return sorted([*SCHEMA_VERSIONS, *ALIASES])


def json_schema(name: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of one object, or one line, that a verb writes.

    Args:
        name: "identify", "diagnose", "check", "compare", "replay", ..., as in an object's `schema` field,
            "canid/identify/1"; names may be added to an object at any time, and validate.

    Raises:
        ConfigError: there is no such schema.

    Example:
        >>> json_schema("identify")["properties"]["schema"]
        {'const': 'canid/identify/1'}
    """
    name = ALIASES.get(name, name)
    if name not in SCHEMA_VERSIONS:
        raise ConfigError(f"no schema is called {name!r}; there are {', '.join(names())}")
    mark = f"canid/{name}/{SCHEMA_VERSIONS[name]}"
    body = deepcopy(RESULTS[name])
    body["properties"] = {"schema": {"const": mark}, **body.get("properties", {})}
    body["required"] = ["schema", *body.get("required", [])]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": mark,
        "type": "object",
        **body,
        "$defs": deepcopy(PARTS),
    }
