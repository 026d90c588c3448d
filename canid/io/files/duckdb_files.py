"""DuckDB without extensions, and its files: handed to it by their descriptors, so that no name means anything.

In a path DuckDB takes `name=value` for a column and replaces the file's own, and *, ? and [ for a pattern, with which it
goes through the names next to the file; nothing escapes a backslash. A descriptor (`/proc/self/fd/7`) has no such name, and
stays the same file while another one takes its place. Where the system has none, the path is absolute, which is never an
address, and escaped.

Nothing else in canid connects to DuckDB or hands a file to it (`tests/files/test_duckdb_in_one_place.py`).
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
import stat
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from canid.io.files import opening
from canid.values.errors import ConfigError

# where Linux names the descriptors of a process; a test sets another one, as of a system without it
DESCRIPTORS = "/proc/self/fd"
# no columns out of the names of folders; where a descriptor has no name, the path is one
_PLAIN = "hive_partitioning = false"
# how a file of text is packed, by its suffix: a descriptor has none
_PACKED = {".gz": "gzip", ".zst": "zstd"}
# What DuckDB has not built in (http://, other programs' files), and it would fetch code from a server for, or load what it
# finds in the home folder: canid's own SQL needs none.
_NO_EXTENSIONS = {"autoinstall_known_extensions": False, "autoload_known_extensions": False}


class OpenFile(NamedTuple):
    """A regular file that is open for reading."""

    fd: int
    path: Path
    name: str  # by which DuckDB opens it

    def has_name(self) -> bool:
        """Whether its path still leads to it."""
        return opening.has_name(self.fd, self.path)

    def sha256(self) -> str:
        """The hash of its bytes. Raises OSError."""
        with os.fdopen(os.dup(self.fd), "rb") as file:
            file.seek(0)
            return hashlib.file_digest(file, "sha256").hexdigest()


class Files:
    """Files that are open until `close`; DuckDB has to be done with them by then."""

    def __init__(self) -> None:
        """None yet."""
        self._fds: list[int] = []

    def add(self, path: str | Path) -> OpenFile:
        """Open a file to be read, through a link too.

        Raises:
            OSError: it cannot be opened, or is no regular file.
            ConfigError: this system has no descriptors with names, and DuckDB cannot open a file of this name.
        """
        path = Path(path)
        fd = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        self._fds.append(fd)
        if not stat.S_ISREG(os.fstat(fd).st_mode):
            raise OSError(errno.EINVAL, "not a regular file", str(path))
        return OpenFile(fd, path, _descriptor(fd) or _escaped(path))

    def close(self) -> None:
        """Close them."""
        while self._fds:
            os.close(self._fds.pop())


def connected(needed_by: str, extra: str, **settings: str | int | bool) -> Any:
    """A connection to a new database in memory (`duckdb.DuckDBPyConnection`), which loads no extension.

    Args:
        needed_by: what cannot be done without DuckDB, for the error.
        extra: of canid, which installs it.
        settings: further ones of DuckDB. What does not fit into its memory goes to the folder of temporary files: its own
            choice is the current folder.

    Raises:
        ConfigError: DuckDB is not installed.

    Example:
        >>> with connected("Parquet", "export", threads=1) as db:
        ...     db.execute("SELECT current_setting('threads'), current_setting('autoload_known_extensions')").fetchone()
        (1, False)
    """
    try:
        import duckdb
    except ImportError as error:
        raise ConfigError(f"{needed_by} needs duckdb: pip install 'canid[{extra}]'") from error
    # made when it is needed, and removed by DuckDB
    spilled = os.path.join(tempfile.gettempdir(), f"canid-{secrets.token_hex(8)}")
    return duckdb.connect(config={"temp_directory": spilled, **settings, **_NO_EXTENSIONS})


@contextmanager
def opened() -> Iterator[Files]:
    r"""Files that are closed at the end.

    Example:
        >>> import tempfile
        >>> path = Path(tempfile.mkdtemp()) / "driver=zoe" / "[1].csv"
        >>> path.parent.mkdir()
        >>> path.write_text("driver,K\nanna,0.5\n")
        18
        >>> with opened() as files, connected("Parquet", "export") as db:
        ...     db.execute(f"SELECT * FROM {csv(files.add(path))}").fetchall()
        [('anna', 0.5)]
    """
    files = Files()
    try:
        yield files
    finally:
        files.close()


def quoted(text: str | Path) -> str:
    r"""A text as SQL has it; bytes of a name that are no text, and NUL, are made visible.

    Example:
        >>> quoted("it's"), quoted("a\udcff")
        ("'it''s'", "'a\\udcff'")
    """
    plain = str(text).encode("utf-8", "backslashreplace").decode().replace("\0", "\\0")
    return "'" + plain.replace("'", "''") + "'"


def parquet(files: Sequence[OpenFile], *, union_by_name: bool = False) -> str:
    """SQL for the rows of Parquet files; at least one."""
    union = ", union_by_name = true" if union_by_name else ""
    return f"read_parquet({_list(files)}, {_PLAIN}{union})"


def csv(file: OpenFile) -> str:
    """SQL for the rows of a CSV file, which may be packed."""
    packed = _PACKED.get(file.path.suffix.lower(), "none")
    return f"read_csv({_list([file])}, {_PLAIN}, compression = '{packed}')"


def json_lines(file: OpenFile, types: Mapping[str, str], max_row_bytes: int) -> str:
    """SQL for the rows of a file with a JSON object a line; DuckDB takes twice the bytes of the largest row at once."""
    columns = ", ".join(f"{quoted(name)}: {quoted(kind)}" for name, kind in types.items())
    return (
        f"read_json({_list([file])}, {_PLAIN}, format = 'newline_delimited', columns = {{{columns}}}, "
        f"maximum_object_size = {max_row_bytes}, compression = 'none')"
    )


def parquet_sizes(files: Sequence[OpenFile]) -> str:
    """SQL for what Parquet files state of their columns: `path_in_schema`, `total_uncompressed_size`, ..."""
    return f"parquet_metadata({_list(files)})"


def parquet_notes(files: Sequence[OpenFile]) -> str:
    """SQL for the texts that Parquet files carry: `file_name` (`OpenFile.name`), `key`, `value` (bytes)."""
    return f"parquet_kv_metadata({_list(files)})"


def allow_only(connection: Any, files: Sequence[OpenFile]) -> None:
    """Let a connection open these files and no others from now on, and let nobody change that.

    DuckDB 2 refuses a file then whose path leads to another one by now.
    """
    connection.execute(f"SET allowed_paths = {_list(files)}")
    connection.execute("SET enable_external_access = false")
    connection.execute("SET lock_configuration = true")


def write_parquet(
    connection: Any,
    rows: str,
    fd: int,
    path: str | Path,
    *,
    notes: Mapping[str, str] | None = None,
    row_group_bytes: int = 0,
) -> None:
    """Write rows as Parquet into an open file, which is empty.

    Args:
        connection: of DuckDB.
        rows: a table's name, or a query in parentheses.
        fd: of the file, open for writing.
        path: of the file.
        notes: texts that the file carries.
        row_group_bytes: see DuckDB's ROW_GROUP_SIZE_BYTES; 0: its default.

    Raises:
        duckdb.Error: the query fails, or the file cannot be written.
    """
    pairs = ", ".join(f"{quoted(key)}: {quoted(text)}" for key, text in (notes or {}).items())
    options = [
        "FORMAT parquet",
        "COMPRESSION zstd",
        # its temporary file would be next to the descriptor
        "USE_TMP_FILE false",
        *([f"ROW_GROUP_SIZE_BYTES {row_group_bytes}"] if row_group_bytes else []),
        *([f"KV_METADATA {{{pairs}}}"] if pairs else []),
    ]
    into = quoted(_descriptor(fd) or _text(Path(path)))
    connection.execute(f"COPY {rows} TO {into} ({', '.join(options)})")


def _list(files: Sequence[OpenFile]) -> str:
    return f"[{', '.join(quoted(file.name) for file in files)}]"


def _descriptor(fd: int) -> str:
    """The name of a descriptor; "": this system gives it none."""
    name = f"{DESCRIPTORS}/{fd}"
    return name if os.path.exists(name) else ""


def _text(path: Path) -> str:
    """A path as text. Raises ConfigError where it is none."""
    full = os.path.abspath(path)
    if full.encode("utf-8", "ignore").decode() != full:  # bytes of a file name that are no text
        raise ConfigError(f"{str(path)!r}: DuckDB cannot open a file of this name; rename it, or its folder")
    return full


def _escaped(path: Path) -> str:
    r"""A path as DuckDB takes it for itself.

    >>> _escaped(Path("/a[1]/*.csv"))
    '/a[[]1]/[*].csv'
    """
    full = _text(path)
    escaped = re.sub(r"([*?[])", r"[\1]", full)
    if escaped != full and "\\" in full and os.sep != "\\":
        raise ConfigError(f"{str(path)!r}: DuckDB cannot open a file of this name; rename it, or its folder")
    return escaped
