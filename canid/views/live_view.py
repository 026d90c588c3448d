"""The values of the terminal view under their former name."""

from canid.views.terminal_view.state import HealthLine, View, update

__all__ = ["HealthLine", "View", "update"]
