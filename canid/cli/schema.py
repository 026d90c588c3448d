"""`canid schema [NAME]`: the JSON Schema of what a verb writes with --json."""

from __future__ import annotations

import argparse

from canid.cli.output.messages import print_line
from canid.errors import DONE


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "name", metavar="NAME", nargs="?", help="of a schema, such as identify; default: list all of them"
    )


def run(args: argparse.Namespace) -> int:
    """Print a schema, or the names of all."""
    import json

    from canid.schemas import json_schema, names

    if args.name is not None:
        for line in json.dumps(json_schema(args.name), indent=1).splitlines():
            print_line(line)
        return DONE
    for name in names():
        print_line(f"{name:10}{json_schema(name)['title']}")
    return DONE
