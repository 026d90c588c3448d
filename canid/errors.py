"""Exceptions for the user, with a one-line message and an exit code.

    CanidError                 the line is for the user: what, where, what to do next
      ConfigError       2      usage, vehicle file, DBC
      BusError          3      no bus, or bus lost
      LogError          4      a log that cannot be read at all
      OutputError       5      could not write

Wrong calls raise ValueError; insufficient data are a Status, never an exception.
A log that is damaged but readable in part is no exception either: readers report `Damage`, the command ends with DAMAGED.
"""

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
    """An input that cannot be read at all."""

    exit_code = DAMAGED


class OutputError(CanidError):
    """A result that could not be written."""

    exit_code = NOT_WRITTEN


def one_line(error: BaseException) -> str:
    r"""The text of any exception on one line; its type where it has none.

    >>> one_line(ValueError("two\nlines")), one_line(KeyError())
    ('two lines', 'KeyError')
    """
    return " ".join(str(error).split()) or type(error).__name__
