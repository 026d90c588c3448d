"""Pictures of the report of a diagnosis, in Chromium: the top of a page on a desk, and its beginning on a phone.

python -m benchmarks.diagnosis_report.screenshots [--into docs/images] [--data ../shared/data] [NAME ...]

The logs of measured drives are not part of canid; without them only the simulated drive is shown.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

# as root and without a network: no sandbox, and no attempt to call home
FLAGS = ("--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync")
# px
DESK, PHONE = (900, 640), (390, 844)


class Picture(NamedTuple):
    """One picture: of which log, and what of its page."""

    log: str  # relative to --data; "": simulated
    arguments: tuple[str, ...]  # of `canid diagnose`
    size: tuple[int, int]  # px
    at: str = "html"  # selector of the element that is at the top


PICTURES = {
    "asta_p10_f4": Picture("asta/asta_p10_f4_Mercedes_AClass.blf", ("--vehicle", "openacc_asta"), DESK),
    "acc_first_half": Picture("openacc/acc_short_h2_v4.blf", ("--vehicle", "openacc", "--stop", "160"), DESK),
    "report_evidence": Picture("", ("--vehicle", "generic"), (900, 500), "#evidence"),
    "report_phone": Picture("", ("--vehicle", "generic"), PHONE),
}
# of the simulated drive
HIDDEN = ("--hide", "headway_dead_zone=0.7", "--minutes", "12", "--seed", "3")


def canid(folder: Path, *arguments: str | Path) -> None:
    """Run canid in a folder; its output is not shown."""
    command = [sys.executable, "-m", "canid", *map(str, arguments)]
    quiet = subprocess.DEVNULL
    subprocess.run(command, check=True, stdout=quiet, stderr=quiet, cwd=folder)


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[*PICTURES, []])
    parser.add_argument("--into", type=Path, default=Path("docs/images"))
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    args = parser.parse_args()
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        pages: dict[tuple[str, tuple[str, ...]], Path] = {}
        for name in args.names or PICTURES:
            picture = PICTURES[name]
            log = args.data / picture.log if picture.log else Path(folder) / "simulated.blf"
            if not log.exists() and not picture.log:
                canid(log.parent, "simulate", log.name, *HIDDEN)
            if not log.exists():
                print(f"{name}: {log} is not there")
                continue
            key = (picture.log, picture.arguments)
            if key not in pages:
                pages[key] = Path(folder) / f"{name}.html"
                canid(log.parent, "diagnose", log.name, *picture.arguments, "--report", pages[key])
            width, height = picture.size
            page = browser.new_page(viewport={"width": width, "height": height})
            page.goto(pages[key].as_uri())
            page.wait_for_function("document.documentElement.dataset.drawn === 'all'")
            page.evaluate(f"document.querySelector('{picture.at}').scrollIntoView()")
            target = args.into / f"{name}.png"
            page.screenshot(path=target)
            page.close()
            print(f"{target}: {target.stat().st_size / 1000:.0f} kB")
        browser.close()


if __name__ == "__main__":
    main()
