"""Exceptions for the user, with a one-line message and an exit code.

    CanidError                 the line is for the user: what, where, what to do next
      ConfigError       2      usage, vehicle file, DBC
      BusError          3      no bus, or bus lost
      LogError          2      what was given as a log is none: a folder, unreadable, another kind of file, without frames
        DamagedLogError 4      a log that is damaged so much that nothing of it can be used
      OutputError       5      could not write

Wrong calls raise ValueError; insufficient data are a Status, never an exception.
A log that is damaged but readable in part is no exception either: readers report `Damage`, the command ends with DAMAGED.
"""

from collections.abc import Iterator
from contextlib import contextmanager

DONE, CHECK_FAILED, USAGE, NO_BUS, DAMAGED, NOT_WRITTEN = range(6)  # DESIGN: exit codes


class CanidError(Exception):
    """Base of all errors that the user, not the programmer, can correct. `str(error)` is one line."""

    exit_code = 1


class ConfigError(CanidError):
    r"""Usage or configuration: a vehicle file, a DBC, an argument. Several mistakes are several lines.

    Example:
        >>> str(ConfigError("a.toml: one mistake", "a.toml: another"))
        'a.toml: one mistake\na.toml: another'
    """

    exit_code = USAGE

    def __init__(self, *mistakes: str):
        """Note the mistakes, a line each."""
        super().__init__("\n".join(mistakes))
        self.mistakes = mistakes


class BusError(CanidError):
    """No bus, or the bus was lost."""

    exit_code = NO_BUS


class LogError(CanidError):
    """An input that is no log or table, or holds nothing that could be used."""

    exit_code = USAGE


class DamagedLogError(LogError):
    """A log or table, by its signature or its header, of which damage has left nothing that could be used."""

    exit_code = DAMAGED


class OutputError(CanidError):
    """A result that could not be written. `errno`: the system's number of the error; 0: it was none of the system's."""

    exit_code = NOT_WRITTEN

    def __init__(self, says: str, errno: int | None = None):
        """`says`: the line for the user."""
        super().__init__(says)
        self.errno = errno or 0


@contextmanager
def system_errors(place: object, what: str = "written") -> Iterator[None]:
    """Raise an OSError as OutputError: `PLACE: cannot be WHAT (REASON)`, of the file where the system names one.

    >>> with system_errors("fleet/drives"):
    ...     raise OSError(28, "No space left on device")
    Traceback (most recent call last):
    canid.values.errors.OutputError: fleet/drives: cannot be written (No space left on device)
    """
    try:
        yield
    except OSError as error:
        raise OutputError(f"{error.filename or place}: cannot be {what} ({error.strerror})") from None


def out_of_memory(error: BaseException) -> bool:
    """Whether an exception, or one that it came from, says that there was no memory for an object, a thread or a module.

    >>> out_of_memory(MemoryError()), out_of_memory(RuntimeError("can't start new thread")), out_of_memory(KeyError("x"))
    (True, True, False)
    """
    said = str(error).lower()
    signs = (
        "can't start new thread",
        "failed to map segment",
        "cannot allocate memory",
        "cannot map zero-fill",
        # SystemError, of an exception that had no memory to be raised
        "without setting an exception",
        "without exception set",
    )
    cause = error.__cause__ or error.__context__
    return (
        isinstance(error, MemoryError)
        or any(sign in said for sign in signs)
        or (cause is not None and out_of_memory(cause))
    )


def one_line(error: BaseException) -> str:
    r"""The text of any exception on one line; its type where it has none.

    >>> one_line(ValueError("two\nlines")), one_line(KeyError())
    ('two lines', 'KeyError')
    """
    return " ".join(str(error).split()) or type(error).__name__
