"""The command line of the graders."""

import os
import sys
from pathlib import Path

from .command import main

if __name__ == "__main__":
    # nbgrader calls alembic, which lies beside Python even where the environment is not activated.
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    sys.exit(main())
