"""`python -m canid` is `canid`."""

import sys

from canid.values.processes.child_process import demote_current_folder

demote_current_folder()

from canid.ui.cli import main  # noqa: E402  (not before: its imports must not come from the current folder)

if __name__ == "__main__":
    sys.exit(main())
