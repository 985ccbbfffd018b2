"""The command ``syntable``, and ``python -m syntable``."""

from __future__ import annotations

import os
import signal
import sys

from . import _syntable


def main() -> int:
    """Runs the command line of this process. Returns the exit code."""
    # The library handles signals itself, as the program does.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    code = _syntable.main(["syntable", *sys.argv[1:]])
    sys.stdout.flush()
    # Nothing of Python is left to do.
    os._exit(code)


if __name__ == "__main__":
    sys.exit(main())
