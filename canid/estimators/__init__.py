"""The list of estimators. A new one is a file with `make(input_names, dt, settings)` and a line here.

The name is also the field of the vehicle that holds its settings (`vehicle.armax`, `vehicle.fopdt`).
"""

from canid.estimators import armax, fopdt

ESTIMATORS = (
    ("armax", armax.make),
    ("fopdt", fopdt.make),
)
