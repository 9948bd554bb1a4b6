"""The checker as a command: `python -m nrdob.certificates certificate.json`."""

import runpy

from . import checker

__all__: list[str] = []

if __name__ == "__main__":
    runpy.run_path(checker.__file__, run_name="__main__")
