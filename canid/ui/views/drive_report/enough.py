"""Is a drive long enough: what each verb needs, next to what the drive holds."""

from __future__ import annotations

from canid.mathematics.estimators.status import MIN_DATA_S
from canid.mathematics.systems.car_response import MIN_USABLE_S
from canid.ui.views.document.document import Table
from canid.values.text.numbers import number
from canid.values.types import DriveTime


def table(time: DriveTime, output: str) -> Table:
    """What the drive can be used for. The least that is needed: intervals say how far it goes.

    Args:
        time: of the drive.
        output: role that the driver acts by.

    Example:
        >>> [row[-1] for row in table(DriveTime(80.0, 70.0, 65.0, 62.0), "pedal").rows]
        ['✓ yes', '✓ yes', '✗ 28 s more']
    """
    from canid.models.diagnosis.diagnose import MIN_DRIVING_S

    needs = [("K, τ and θ of the driver", "live, identify", MIN_DATA_S)]
    if output == "pedal":
        needs.append(("margins of driver and car", "identify", MIN_USABLE_S))
    needs.append(("causes, and a better model", "diagnose", MIN_DRIVING_S))
    rows = [
        (answer, verb, number(s, "s"), number(time.usable, "s"),
         "✓ yes" if time.usable >= s else f"✗ {number(s - time.usable, 's')} more")
        for answer, verb, s in needs
    ]  # fmt: skip
    caption = (
        "The least usable time that each answer needs: a person follows a vehicle, and the signals are there. Its interval "
        "says how exact the answer is then."
    )
    return Table(("answer", "canid", ">needed", ">here", "enough"), rows, caption=caption)
