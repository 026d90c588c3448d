"""Pictures of the terminal view for the documentation, as SVG.

python -m benchmarks.terminal.screenshots [--into docs/images] [--log LOG --vehicle V.toml --at S]
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path

from benchmarks.terminal.views import LOG, VEHICLE, recorded, replayed
from canid.ui.terminal.spans import Line
from canid.ui.views.terminal_view.picture import Overlay, render
from canid.ui.views.terminal_view.state import View

SIZES = ((40, 15), (80, 24), (200, 60))
# s of the log at which the pictures are taken
AT_S = 168.0
# rich's own format without its web font: a picture asks for nothing from elsewhere
FORMAT = """<svg class="rich-terminal" viewBox="0 0 {width} {height}" xmlns="http://www.w3.org/2000/svg">
<style>
.{unique_id}-matrix {{ font-family: DejaVu Sans Mono, Menlo, Consolas, monospace; font-size: {char_height}px; }}
{styles}
</style>
<defs><clipPath id="{unique_id}-clip-terminal">
<rect x="0" y="0" width="{terminal_width}" height="{terminal_height}"/></clipPath>
{lines}</defs>
<rect fill="#292929" width="{terminal_width}" height="{terminal_height}" rx="6"/>
<g clip-path="url(#{unique_id}-clip-terminal)">
{backgrounds}
<g class="{unique_id}-matrix">
{matrix}
</g></g></svg>
"""


def svg(lines: list[Line], columns: int) -> str:
    """A picture as SVG."""
    from rich.console import Console
    from rich.text import Text

    console = Console(
        file=io.StringIO(), record=True, width=columns, force_terminal=True, color_system="standard"
    )
    for line in lines:
        text = Text(no_wrap=True, overflow="crop")
        for part, style in line:
            text.append(part, style=style)
        console.print(text)
    drawn = console.export_svg(title="", code_format=FORMAT, unique_id="t")
    return "\n".join(line.rstrip() for line in drawn.splitlines()) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--into", type=Path, default=Path("docs/images"))
    parser.add_argument("--log", type=Path, default=LOG)
    parser.add_argument("--vehicle", default=VEHICLE)
    parser.add_argument("--at", type=float, default=AT_S)
    parser.add_argument("--prefix", default="terminal")
    args = parser.parse_args()
    replay = replayed(args.at, args.log, args.vehicle)
    views: list[tuple[str, View, tuple[int, int]]] = [
        (f"replay_{columns}x{rows}", replay, (columns, rows)) for columns, rows in SIZES
    ]
    if args.log == LOG:
        live = recorded(args.at)
        views += [("live_80x24", live, (80, 24)), ("live_40x15", live, (40, 15))]
    for name, view, (columns, rows) in views:
        path = args.into / f"{args.prefix}_{name}.svg"
        path.write_text(svg(render(view, columns, rows, Overlay(keys=True)), columns), encoding="utf-8")
        print(f"{path}: {path.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
