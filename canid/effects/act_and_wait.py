"""The driver decides now and then and holds in between (Gawthrop 2011; Wagner 2006; Markkula 2018)."""

from __future__ import annotations

from canid.effects.cause import Effect, Foot, Parameter, Params


def init(p: Params, first: float) -> tuple[float, float]:
    """Begin with a decision: (what was decided, s since then)."""
    return first, 0.0


def step(
    p: Params, state: tuple[float, float], demand: float, dt: float
) -> tuple[tuple[float, float], float]:
    """Hold the demand for D s, then take the new one.

    Example:
        >>> state, held = step((1.0,), (10.0, 0.5), 14.0, 0.1)
        >>> held, step((1.0,), (10.0, 0.95), 14.0, 0.1)[1]
        (10.0, 14.0)
    """
    held, since = state
    since += dt
    if since >= p[0] - 1e-9:
        # a decision that comes between two steps of the grid keeps its own rhythm
        return (demand, since - p[0]), demand
    return (held, since), held


EFFECT = Effect(
    id="act_and_wait",
    says="The driver decides every {interval} s and holds the pedal in between.",
    where="driver",
    kind="episodes",
    parameters=(Parameter("interval", "s", 0.3, 4.0, (), 1.0),),
    needs=(),
    source="Gawthrop et al. 2011; Wagner 2006; Markkula et al. 2018",
    decides="10 min of following with a calm foot",
    foot=Foot(init, step),
    planted=((1.5,), (2.5,)),
)
