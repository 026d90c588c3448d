"""The diagnosis as one self-contained HTML page."""

from canid.views.report.report_page import page

__all__ = ["page"]
