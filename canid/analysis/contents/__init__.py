"""What a log contains: ids, rates, changing bits, counters and checksums, and the signals of DBC files over time."""

from canid.analysis.contents.log_survey import survey

__all__ = ["survey"]
