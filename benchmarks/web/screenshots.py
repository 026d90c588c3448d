"""The pictures of docs/web.md: the live page on a replay, in Chromium.

python -m benchmarks.web.screenshots [DIR]
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parents[2]
LOG = ROOT / "replay_logs/following_urban.blf"
# name: width and height of the window, color scheme
PICTURES: dict[str, tuple[int, int, Any]] = {
    "web_desktop": (1500, 740, "light"),
    "web_dark": (1100, 760, "dark"),
    "web_phone": (390, 844, "light"),
}
# s of the drive at which the pictures are taken
AT_S = 155.0


def main() -> None:
    """Replay up to `AT_S`, and take the pictures there."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.web.screenshots")
    parser.add_argument("folder", nargs="?", default=str(ROOT / "docs/images"))
    folder = Path(parser.parse_args().folder)
    chromium = shutil.which("chromium")
    assert chromium is not None, "chromium is not installed"
    words = [str(LOG), "--vehicle", "generic", "--web", "--speed", "max"]
    process = subprocess.Popen(
        [sys.executable, "-m", "canid", "replay", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    try:
        assert process.stderr is not None
        url = re.search(r"http\S+", process.stderr.readline())
        assert url is not None
        with sync_playwright() as play:
            browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
            page = browser.new_page()
            page.goto(url[0])
            wait(page, "document.querySelector('#playing').textContent === 'end of the log'")
            page.click("#pause")
            page.fill("#seek", str(AT_S))
            wait(page, "document.querySelector('#playing').textContent === 'paused'")
            for name, (width, height, scheme) in PICTURES.items():
                page.set_viewport_size({"width": width, "height": height})
                page.emulate_media(color_scheme=scheme)
                page.wait_for_timeout(2500)
                page.screenshot(path=folder / f"{name}.png")
                print(folder / f"{name}.png", (folder / f"{name}.png").stat().st_size)
            browser.close()
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate()


def wait(page: Any, condition: str) -> None:
    """Wait; from outside, because the page's policy keeps playwright from waiting inside."""
    while not page.evaluate(condition):
        page.wait_for_timeout(100)


if __name__ == "__main__":
    main()
