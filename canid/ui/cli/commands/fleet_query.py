"""`canid fleet query DIR "SQL"`: DuckDB over the tables of a fleet folder; it can read these tables and write nothing."""

from __future__ import annotations

import argparse
import csv
import io
import re
import shutil
import sys
from collections.abc import Iterator
from difflib import get_close_matches
from itertools import compress
from typing import TYPE_CHECKING, Any

from canid.ui.terminal.messages import info, print_line
from canid.ui.terminal.progress import is_terminal
from canid.values import bounded_numbers
from canid.values.errors import DONE, ConfigError, OutputError

if TYPE_CHECKING:
    from canid.analysis.fleet.storage.database import Database

# characters of a line where the output is no terminal
PLAIN_WIDTH = 80
# rows of a table for people; the other formats have all
MAX_ROWS = 100
# rows that are fetched at once
PART_ROWS = 1000
FORMATS = ("table", "csv", "json")
# times that tables may be replaced while a query begins: each takes a run of canid fleet
TRIES = 20


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from canid.analysis.fleet.storage.database import MEMORY_BYTES
    from canid.analysis.fleet.storage.queries import QUERIES

    names = ", ".join(query.name for query in QUERIES)
    parser.add_argument(
        "words",
        metavar="[DIR] QUESTION",
        nargs="*",
        help=f"folder of canid fleet (default: this folder), and SQL or the name of a ready question: {names}",
    )
    parser.add_argument("-o", "--output", metavar="DIR", help="folder of canid fleet, in the place of DIR")
    parser.add_argument(
        "--with",
        dest="own",
        metavar="FILE",
        action="append",
        default=[],
        help="a table of your own, CSV or Parquet, under the name of its file: --with people.csv and then "
        "... FROM drives JOIN people USING (driver); may be repeated",
    )
    parser.add_argument("--format", choices=FORMATS, default="table", help="default: table")
    parser.add_argument("--list", action="store_true", help="list the ready questions, and the tables")
    parser.add_argument(
        "--memory",
        type=bounded_numbers.size,
        default=MEMORY_BYTES,
        metavar="SIZE",
        help="memory that a query may take: 500M, 8G; default: 2G",
    )
    # `DIR --format csv "SELECT ..."`: argparse takes words on both sides of an option as one list in this way only
    parser.parse_args = parser.parse_intermixed_args  # type: ignore[method-assign]


def run(args: argparse.Namespace) -> int:
    """Ask."""
    if args.list:
        return _list()
    from canid.analysis.fleet.storage import mirror
    from canid.analysis.fleet.storage.database import database

    named, question = _asked(args)
    sql = _sql(question)
    folder = mirror.local(named)
    for _ in range(TRIES):
        with database(folder, args.memory, args.own) as tables:
            _pooled(tables, folder, sql)
            tables.close_off()
            try:
                _execute(tables.db, sql)
            except ConfigError:
                if tables.replaced():
                    continue  # a table that lost its name is refused: those that have it now are asked
                raise
            _show(tables.db, args.format)
            return DONE
    raise OutputError(
        f"{named}: runs of canid fleet replace its tables again and again; ask when they have ended"
    )


def _show(db: Any, form: str) -> None:
    names = [column[0] for column in db.description]
    if form == "table":
        _table(db, names)
        return
    write = _csv if form == "csv" else _json
    for line in write(names, _fetched(db)):
        # what a file holds is data: a terminal is not to act on it
        print_line(line) if is_terminal(sys.stdout) else sys.stdout.write(f"{line}\n")


def _asked(args: argparse.Namespace) -> tuple[str, str]:
    """Folder and question."""
    words = list(args.words)
    folder = args.output if args.output is not None else words.pop(0) if len(words) > 1 else "."
    if len(words) != 1:
        raise ConfigError(
            'fleet query: needs a folder and a question: `canid fleet query DIR "SELECT ..."`; '
            "`canid fleet query --list` lists the ready questions"
        )
    return folder, words[0]


def _sql(question: str) -> str:
    from canid.analysis.fleet.storage.queries import QUERIES, named

    ready = named(question.strip())
    if ready is not None:
        return ready.sql
    if re.fullmatch(r"[\w-]*", question.strip()):  # one word is no SQL
        close = get_close_matches(question.strip(), [query.name for query in QUERIES], n=1)
        hint = f'did you mean "{close[0]}"?' if close else "`canid fleet query --list` lists them"
        raise ConfigError(f'fleet query: no ready question "{question}"; {hint}')
    return question


def _pooled(tables: Database, folder: str, sql: str) -> None:
    """Make the tables of drivers and of the population, if they are asked for and are not those of the drives."""
    from canid.analysis.fleet.answers.summary import pool

    if not re.search(r"\b(drivers|population)\b", sql, re.IGNORECASE) or tables.opened.has_pooled():
        return
    info(
        "the drives are pooled first: the tables of drivers and of the population are not those of the drives"
    )
    try:
        pool(tables, folder)
    except OutputError as error:
        info(f"{error}; the answer is right, and the next query pools them again")


