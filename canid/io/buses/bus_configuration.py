"""python-can's configuration of a bus: where each parameter comes from, and which ones are refused.

The sources and their order are those of `can.util.load_config` (python-can 4.6): the call itself, `can.rc`, the
environment (CAN_CONFIG, CAN_INTERFACE, CAN_CHANNEL, CAN_BITRATE), then the files of `can.util.CONFIG_FILES`, the later
of which take precedence. canid merges them itself, so that it can report where a parameter comes from; python-can then
casts and validates the result.
"""

from __future__ import annotations

import configparser
import os
from collections.abc import Mapping
from typing import Any, NamedTuple

from canid.io.buses import python_can
from canid.values.errors import BusError, ConfigError, one_line

# Parameters that name a library to load: usb2can and neovi. In a file or the environment they are refused, and on the
# command line they need an absolute path, because a bare name is searched in the current folder too.
_LIBRARIES = ("dll", "override_library_name")
# pyserial's spy:// writes everything that passes into a file of any name
_WRITING_URLS = ("spy",)


class BusConfiguration(NamedTuple):
    """The parameters of one bus."""

    parameters: dict[str, Any]  # for can.Bus
    given: frozenset[str]  # the names that the call itself gave
    sources: tuple[
        str, ...
    ]  # the files and environment variables that gave the others: "CAN_CONFIG (bitrate)"

    @property
    def interface(self) -> str:
        """The interface's name."""
        return str(self.parameters.get("interface", ""))

    @property
    def channel(self) -> str:
        """The channel's name; "" where none is given."""
        return str(self.parameters.get("channel", ""))

    @property
    def name(self) -> str:
        """Both."""
        return f"{self.interface} {self.channel}".strip()


def configure(config: Mapping[str, Any], *, given_only: bool = False) -> BusConfiguration:
    """Merge python-can's sources of configuration.

    `given_only`: use nothing but `config`. Raises BusError where no interface comes out, ConfigError for a
    parameter that canid refuses.

    >>> configure({"interface": "virtual", "channel": "a"}).name
    'virtual a'
    """
    given = {key: value for key, value in config.items() if key != "config_context"}
    try:
        read = [] if given_only else _sources(config.get("config_context"))
        merged, used = dict(given), []
        if "bustype" in merged:  # python-can's former name for it
            merged.setdefault("interface", merged["bustype"])
            del merged["bustype"]
        for name, parameters in read:
            new = [key for key in parameters if key not in merged]
            merged |= {key: parameters[key] for key in new}
            if new:
                used.append(f"{name} ({', '.join(sorted(map(_printable, new)))})")
            _refuse_libraries({key: parameters[key] for key in new}, name)
        parameters_used = {**_cast(merged)}
    except (BusError, ConfigError):
        raise
    except Exception as error:  # of any kind, from files that the user wrote
        # python-can's message where no source names an interface
        why = "none is named" if '"None"' in str(error) else one_line(error)
        raise BusError(
            f"no bus: {why}; name one with -i INTERFACE -c CHANNEL, in can.conf or CAN_INTERFACE"
        ) from None
    # load_config adds parameters of environment and files
    known = set(merged) | ({"timing"} if _holds_timing(merged) else set())
    parameters_used = {
        key: value for key, value in parameters_used.items() if key in known and value is not None
    }
    _refuse_libraries({key: parameters_used[key] for key in parameters_used if key in given}, "")
    _refuse_writing(parameters_used.get("channel"))
    return BusConfiguration(parameters_used, frozenset(given), tuple(used))


def _sources(context: str | None) -> list[tuple[str, dict[str, Any]]]:
    """Every source with parameters, the one that takes precedence first."""
    can = python_can.load()
    out: list[tuple[str, dict[str, Any]]] = []
    if can.rc:
        out.append(("can.rc", dict(can.rc)))
    for each in [context, None] if context else [None]:
        suffix = f"_{each}" if each else ""
        parameters = can.util.load_environment_config(each)
        names = [
            f"CAN_{word}{suffix}"
            for word in ("CONFIG", "INTERFACE", "CHANNEL", "BITRATE")
            if os.environ.get(f"CAN_{word}{suffix}")
        ]
        if parameters:
            out.append((" and ".join(names), dict(parameters)))
    files = [os.path.expanduser(path) for path in can.util.CONFIG_FILES]
    for section in [context, "default"] if context else ["default"]:
        # python-can reads all files into one: the later one takes precedence
        for path in reversed(files):
            parser = configparser.ConfigParser()
            parser.optionxform = lambda option: option  # type: ignore[assignment, method-assign]
            if parser.read(path) and parser.has_section(section):
                out.append((path, dict(parser.items(section))))
    for _, parameters in out:
        if "bustype" in parameters:
            bustype = parameters.pop("bustype")
            parameters["interface"] = parameters.get("interface") or bustype
    return out


def _cast(merged: dict[str, Any]) -> dict[str, Any]:
    """Cast and validate as python-can does."""
    cast: dict[str, Any] = python_can.load().util.load_config(path=os.devnull, config=dict(merged))
    return cast


def _holds_timing(merged: Mapping[str, Any]) -> bool:
    """Whether all parts are given from which python-can makes a bit timing."""
    types = python_can.load().typechecking
    return any(
        set(kind.__annotations__) <= set(merged) for kind in (types.BitTimingDict, types.BitTimingFdDict)
    )


def _refuse_libraries(parameters: Mapping[str, Any], source: str) -> None:
    for key in _LIBRARIES:
        if key not in parameters:
            continue
        if source:
            raise ConfigError(
                f"{source} names a library to load ({key}); canid takes that from --bus-kwargs only"
            )
        if not os.path.isabs(str(parameters[key])):
            raise ConfigError(f"--bus-kwargs {key}: a library to load needs its absolute path")


def _refuse_writing(channel: Any) -> None:
    protocol, separator, _ = str(channel or "").lower().partition("://")
    if separator and protocol.strip() in _WRITING_URLS:
        raise ConfigError(f"the channel {protocol}://... writes files; name the device itself")


def _printable(name: object) -> str:
    text = str(name)
    return text if text.isascii() and text.isprintable() and len(text) <= 40 else "..."
