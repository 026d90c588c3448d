"""The pictures in docs/images, made anew: the live page, the terminal view, a diagnosis and a page of identify.

python docs/screenshots.py [NAME ...]

Needs Chromium and `pip install -e '.[dev]'`; a minute. Pictures of measured drives come from
`python -m benchmarks.diagnosis_report.screenshots`, and need their logs.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image
from playwright.sync_api import sync_playwright

from canid.values.shipped_files import shipped

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs/images"
# bytes: a page with five pictures stays under a megabyte
MAX_BYTES = 150_000
# as root and without a network: no sandbox, and no attempt to call home
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync"]
# the second drive of `canid demo`
HIDDEN = ("--seed", "21", "--minutes", "5", "--profile", "urban", "--hide", "relative_speed_dead_zone=1")
URBAN = ROOT / "replay_logs/following_urban.blf"


class Picture(NamedTuple):
    """A part of a page that a verb writes."""

    page: str
    size: tuple[int, int]  # px
    at: str = "html"  # selector of the element that is at the top


PICTURES = {
    "diagnosis_top": Picture("diagnosis.html", (1000, 760)),
    "diagnosis_evidence": Picture("diagnosis.html", (1000, 610), "#evidence"),
    "drive_report": Picture("drive.html", (1000, 700), "#time"),
}
# pictures that benchmarks already make: of the live page, the terminal view and a report on a phone
MODULES = {
    "web": ("benchmarks.web.screenshots",),
    "terminal": ("benchmarks.terminal.screenshots",),
    "report": ("benchmarks.diagnosis_report.screenshots", "report_evidence", "report_phone"),
}


def main(names: list[str]) -> None:
    """Make the pictures, or those that are named."""
    unknown = set(names) - {*MODULES, *PICTURES, "notebook"}
    if unknown:
        sys.exit(f"no picture {', '.join(unknown)}; there are {', '.join((*MODULES, *PICTURES, 'notebook'))}")
    for name, words in MODULES.items():
        if not names or name in names:
            python("-m", *words)
    chosen = {name: picture for name, picture in PICTURES.items() if not names or name in names}
    if chosen:
        photograph(chosen)
    if not names or "notebook" in names:
        notebook()
    for path in sorted(IMAGES.glob("*.png")):
        if path.stat().st_size > MAX_BYTES:
            reduce(path)
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1000:.0f} kB")


def photograph(pictures: dict[str, Picture]) -> None:
    """Write the pages in a temporary folder, and take the pictures of them."""
    with tempfile.TemporaryDirectory() as name, sync_playwright() as play:
        folder = Path(name)
        python("-m", "canid", "simulate", "hidden.blf", *HIDDEN, folder=folder)
        # a page names its vehicle file: here without a path of this machine
        shutil.copytree(shipped(), folder / "dbc")
        words = ("--vehicle", "dbc/generic.toml", "--report")
        python("-m", "canid", "diagnose", "hidden.blf", *words, "diagnosis.html", folder=folder)
        shutil.copy(URBAN, folder / "drive.blf")
        python("-m", "canid", "identify", "drive.blf", *words, "drive.html", folder=folder)
        browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        for title, picture in pictures.items():
            width, height = picture.size
            page: Any = browser.new_page(viewport={"width": width, "height": height})
            page.goto((folder / picture.page).as_uri())
            page.wait_for_function("document.documentElement.dataset.drawn === 'all'")
            page.evaluate(f"document.querySelector('{picture.at}').scrollIntoView()")
            page.screenshot(path=IMAGES / f"{title}.png")
            page.close()
        browser.close()


def notebook() -> None:
    """Run the notebook, and take a picture of what its cells show."""
    import nbformat
    from nbclient import NotebookClient

    source = ROOT / "docs/notebooks/first_drive.ipynb"
    cells = nbformat.read(source, as_version=4)
    NotebookClient(cells, timeout=300, resources={"metadata": {"path": str(source.parent)}}).execute()
    shown = [out["data"]["text/html"] for cell in cells.cells for out in cell.get("outputs", ()) if "data" in out
             and "<svg" in out["data"].get("text/html", "")]  # fmt: skip
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        page = browser.new_page(viewport={"width": 820, "height": 400})
        page.set_content(f'<meta charset="utf-8"><body style="font-family: sans-serif">{"<hr>".join(shown)}')
        page.screenshot(path=IMAGES / "notebook.png", full_page=True)
        browser.close()


def python(*words: str, folder: Path = ROOT) -> None:
    """Run Python in a folder; of its output errors alone are shown."""
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    subprocess.run(
        [sys.executable, *words], check=True, cwd=folder, env=environment, stdout=subprocess.DEVNULL
    )


def reduce(path: Path) -> None:
    """Save a picture with 256 colors: plots and text lose nothing that is seen."""
    with Image.open(path) as picture:
        few = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    few.save(path, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
