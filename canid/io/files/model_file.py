"""The model in a JSON report of `canid diagnose`."""

from __future__ import annotations

import json
from pathlib import Path

from canid.values.errors import ConfigError
from canid.values.identified_model import IdentifiedModel
from canid.values.text.model_json import from_json


def read_model(path: str | Path) -> IdentifiedModel:
    """Read the model out of a JSON report of `canid diagnose --json`.

    Args:
        path: of the report, of one log.

    Raises:
        ConfigError: no such file, or it holds no model.
    """
    try:
        report = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise ConfigError(f"{path}: is no JSON: give what `canid diagnose LOG --json FILE` wrote") from error
    if isinstance(report, list):
        raise ConfigError(f"{path}: is a report of {len(report)} logs: diagnose one of them by itself")
    if not isinstance(report, dict) or "verdict" not in report:
        raise ConfigError(f"{path}: is no report of `canid diagnose LOG --json FILE`")
    if not isinstance(report.get("model"), dict):
        raise ConfigError(f"{path}: holds no model: its drive identified none ({report['verdict']})")
    try:
        return from_json(report["model"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ConfigError(f"{path}: its model is damaged ({error!r}): diagnose the log again") from error
