"""`python -m canid` is `canid`."""

import sys

from canid.cli import main

if __name__ == "__main__":
    sys.exit(main())
