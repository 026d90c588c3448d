"""The certificate of docs/clusters.md, made by its own commands."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

from tests.fleet.short_logs import REPO

# the folder that the pages name
OF_PAGE = "/home/me/tls"


def made(home: Path) -> dict[str, str]:
    """Make it in a home; what has to be in the environment of everything that uses it."""
    page = (REPO / "docs/clusters.md").read_text("utf-8")
    commands, configuration = (
        re.findall(rf"^```{language} certificate\n(.*?)^```$", page, flags=re.M | re.S)
        for language in ("sh", "yaml")
    )
    subprocess.run(
        ["sh", "-e", "-c", commands[0]],
        env={**os.environ, "HOME": str(home)},
        check=True,
        capture_output=True,
    )
    (home / "tls/dask.yaml").write_text(
        configuration[0].replace(OF_PAGE, str(home / "tls")), encoding="utf-8"
    )
    return {"DASK_CONFIG": str(home / "tls/dask.yaml")}
