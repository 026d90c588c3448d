"""An identified driver's transfer functions for other programs: python-control, MATLAB's ident, LaTeX.

Every method and input, in continuous time K e^(-θs) / (τs + 1) of FOPDT, sampled b(z)/f(z) of ARMAX. What may not be quoted
is marked so, and never left out silently: a simulation needs a number, a paper needs to know that it is none.
"""

from __future__ import annotations

import io
import pprint
import re
from typing import Any

import numpy as np

from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.export.mat_file import TEXT_BYTES
from canid.mathematics.identification.identifiability import PARAMETERS, quotable
from canid.values.text.names import readable
from canid.values.text.numbers import gain_unit, interval
from canid.values.types import Channel

# the first line of a file says what it is; `ui.cli.output.output_kinds` reads it
PYTHON_HEAD = '"""Driver identified by canid, for python-control.'
LATEX_HEAD = "% Driver identified by canid"
MATLAB_HEAD = "MATLAB 5.0 MAT-file, driver identified by canid"

_PYTHON = """
import control

MODELS = {models}


def fopdt(name, order=5):
    # K e^(-dead_time s) / (tau s + 1), the dead time as a Pade approximation of an order
    of = MODELS["fopdt"][name]
    lag = control.tf([of["K"]["value"]], [of["tau"]["value"], 1.0])
    if of["dead_time"]["value"] == 0.0:
        return lag
    return lag * control.tf(*control.pade(of["dead_time"]["value"], order))


def armax(name):
    # the sampled model of ARMAX, with its dead time as whole samples
    of = MODELS["armax"][name]
    return control.tf(of["num"], of["den"], of["dt"])
"""


def models(result: Identified) -> dict[str, dict[str, dict[str, Any]]]:
    """Method -> input -> parameters, and numerator and denominator of a sampled model in descending powers of z.

    Args:
        result: with its responses.
    """
    output = result.drive_summary.output
    out: dict[str, dict[str, dict[str, Any]]] = {}
    for method, identified in result.whole.items():
        for name, channel in {} if identified is None else identified.channels.items():
            if not np.isfinite(channel.K.value):
                continue
            each: dict[str, Any] = {field: _parameter(channel, field, output, name) for field in PARAMETERS}
            response = result.responses.methods.get(method, {}).get(name)
            if response is not None and len(response.denominator):
                b, f = response.numerator, response.denominator
                length = max(len(b), len(f))
                each |= {
                    "num": np.pad(b, (0, length - len(b))).tolist(),
                    "den": np.pad(f, (0, length - len(f))).tolist(),
                    "dt": response.dt,
                }
            out.setdefault(method, {})[name] = each
    return out


def _parameter(channel: Channel, field: str, output: str, name: str) -> dict[str, Any]:
    estimate = getattr(channel, field)
    unit = gain_unit(output, name) if field == "K" else "s"
    may = quotable(channel, field)
    return {
        "value": estimate.value,
        "low": estimate.low,
        "high": estimate.high,
        "unit": unit,
        "quotable": may,
    }


def python(result: Identified, origin: str) -> bytes:
    """A Python module with the models and two functions that make transfer functions of python-control.

    Args:
        result: with its responses.
        origin: log, vehicle and program, a line.
    """
    head = f'{PYTHON_HEAD}\n\n{_plain(origin)}\nA parameter with quotable False is given for what it is worth.\n"""\n'
    text = pprint.pformat(models(result), sort_dicts=False, width=110)
    return (head + _PYTHON.format(models=re.sub(r"\bnan\b", 'float("nan")', text))).encode()


def latex(result: Identified, origin: str) -> bytes:
    """A table (booktabs) of every parameter of every method, with 95 % intervals; in brackets what may not be quoted."""
    rows = []
    for method, inputs in models(result).items():
        for name, each in inputs.items():
            for field in PARAMETERS:
                x = each[field]
                if not np.isfinite(x["value"]):
                    continue
                text = interval(getattr(result.whole[method].channels[name], field))  # type: ignore[union-attr]
                shown = text if x["quotable"] else f"({text})"
                cells = (
                    method.upper(),
                    readable(name),
                    _SYMBOLS[field],
                    _escaped(shown),
                    _escaped(x["unit"]),
                )
                rows.append(" & ".join(cells) + r" \\")
    return "\n".join(
        [
            f"{LATEX_HEAD}: {_plain(origin)}",
            r"\begin{tabular}{llllr}",
            r"\toprule",
            r"method & input & parameter & value [95\,\% interval] & unit \\",
            r"\midrule",
            *rows,
            r"\bottomrule",
            r"\end{tabular}",
            "",
        ]
    ).encode()


_SYMBOLS = {"K": "$K$", "tau": r"$\tau$", "dead_time": r"$\theta$", "tau_plus_dead_time": r"$\tau+\theta$"}


def _escaped(text: str) -> str:
    r"""Text for LaTeX.

    >>> _escaped("5 % per m/s²")
    '5 \\% per m/s$^2$'
    """
    return text.replace("%", r"\%").replace("²", "$^2$").replace("–", "--").replace("_", r"\_")


def _plain(text: str) -> str:
    """Text that ends neither a comment nor a docstring."""
    return text.replace("\\", "/").replace('"', "'").replace("\n", " ").replace("\r", " ")


def matlab(result: Identified, origin: str) -> bytes:
    """A .mat with a struct for each method and in it one for each input, whose num, den, Ts and IODelay `idtf` takes."""
    from scipy.io import savemat

    out: dict[str, Any] = {
        "info": {"origin": origin, "use": "idtf(m.num, m.den, m.Ts, 'IODelay', m.IODelay)"}
    }
    for method, inputs in models(result).items():
        out[method] = {}
        for name, each in inputs.items():
            K, tau, dead_time = (each[field]["value"] for field in PARAMETERS[:3])
            sampled = "num" in each
            num, den = (each["num"], each["den"]) if sampled else ([K], [tau, 1.0])
            struct = {field: each[field] for field in PARAMETERS}
            struct |= {
                "num": np.array([num]), "den": np.array([den]), "Ts": each["dt"] if sampled else 0.0,
                "IODelay": 0.0 if sampled else dead_time,
            }  # fmt: skip
            if sampled or np.isfinite([K, tau, dead_time]).all():
                out[method][name] = struct
    file = io.BytesIO()
    savemat(file, {key: value for key, value in out.items() if value}, long_field_names=True)
    content = file.getvalue()
    return MATLAB_HEAD.ljust(TEXT_BYTES).encode("ascii") + content[TEXT_BYTES:]
