"""Processes that take an order in each line of their input, and answer it in a line: JSON both.

Of such a process Jupyter gets its kernels: copies of one that has read their libraries, which takes
seconds. It knows no more than a kernel does, and nothing of the graders, see `kernel`.
"""

import gc
import json
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import psutil
from jupyter_client.provisioning.local_provisioner import LocalProvisioner

__all__ = ["Child", "Provisioner", "end", "serve"]


class Child:
    """Such a process, as the one sees it that has started it: Python runs a module that serves."""

    def __init__(self, module: str, **how: Any) -> None:
        self.module = module
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            encoding="utf-8",
            **how,
        )

    def ask(self, order: Mapping[str, Any]) -> Any:
        """Give an order, and take the answer; OSError if the process has ended."""
        assert self.process.stdin and self.process.stdout
        self.process.stdin.write(json.dumps(order) + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise OSError(f"{self.module} has ended")
        return json.loads(answer)

    def close(self) -> None:
        """End it, and all that it has started."""
        end(self.process.pid)
        with self.process:  # its pipes are closed, and its end is waited for
            pass


def serve(answer: Callable[[dict[str, Any]], Any]) -> None:
    """Answer orders until there are no more."""
    for line in sys.stdin:
        gc.freeze()  # no copy looks for garbage in the libraries
        print(json.dumps(answer(json.loads(line))), flush=True)


def end(pid: int, itself: bool = True) -> None:
    """End all that a process started, and itself: a kernel may be deaf to everything else."""
    try:
        process = psutil.Process(pid)
        family = process.children(recursive=True) + ([process] if itself else [])
    except psutil.NoSuchProcess:
        return
    for member in family:
        with suppress(psutil.NoSuchProcess):
            member.kill()


class Kernel(psutil.Process):  # type: ignore[misc]
    """A kernel, which is no child of this process, with what Jupyter wants to know of one."""

    stdin = stdout = stderr = None

    def poll(self) -> int | None:
        """Give an exit code, whatever it was, if it has ended."""
        return None if self.is_running() else 1

    def send_signal(self, number: int) -> None:
        """Send a signal, if it has not ended."""
        with suppress(psutil.NoSuchProcess):
            super().send_signal(number)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self.send_signal(signal.SIGKILL)


class Provisioner(LocalProvisioner):
    """Lets Jupyter start its kernels so."""

    server: Child

    async def launch_kernel(self, cmd: list[str], **kwargs: Any) -> Any:
        """Start a kernel; of its command, python -P -m kernel CONNECTION WORKDIR, the last two."""
        kernel: Any = Kernel(self.server.ask({"start": cmd[4:6], "environment": kwargs["env"]}))
        self.process, self.pid = kernel, kernel.pid
        self.pgid = None
        return self.connection_info
