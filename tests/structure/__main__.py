"""Name every fault with its place, and fail if there is one."""

import sys
from pathlib import Path

from . import callers, docstrings, imports, pages

if __name__ == "__main__":
    root = Path(__file__).resolve().parents[2]
    checks = (imports.faults, callers.faults, pages.faults, docstrings.faults)
    sys.exit("\n".join(fault for check in checks for fault in check(root)) or None)
