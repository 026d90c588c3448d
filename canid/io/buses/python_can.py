"""The one place that imports python-can. It keeps asammdf and modules of the current folder out of that import.

`import can` pulls in `can.io.mf4`, which imports asammdf where that is installed; only .mf4 needs it, and .mf4 is
read in a child process (`mf4_child`). python-can finds plug-ins in every folder of `sys.path`, and with
`python -m canid` the current folder is one of them: files next to a log are data, not code.
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import os
import sys
import sysconfig
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING, Any

from canid.values.errors import ConfigError
from canid.values.processes.import_guard import without

if TYPE_CHECKING:
    from can import Listener as Listener

_OWN = "can.interfaces."
_path_lock = threading.RLock()


@cache
def load() -> ModuleType:
    """Python-can, imported at the first call; asammdf stays importable for everybody else.

    >>> load().Message(arbitration_id=0x123).arbitration_id
    291
    """
    # python-can logs what it also raises; without a handler Python would print it in addition to canid's one line
    logging.getLogger("can").addHandler(logging.NullHandler())
    with without("asammdf"), without_current_folder():
        import can
    return can


def is_own(interface: str) -> bool:
    """Whether an interface is python-can's own: a plug-in may have the name of one, and replaces it then.

    >>> is_own("virtual"), is_own("no such interface")
    (True, False)
    """
    module: str = load().interfaces.BACKENDS.get(interface, ("", ""))[0]
    return module.startswith(_OWN)


def bus_class(interface: str) -> Any:
    """The class behind the name of an interface. Raises ConfigError for code that lies in the current folder.

    >>> bus_class("virtual").__name__
    'VirtualBus'
    """
    can = load()
    module, name = can.interfaces.BACKENDS[interface]
    top = module.partition(".")[0]
    with without_current_folder():
        # a module that is loaded already was imported by the caller of canid
        if top not in sys.modules and importlib.util.find_spec(top) is None:
            raise ConfigError(
                f"the interface {interface} is in no installed package (the module {top} would come from the"
                f" current folder, {os.getcwd()}); install it to use it"
            )
        return getattr(importlib.import_module(module), name)


@contextmanager
def without_current_folder() -> Iterator[None]:
    """Keep the current folder out of the module search path inside the `with` block, unless packages are installed in it.

    >>> with without_current_folder():
    ...     "" in sys.path
    False
    """
    with _path_lock:
        before = sys.path
        sys.path = [folder for folder in before if not _is_current(folder)]
        try:
            yield
        finally:
            # folders that were added in between stay
            added = [folder for folder in sys.path if folder not in before]
            sys.path = before
            sys.path.extend(added)


def _is_current(folder: str) -> bool:
    if not folder:
        return True
    try:
        here = os.path.samefile(folder, os.getcwd())
    except OSError:
        return False
    installed = {os.path.realpath(path) for path in sysconfig.get_paths().values()}
    return here and os.path.realpath(folder) not in installed
