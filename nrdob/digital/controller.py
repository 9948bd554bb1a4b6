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
from functools import cached_property

import numpy as np

from ..numerics import FloatArray
from .sections import Section, StateSpace, at_rest, bilinear_sections, state_space

__all__ = ["ModelDelay", "SampledController", "sampled_controller"]

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


@dataclass(frozen=True, eq=False)
class SampledController:
    """All that the processor does from (r, y, applied u) to u.

    In each sample it computes ``u = C @ x + D @ (r, y)``, writes it, and then renews its states
    with what has been applied, ``x = A @ x + B @ (r, y, applied)``. Its blocks are "C", "F" (of
    which there are two copies, one of u and one of y), "F/Gm" and "(1-F)Gm" (for a model with dead
    time "Gm", the model without it).
    """

    dt: float
    sections: Mapping[str, tuple[Section, ...]]
    delay: ModelDelay

    @cached_property
    def blocks(self) -> dict[str, StateSpace]:
        """The blocks by name, each as one state space."""
        return {name: state_space(cascade) for name, cascade in self.sections.items()}

    @property
    def inner(self) -> str:
        """Name of the block between u and yf: "(1-F)Gm" or "Gm"."""
        return "Gm" if self.delay else "(1-F)Gm"

    @cached_property
    def factor(self) -> float:
        """1 - F∞ + C∞ M∞, the factor of u[k] in the diagram."""
        return float(1 - self._signals["command"][-1])

    @property
    def states(self) -> int:
        """Number of states."""
        return int(self.rows["past"].stop)

    @cached_property
    def rows(self) -> dict[str, slice]:
        """Which states belong to which block: "C", "F u", "F y", "F/Gm", "(1-F)Gm" or "Gm".

        And "past", the past inputs that a model with dead time keeps, youngest first.
        """
        sizes = [block.B.size for block in self._copies.values()]
        ends = np.cumsum([0, *sizes, self.delay.memory]).tolist()
        return dict(zip([*self._copies, "past"], map(slice, ends[:-1], ends[1:]), strict=True))

    @property
    def A(self) -> FloatArray:
        """How the states are renewed from the states, shape (n, n)."""
        return self._renewed[:, : self.states]

    @property
    def B(self) -> FloatArray:
        """How the states are renewed from (r, y, applied u), shape (n, 3)."""
        return self._renewed[:, self.states :]

    @property
    def C(self) -> FloatArray:
        """Part of u from the states, shape (n,)."""
        return self._signals["command"][: self.states] / self.factor

    @property
    def D(self) -> FloatArray:
        """Part of u from (r, y), shape (2,)."""
        return self._signals["command"][self.states : -1] / self.factor

    @property
    def estimate(self) -> FloatArray:
        """The estimate of the disturbance at the input over (states, r, y, applied u)."""
        return self._signals["estimate"]

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

    @cached_property
    def _copies(self) -> dict[str, StateSpace]:
        names = {"C": "C", "F u": "F", "F y": "F", "F/Gm": "F/Gm", self.inner: self.inner}
        return {copy: self.blocks[name] for copy, name in names.items()}

    @cached_property
    def _signals(self) -> dict[str, FloatArray]:
        """Inputs of the blocks, estimate, and command with that of u[k], over (x, r, y, u)."""
        n = self.states
        r, y, u = np.eye(3, n + 3, n)

        def output(name: str, signal: FloatArray) -> FloatArray:
            row = self._copies[name].D * signal
            row[self.rows[name]] += self._copies[name].C
            return row

        late = self._late(u) if self.delay else u
        filtered, explained = output("F u", late), output("F/Gm", y)
        entering = u - filtered if self.delay else u
        error = r - output("F y", y) - output(self.inner, entering)
        return {
            "C": error, "F u": late, "F y": y, "F/Gm": y, self.inner: entering,
            "command": output("C", error) + filtered - explained, "estimate": explained - filtered,
        }  # fmt: skip

    @cached_property
    def _renewed(self) -> FloatArray:
        n, line = self.states, self.rows["past"]
        renewed = np.zeros((n, n + 3))
        for name, block in self._copies.items():
            own = self.rows[name]
            renewed[own, own] = block.A
            renewed[own] += np.outer(block.B, self._signals[name])
        if self.delay:
            renewed[line.start, n + 2] = 1.0
            younger = np.arange(line.start, line.stop - 1)
            renewed[younger + 1, younger] = 1.0
        return renewed

    def _late(self, u: FloatArray) -> FloatArray:
        """(1 - φ) u[k-m] + φ u[k-m-1], as a row over (states, r, y, u)."""
        late = np.zeros(u.size)
        for weight, age in self.delay.terms:
            late[self.rows["past"].start + age - 1 if age else -1] = weight
        return late


def sampled_controller(
    factors: Mapping[str, tuple[Sequence[FloatArray], Sequence[FloatArray]]],
    delay: ModelDelay,
    dt: float,
) -> SampledController:
    """Sample the blocks and solve the diagram for u[k].

    Numerators and denominators are given as factors, in descending powers of w, α = dt/2, under the
    names of `SampledController.sections`. A block with a pole at z = ∞, or a diagram without
    solution for u[k], raises a ValueError.
    """
    sections = {name: bilinear_sections(*block, dt / 2, name) for name, block in factors.items()}
    found = SampledController(dt, sections, delay)
    C, F, inner = (found.blocks[name].D for name in ("C", "F", found.inner))
    if abs(found.factor) < SINGULAR * (1 + abs(F) + abs(C * inner)):
        raise ValueError(
            f"the sampled loop is ill-posed: u[k] stands on both sides of the diagram with the "
            f"same factor, (1 - F)(1 + C·model) = {found.factor:.3g} at z = ∞; choose another dt "
            "or another controller gain"
        )
    return found
