"""Roles that no signal gives and that others make: speed from the wheels, range rate from the lead's speed or the gap."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from canid.analysis.proposal.log_evidence import MAX_GAP_RATE
from canid.analysis.proposal.signal_agreement import References, correlation, moves, slope, smooth
from canid.analysis.proposal.wheel_reference import Wheel, median, own_wheels
from canid.signals.vehicle.units import factor_to
from canid.values.types import Array

if TYPE_CHECKING:
    from canid.analysis.proposal.choice import Decision

# correlation of the lead's speed less the own with the change of the gap from which on it is the lead's
_FOLLOWS = 0.75


class MadeRole(NamedTuple):
    """An entry that makes a role of others."""

    entry: str  # as TOML
    says: tuple[str, ...]  # why, and what is open
    values: Array | None = None  # on the log's raster, in the role's unit


def speed_of_wheels(wheels: Sequence[Wheel], buses: Sequence[int], usual: int | None) -> MadeRole | None:
    """The mean of the wheel speeds; None where fewer than two are known, or none has a unit.

    Args:
        wheels: of the DBC files, and of the log where there is one.
        buses: of the log.
        usual: the bus to which the wheels' DBC is bound.
    """
    chosen = own_wheels(wheels)
    if not chosen:
        return None
    parts = [f"mean_of = [{', '.join(json.dumps(wheel.where) for wheel in chosen)}]"]
    first = chosen[0]
    if factor_to(first.signal.unit, "m/s") is None:
        parts.append(f'unit = "{first.unit}"')
    if first.bus is not None and len(buses) > 1 and first.bus != usual:
        parts.append(f"bus = {first.bus}")
    says = [f"no own speed was found: the mean of {len(chosen)} wheel speeds"]
    values = None
    if first.values is not None:
        values = median(chosen)
        says.append(f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g} m/s in the log")
    says.append("the tyres' scale stays open, 2 % or so")
    return MadeRole(f"{{ {', '.join(parts)} }}", tuple(says), values)


def range_rate_of_others(roles: Mapping[str, Decision], known: References) -> MadeRole | None:
    """The lead's speed less the own where the log shows that they are that, else the derivative of the gap.

    Args:
        roles: what was decided.
        known: the own speed on the log's raster.
    """
    gap = roles["gap"].chosen
    if gap is None or not gap.unit_is_known or (gap.values is not None and not moves(gap.values)):
        return None
    lead = roles["lead_speed"].chosen
    if lead is not None and lead.unit_is_known and lead.values is not None and gap.values is not None:
        change = slope(gap.values)
        change[~(np.abs(change) < MAX_GAP_RATE)] = np.nan
        speed = known.speed if known.speed is not None else np.full(len(change), np.nan)
        r, _, _ = correlation(change, smooth(lead.values - speed))
        if math.isfinite(r) and r > _FOLLOWS:
            signal = lead.candidate
            parts = [f"lead_speed = {json.dumps(signal.where)}"]
            if factor_to(signal.signal.unit, "m/s") is None:
                parts.append(f'unit = "{signal.unit}"')
            return MadeRole(
                f"{{ {', '.join(parts)} }}",
                (f"lead speed less own speed; r = {r:.2f} with the change of the gap",),
                lead.values - speed,
            )
    values = slope(gap.values) if gap.values is not None else None
    says = "no range rate was found: the derivative of the gap, whose noise widens the intervals"
    return MadeRole('{ derivative_of = "gap" }', (says,), values)
