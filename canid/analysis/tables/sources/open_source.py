"""Which source reads a file, by its suffix."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from canid.analysis.tables import kinds
from canid.analysis.tables.column_map import ColumnMap
from canid.analysis.tables.headings import TIME
from canid.analysis.tables.source import Source
from canid.analysis.tables.sources.array_source import ArraySource
from canid.analysis.tables.sources.parquet_source import ParquetSource
from canid.analysis.tables.sources.text_source import text_source
from canid.io.logs.input_file import regular_file


def source_of(path: str | Path, by: ColumnMap) -> Source:
    """Open a file of columns. Raises ConfigError or LogError."""
    file = Path(path)
    regular_file(file)
    if kinds.suffix(file) == ".parquet":
        return ParquetSource(file)
    if kinds.suffix(file) in (".mf4", ".mcap"):
        from canid.analysis.tables.sources.signals_source import read_signals_file

        return read_signals_file(file)
    if kinds.suffix(file) in (".xml", ".xml.gz"):
        from canid.analysis.tables.sources.xml_source import XmlSource

        return XmlSource(file)
    if kinds.suffix(file) == ".vbo":
        from canid.analysis.tables.sources.vbo import read_vbo

        vbo = read_vbo(file)
        t: Any = vbo.t
        if np.isfinite(vbo.start_utc):
            t = np.round((vbo.start_utc + vbo.t) * 1e9).astype("datetime64[ns]")
        named = {f"{name} [{unit}]" if unit else name: x for name, (x, unit) in vbo.columns.items()}
        return ArraySource({TIME: t, **named}, str(path), vbo.lines, vbo.notes)
    return text_source(file, by.header)
