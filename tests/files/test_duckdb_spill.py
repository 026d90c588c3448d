"""Where DuckDB puts what does not fit into its memory."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

from canid.io.files import duckdb_files

SORTED = "SELECT hash(range) AS h, repeat('x', 50) AS x FROM range(400000) ORDER BY h"


def test_a_spill_is_a_temporary_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing appears in the current folder, which may be read-only or full of logs, and nothing is left."""
    here, temporary = tmp_path / "here", tmp_path / "temporary"
    here.mkdir()
    temporary.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    with duckdb_files.connected("a sort", "export", memory_limit="24MB", threads=1) as db:
        assert len(db.execute(SORTED).fetchmany(10)) == 10
        assert len(os.listdir(temporary)) == 1
        assert os.listdir(here) == []
    assert os.listdir(temporary) == []
