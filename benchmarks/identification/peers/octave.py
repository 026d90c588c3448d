"""Octave's control package, in one child for each process of ours that stays: starting it takes seconds."""

from __future__ import annotations

import os
import subprocess
from functools import cache

import numpy as np

_PRELUDE = "warning('off', 'all'); pkg load control;\n"
_ANSWER = "printf('ANSWER'); printf(' %.17g', x); printf('\\n'); fflush(stdout);"


@cache
def _octave(pid: int) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        ["octave-cli", "--no-gui", "--quiet", "--no-init-file"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdin is not None
    process.stdin.write(_PRELUDE)
    return process


def ask(code: str) -> np.ndarray:
    """Run code that leaves its answer in `x`; returns that.

    Raises:
        RuntimeError: with what Octave says.
    """
    process = _octave(os.getpid())
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(
        f"try\n{code}\n{_ANSWER}\ncatch err\nprintf('ERROR %s\\n', err.message); fflush(stdout);\nend\n"
    )
    process.stdin.flush()
    for line in process.stdout:
        if line.startswith("ANSWER"):
            return np.array(line.split()[1:], float)
        if line.startswith("ERROR"):
            raise RuntimeError(line[6:].split(" near line")[0].strip())
    raise RuntimeError("Octave has ended")


def _matrix(x: np.ndarray) -> str:
    return "[" + ";".join(" ".join(f"{v:.17g}" for v in row) for row in np.atleast_2d(x)) + "]"


def polynomials(y: np.ndarray, u: np.ndarray, model: str) -> np.ndarray:
    """Return a1 a2 b1 b2 and NaN of a model of one input at 10 Hz."""
    code = f"dat = iddata({_matrix(y[:, None])}, {_matrix(u[:, None])}, 0.1); sys = {model};\n"
    code += "g = tf(sys(1, 1)); [num, den] = tfdata(g, 'vector'); num = [zeros(1, 3 - numel(num)), num];\n"
    code += "x = [den(2:3), num(end-1:end)] / den(1);"
    return np.append(ask(code), np.nan)


def gains(y: np.ndarray, inputs: np.ndarray, model: str) -> np.ndarray:
    """Return the DC gain of every input."""
    m = inputs.shape[1]
    code = f"dat = iddata({_matrix(y[:, None])}, {_matrix(inputs)}, 0.1); sys = {model};\n"
    code += f"x = dcgain(sys)(1, 1:{m});"
    return ask(code)
