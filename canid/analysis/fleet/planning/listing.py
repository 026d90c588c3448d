"""The logs that LOGS name: files, folders, patterns, lists and URLs, listed without reading any of them.

A folder costs one `os.scandir` of each folder below it. Links to folders are followed last, and no folder is listed
twice, so loops of links end.
"""

from __future__ import annotations

import os
import stat
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple
from urllib.parse import unquote

from canid.analysis.fleet.planning import address, globs
from canid.io.logs import formats
from canid.signals.vehicle.file_bytes import read as read_bytes
from canid.signals.vehicle.quoting import brief
from canid.values.errors import ConfigError, one_line

# a list of 100,000 paths of 300 bytes
MAX_LIST_BYTES = 64_000_000
# the file by which a folder of canid fleet is known; such folders hold no logs
MARK = "fleet.json"
# size of a log that was named but is not there
MISSING = -1


class Listed(NamedTuple):
    """One log."""

    log: str  # absolute path, or URL
    root: str  # the folder from which folder names and patterns count
    size: int  # bytes; `MISSING`: there is no such file
    modified_ns: int  # ns since 1970; 0: not known
    problem: str = ""  # why a folder could not be listed

    @property
    def relative(self) -> str:
        """The path below the root, with slashes."""
        path = below(self.log, self.root)
        # the names of a web server are encoded (RFC 3986, sec. 2.1), those of other storage are as they are
        return unquote(path) if address.scheme_of(self.log) in address.WEB else path


def below(path: str, root: str) -> str:
    """A path below a root.

    Example:
        >>> below("/data/a/b.blf", "/data"), below("/b.blf", "/"), below("/other/b.blf", "/data")
        ('a/b.blf', 'b.blf', 'b.blf')
    """
    start = root if root.endswith("/") else f"{root}/"
    return path[len(start) :] if path.startswith(start) else path.rpartition("/")[2]


def is_url(words: str) -> bool:
    """Whether what a user names is an address in storage: what exists as a file is a file, whatever its name holds.

    Raises:
        ConfigError: it has the form of an address, and canid opens none of its kind.

    Example:
        >>> is_url("s3://bucket/a.blf"), is_url("a.blf"), is_url("a::b.blf")
        (True, False, False)
    """
    return not os.path.lexists(words) and address.is_address(words)


def listed(words: Sequence[str], skip: Sequence[str] = ()) -> list[Listed]:
    """List the logs; each path once, in the order of the words and of names.

    Args:
        words: of the command line: a file, a folder, a pattern, `@list.txt` or a URL.
        skip: folders that are not entered, such as that of the results.

    Returns:
        the logs. Files that are named together have as root the folder that they have in common.

    Raises:
        ConfigError: a word names nothing, or a folder holds no log.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> root = Path(tempfile.mkdtemp())
        >>> (root / "anna").mkdir()
        >>> _ = [(root / "anna" / name).write_bytes(b"0") for name in ("a.blf", ".hidden.blf", "notes.txt")]
        >>> [one.relative for one in listed([str(root)])]
        ['anna/a.blf']
    """
    skipped = frozenset(filter(None, map(_identity, skip)))
    by_path: dict[str, Listed] = {}
    files: list[Listed] = []
    for word in words:
        if word.startswith("@") and not os.path.lexists(word):
            _add(by_path, _of_list(word[1:], skipped))
        elif is_url(word):
            from canid.analysis.fleet.planning import remote

            # results below the logs' own URL, as in a folder
            results = tuple(f"{folder.rstrip('/')}/" for folder in skip if is_url(folder))
            _add(by_path, [file for file in remote.listed(word) if not file.log.startswith(results)])
        elif os.path.isdir(word):
            _add(
                by_path,
                _some(walked(word, skipped), f"{word}: holds no log ({formats.described()}, or a table)"),
            )
        elif os.path.lexists(word):
            files.append(named(word))
            by_path.setdefault(files[-1].log, files[-1])
        elif globs.is_pattern(word):
            _add(by_path, _some(matched(word, skipped), f"{word}: matches no log"))
        else:
            raise ConfigError(f"fleet: {brief(word)} is no file, folder, pattern, @list or URL")
    if files:
        root = os.path.commonpath([file.root for file in files])
        for file in files:
            if by_path[file.log] is file:
                by_path[file.log] = file._replace(root=root)
    return list(by_path.values())


def _add(by_path: dict[str, Listed], more: Sequence[Listed]) -> None:
    for file in more:
        by_path.setdefault(file.log, file)


def _some(more: Iterator[Listed], none: str) -> list[Listed]:
    out = list(more)
    if not out:
        raise ConfigError(none)
    return out


def named(path: str, root: str | None = None) -> Listed:
    """A file that is named itself, of any suffix; what is wrong with it shows when it is read.

    Example:
        >>> named("/no such file.blf").size
        -1
    """
    full = os.path.abspath(path)
    try:
        status = os.stat(full)
    except (OSError, ValueError):
        return Listed(full, root or os.path.dirname(full), MISSING, 0)
    return Listed(full, root or os.path.dirname(full), status.st_size, status.st_mtime_ns)


def is_log(name: str) -> bool:
    """Whether a name in a folder is that of a log or a table.

    Example:
        >>> is_log("a.BLF"), is_log("a.asc.gz"), is_log("a.parquet"), is_log(".a.blf"), is_log("a.dbc")
        (True, True, True, False, False)
    """
    if name.startswith("."):
        return False
    at = name.rfind(".")
    if at < 0:
        return False
    last = name[at:].lower()
    return last in _SUFFIXES or (last == ".gz" and formats.log_suffix(name) in _SUFFIXES)


