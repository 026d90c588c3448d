"""Read all columns of a log and print how many frames there are: `python -m benchmarks.reading.walk LOG`."""

from __future__ import annotations

import sys

from canid.io.logs import open_log

if __name__ == "__main__":
    print(f"{sum(len(chunk.t) for chunk in open_log(sys.argv[1]).columns()):,} frames")
