"""Building blocks of JSON Schema (draft 2020-12), and the objects that several verbs write."""

from __future__ import annotations

from typing import Any

from canid.types import BlockStatus, Identifiable, Status

Schema = dict[str, Any]

TEXT: Schema = {"type": "string"}
FLAG: Schema = {"type": "boolean"}
COUNT: Schema = {"type": "integer", "minimum": 0}
NUMBER: Schema = {"type": "number"}
KNOWN: Schema = {"type": ["number", "null"]}  # null: not known
NAMES: Schema = {"type": "array", "items": TEXT}


def one_of(*words: str) -> Schema:
    """One of these words."""
    return {"enum": list(words)}


def some(items: Schema) -> Schema:
    """A list."""
    return {"type": "array", "items": items}


def by_name(values: Schema) -> Schema:
    """An object with any names."""
    return {"type": "object", "additionalProperties": values}


def nullable(of: Schema) -> Schema:
    """This, or null."""
    return {"anyOf": [of, {"type": "null"}]}


def ref(name: str) -> Schema:
    """A part by its name in `$defs`."""
    return {"$ref": f"#/$defs/{name}"}


def record(required: dict[str, Schema], optional: dict[str, Schema] | None = None) -> Schema:
    """An object with these names; further ones are allowed, since names may be added.

    Example:
        >>> record({"t": NUMBER})["required"]
        ['t']
    """
    return {"type": "object", "properties": {**required, **(optional or {})}, "required": list(required)}


IV, CHANNEL, CHANNELS, SIGNAL, TIME, CHANGE, RESIDUALS, ESTIMATE = (
    ref(name)
    for name in ("interval", "channel", "channels", "signal", "time", "change", "residuals", "estimate")
)

PARTS: dict[str, Schema] = {
    "interval": {
        "description": "a value with its 95 % interval; null: not estimated",
        **record({"value": KNOWN, "low": KNOWN, "high": KNOWN}),
    },
    "channel": record(
        {
            "K": IV,
            "tau": IV,
            "dead_time": IV,
            "tau_plus_dead_time": IV,
            "status": one_of(*(status.value for status in Identifiable)),
            "K_anytime": IV,
            "prior_weight": KNOWN,
            "progress": nullable(record({"parameter": TEXT, "sd": KNOWN, "needed": KNOWN, "seconds": KNOWN})),
            "prior_weights": by_name(KNOWN),
        }
    ),
    "channels": by_name(CHANNEL),
    "change": record({"t": IV, "before": by_name(IV), "after": by_name(IV), "evidence": KNOWN, "new": FLAG}),
    "residuals": record(
        {
            "white": FLAG,
            "statistic": KNOWN,
            "bound": KNOWN,
            "left_over": NAMES,
            "feedback": NAMES,
            "stationary": FLAG,
            "excitation_order": by_name(COUNT),
            "left_over_share": by_name(KNOWN),
        }
    ),
    "signal": record(
        {
            "finding": TEXT,
            "roles": NAMES,
            "since": KNOWN,
            "raised": KNOWN,
            "until": KNOWN,
            "says": TEXT,
            "remedy": TEXT,
            "withholds": FLAG,
        }
    ),
    "time": record({"total": KNOWN, "driving": KNOWN, "behind_lead": KNOWN, "usable": KNOWN}),
    "estimate": record(
        {
            "t": KNOWN,
            "estimator": TEXT,
            "status": one_of(*(status.value for status in Status)),
            "says": TEXT,
            "channels": CHANNELS,
            "fit_percent": KNOWN,
            "excitation": by_name(KNOWN),
            "used": KNOWN,
            "residual_tests": nullable(RESIDUALS),
            "headline": FLAG,
            "change": nullable(CHANGE),
        }
    ),
    "monitor": record(
        {
            "t": KNOWN,
            "screen": record(
                {
                    "fits": FLAG,
                    "since": KNOWN,
                    "block": one_of("driver", "vehicle", "sensing", ""),
                    "says": TEXT,
                    "blocks": by_name(
                        record(
                            {
                                "state": one_of(*(state.value for state in BlockStatus)),
                                "since": KNOWN,
                                "says": TEXT,
                                "evidence": KNOWN,
                                "needed": KNOWN,
                            }
                        )
                    ),
                }
            ),
        }
    ),
    "signals": record({"t": KNOWN, "signals": some(SIGNAL)}),
}
