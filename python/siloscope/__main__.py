"""``python -m siloscope``."""

import sys

from siloscope.cli import main

if __name__ == "__main__":
    sys.exit(main())
