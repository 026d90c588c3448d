"""Why a log has no results: which exception means which `Failure`."""

from __future__ import annotations

import gzip

from canid.analysis.fleet.job import Failure
from canid.values.errors import CanidError, one_line

# the reason of `Failure.MEMORY`
NO_MEMORY = "it takes more memory than it may; --memory allows more"
# of duckdb, which is optional
_DUCKDB_MEMORY_ERROR = "OutOfMemoryException"


class Failed(Exception):  # noqa: N818 (it is no error in canid)
    """A log has no results. `str` is the reason, one line without the log's name."""

    def __init__(self, failure: Failure, reason: str):
        """Note why."""
        super().__init__(reason)
        self.failure = failure


def failure_of(error: BaseException, otherwise: Failure) -> Failure:
    """Which failure an exception means; an `OSError` behind a line for the user is one of disk or network.

    Args:
        error: of any kind.
        otherwise: of an exception that says nothing of the kind.

    Example:
        >>> failure_of(FileNotFoundError(), Failure.ERROR).value, failure_of(ValueError(), Failure.ERROR).value
        ('missing', 'error')
    """
    if isinstance(error, Failed):
        return error.failure
    cause = error.__cause__ or error.__context__ if isinstance(error, CanidError) else error
    if isinstance(cause, MemoryError) or type(cause).__name__ == _DUCKDB_MEMORY_ERROR:
        return Failure.MEMORY
    if isinstance(cause, FileNotFoundError | NotADirectoryError):
        return Failure.MISSING
    if isinstance(cause, PermissionError):
        return Failure.PERMISSION
    # a package is missing
    if isinstance(cause, ImportError):
        return Failure.UNREADABLE
    if isinstance(cause, OSError) and not isinstance(cause, gzip.BadGzipFile):
        return Failure.UNREADABLE
    return otherwise


def reason_of(error: BaseException, path: str, log: str) -> str:
    """The reason in one line: the line for the user, or the exception's type and text; without the log's name at its begin.

    Args:
        error: of any kind.
        path: under which the log was read.
        log: its name.

    Example:
        >>> reason_of(CanidError("/tmp/x.blf: is spoilt"), "/tmp/x.blf", "s3://b/x.blf"), reason_of(KeyError(1), "", "")
        ('is spoilt', 'KeyError: 1')
    """
    text = one_line(error)
    if isinstance(error, OSError) and error.strerror:
        text = error.strerror
    elif not isinstance(error, CanidError | Failed):
        name = type(error).__name__
        text = name if text == name else f"{name}: {text}"
    if path:
        text = text.replace(path, log)
    return text.removeprefix(f"{log}: ").removeprefix(f"{log} ") if log else text
