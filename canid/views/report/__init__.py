"""The diagnosis as one self-contained HTML page."""

from canid.views.report.writing import page

__all__ = ["page"]
