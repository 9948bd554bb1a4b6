r"""What the processor runs: every block one difference equation, the diagram solved for u[k].

Each block of the diagram is sampled as one (F, F/Gm, (1 - F) Gm and C, without what cancels in it)
and is a cascade of sections (`nrdob.digital.sections`). At the sample k the processor reads y[k]
(with its noise) and r[k], and both u[k] and yf[k] stand on two sides of the diagram::

    f = F u        q = (F/Gm) y        yf = F y + (1 - F) Gm u        u = C (r - yf) + f - q

With the direct terms of the blocks taken out, f = f0 + F∞ u and (1 - F) Gm u = m0 + M∞ u with f0
and m0 known from the past, that is one linear equation for u[k]::

    (1 - F∞ + C∞ M∞) u[k] = c0 + C∞ (r - F y - m0) + f0 - (F/Gm) y

where c0 is the part of C's output that comes from its past. If the factor on the left is 0 the
sampled loop is ill-posed and refused. Only then are the states renewed, with the u that has really
been *applied*: a saturated actuator is then no disturbance, and the observer cannot wind up. With a
limit sat(u) this u is also the solution of the diagram with the limit in it, as long as the factor
is positive.

A model with dead time has F W in place of F, where u goes through (W u)[k] = (1 - φ) u[k-m] +
φ u[k-m-1] for a dead time of (m + φ) dt: for whole samples that is exact, and for a fraction it is
the mean of a held u over a sample. Its yf is F y + Gm0 (u - F W u), with Gm0 one block.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..numerics import FloatArray
from .sections import at_rest, bilinear_sections, state_space

__all__ = ["ModelDelay", "SampledController"]

SINGULAR = 1e-12  # size of the factor of u[k], against its terms, at which it is 0


@dataclass(frozen=True)
class ModelDelay:
    """The dead time of a model on the processor: (1 - φ) u[k-m] + φ u[k-m-1], 0 <= φ < 1."""

    samples: int = 0
    fraction: float = 0.0

    def __bool__(self) -> bool:
        """Whether there is any dead time."""
        return self.samples > 0 or self.fraction > 0

    @property
    def memory(self) -> int:
        """Number of past inputs that must be kept."""
        return self.samples + (self.fraction > 0)

    @property
    def terms(self) -> list[tuple[float, int]]:
        """Weights of u and their ages in samples."""
        later = [(self.fraction, self.samples + 1)] if self.fraction else []
        return [(1 - self.fraction, self.samples), *later]


class SampledController:
    """All that the processor does from (r, y, applied u) to u.

    In each sample it computes ``u = C @ x + D @ (r, y)``, writes it, and then renews its states
    with what has been applied, ``x = A @ x + B @ (r, y, applied)``. Its blocks are "C", "F" (of
    which there are two copies, one of u and one of y), "F/Gm" and "(1-F)Gm" (for a model with dead
    time "Gm", the model without it). It is made of their numerators and denominators, given as
    factors in descending powers of w, α = dt/2. A block with a pole at z = ∞, or a diagram without
    solution for u[k], raises a ValueError.

    Attributes
    ----------
    delay, dt : ModelDelay, float
    sections, blocks : dict of str
        The blocks by name: as sections, and each as one state space.
    inner : str
        Name of the block between u and yf: "(1-F)Gm" or "Gm".
    rows : dict of str: slice
        Which states belong to "C", "F u", "F y", "F/Gm", "(1-F)Gm" or "Gm"; and to "past", the past
        inputs that a model with dead time keeps, youngest first.
    states : int
        Number of states.
    factor : float
        1 - F∞ + C∞ M∞, the factor of u[k] in the diagram.
    A, B, C, D : arrays of float, shapes (n, n), (n, 3), (n,), (2,)
        How the states are renewed from the states and (r, y, applied u); u from the states and
        (r, y).
    estimate : array of float, shape (n+3,)
        The estimate of the disturbance at the input over (states, r, y, applied u).
    """

    def __init__(
        self,
        factors: Mapping[str, tuple[Sequence[FloatArray], Sequence[FloatArray]]],
        delay: ModelDelay,
        dt: float,
    ) -> None:
        self.delay, self.dt = delay, dt
        self.sections = {
            name: bilinear_sections(*block, dt / 2, name) for name, block in factors.items()
        }
        self.blocks = {name: state_space(cascade) for name, cascade in self.sections.items()}
        self.inner = "Gm" if delay else "(1-F)Gm"
        names = {"C": "C", "F u": "F", "F y": "F", "F/Gm": "F/Gm", self.inner: self.inner}
        copies = {copy: self.blocks[name] for copy, name in names.items()}
        ends = np.cumsum([0, *(copy.B.size for copy in copies.values()), delay.memory]).tolist()
        self.rows = dict(zip([*copies, "past"], map(slice, ends[:-1], ends[1:]), strict=True))
        self.states = n = int(ends[-1])
        unit = np.eye(n + 3)  # every signal is a row over the states, r, y and the u applied
        r, y, u = unit[n:]
        past = unit[self.rows["past"]]

        def output(copy: str, signal: FloatArray) -> FloatArray:
            own = unit[self.rows[copy]]
            return np.asarray(copies[copy].C @ own + copies[copy].D * signal)

        late: FloatArray = sum(weight * [u, *past][age] for weight, age in delay.terms)
        filtered, explained = output("F u", late), output("F/Gm", y)
        entering = u - filtered if delay else u
        error = r - output("F y", y) - output(self.inner, entering)
        command = output("C", error) + filtered - explained  # with what u[k] adds to itself
        self.estimate = explained - filtered
        self.factor = float(1 - command[-1])
        C, F, inner = (self.blocks[name].D for name in ("C", "F", self.inner))
        if abs(self.factor) < SINGULAR * (1 + abs(F) + abs(C * inner)):
            raise ValueError(
                f"the sampled loop is ill-posed: u[k] stands on both sides of the diagram with the "
                f"same factor, (1 - F)(1 + C·model) = {self.factor:.3g} at z = ∞; choose another "
                "dt or another controller gain"
            )
        self.C, self.D = command[:n] / self.factor, command[n:-1] / self.factor

        inputs = {"C": error, "F u": late, "F y": y, "F/Gm": y, self.inner: entering}
        renewed = [
            copies[copy].A @ unit[self.rows[copy]] + np.outer(copies[copy].B, signal)
            for copy, signal in inputs.items()
        ]
        self.A, self.B = np.split(np.vstack([*renewed, *[u, *past][: len(past)]]), [n], axis=1)

    def start(self, r: float, y: float, u: float) -> FloatArray:
        """States that take over from a constant u, y being at rest, shape (n,).

        If C integrates, the first output is u. Otherwise it is u only where r, y and u are a state
        of rest of the loop; elsewhere C answers to the error at once.
        """
        found = {"past": np.full(self.delay.memory, u)}

        def output(copy: str, name: str, input: float, integrated: float) -> float:
            found[copy] = at_rest(self.sections[name], input, integrated)
            return float(self.blocks[name].C @ found[copy] + self.blocks[name].D * input)

        filtered = output("F u", "F", u, u)
        estimate = output("F/Gm", "F/Gm", y, 0.0) - filtered
        entering = u - filtered if self.delay else u
        yf = output("F y", "F", y, y) + output(self.inner, self.inner, entering, 0.0)
        output("C", "C", r - yf, u + estimate)
        return np.concatenate([found[name] for name in self.rows])
