"""Write every schema next to this file: `python -m canid.schemas`."""

from __future__ import annotations

import json
from pathlib import Path

from canid.schemas import json_schema, names


def text(name: str) -> str:
    """A schema as its file holds it."""
    return json.dumps(json_schema(name), indent=1) + "\n"


if __name__ == "__main__":
    for each in names():
        Path(__file__).with_name(f"{each}.json").write_text(text(each), encoding="utf-8")
