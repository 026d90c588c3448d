"""Slope and wind: without a measured slope they are not distinguishable."""

from __future__ import annotations

from canid.models.effects.effect import DriveFeatures, Unavailable


def unmeasured_slope(drive: DriveFeatures) -> Unavailable | None:
    """Without a measured slope, slow disturbances of the car are slope or wind."""
    if drive.slope_sd == drive.slope_sd:
        return None
    return Unavailable(
        "slow disturbances of the car are slope or wind, and nothing says which: map grade or altitude"
    )