# of logs and of tables; .csv is among the log formats, and a .txt of a folder is mostly no table
_SUFFIXES = frozenset((*formats.read_suffixes(), *formats.TABLES_ALONE, ".tsv", ".tsv.gz"))


def walked(
    folder: str,
    skipped: frozenset[tuple[int, int]] = frozenset(),
    *,
    chosen: Callable[[str], bool] = lambda _: True,
    entered: Callable[[str], bool] = lambda _: True,
) -> Iterator[Listed]:
    """The logs in a folder and below it, by name; hidden names and folders of canid fleet are left out.

    Args:
        folder: where to begin.
        skipped: device and inode of folders that are not entered.
        chosen: of a relative path: whether the log is taken.
        entered: of a relative path: whether the folder is.
    """
    root = os.path.abspath(folder)
    seen = set(skipped)
    pending, links = [root], deque[str]()
    while pending or links:
        # links last: a folder that has a place of its own is listed there
        here = pending.pop() if pending else links.popleft()
        identity = _identity(here)
        if identity is not None and identity in seen:
            continue
        if identity is not None:
            seen.add(identity)
        try:
            with os.scandir(here) as entries:
                names = sorted((entry for entry in entries if not entry.name.startswith(".")), key=_name)
        except OSError as error:
            yield Listed(here, root, MISSING, 0, f"cannot be listed ({error.strerror})")
            continue
        if any(entry.name == MARK for entry in names):
            continue
        folders = []
        for entry in names:
            relative = below(entry.path, root)
            if _is_folder(entry):
                if entered(relative):
                    links.append(entry.path) if entry.is_symlink() else folders.append(entry.path)
            elif is_log(entry.name) and chosen(relative):
                file = _stated(entry, root)
                if file is not None:
                    yield file
        pending += reversed(folders)


def _name(entry: os.DirEntry[str]) -> str:
    return entry.name


def _identity(folder: str) -> tuple[int, int] | None:
    """Device and inode; None: unknown, as on network file systems without inode numbers."""
    try:
        status = os.stat(folder)
    except OSError:
        return None
    return (status.st_dev, status.st_ino) if status.st_ino else None


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:
        return False


def _stated(entry: os.DirEntry[str], root: str) -> Listed | None:
    try:
        status = entry.stat()
    except OSError:
        return Listed(entry.path, root, MISSING, 0)
    # a pipe would be waited for
    return (
        Listed(entry.path, root, status.st_size, status.st_mtime_ns) if stat.S_ISREG(status.st_mode) else None
    )


def matched(pattern: str, skipped: frozenset[tuple[int, int]] = frozenset()) -> Iterator[Listed]:
    """The logs that a pattern matches; only folders that can hold some are listed.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> root = Path(tempfile.mkdtemp())
        >>> _ = [(root / name).write_bytes(b"0") for name in ("a1.blf", "b1.blf")]
        >>> [one.relative for one in matched(f"{root}/a*.blf")]
        ['a1.blf']
    """
    folder, names = globs.parted(pattern)
    if not names or not os.path.isdir(folder or "."):
        return
    whole = globs.of_names(names)
    each = [None if name == "**" else globs.of_name(name) for name in names]

    def entered(relative: str) -> bool:
        for depth, name in enumerate(relative.split("/")):
            if depth >= len(each) - 1:
                return False
            expression = each[depth]
            if expression is None:
                return True
            if not expression.fullmatch(name):
                return False
        return True

    # ** at the end means all below
    last = entered if names[-1] != "**" else lambda _: True
    yield from walked(folder or ".", skipped, chosen=lambda path: bool(whole.fullmatch(path)), entered=last)


def _of_list(path: str, skipped: frozenset[tuple[int, int]]) -> list[Listed]:
    """The logs of a list file: a path, pattern or URL a line, relative to the list; # begins a comment."""
    from pathlib import Path

    data = read_bytes(Path(path), MAX_LIST_BYTES, "list of logs")
    folder = os.path.dirname(os.path.abspath(path))
    out: list[Listed] = []
    # not splitlines: a name may hold what Unicode counts as the end of a line
    for line in os.fsdecode(data.removeprefix(b"\xef\xbb\xbf")).split("\n"):
        word = line.strip()
        if not word or word.startswith("#"):
            continue
        # a line that names nothing is one failed log, not the end of a run over all others
        try:
            out += _of_line(word, folder, skipped)
        except ConfigError as error:
            out.append(Listed(word, folder, MISSING, 0, one_line(error)))
    if not out:
        raise ConfigError(f"{path}: names no log; write one path a line")
    return out


def _of_line(word: str, folder: str, skipped: frozenset[tuple[int, int]]) -> list[Listed]:
    """The logs of one line of a list in a folder. Raises ConfigError where it names none."""
    full = os.path.join(folder, word)
    if os.path.isdir(full):
        logs = _some(walked(full, skipped), f"{brief(word)}: holds no log")
        return [file._replace(root=folder) for file in logs]
    if not os.path.lexists(full):
        if address.is_address(word):
            from canid.analysis.fleet.planning import remote

            return remote.listed(word)
        if globs.is_pattern(word):
            return _some(matched(full, skipped), f"{brief(word)}: matches no log")
    file = named(full)
    return [file._replace(root=folder) if file.log.startswith(f"{folder}/") else file]
