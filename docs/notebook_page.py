"""A notebook as Markdown, with the outputs that are stored in it: nothing is executed."""

from __future__ import annotations

import html
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any


def markdown(path: Path) -> str:
    """The cells of a notebook: text as it is, code as blocks, outputs below their code."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return "\n\n".join(part for cell in cells for part in _cell(cell) if part.strip()) + "\n"


def _cell(cell: dict[str, Any]) -> Iterator[str]:
    source = "".join(cell["source"]).strip("\n")
    if cell["cell_type"] == "markdown":
        yield source
    elif cell["cell_type"] == "code":
        yield f"```python\n{source}\n```"
        for output in cell["outputs"]:
            yield _output(output)


def _output(output: dict[str, Any]) -> str:
    """The richest form that a page without scripts can show."""
    data = output.get("data", {})
    if "image/png" in data:
        return f'<img alt="output of the cell above" src="data:image/png;base64,{"".join(data["image/png"]).strip()}">'
    markup = "".join(data.get("text/html", ""))
    # a block of HTML ends at the first empty line
    if markup and "<script" not in markup:
        return "\n".join(line for line in markup.splitlines() if line.strip())
    text = "".join(output.get("text", "")) or "".join(data.get("text/plain", ""))
    return f"<pre>{html.escape(text.rstrip())}</pre>".replace("\n\n", "\n&#8203;\n") if text.strip() else ""
