"""Start kernels as copies of a process that has read their libraries: reading takes seconds.

    python -P -m nrdob_course.grading.kernel

The process knows no more than a kernel does, and nothing of the graders. It takes an order in each
line of its input, and answers it in a line: of a kernel to be started with its process, of one
asked for with its exit code.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from typing import Any

from jupyter_client.provisioning.local_provisioner import LocalProvisioner

from .children import Child, serve

__all__ = ["Kernel", "Provisioner", "fork_kernels"]


class Kernel:
    """A kernel, with what Jupyter wants to know of a process of its own."""

    stdin = stdout = stderr = None

    def __init__(self, server: Child, arguments: list[str], environment: dict[str, str]) -> None:
        self.server, self.code = server, None
        self.pid = server.ask({"start": arguments, "environment": environment})

    def poll(self) -> int | None:
        """Give the exit code, if it has ended."""
        if self.code is None:
            self.code = self.server.ask({"ended": self.pid})
        return self.code

    def wait(self) -> int:
        """Wait for its end."""
        while (code := self.poll()) is None:
            time.sleep(0.01)
        return code

    def send_signal(self, number: int) -> None:
        """Send a signal, if it has not ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

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
        kernel: Any = Kernel(self.server, cmd[4:6], kwargs["env"])
        self.process, self.pid = kernel, kernel.pid
        self.pgid = None
        return self.connection_info


def fork_kernels(kernel: Callable[[list[str]], None]) -> None:
    """Take orders until there are no more: a kernel to be started, or one that may have ended."""

    def answer(order: dict[str, Any]) -> int | None:
        if "ended" in order:
            return _ended(order["ended"])
        child = os.fork()
        if not child:
            _become_a_kernel(order, kernel)
        return child

    serve(answer)


def _ended(pid: int) -> int | None:
    try:
        done, status = os.waitpid(pid, os.WNOHANG)
    except ChildProcessError:
        return 1
    return os.waitstatus_to_exitcode(status) if done else None


def _become_a_kernel(order: dict[str, Any], kernel: Callable[[list[str]], None]) -> None:
    """Leave all that is the server's, its pipes above all, and be a kernel."""
    code = 1
    try:
        os.setsid()
        for number in (0, 1, 2):
            os.dup2(os.open(os.devnull, os.O_RDWR), number)
        os.closerange(3, 1024)
        os.environ.clear()
        os.environ.update(order["environment"])
        kernel(order["start"])
        code = 0
    finally:
        os._exit(code)
