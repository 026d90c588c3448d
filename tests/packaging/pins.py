"""Prints the versions of a report of `pip install --report` as constraints: `python pins.py REPORT`, see the Makefile."""

from __future__ import annotations

import json
import sys
from pathlib import Path

if __name__ == "__main__":
    report = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    pins = {each["metadata"]["name"]: each["metadata"]["version"] for each in report["install"]}
    del pins["canid"]
    print(
        "\n".join(
            f"{name}=={version}" for name, version in sorted(pins.items(), key=lambda pin: pin[0].lower())
        )
    )
