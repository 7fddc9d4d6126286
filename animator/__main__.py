"""`python -m animator`: the command `splatimate`."""

import sys

from animator.cli import main

if __name__ == "__main__":
    sys.exit(main())
