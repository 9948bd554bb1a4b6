"""Blocks of work sent to any executor, and brought home one by one, whatever happens to workers.

Executors differ in what they do when a worker dies: a pool of processes breaks, a cluster may send
the work elsewhere, or never say a word again. So everything that has come back is kept here, what
fails is sent again, and so is all that is out when nothing has come back for too long.
"""

from __future__ import annotations

import hashlib
import os
import sys
import zipfile
from collections.abc import Callable
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Columns", "Keep", "Progress", "SweepStopped", "gather", "told"]

Columns = dict[str, NDArray[Any]]
Progress = bool | Callable[[int, int], None]

OUT = 64
"""Blocks that are out at a time: a scheduler is slow with more, and none is lost with fewer."""

TRIES = 4
"""How often a block is sent before its failure is taken for good."""


class SweepStopped(RuntimeError):  # noqa: N818  (no error of the caller's)
    """Raised where a sweep cannot go on; what was finished is in `table`.

    Attributes
    ----------
    table : SweepTable or None
        The rows that were finished.
    """

    table: Any = None


class Keep:
    """A folder in which finished blocks are kept, so that a sweep can go on where it stopped.

    Parameters
    ----------
    folder : str or Path
        Made if it is not there.
    mark : bytes
        What tells this sweep from any other.

    Raises
    ------
    OSError
        If nothing can be written there.
    """

    def __init__(self, folder: str | os.PathLike[str], mark: bytes) -> None:
        self.folder = Path(folder)
        self.name = hashlib.sha256(mark).hexdigest()[:16]
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            probe = self.folder / f"{self.name}.{os.getpid()}.probe"
            probe.write_bytes(b"?")
            probe.unlink()
        except OSError as error:
            raise _like(error, (
                f"keep={str(folder)!r} cannot be written ({error.strerror}); give a folder that "
                "can, or leave keep out"
            )) from error  # fmt: skip

    def _path(self, block: int) -> Path:
        return self.folder / f"{self.name}-{block:06d}.npz"

    def load(self, block: int) -> Columns | None:
        """Return a block that was kept before, None if it was not, or is damaged.

        Parameters
        ----------
        block : int
            Which.
        """
        try:
            with np.load(self._path(block), allow_pickle=False) as stored:
                found = {name: stored[name] for name in stored.files}
        except (OSError, ValueError, EOFError, zipfile.BadZipFile):
            return None
        return {name: c.astype(object) if c.dtype.kind == "U" else c for name, c in found.items()}

    def save(self, block: int, columns: Columns) -> None:
        """Keep a block; what is half written never takes its name.

        Parameters
        ----------
        block : int
            Which.
        columns : dict of str: array
            Its columns.
        """
        path = self._path(block)
        partial = path.with_suffix(f".{os.getpid()}.part")
        texts = {name: c.astype(str) if c.dtype == object else c for name, c in columns.items()}
        try:
            with partial.open("wb") as file:
                np.savez(file, **texts)  # type: ignore[arg-type]
            partial.replace(path)
        except OSError as error:
            partial.unlink(missing_ok=True)
            raise SweepStopped(
                f"block {block} could not be kept in {str(self.folder)!r} ({error.strerror}); "
                "what was finished before is there, and in the table of this error: make room and "
                "sweep again with the same folder, or leave keep out"
            ) from error


def gather(
    work: Callable[[int], Columns],
    blocks: int,
    *,
    executor: Executor | None,
    timeout: float,
    keep: Keep | None,
    progress: Callable[[int, int], None],
) -> dict[int, Columns]:
    """Do all blocks, here or by an executor.

    Parameters
    ----------
    work : callable
        Takes the number of a block; with an executor of other processes it must be picklable.
    blocks : int
        How many there are.
    executor : concurrent.futures.Executor or None
        Who does it; None for this process.
    timeout : float
        Seconds without any result after which what is out is sent again.
    keep : Keep or None
        Where finished blocks are kept.
    progress : callable
        Told how many blocks of how many are finished.

    Returns
    -------
    dict of int: dict of str: array
        The columns of every block.

    Raises
    ------
    SweepStopped
        If it cannot go on; its `table` is a dict of what was finished.
    """
    done: dict[int, Columns] = {}

    def finish(block: int, columns: Columns) -> None:
        done[block] = columns
        if keep:
            keep.save(block, columns)
        progress(len(done), blocks)

    try:
        for block in range(blocks) if keep else ():
            if (before := keep.load(block) if keep else None) is not None:
                done[block] = before
        progress(len(done), blocks)
        todo = [block for block in range(blocks) if block not in done]
        if executor is None:
            for block in todo:
                finish(block, work(block))
        else:
            _send(work, todo, executor, timeout, finish)
    except SweepStopped as stopped:
        stopped.table = done
        raise
    return done