def _execute(db: Any, sql: str) -> None:
    import duckdb

    try:
        statements = db.extract_statements(sql)
        # COPY could replace a table of the folder; everything else has nothing to act on
        if len(statements) != 1 or statements[0].type != duckdb.StatementType.SELECT:
            raise ConfigError(
                "fleet query: takes one SELECT (or FROM, WITH, SUMMARIZE, DESCRIBE, SHOW TABLES)"
            )
        db.execute(statements[0])
    except duckdb.Error as error:
        raise ConfigError(f"fleet query: {error_line(str(error))}") from error


def error_line(text: str) -> str:
    r"""DuckDB's error and its hint, without the picture of the statement.

    Example:
        >>> error_line('Binder Error: column "k" not found!\nCandidate bindings: "K"\n\nLINE 1: select k\n               ^')
        'Binder Error: column "k" not found! Candidate bindings: "K" (line 1)'
    """
    said, _, picture = text.partition("\nLINE ")
    at = f" (line {picture.partition(':')[0]})" if picture else ""
    hint = ""
    before, asks, _ = said.partition("\n\nPlease try installing")
    if asks:
        said, hint = before, "; canid loads no extension of DuckDB"
    elif "Out of Memory" in said:
        said, hint = said.partition("\n")[0], "; allow more by --memory, or ask for less"
    elif "does not exist" in said and "Table with name" in said:
        from canid.analysis.fleet.storage.database import VIEWS

        hint = f"; the tables are {', '.join(VIEWS)}"
    return " ".join(said.split()) + at + hint


def _fetched(db: Any) -> Iterator[tuple[Any, ...]]:
    import duckdb

    try:
        while part := db.fetchmany(PART_ROWS):
            yield from part
    except duckdb.Error as error:
        raise ConfigError(f"fleet query: {error_line(str(error))}") from error


def _table(db: Any, names: list[str]) -> None:
    from canid.ui.views.query_table import text

    rows: list[tuple[Any, ...]] = []
    more = False
    for row in _fetched(db):
        if len(rows) == MAX_ROWS:
            more = True
            break
        rows.append(row)
    names, rows, empty = _without_empty(names, rows)
    width = shutil.get_terminal_size().columns if is_terminal(sys.stdout) else PLAIN_WIDTH
    for line in text(names, rows, width):
        print_line(line)
    if not rows:
        info("no rows")
    if empty:
        info(f"without any value, and left out: {', '.join(empty)}")
    if more:
        info(f"the first {MAX_ROWS} rows; --format csv has all of them, LIMIT and OFFSET others")


def _without_empty(
    names: list[str], rows: list[tuple[Any, ...]]
) -> tuple[list[str], list[tuple[Any, ...]], list[str]]:
    """Leave out the columns without any value, unless no other is left.

    >>> _without_empty(["a", "b"], [(1, None), (2, None)])
    (['a'], [(1,), (2,)], ['b'])
    """
    has = [any(row[k] is not None for row in rows) for k in range(len(names))]
    if not any(has):
        return names, rows, []
    left = [tuple(compress(row, has)) for row in rows]
    return [*compress(names, has)], left, [name for name, some in zip(names, has, strict=True) if not some]


def _csv(names: list[str], rows: Iterator[tuple[Any, ...]]) -> Iterator[str]:
    from canid.values.text.json_values import line, plain

    yield _csv_line(names)
    for values in rows:
        cells = ("" if v is None else line(plain(v)) if isinstance(v, list | dict) else v for v in values)
        yield _csv_line(cells)


def _csv_line(cells: Any) -> str:
    into = io.StringIO()
    csv.writer(into, lineterminator="\n").writerow(cells)
    return into.getvalue().removesuffix("\n")


def _json(names: list[str], rows: Iterator[tuple[Any, ...]]) -> Iterator[str]:
    import json

    from canid.values.text.json_values import plain

    before = "["
    for values in rows:
        item = dict(zip(names, map(plain, values), strict=True))
        yield before + json.dumps(item, ensure_ascii=False, allow_nan=False, default=str)
        before = ","
    yield "[]" if before == "[" else "]"


def _list() -> int:
    from canid.analysis.fleet.storage.database import VIEWS
    from canid.analysis.fleet.storage.queries import QUERIES

    wide = max(len(query.name) for query in QUERIES)
    for query in QUERIES:
        print_line(f"{query.name.ljust(wide)}  {query.what}")
    info(f'tables: {", ".join(VIEWS)}; `canid fleet query DIR "DESCRIBE drives"` lists columns')
    return DONE
