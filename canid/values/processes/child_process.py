"""The command line of a child process of canid: the parent's modules, and none from the current folder.

`python -m canid.x` would put the current folder first on the child's module path, so that a `queue.py` next to a
log would run inside canid. A child is started isolated (`-I`: no current folder, no PYTHON* variables, no user site) and is
given the parent's module path explicitly, behind the standard library and the installed packages.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

# the folder that canid lies in: above the file as often as the package's name has parts
_ROOT = os.path.abspath(__file__).rsplit(os.sep, __package__.count(".") + 2)[0]

# argv: the number of paths, the paths, the module, its arguments
_START = """
import sys
count = int(sys.argv[1])
sys.path += [path for path in sys.argv[2 : 2 + count] if path not in sys.path]
import runpy
module = sys.argv[2 + count]
sys.argv = [module, *sys.argv[3 + count :]]
runpy.run_module(module, run_name="__main__", alter_sys=True)
"""


def command(module: str, *arguments: str, options: Sequence[str] = ()) -> list[str]:
    """The command that runs a module of canid in an isolated child process.

    Args:
        module: to run as `__main__`.
        arguments: of the module.
        options: of the interpreter, such as ("-W", "ignore").

    Example:
        >>> import subprocess
        >>> words = command("canid.values.processes.child_process", "a", "b")
        >>> words[1], words[-3:], subprocess.run(words).returncode
        ('-I', ['canid.values.processes.child_process', 'a', 'b'], 0)
    """
    paths = module_path(sys.path, _ROOT)
    # -I also ignores PYTHONUTF8: the child must read and write names as the parent does
    utf8 = ["-X", "utf8"] if sys.flags.utf8_mode else []
    start = [sys.executable, "-I", *utf8, *options, "-c", _START]
    return [*start, str(len(paths)), *paths, module, *arguments]


def module_path(parent: Sequence[str], root: str) -> list[str]:
    """Choose what a child inherits of its parent's module path, in order; the folder of canid itself comes last.

    Left out is what stands for the current folder: an empty or a relative entry, and the entry that `python -m` has
    made from it. Where canid itself is imported from that folder it is kept, but behind everything else.

    Example:
        >>> module_path(["", "lib", "/usr/lib/python3", "/src"], "/src")
        ['/usr/lib/python3', '/src']
    """
    here = os.getcwd() if not sys.flags.safe_path else None
    chosen = [path for path in parent if os.path.isabs(path) and path not in (here, root)]
    return [*chosen, root]


def demote_current_folder() -> None:
    """Undo what `python -m canid` did to this process's module path: the current folder is no place for modules.

    Where canid itself is imported from there (a source tree that is not installed), the folder goes last instead.
    """
    if sys.flags.safe_path or not sys.path:
        return
    first = sys.path[0]
    if first in ("", os.getcwd()):
        del sys.path[0]
        if os.path.abspath(first) == _ROOT and _ROOT not in sys.path:
            sys.path.append(_ROOT)
