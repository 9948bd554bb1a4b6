"""Name every fault of the house with its place, and fail if there is one."""

import sys
from pathlib import Path

from . import docstrings, doors, pages

if __name__ == "__main__":
    root = Path(__file__).resolve().parents[2]
    found = [*doors.faults(root), *pages.faults(root), *docstrings.faults(root)]
    sys.exit("\n".join(found) or None)
