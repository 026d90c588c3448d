"""`canid schema [NAME]`: the JSON Schema of what a verb writes with --json, from the types of the results."""

from __future__ import annotations

import argparse
from typing import Any

from canid.ui.cli.verbs import VERBS
from canid.ui.terminal.messages import print_line, print_text
from canid.values.errors import DONE, ConfigError

# names that are another schema's: the lines of live are those of replay
ALIASES = {"live": "replay"}


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "name", metavar="NAME", nargs="?", help="of a schema, such as identify; default: list all of them"
    )


def run(args: argparse.Namespace) -> int:
    """Print a schema, or the names of all."""
    import json

    from canid.values.text.json_values import mark

    if args.name is not None:
        print_text(json.dumps(json_schema(args.name), indent=1))
        return DONE
    for name in names():
        print_line(f"{name:10}{mark(ALIASES.get(name, name))}")
    return DONE


def results() -> dict[str, Any]:
    """Name of a schema -> type of what a verb writes: this verb writes a schema, which has none."""
    return {}


def names() -> list[str]:
    """The schemas that there are."""
    return sorted([*_types(), *ALIASES])


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
    from canid.ui.views.json_schema import json_schema as schema_of

    name = ALIASES.get(name, name)
    types = _types()
    if name not in types:
        raise ConfigError(f"no schema is called {name!r}; there are {', '.join(names())}")
    return schema_of(name, types[name])


def _types() -> dict[str, Any]:
    return {name: kind for verb in VERBS for name, kind in verb.results.items()}
