"""Set 2: counting turns, and Lemma 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..loop import NRDOB
from ..nyquist import encirclements
from ..sampling import random_loop
from .grading import Problem, answers_like, same


@dataclass(frozen=True)
class LoopCase:
    """A loop to be judged: `case.loop` is an `nrdob.NRDOB`."""

    loop: NRDOB

    def __str__(self) -> str:
        return f"plant {_factors(self.loop.process)}, model {_factors(self.loop.model)}"


def _factors(tf: Any) -> str:
    zeros, poles = (np.round(np.sort_complex(p), 3).tolist() for p in (tf.zeros(), tf.poles()))
    return f"with zeros {zeros} and poles {poles}"


def _loop_case(rng: np.random.Generator) -> LoopCase:
    while True:
        loop = random_loop(rng)
        counted = encirclements(loop.FH)
        # Clockwise and counter-clockwise must be told apart, and so must P and Z.
        if counted.encirclements and counted.open_loop_rhp and counted.closed_loop_rhp:
            return LoopCase(loop)


def _turns(case: LoopCase) -> float | None:
    return encirclements(case.loop.FH).encirclements


TURNS = Problem(
    id="2.1",
    title="Clockwise turns from P and Z",
    case=_loop_case,
    accepts=lambda case, got: same(_turns(case), got),
    praise="Right: N = Z - P, clockwise turns counted as positive.",
    misconceptions=(
        answers_like(
            "counter-clockwise counted as positive",
            "The size is right, the sign is not: here, as in python-control, clockwise turns count "
            "as positive, so N = Z - P. Which way does the plot turn for a stable loop with an "
            "unstable plant?",
            lambda case: -(_turns(case) or 0),
            marks=0.5,
        ),
    ),
)

PROBLEMS = (TURNS,)