def _send(
    work: Callable[[int], Columns],
    todo: list[int],
    executor: Executor,
    timeout: float,
    finish: Callable[[int, Columns], None],
) -> None:
    """Send blocks out and bring them home; the first answer to a block counts."""
    waiting, tries = todo[::-1], dict.fromkeys(todo, 0)
    missing, sent = set(todo), set[int]()
    out: dict[Future[Columns], int] = {}
    try:
        while missing:
            while waiting and len(sent) < OUT:
                block = waiting.pop()
                if block in missing:
                    tries[block] += 1
                    sent.add(block)
                    out[_submit(executor, work, block)] = block
            ready, _ = wait(out, timeout, FIRST_COMPLETED)
            failed: list[tuple[int, BaseException]] = []
            for future in ready:
                block = out.pop(future)
                if block not in missing:
                    continue
                if (error := _error(future)) is not None:
                    failed.append((block, error))
                    continue
                missing.discard(block)
                sent.discard(block)
                finish(block, future.result())
            if not ready:  # what is late may still come: the first answer counts
                _give_up_if([block for block in sent if tries[block] >= TRIES], timeout)
                waiting += sorted(sent, reverse=True)
                sent.clear()
            for block, error in failed:
                if isinstance(error, BrokenExecutor):
                    raise SweepStopped(_broken(error)) from error
                if block not in out.values():
                    _give_up_on(block, error, tries[block])
                    sent.discard(block)
                    waiting.append(block)
    finally:
        for future in out:
            future.cancel()


def _submit(executor: Executor, work: Callable[[int], Columns], block: int) -> Future[Columns]:
    try:
        return executor.submit(work, block)
    except RuntimeError as error:  # broken, or shut down
        raise SweepStopped(_broken(error)) from error


def _error(future: Future[Columns]) -> BaseException | None:
    try:
        return future.exception()
    except CancelledError as error:  # by a cluster that lost it
        return error


def _give_up_if(tired: list[int], timeout: float) -> None:
    """Stop where the executor has been silent too often."""
    if tired:
        raise SweepStopped(
            f"the executor has not answered for {timeout:g} s, {TRIES} times; what was finished is "
            "in the table of this error: look after the workers, give a longer timeout, and sweep "
            "again with keep=folder to go on where this one stops"
        )


def _give_up_on(block: int, error: BaseException, tries: int) -> None:
    """Stop where a block has failed too often; a lost worker has many names."""
    if tries >= TRIES:
        raise SweepStopped(
            f"block {block} failed {TRIES} times, at last with {type(error).__name__}: {error}; "
            "what was finished is in the table of this error"
        ) from error


def _broken(error: BaseException) -> str:
    return (
        f"the executor is dead ({type(error).__name__}: {error}); what was finished is in the "
        "table of this error: give another executor, and keep=folder to go on where one stops. A "
        "worker that dies at once may lack memory, or cannot import what it is sent"
    )


def _like(error: OSError, message: str) -> OSError:
    """Return an error of the same kind with another message."""
    return type(error)(error.errno, message)


def told(progress: Progress) -> Callable[[int, int], None]:
    """Return whom to tell how far the work is.

    Parameters
    ----------
    progress : bool or callable
        True for a line on the screen where standard error is a terminal, and for nobody elsewhere;
        a function of (finished, all) is told by itself.

    Raises
    ------
    TypeError
        If it is neither.
    """
    if callable(progress):
        return progress
    if not isinstance(progress, bool):
        raise TypeError(f"progress is {progress!r}; give True, False, or a function of two numbers")
    stream = sys.stderr
    if not (progress and stream is not None and stream.isatty()):
        return lambda finished, blocks: None

    def show(finished: int, blocks: int) -> None:
        end = "\n" if finished == blocks else ""
        stream.write(f"\rsweep: {finished} of {blocks} blocks{end}")
        stream.flush()

    return show
