"""plotly.js in a page: packed, the same bytes, and unpacked by the browser before the page has loaded."""

import re
import zlib
from base64 import b64decode, b64encode
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from canid.ui.views.diagnosis_report.diagnosis_document import page
from canid.ui.views.drawing.plotly_package import plotly_file
from canid.values.findings import Report

INFLATE = files("canid.ui.views").joinpath("drawing/inflate.js").read_text(encoding="utf-8")
# bytes of plotly.js in a page; 4.8 MB unpacked
MAX_BYTES = 2_100_000


def test_a_page_has_the_installed_plotly_packed(named: Report) -> None:
    found = re.search(r'id="plotly" data-bytes="(\d+)">([^<]*)<', page(named))
    file = plotly_file()
    assert found is not None
    assert file is not None
    assert len(found[2]) < MAX_BYTES
    unpacked = zlib.decompress(b64decode(found[2]), -zlib.MAX_WBITS)
    assert unpacked == file.read_bytes()
    assert len(unpacked) == int(found[1])


def packed(text: bytes, kind: str) -> bytes:
    level, strategy = {"stored": (0, 0), "fixed": (9, zlib.Z_FIXED), "dynamic": (9, 0), "fast": (1, 0)}[kind]
    packer = zlib.compressobj(level, wbits=-zlib.MAX_WBITS, strategy=strategy)
    return packer.compress(text) + packer.flush()


@pytest.mark.slow("pages in a browser")
@pytest.mark.parametrize("kind", ["stored", "fixed", "dynamic", "fast"])
def test_the_browser_unpacks_every_kind_of_block(browser: Any, tmp_path: Path, kind: str, seed: int) -> None:
    """What runs is what was packed: random text with repetitions near and far, beyond ASCII too."""
    rng = np.random.default_rng(seed)
    words = ["".join(rng.choice([*"abcdefghij äτ−"], rng.integers(1, 9))) for _ in range(400)]
    text = "".join(rng.choice(words, 30_000)) + "a" * 1000
    script = f"window.unpacked = '{text}';".encode()
    data = b64encode(packed(script, kind)).decode()
    path = tmp_path / "page.html"
    path.write_text(
        f'<meta charset="utf-8"><script type="text/plain" id="plotly" data-bytes="{len(script)}">{data}</script>'
        f"<script>{INFLATE}</script><script>window.ready = window.unpacked !== undefined;</script>",
        encoding="utf-8",
    )
    opened = browser.new_page()
    opened.goto(path.as_uri())
    assert opened.evaluate("window.ready")
    assert opened.evaluate("window.unpacked") == text
    opened.close()
