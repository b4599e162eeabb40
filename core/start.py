# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the program ``rockfall`` begins: it can be interrupted before the command line is even loaded."""

import gc
import os
import sys


def main() -> int:
    """Run the command line; returns the exit status."""
    try:
        from .cli import SIGNALLED
        from .cli import main as run

        status = run()
    except KeyboardInterrupt:
        sys.stderr.write("rockfall: interrupted, nothing was written.\n")
        os._exit(130)
    if status >= SIGNALLED:  # threads that still compute are not waited for
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    gc.freeze()  # to look for garbage once more at the end is a sixth of a command that draws
    return status


if __name__ == "__main__":
    sys.exit(main())
