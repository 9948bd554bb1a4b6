"""A whole family judged: blocks of ten thousand members, here or on any number of machines."""

from __future__ import annotations

import os
from collections.abc import Iterable
from concurrent.futures import Executor
from functools import partial
from math import isfinite

import numpy as np

from ..loop import NRDOB
from ..numerics import is_real
from .draws import BLOCK
from .family import Family
from .farm import Columns, Keep, Progress, SweepStopped, gather, told
from .judging import QUANTITIES, Job, judge_block
from .table import SweepTable

__all__ = ["sweep"]


def sweep(
    loop: NRDOB,
    family: Family,
    quantities: Iterable[str] = QUANTITIES,
    *,
    executor: Executor | None = None,
    progress: Progress = True,
    keep: str | os.PathLike[str] | None = None,
    timeout: float = 600.0,
) -> SweepTable:
    r"""Judge every member of a family in place of the loop's process.

    Model, controller and filter remain. Verdicts are those of `NRDOB.stability`, found for many
    members at once where Routh's test, or with dead time the turns of the argument, are certain
    however the coefficients are rounded; the others are judged one by one and flagged in the column
    "alone".

    Parameters
    ----------
    loop : NRDOB
        The loop.
    family : Family
        What the plant may be, see `nrdob.family`.
    quantities : iterable of str
        Of "stable"; "ms", "gm", "pm", "delay_margin", the margins of the plant loop L as
        `nrdob.analysis.Margins` has them; "peak_d", the largest ``|y|`` after a unit step of d,
        which takes one simulation a member where there is a dead time, some 10 ms each: leave it
        out of sweeps of many such plants. It is 1, the jump itself, unless y swings further later.
    executor : concurrent.futures.Executor, optional
        Who does the work, by default this process: a `ProcessPoolExecutor`, or
        ``Client.get_executor()`` of a Dask cluster. Blocks of ten thousand members are sent out
        and brought home; the numbers are the same bit for bit, whoever computes them on the same
        kind of machine: no verdict and no margin asks BLAS, whose threads then do not matter either
        (give a worker one all the same, OPENBLAS_NUM_THREADS=1). Where the family has a function
        `parameters`, workers must be able to import it.
    progress : bool or callable
        True shows a line where standard error is a terminal, and nothing elsewhere; a function is
        called with the number of finished blocks and of all.
    keep : path, optional
        A folder in which finished blocks are kept: the same sweep again goes on from there.
    timeout : float
        Seconds without any result from the executor after which what is out is sent again.

    Returns
    -------
    SweepTable
        With a row for each member.

    Raises
    ------
    TypeError, ValueError
        If there is no such quantity, or an argument is of the wrong kind.
    OSError
        If `keep` cannot be written.
    SweepStopped
        A RuntimeError: if the executor dies, or a block cannot be kept. Its `.table` has what was
        finished.

    See Also
    --------
    nrdob.design.chart.stability_chart : exact borders in two parameters.

    Examples
    --------
    Example 3 of the paper, if the gain of the plant is known to a factor of two, and it has one
    more lag:

    >>> import nrdob
    >>> loop = nrdob.paper.example(3)
    >>> plants = nrdob.family(loop.process, gain=(0.5, 2.0), lag=(0.0, 0.2), samples=1000)
    >>> table = nrdob.sweep(loop, plants, ("stable", "ms"))
    >>> table["stable"].size, table["gain"].min() > 0.5, int((~table["decided"]).sum())
    (1000, np.True_, 0)
    """
    if not isinstance(loop, NRDOB):
        raise TypeError(f"loop is a {type(loop).__name__}; give an nrdob.NRDOB")
    if not isinstance(family, Family):
        raise TypeError(f"family is a {type(family).__name__}; make one with nrdob.family")
    if executor is not None and not isinstance(executor, Executor):
        raise TypeError(
            f"executor is a {type(executor).__name__}; give a concurrent.futures.Executor, of a "
            "Dask client that is client.get_executor()"
        )
    if not is_real(timeout):
        raise TypeError(f"timeout is {timeout!r}; give seconds as a number")
    if not (isfinite(timeout) and timeout > 0):
        raise ValueError(f"timeout is {timeout}; give a positive number of seconds")
    asked = _asked(quantities)
    # A loop that remembers nothing, so that little is sent.
    job = Job(
        NRDOB(family.process, loop.model, loop.controller, loop.filter, loop.keep_factors),
        family,
        asked,
    )
    try:
        done = gather(
            partial(judge_block, job),
            family.blocks,
            executor=executor,
            timeout=float(timeout),
            keep=Keep(keep, _mark(job)) if keep is not None else None,
            progress=told(progress),
        )
    except SweepStopped as stopped:
        stopped.table = _table(family, stopped.table)
        raise
    return _table(family, done)


def _asked(quantities: Iterable[str]) -> tuple[str, ...]:
    asked = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    if unknown := [name for name in asked if name not in QUANTITIES]:
        raise ValueError(f"there is no {unknown[0]!r} to ask; choose from {', '.join(QUANTITIES)}")
    return tuple(name for name in QUANTITIES if name in (*asked, "stable"))


def _mark(job: Job) -> bytes:
    """Tell this sweep from any other: by what is asked, and the numbers it is asked about."""
    fractions, family = job.loop.fractions, job.family
    drawn = family.drawn.block(0)
    first, _ = family.plants({name: values[:1] for name, values in drawn.items()})
    numbers = [part for block in (fractions.Gm, fractions.C, fractions.F) for part in block]
    numbers += [np.array([job.loop.model_delay, len(family), job.loop.keep_factors], dtype=float)]
    numbers += [*first, *drawn.values()]
    text = repr((job.quantities, family.names, [part.shape for part in numbers]))
    return text.encode() + b"".join(np.ascontiguousarray(part).tobytes() for part in numbers)


def _table(family: Family, done: dict[int, Columns]) -> SweepTable:
    blocks = sorted(done)
    names = list(done[blocks[0]]) if blocks else [*family.names, "stable", "decided", "alone"]
    joined = {
        name: np.concatenate([done[k][name] for k in blocks]) if blocks else np.zeros(0)
        for name in names
    }
    rows = [k * BLOCK + np.arange(done[k]["stable"].size) for k in blocks]
    return SweepTable(family, joined, np.concatenate([np.zeros(0, dtype=np.intp), *rows]))
