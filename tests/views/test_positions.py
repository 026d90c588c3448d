"""A position hardly moves: tables and plots have as many digits as show how it does."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from canid.analysis.drive.vehicle_check import Row
from canid.ui.views import check_document
from canid.ui.views.drawing.figure import to_list

# 10 m to the north, with the resolution of a receiver
LATITUDES = 46.87 + 1e-6 * np.arange(0.0, 90.0, 10.0)


def test_check_shows_where_a_drive_went() -> None:
    low, high = LATITUDES[[0, -1]]
    row = Row("lat", "deg", "GNSS.Latitude (0x170)", 9, 3.33333, 0.0, low, LATITUDES[4], high)
    checked: Any = SimpleNamespace(rows=(row,), left_out={})
    (cells,) = check_document._roles(checked)
    assert (cells[">low"], cells[">median"], cells[">high"]) == ("46.87", "46.87004", "46.87008")
    assert cells[">1/s"] == "3.333"


def test_a_plot_has_every_step_of_a_position() -> None:
    assert np.allclose(to_list(LATITUDES), LATITUDES, atol=1e-7)
    assert to_list(np.array([0.1234567, 3.0])) == [0.12346, 3.0]
