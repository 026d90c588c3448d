"""Keeping an optional dependency out of a library's import."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def without(package: str) -> Iterator[None]:
    """Make `import package` raise ImportError inside the `with` block, unless it is loaded already.

    python-can (and cantools, which imports it) loads asammdf where that is installed, 0.8 s and 90 MB that no bus and no
    log format but .mf4 needs, and expects the ImportError where it is not. Elsewhere it stays importable.

    Example:
        >>> with without("this_package_is_not_loaded"):
        ...     "this_package_is_not_loaded" in sys.modules
        True
        >>> "this_package_is_not_loaded" in sys.modules
        False
    """
    if package in sys.modules:
        yield
        return
    # None in sys.modules makes an import raise
    sys.modules[package] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules[package]
