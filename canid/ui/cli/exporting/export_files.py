"""The files of `canid export`: their names, and who writes each of them."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import NotRequired, TypedDict

from canid.analysis.export import (
    csv_table,
    mat_file,
    mcap_file,
    names,
    parquet_table,
    plotjuggler_layout,
    vbo_file,
)
from canid.analysis.export.mf4_file import Mf4Writer
from canid.analysis.export.table import Table
from canid.ui.cli.exporting.export_tables import Exported
from canid.ui.cli.options import options
from canid.ui.cli.output import output_kinds, outputs
from canid.ui.cli.output.complete_files import CompleteFiles, Part
from canid.ui.cli.output.output_kinds import Kind
from canid.ui.cli.output.outputs import Output

_KINDS = {
    "csv": output_kinds.CSV,
    "parquet": output_kinds.PARQUET,
    "mat": output_kinds.MAT,
    "mf4": output_kinds.MF4,
    "mcap": output_kinds.MCAP,
    "vbo": output_kinds.VBO,
}


class ExportedTable(TypedDict):
    """One table of a file that holds several."""

    name: str
    rows: int
    columns: list[str]


class ExportedFile(TypedDict):
    """An object of --json."""

    path: str
    rows: int  # of all tables
    columns: list[str]
    tables: NotRequired[list[ExportedTable]]


# tables by which CSV and Parquet name their files, where a vehicle file is given
_DRIVE_TABLES = ("samples", "estimates")


def known_outputs(args: argparse.Namespace, prefix: str) -> dict[str, Output]:
    """Files whose names are known before the log is read, by their tables; "": all tables."""
    if args.to == "plotjuggler":
        suffixes = {"plot": f"plotjuggler.{args.data}", "layout": "plotjuggler.xml"}
        kinds = {"plot": _KINDS[args.data], "layout": output_kinds.LAYOUT}
        return {what: _output(args, f"{prefix}.{suffixes[what]}", kinds[what]) for what in suffixes}
    if args.to not in ("csv", "parquet"):
        return {"": _output(args, f"{prefix}.{args.to}", _KINDS[args.to])}
    tables = (
        []
        if args.vehicle is None
        else [t for t in _DRIVE_TABLES if t == "samples" or args.estimates != "none"]
    )
    return {what: _output(args, f"{prefix}.{what}.{args.to}", _KINDS[args.to]) for what in tables}


def _output(args: argparse.Namespace, path: str, kind: Kind) -> Output:
    return Output("-o", path, kind, replace=args.force)


@contextmanager
def started(
    args: argparse.Namespace, files: CompleteFiles, known: Mapping[str, Output]
) -> Iterator[tuple[Part, Mf4Writer] | None]:
    """The writer of .mf4, which is started before the log is read; None: another format."""
    if args.to != "mf4":
        yield None
        return
    with files.writing(known[""]) as part, closing(Mf4Writer(part.path)) as writer:
        yield part, writer


def write(
    args: argparse.Namespace,
    prefix: str,
    files: CompleteFiles,
    known: Mapping[str, Output],
    exported: Exported,
    mf4: tuple[Part, Mf4Writer] | None,
    json: Output | None,
) -> list[ExportedFile]:
    """Write all tables; returns what was written, for --json.

    Raises:
        OutputError: a file cannot be written, or must not be replaced.
        ConfigError: the format cannot hold the tables, or its library is missing.
    """
    if args.to in ("csv", "parquet"):
        named = _table_files(args, prefix, known, exported.tables, json)
        _write_tables(args.to, named, files, exported, args)
        return [_one(output.path, table) for output, table in named]
    if args.to == "plotjuggler":
        return _plotjuggler(args, files, known, exported)
    output = known[""]
    if args.to == "vbo":
        assert exported.drive is not None
        with files.writing(output) as part:
            rows, columns = vbo_file.write(part.file, exported.drive.trace, exported.origin)
        return [{"path": output.path, "rows": rows, "columns": columns}]
    if mf4 is not None:
        mf4[1].write(exported.tables, exported.origin, mf4[0].file)
    else:
        with files.writing(output) as part:
            writer = mat_file.write if args.to == "mat" else mcap_file.write
            writer(part.file, exported.tables, exported.origin)
    return [_several(output.path, exported.tables)]


def _table_files(
    args: argparse.Namespace,
    prefix: str,
    known: Mapping[str, Output],
    tables: Sequence[Table],
    json: Output | None,
) -> list[tuple[Output, Table]]:
    """A file for each table. Signals: only now are their names known."""
    signals = [table for table in tables if table.group == "signals"]
    parts = names.unique([table.title for table in signals], names.file_part)
    made = []
    for part, table in zip(parts, signals, strict=True):
        kind = output_kinds.PARQUET
        if args.to == "csv":
            kind = output_kinds.signals_table(csv_table.header_line(table, args.time))
        made.append((_output(args, f"{prefix}.{part}.{args.to}", kind), table))
    if made:
        outputs.check([json, *known.values(), *(output for output, _ in made)], options.read_by(args))
    return [(known[table.group], table) for table in tables if table.group in known] + made


def _write_tables(
    kind: str,
    named: Sequence[tuple[Output, Table]],
    files: CompleteFiles,
    exported: Exported,
    args: argparse.Namespace,
) -> None:
    if kind == "parquet":
        with parquet_table.opened() as write_parquet:
            for output, table in named:
                with files.writing(output) as part:
                    write_parquet(part.path, table, exported.origin, args.time)
        return
    for output, table in named:
        with files.writing(output) as part:
            if kind == "csv":
                for piece in csv_table.lines(table, exported.origin, args.time):
                    part.file.write(piece)
            else:
                mcap_file.write(part.file, [table], exported.origin)


def _plotjuggler(
    args: argparse.Namespace, files: CompleteFiles, known: Mapping[str, Output], exported: Exported
) -> list[ExportedFile]:
    table = exported.tables[0]
    data = known["plot"]
    _write_tables(args.data, [(data, table)], files, exported, args)
    cells = csv_table.header(table, args.time)
    shift = len(cells) - len(table.fields)
    time = cells[0]
    if args.data == "csv":
        curves = cells[shift:]
    elif args.data == "parquet":
        curves, time = (
            [names.header(field.name) for field in table.fields],
            {"log": "t"}.get(args.time, args.time),
        )
    else:
        curves, time = [f"{mcap_file.topic(table)}/{field.name}" for field in table.fields], ""
    with files.writing(known["layout"]) as part:
        part.file.write(
            plotjuggler_layout.layout(table, curves.__getitem__, Path(data.path), args.data, time)
        )
    return [_one(data.path, table), {"path": known["layout"].path, "rows": 0, "columns": []}]


def _one(path: str, table: Table) -> ExportedFile:
    return {"path": path, "rows": len(table.t), "columns": _columns(table)}


def _columns(table: Table) -> list[str]:
    return ["t", *(field.name for field in table.fields)]


def _several(path: str, tables: Sequence[Table]) -> ExportedFile:
    parts: list[ExportedTable] = [
        {"name": table.title, "rows": len(table.t), "columns": _columns(table)} for table in tables
    ]
    columns = [f"{part['name']}.{name}" for part in parts for name in part["columns"]]
    return {"path": path, "rows": sum(len(table.t) for table in tables), "columns": columns, "tables": parts}
