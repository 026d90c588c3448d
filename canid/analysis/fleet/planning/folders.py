"""Driver and car of a log from the names of its folders."""

from __future__ import annotations

import re
from typing import NamedTuple

from canid.analysis.fleet.planning import globs
from canid.signals.vehicle.schema import did_you_mean
from canid.values.errors import ConfigError

FIELDS = ("driver", "car", "group")
_FIELD = re.compile(r"\{([^{}]*)\}")


class Whose(NamedTuple):
    """Who drove what; "": not known."""

    driver: str = ""
    car: str = ""
    group: str = ""


class FolderPattern(NamedTuple):
    """A pattern of folder names, such as {car}/{driver}."""

    text: str
    expression: re.Pattern[str]
    depth: int  # folders


def pattern(text: str) -> FolderPattern:
    """Compile a pattern of folder names below the root: {driver}, {car}, {group}, and * for any name.

    Raises:
        ConfigError: an unknown field, one that stands twice, or no {driver}.

    Example:
        >>> whose("tesla/2019/anna/a.blf", pattern("{car}/*/{driver}"))
        Whose(driver='anna', car='tesla', group='')
    """
    names = text.strip("/").split("/")
    fields = _FIELD.findall(text)
    for field in fields:
        if field not in FIELDS:
            hint = did_you_mean(field, FIELDS)
            raise ConfigError(f"fleet: --folders {text}: unknown field {{{field}}}{hint}")
        if fields.count(field) > 1:
            raise ConfigError(f"fleet: --folders {text}: {{{field}}} stands twice")
    if "driver" not in fields:
        raise ConfigError(f"fleet: --folders {text}: {{driver}} is missing, as in {{car}}/{{driver}}")
    return FolderPattern(text, re.compile("/".join(map(_of_name, names)), re.DOTALL), len(names))


def _of_name(name: str) -> str:
    parts = _FIELD.split(name)
    out = [
        globs.of_name(part).pattern if i % 2 == 0 else f"(?P<{part}>[^/]+?)" for i, part in enumerate(parts)
    ]
    return "".join(out)


def whose(relative: str, by: FolderPattern | None = None) -> Whose | None:
    """Who drove a log.

    Args:
        relative: its path below the root.
        by: the pattern; None: one folder is the driver, of two the first is the car; a log without folders has its
            name as the driver.

    Returns:
        None: its folders do not match.

    Example:
        >>> whose("anna/a.blf").driver, whose("tesla/anna/2019/a.blf"), whose("a.blf").driver
        ('anna', Whose(driver='anna', car='tesla', group=''), 'a')
        >>> whose("a.blf", pattern("{driver}")) is None
        True
    """
    *folders, name = relative.split("/")
    if by is None:
        if not folders:
            return Whose(driver=stem(name))
        return Whose(driver=folders[0]) if len(folders) == 1 else Whose(driver=folders[1], car=folders[0])
    match = by.expression.fullmatch("/".join(folders[: by.depth])) if len(folders) >= by.depth else None
    return None if match is None else Whose(**{key: value or "" for key, value in match.groupdict().items()})


def stem(name: str) -> str:
    """A file's name without the suffixes of its format.

    Example:
        >>> stem("a.1.blf"), stem("a.asc.gz")
        ('a.1', 'a')
    """
    name = name[:-3] if name.lower().endswith(".gz") else name
    return name.rpartition(".")[0] or name
