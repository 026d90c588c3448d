"""JSON Schema of what each verb writes, by the name that its `schema` field carries."""

from __future__ import annotations

from canid.findings import Verdict
from canid.schemas.parts import (
    CHANGE,
    CHANNELS,
    COUNT,
    ESTIMATE,
    FLAG,
    IV,
    KNOWN,
    NAMES,
    NUMBER,
    RESIDUALS,
    SIGNAL,
    TEXT,
    TIME,
    Schema,
    by_name,
    nullable,
    one_of,
    record,
    ref,
    some,
)

_WHOLE = record(
    {"estimator": TEXT},
    {
        "channels": CHANNELS,
        "fit_percent": KNOWN,
        "fit_kind": one_of("simulated", "one_step"),
        "residual_tests": RESIDUALS,
        "says": TEXT,
        "changes": some(CHANGE),
        "segments": some(record({"start": KNOWN, "stop": KNOWN, "channels": CHANNELS})),
        "constancy": some(record({"input": TEXT, "parameter": TEXT, "p_value": KNOWN})),
    },
)
_ARMAX = record(
    {"A": some(KNOWN), "B": by_name(some(KNOWN)), "C": some(KNOWN), "K": by_name(IV)},
    {"dt": NUMBER, "poles": {"type": "array"}, "whiteness": {"type": "object"}, "residual_tests": RESIDUALS},
)
IDENTIFY = record(
    {
        "log": TEXT,
        "vehicle": TEXT,
        "verdict": record(
            {
                "kind": one_of("identified", "partly", "changed", "nothing"),
                "title": TEXT,
                "says": TEXT,
                "withheld": TEXT,
            }
        ),
        "duration": NUMBER,
        "driver_time": NUMBER,
        "time": TIME,
        "signals": some(SIGNAL),
        "windows": some(ESTIMATE),
        "whole": nullable(_WHOLE),
        "armax": nullable(_ARMAX),
        "loop": record({"says": TEXT, "phase_margin": IV, "delay_margin": IV, "string_peak": IV}),
        "output": TEXT,
        "unit": TEXT,
        "summary": record(
            {
                "driven": by_name(IV),
                "excitation": by_name(KNOWN),
                "noise_sd": IV,
                "wanted_headway": IV,
                "draws": nullable({"type": "object"}),
            }
        ),
        "orders": some(record({"aic": KNOWN, "bic": KNOWN, "fpe": KNOWN, "white": FLAG})),
    }
)

_FIT = record(
    {
        "channels": CHANNELS,
        "fit_percent": KNOWN,
        "noise_sd": KNOWN,
        "form": nullable(
            record({"name": TEXT, "parameters": by_name(IV), "units": by_name(TEXT), "says": TEXT})
        ),
    }
)
_NULL = record({"median": KNOWN, "high": KNOWN, "replicates": COUNT})
_FINDING = record(
    {
        "effect": TEXT,
        "where": one_of("driver", "vehicle", "sensing", "remnant"),
        "rivals": NAMES,
        "surrogate": FLAG,
        "parameters": by_name(IV),
        "units": by_name(TEXT),
        "gain": IV,
        "null_gain": _NULL,
        "log_score_gain": IV,
        "says": TEXT,
        "evidence": KNOWN,
        "needed": KNOWN,
        "episodes": some(record({"start": KNOWN, "stop": KNOWN})),
    }
)
DIAGNOSE = record(
    {
        "log": TEXT,
        "vehicle": TEXT,
        "duration": KNOWN,
        "used_time": KNOWN,
        "time": nullable(TIME),
        "signals": some(SIGNAL),
        "output": TEXT,
        "unit": TEXT,
        "verdict": one_of(*(verdict.value for verdict in Verdict)),
        "says": TEXT,
        "baseline": _FIT,
        "extended": _FIT,
        "findings": some(_FINDING),
        "unexplained": IV,
        "gain": IV,
        "null_gain": _NULL,
        "log_score_gain": IV,
        "not_testable": some(record({"effects": NAMES, "why": TEXT})),
        "power": some(record({"effect": TEXT, "parameter": TEXT, "strength": KNOWN, "unit": TEXT})),
        "advice": NAMES,
        "candidates_tried": COUNT,
        "tried": some(record({"effect": TEXT, "where": TEXT, "step": COUNT, "outcome": TEXT, "why": TEXT})),
        "checks": some(record({"name": TEXT, "passed": nullable(FLAG), "says": TEXT, "gate": FLAG})),
        "masked": some(record({"effect": TEXT, "start": KNOWN, "stop": KNOWN})),
        "blocks": some(record({"where": TEXT, "state": TEXT, "says": TEXT})),
        "closed_loop": some(record({"role": TEXT, "unit": TEXT})),
        "shifts": by_name(record({"before": IV, "after": IV})),
        "model": nullable(record({"equation": TEXT, "output": TEXT, "driver": by_name(NUMBER)})),
        "steps": NAMES,
        "provenance": {"type": "object"},
    }
)

