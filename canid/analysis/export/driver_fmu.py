"""The identified driver as an FMU of FMI 3.0 for co-simulation, by pythonfmu3."""

from __future__ import annotations

import io
import json
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from canid.analysis.drive.drive_parameters import Identified
from canid.analysis.export.driver_models import models
from canid.values.errors import ConfigError
from canid.values.text.names import readable
from canid.values.text.numbers import UNITS

# of FOPDT, which is continuous and has a dead time of its own; ARMAX is sampled
METHOD, FIELDS = "fopdt", ("K", "tau", "dead_time")
# of the archive; `ui.cli.output.output_kinds` reads it
FIRST_NAME = "resources/driver.json"


def fmu(result: Identified, origin: str) -> bytes:
    """The file: the FOPDT model of every input, exact for inputs that are held during a step, and its parameters tunable.

    Args:
        result: with its responses.
        origin: log, vehicle and program, a line.

    Raises:
        ConfigError: pythonfmu3 is not installed.
    """
    try:
        from pythonfmu3 import FmuBuilder

        from canid.analysis.export import fmu_driver
    except ImportError:
        raise ConfigError("export: --to fmu needs pythonfmu3: pip install 'canid[fmu]'") from None
    with tempfile.TemporaryDirectory() as made:
        values = Path(made) / fmu_driver.PARAMETERS_FILE
        values.write_text(json.dumps(_values(result, origin), indent=1), encoding="utf-8")
        return _repacked(FmuBuilder.build_FMU(fmu_driver.__file__, dest=made, project_files=[values]))


def known_inputs(result: Identified) -> dict[str, list[str]]:
    """Method -> the inputs of which it knows gain, lag and dead time: what the FMU has."""
    return {
        METHOD: [
            name
            for name, each in models(result).get(METHOD, {}).items()
            if np.isfinite([each[field]["value"] for field in FIELDS]).all()
        ]
    }


def _repacked(file: Path) -> bytes:
    """The archive compressed, the driver's values first: by them a file of this kind is known again."""
    out = io.BytesIO()
    with zipfile.ZipFile(file) as read, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as packed:
        for name in sorted(read.namelist(), key=lambda name: (name != FIRST_NAME, name)):
            packed.writestr(name, read.read(name))
    return out.getvalue()


def _values(result: Identified, origin: str) -> dict[str, Any]:
    """What `fmu_driver` reads."""
    known = models(result)[METHOD]
    inputs = {name: _input(name, known[name]) for name in known_inputs(result)[METHOD]}
    output = result.drive_summary.output
    unit = UNITS.get(output, "")
    units = {unit} | {each["unit"] for each in inputs.values()}
    units |= {parameter["unit"] for each in inputs.values() for parameter in each["parameters"].values()}
    return {
        "description": f"{METHOD.upper()} model of the driver, identified by canid: {origin}",
        "output": output, "unit": unit, "units": sorted(units - {""}), "inputs": inputs,
    }  # fmt: skip


def _input(name: str, known: dict[str, Any]) -> dict[str, Any]:
    parameters = {}
    for field in FIELDS:
        x = known[field]
        said = "" if x["quotable"] else "; may not be quoted"
        parameters[field] = {
            "value": x["value"],
            "unit": x["unit"],
            "description": f"{field} of {readable(name)}, 95 % interval {x['low']:.4g} to {x['high']:.4g}{said}",
        }
    return {"unit": UNITS.get(name, ""), "description": readable(name), "parameters": parameters}
