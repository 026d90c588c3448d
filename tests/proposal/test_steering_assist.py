"""A steering assistant is proposed by what a log shows of it, or said to be a guess."""

from __future__ import annotations

import numpy as np

from canid.analysis.proposal.choice import decide
from canid.analysis.proposal.name_score import Candidate
from canid.analysis.proposal.signal_agreement import CONTRADICTS, References
from canid.analysis.proposal.switch_evidence import steering_assist
from canid.signals.dbc_text.parsing import Message, Signal
from canid.signals.vehicle.database import Dbc
from canid.values.types import Array

N = 1200
T = 0.1 * np.arange(N)
SPEED = np.clip(15.0 + 20.0 * np.sin(T / 15.0), 0.0, None)
STEERING = np.where(SPEED < 3.0, 300.0, 5.0 * np.sin(T))
SWITCH = Signal("LKA_ACTIVE", 0, 1, True, False, False, 1.0, 0.0, None, None, "", {}, False, None, ())
MESSAGE = Message("LKA_STATUS", 0x200, False, 8, 0.1, (SWITCH,))


def judged(on: Array, known: References) -> tuple[float, str]:
    candidate = Candidate("steering_assist", 0, MESSAGE, SWITCH, 4.0, 6.0, "")
    points, remarks, _ = steering_assist(candidate, on.astype(float), known)
    return points, " ".join(remarks)


def test_it_steers_a_car_that_drives_and_gently() -> None:
    """On while the car stands or turns around a corner: no assistant. Else it fits, and that is said to be weak."""
    known = References(speed=SPEED, steering=STEERING)
    points, says = judged(SPEED > 15.0, known)
    assert points > 0.0
    assert "it may be a lamp all the same" in says
    assert judged(SPEED < 3.0, known)[0] == CONTRADICTS
    assert "stands" in judged(SPEED == 0.0, known)[1]
    assert "turned" in judged(SPEED < 3.0, References(steering=STEERING))[1]


def test_a_guess_is_called_one() -> None:
    """Constant in the log, with nothing to compare, and without a log."""
    assert "a guess" in judged(np.zeros(N), References(speed=SPEED))[1]
    assert "a guess" in judged(SPEED > 15.0, References())[1]
    chosen = decide([Dbc("car.dbc", None, {MESSAGE.name: MESSAGE})]).roles["steering_assist"].chosen
    assert chosen is not None
    assert any("a guess" in remark for remark in chosen.remarks)
