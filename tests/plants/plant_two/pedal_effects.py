"""Effects behind the lag: on the answer, and on the pedal with its noise."""

from __future__ import annotations

import math

from tests.plants.plant_two.driver import Touch
from tests.plants.plant_two.perception import Make, Scene, Values
from tests.plants.plant_two.shapes import below, switch

RELEASE_S = 0.3  # s, in which a pedal that was held returns


def second_lag(p: Values, scene: Scene) -> Touch:
    ahead = scene.dt / (2.0 * p["tau"] + scene.dt)
    y = before = 0.0

    def touch(x: float, k: int, gap: float, v: float, w: float, la: float, a: float) -> float:
        nonlocal y, before
        y = x if k == 0 else y + ahead * (x + before - 2.0 * y)
        before = x
        return y

    return touch


def act_and_wait(p: Values, scene: Scene) -> Touch:
    interval, dt = p["interval"], scene.dt
    ramp = min(RELEASE_S, 0.4 * interval)
    start = held = due = 0.0
    acted = -math.inf

    def touch(x: float, k: int, gap: float, v: float, w: float, la: float, a: float) -> float:
        nonlocal start, held, acted, due
        t = k * dt
        if t >= due - 0.5 * dt:
            start, held = (held if k else x), x
            acted, due = t, due + interval
        moved = min((t - acted) / ramp, 1.0)
        return start + (held - start) * moved * moved * (3.0 - 2.0 * moved)

    return touch


def periodic_task(p: Values, scene: Scene) -> Touch:
    """A line whose phase is a random walk of 0.3 rad in 5 min."""
    amplitude, turn = p["amplitude"], 2.0 * math.pi * p["frequency"] * scene.dt
    walk = 0.3 * math.sqrt(scene.dt / 300.0) * scene.rng.standard_normal(scene.n)
    phases = (scene.rng.uniform(0.0, 2.0 * math.pi) + walk.cumsum()).tolist()
    return lambda x, k, gap, v, w, la, a: x + amplitude * math.sin(turn * k + phases[k])


def backlash(p: Values, scene: Scene) -> Touch:
    """Play whose flanks yield: a rubber a hundredth of the play thick."""
    half, rubber = 0.5 * p["width"], 0.01 * p["width"]
    out = math.nan

    def touch(x: float, k: int, gap: float, v: float, w: float, la: float, a: float) -> float:
        nonlocal out
        if k == 0:
            out = x
        pressed = abs(x - out) - half
        if pressed > 0.0:
            out += math.copysign(pressed * pressed / (pressed + rubber), x - out)
        return out

    return touch


def pedal_ceiling(p: Values, scene: Scene) -> Touch:
    level = p["level"]
    return lambda x, k, gap, v, w, la, a: below(x, level, 0.3)


def attention_gap(p: Values, scene: Scene) -> Touch:
    """The pedal stays where it was; afterwards it returns within `RELEASE_S`."""
    episodes, dt = scene.episodes, scene.dt
    i, held, before = 0, 0.0, math.nan

    def touch(x: float, k: int, gap: float, v: float, w: float, la: float, a: float) -> float:
        nonlocal i, held, before
        t = k * dt
        while i < len(episodes) and t >= episodes[i][1] + RELEASE_S:
            i += 1
        out = x
        if i < len(episodes) and t >= episodes[i][0]:
            if t - dt < episodes[i][0]:
                held = x if math.isnan(before) else before
            back = max(t - episodes[i][1], 0.0) / RELEASE_S
            out = held + (x - held) * (0.5 - 0.5 * math.cos(math.pi * back))
        before = out
        return out

    return touch


# --- in nobody's catalogue ---------------------------------------------------------------------------


def pulse_and_glide(p: Values, scene: Scene) -> Touch:
    """Action points: presses until the gap closes by `band`, then glides until it opens by `band`."""
    swing, band, dt = p["swing"], p["band"], scene.dt
    side, moved = 1.0, 0.0

    def touch(x: float, k: int, gap: float, v: float, w: float, la: float, a: float) -> float:
        nonlocal side, moved
        if side * w < -band:
            side = -side
        moved += (side - moved) * dt / (0.4 + dt)
        return x + swing * moved

    return touch


def pedal_steps(p: Values, scene: Scene) -> Touch:
    """A staircase with round edges: the pedal prefers multiples of `step`."""
    step = p["step"]
    turn = 2.0 * math.pi / step
    return lambda x, k, gap, v, w, la, a: x - 0.9 / turn * math.sin(turn * x)


def uneven_lag(p: Values, scene: Scene) -> Touch:
    """Pressing lags by `tau` more than lifting."""
    tau, dt = p["tau"], scene.dt
    y = math.nan

    def touch(x: float, k: int, gap: float, v: float, w: float, la: float, a: float) -> float:
        nonlocal y
        y = x if k == 0 else y + (x - y) * dt / (tau * switch(x - y, 0.1) + dt)
        return y

    return touch


PEDAL_EFFECTS: dict[str, tuple[tuple[str, Make], ...]] = {
    "second_lag": (("answer", second_lag),),
    "uneven_lag": (("answer", uneven_lag),),
    "pedal_steps": (("answer", pedal_steps),),
    "act_and_wait": (("answer", act_and_wait),),
    "pulse_and_glide": (("answer", pulse_and_glide),),
    "periodic_task": (("answer", periodic_task),),
    "backlash": (("pedal", backlash),),
    "pedal_ceiling": (("pedal", pedal_ceiling),),
    "attention_gap": (("pedal", attention_gap),),
}
