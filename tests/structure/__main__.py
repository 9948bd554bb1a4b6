"""Name every fault with its place, and fail if there is one."""

import gc
import sys
from pathlib import Path

from . import callers, docstrings, imports, modules, pages

if __name__ == "__main__":
    gc.disable()  # the syntax trees live to the end, and to walk them takes seconds
    root = Path(__file__).resolve().parents[2]
    checks = (imports.faults, callers.faults, modules.faults, pages.faults, docstrings.faults)
    sys.exit("\n".join(fault for check in checks for fault in check(root)) or None)
