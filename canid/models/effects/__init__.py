"""The catalogue of effects: one file each; a new effect is a file and its name in the lists here."""

from canid.models.effects.driver import (
    act_and_wait,
    asymmetric_gain,
    attention_gap,
    backlash,
    comfort_speed,
    curvature_preview,
    delay_drift,
    gain_change,
    gain_drift,
    headway_dead_zone,
    headway_drift,
    lateral_dead_zone,
    lead_acceleration,
    looming_gain,
    looming_threshold,
    pedal_ceiling,
    periodic_task,
    relative_speed_dead_zone,
    second_lag,
    speed_gain,
    standstill_gap,
)
from canid.models.effects.effect import Effect
from canid.models.effects.masks import (
    brake_overlap,
    cruise_control,
    cut_in,
    gear_shift,
    stale_signal,
)
from canid.models.effects.remnant import clustered_scale, heavy_tails, state_dependent_scale
from canid.models.effects.sensing import (
    clock_skew,
    radar_latency,
    range_offset,
    range_rate_scale,
    range_rate_sign,
    range_scale,
    speed_scale,
)
from canid.models.effects.vehicle import (
    actuator_lag,
    engine_braking,
    gear_ratio,
    headwind,
    pedal_map,
    power_limit,
    road_grade,
    turbo_lag,
)

CATALOGUE: tuple[Effect, ...] = (
    # the driver
    headway_dead_zone.EFFECT,
    relative_speed_dead_zone.EFFECT,
    looming_threshold.EFFECT,
    looming_gain.EFFECT,
    asymmetric_gain.EFFECT,
    gain_drift.EFFECT,
    gain_change.EFFECT,
    headway_drift.EFFECT,
    delay_drift.EFFECT,
    attention_gap.EFFECT,
    act_and_wait.EFFECT,
    standstill_gap.EFFECT,
    speed_gain.EFFECT,
    comfort_speed.EFFECT,
    second_lag.EFFECT,
    lead_acceleration.EFFECT,
    pedal_ceiling.EFFECT,
    backlash.EFFECT,
    periodic_task.EFFECT,
    # the driver's remnant
    heavy_tails.EFFECT,
    state_dependent_scale.EFFECT,
    clustered_scale.EFFECT,
    # masks: no person drives, or an input is not valid
    cruise_control.EFFECT,
    gear_shift.EFFECT,
    cut_in.EFFECT,
    brake_overlap.EFFECT,
    stale_signal.EFFECT,
    # the sensors
    range_offset.EFFECT,
    speed_scale.EFFECT,
    range_rate_scale.EFFECT,
    range_scale.EFFECT,
    range_rate_sign.EFFECT,
    radar_latency.EFFECT,
    clock_skew.EFFECT,
    # the vehicle, from pedal to speed
    road_grade.EFFECT,
    headwind.EFFECT,
    engine_braking.EFFECT,
    power_limit.EFFECT,
    gear_ratio.EFFECT,
    turbo_lag.EFFECT,
    pedal_map.EFFECT,
    actuator_lag.EFFECT,
)

# of a driver who keeps the lane: the same names where the cause is the same
LANE_CATALOGUE: tuple[Effect, ...] = (
    lateral_dead_zone.EFFECT,
    gain_drift.LANE,
    attention_gap.LANE,
    delay_drift.LANE,
    second_lag.LANE,
    curvature_preview.EFFECT,
)

# what a linear second-order model of steering does not hold, at strengths that show in an hour: a neuromuscular lag in s, a
# zone without an answer in m
NOT_IN_ARMAX: dict[str, tuple[float, ...]] = {second_lag.LANE.id: (0.3,), lateral_dead_zone.EFFECT.id: (0.2,)}
