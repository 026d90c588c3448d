"""Logs and buses: everything that brings frames in, and the recorder; the only part that imports `can`."""

from canid.frames.log import SUFFIXES, Log, open_log
from canid.frames.write import WRITTEN, write_log

__all__ = ["SUFFIXES", "WRITTEN", "Log", "open_log", "write_log"]