CHECK = {
    "anyOf": [
        record(
            {
                "frames": COUNT,
                "duration": KNOWN,
                "roles": by_name(
                    record(
                        {
                            "from": TEXT,
                            "readings": COUNT,
                            "rate": KNOWN,
                            "missing_percent": KNOWN,
                            "unit": TEXT,
                        }
                    )
                ),
                "gates": by_name(KNOWN),
                "time": TIME,
                "signals": some(SIGNAL),
                "problems": NAMES,
                "remarks": NAMES,
                "unmapped": some(record({"bus": COUNT, "id": COUNT, "frames": COUNT})),
            }
        ),
        # without a vehicle file: what the log contains
        record({"frames": COUNT, "duration": KNOWN, "ids": {"type": "array"}}),
    ]
}

_SIDE = record(
    {
        "label": TEXT,
        "drives": some(
            record(
                {
                    "name": TEXT,
                    "method": one_of("identify", "diagnose"),
                    "vehicle": TEXT,
                    "output": nullable(TEXT),
                    "used": KNOWN,
                }
            )
        ),
    }
)
COMPARE = record(
    {
        "verdict": one_of("different", "no_difference_found", "not_comparable"),
        "says": TEXT,
        "a": _SIDE,
        "b": _SIDE,
        "parameters": some(
            record(
                {
                    "name": TEXT,
                    "unit": TEXT,
                    "a": IV,
                    "b": IV,
                    "why_not": nullable(TEXT),
                    "difference": IV,
                    "together": IV,
                    "ratio": IV,
                    "p": KNOWN,
                    "p_adjusted": KNOWN,
                    "differs": nullable(FLAG),
                    "detectable": KNOWN,
                    "spread": KNOWN,
                    "drives": some(COUNT),
                }
            )
        ),
        "causes": {"type": "array"},
        "conditions": some(record({"name": TEXT, "unit": TEXT, "a": IV, "b": IV, "overlap": KNOWN})),
        "remarks": NAMES,
        "critical": KNOWN,
        "margins_at": nullable(record({"speed": KNOWN, "headway": KNOWN})),
        "command": TEXT,
    }
)

_BUS = record({"name": TEXT, "state": TEXT, "frames": COUNT, "errors": COUNT, "drops": COUNT, "load": KNOWN})
RECORD = record(
    {
        "state": TEXT,
        "path": nullable(TEXT),
        "files": COUNT,
        "frames": COUNT,
        "written": COUNT,
        "bytes": COUNT,
        "errors": COUNT,
        "drops": COUNT,
        "drops_disk": COUNT,
        "elapsed": KNOWN,
        "buses": some(_BUS),
        "trigger": nullable({"type": "object"}),
    }
)
RECOVER = record(
    {
        "log": TEXT,
        "path": nullable(TEXT),
        "frames": COUNT,
        "events": COUNT,
        "read": COUNT,
        "total": nullable(COUNT),
        "damaged": some(some({"type": "integer"})),
        "says": TEXT,
    }
)
STUDY = record(
    {"canid_study": COUNT, "command": TEXT, "paper": TEXT, "title": TEXT, "artifacts": {"type": "array"}}
)
FLEET = record(
    {
        "folder": TEXT,
        "command": TEXT,
        "logs": record(
            {
                "planned": COUNT,
                "ok": COUNT,
                "damaged": COUNT,
                "failed": COUNT,
                "duplicates": COUNT,
                "analysed": COUNT,
            }
        ),
        "failures": by_name(COUNT),
        "drivers": some(record({"driver": TEXT, "drives": COUNT})),
        "not_ok": some(
            record({"log": TEXT, "status": nullable(TEXT), "failure": nullable(TEXT), "reason": TEXT})
        ),
    }
)

RESULTS: dict[str, Schema] = {
    "check": CHECK,
    "compare": COMPARE,
    "diagnose": DIAGNOSE,
    "export": record(
        {"path": TEXT, "rows": COUNT, "columns": NAMES},
        {"tables": some(record({"name": TEXT, "rows": COUNT, "columns": NAMES}))},
    ),
    "fleet": FLEET,
    "identify": IDENTIFY,
    "init": record({"files": NAMES, "proposed": {"type": "object"}}),
    "look": record(
        {
            "log": TEXT,
            "duration": KNOWN,
            "frames": COUNT,
            "buses": some(record({"bus": COUNT, "frames": COUNT})),
        }
    ),
    "onto": record({"log": TEXT, "sent": COUNT}),
    "record": RECORD,
    "recover": RECOVER,
    "replay": {"anyOf": [ESTIMATE, ref("monitor"), ref("signals")]},
    "study": STUDY,
}
