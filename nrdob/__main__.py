"""The command line of the package: `python -m nrdob`."""

import sys

from .reporting import main

__all__: list[str] = []

if __name__ == "__main__":
    sys.exit(main())
