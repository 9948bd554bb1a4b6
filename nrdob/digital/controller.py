r"""What the processor runs: every block one difference equation, the diagram solved for u[k].

Each block of the diagram is sampled as one (F, F/Gm, (1 - F) Gm and C, without what cancels in it)
and is a small state space of its own. At the sample k the processor reads y[k] (with its noise) and
r[k], and both u[k] and yf[k] stand on two sides of the diagram::

    f = F u        q = (F/Gm) y        yf = F y + (1 - F) Gm u        u = C (r - yf) + f - q

With the direct terms of the blocks taken out, f = f0 + F∞ u and (1 - F) Gm u = m0 + M∞ u with f0
and m0 known from the past, that is one linear equation for u[k]::

    (1 - F∞ + C∞ M∞) u[k] = c0 + C∞ (r - F y - m0) + f0 - (F/Gm) y

where c0 is what C still gives from its past. If the factor on the left is 0 the sampled loop is
ill-posed and refused. Only then are the states renewed, with the u that has really been *applied*:
an actuator at its limit, or a hand on the valve, is then no disturbance, and the observer cannot
wind up. With a limit sat(u) this u is also the solution of the diagram with the limit in it, as
long as the factor is positive.

A model that waits has F W in place of F, where u goes through (W u)[k] = (1 - φ) u[k-m] +
φ u[k-m-1] for a dead time of (m + φ) dt: for whole samples that is exact, and for a fraction it is
what a held u is on average over a sample. Its yf is F y + Gm0 (u - F W u), with Gm0 one block.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from ..diagram import Fraction
from ..numerics import FloatArray
from .hold import realised

__all__ = ["SampledBlock", "SampledController", "Wait", "bilinear_block", "wired"]

SINGULAR = 1e-12
"""Size of the factor of u[k], against its terms, at which it is 0."""


@dataclass(frozen=True, eq=False)
class SampledBlock:
    """One block as difference equations, x[k+1] = A x[k] + B v[k] and w[k] = C x[k] + D v[k].

    Attributes
    ----------
    name : str
        How the diagram writes it.
    A, B, C, D : arrays of float, shapes (n, n), (n,), (n,), and a float
        The state space.
    """

    name: str
    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: float

    @property
    def states(self) -> int:
        """Number of states."""
        return self.B.size


@dataclass(frozen=True)
class Wait:
    """The dead time of a model on the processor: (1 - φ) u[k-m] + φ u[k-m-1].

    Attributes
    ----------
    samples : int
        m.
    fraction : float
        φ, 0 <= φ < 1.
    """

    samples: int = 0
    fraction: float = 0.0

    def __bool__(self) -> bool:
        """Whether there is anything to wait for."""
        return self.samples > 0 or self.fraction > 0

    @property
    def memory(self) -> int:
        """Number of past inputs that must be kept."""
        return self.samples + (self.fraction > 0)


@dataclass(frozen=True, eq=False)
class SampledController:
    """All that the processor does from (r, y, applied u) to u.

    In each sample it computes ``u = C @ x + D @ (r, y)``, writes it, and then renews its states
    with what has been applied, ``x = A @ x + B @ (r, y, applied)``. The same is written out block
    by block in `nrdob.digital.controller`. The matrices are built when they are first used.

    Attributes
    ----------
    dt : float
        Sampling time in seconds.
    blocks : dict of str: SampledBlock
        The blocks: "C", "F" (of which there are two copies, one of u and one of y), "F/Gm" and
        "(1-F)Gm" (for a model that waits "Gm", the model without its dead time).
    wait : Wait
        Dead time of the model.
    factor : float
        1 - F∞ + C∞ M∞, the factor of u[k] in the diagram.
    """

    dt: float
    blocks: Mapping[str, SampledBlock]
    wait: Wait
    factor: float

    @property
    def states(self) -> int:
        """Number of states."""
        return sum(part.states for part in self._parts.values()) + self.wait.memory

    @cached_property
    def rows(self) -> dict[str, slice]:
        """Which states belong to which block: "C", "F u", "F y", "F/Gm", "(1-F)Gm" or "Gm".

        And "wait", the past inputs, youngest first.
        """
        sizes = [part.states for part in self._parts.values()]
        ends = np.cumsum([0, *sizes, self.wait.memory]).tolist()
        return dict(zip([*self._parts, "wait"], map(slice, ends[:-1], ends[1:]), strict=True))

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
    def _parts(self) -> dict[str, SampledBlock]:
        controller, F, inverse = (self.blocks[name] for name in ("C", "F", "F/Gm"))
        inner = inner_block(self.blocks)
        return {"C": controller, "F u": F, "F y": F, "F/Gm": inverse, inner.name: inner}

    @cached_property
    def _signals(self) -> dict[str, FloatArray]:
        """Inputs of the blocks, and the command with that of u[k], over (states, r, y, u)."""
        n, inner = self.states, inner_block(self.blocks).name
        r, y, u = np.eye(3, n + 3, n)

        def output(name: str, signal: FloatArray) -> FloatArray:
            row = self._parts[name].D * signal
            row[self.rows[name]] += self._parts[name].C
            return row

        late = self._waited(u) if self.wait else u
        filtered = output("F u", late)
        entering = u - filtered if self.wait else u
        error = r - output("F y", y) - output(inner, entering)
        command = output("C", error) + filtered - output("F/Gm", y)
        return {"C": error, "F u": late, "F y": y, "F/Gm": y, inner: entering, "command": command}

    @cached_property
    def _renewed(self) -> FloatArray:
        n, line = self.states, self.rows["wait"]
        renewed = np.zeros((n, n + 3))
        for name, part in self._parts.items():
            own = self.rows[name]
            renewed[own, own] = part.A
            renewed[own] += np.outer(part.B, self._signals[name])
        if self.wait:
            renewed[line.start, n + 2] = 1.0
            younger = np.arange(line.start, line.stop - 1)
            renewed[younger + 1, younger] = 1.0
        return renewed

    def _waited(self, u: FloatArray) -> FloatArray:
        """(1 - φ) u[k-m] + φ u[k-m-1], as a row over (states, r, y, u)."""
        samples, fraction = self.wait.samples, self.wait.fraction
        late = (1 - fraction) * u if not samples else np.zeros(u.size)
        for age, share in ((samples, 1 - fraction), (samples + 1, fraction)):
            if age and share:
                late[self.rows["wait"].start + age - 1] = share
        return late


def bilinear_block(name: str, block: Fraction, alpha: float, dt: float) -> SampledBlock:
    r"""Turn a block of w = (z - 1)/(α (z + 1)) into difference equations.

    With Tustin's α = dt/2 this samples a block of s.

    Parameters
    ----------
    name : str
        How the diagram writes the block.
    block : Fraction
        Proper, in powers of w.
    alpha : float
        α in seconds.
    dt : float
        Sampling time in seconds.

    Raises
    ------
    ValueError
        If the block has a pole at w = 1/α, which would be at z = ∞.

    Examples
    --------
    >>> import numpy as np
    >>> integrator = bilinear_block("C", Fraction(np.ones(1), np.array([1.0, 0.0])), 0.05, 0.1)
    >>> integrator.A.tolist(), integrator.D                 # the trapezoidal rule
    ([[1.0]], 0.05)
    """
    A, B, C, D = realised(block, dt)
    n = B.size
    if not n:
        return SampledBlock(name, A, B, C, D)
    implicit = np.eye(n) - alpha * A
    largest = np.maximum(np.abs(implicit).sum(axis=1), SINGULAR)
    if np.linalg.svd(implicit / largest[:, None], compute_uv=False)[-1] < SINGULAR:
        raise ValueError(
            f"{name} has a pole at {1 / alpha:.6g} rad/s, which Tustin's rule maps to z = ∞: it "
            "would need y before it is there; choose another dt"
        )
    factors = lu_factor(implicit)
    column = lu_solve(factors, B)
    return SampledBlock(
        name,
        np.asarray(lu_solve(factors, np.eye(n) + alpha * A)),
        2 * alpha * column,
        np.asarray(lu_solve(factors, C, trans=1)),
        float(D + alpha * C @ column),
    )


def wired(blocks: Mapping[str, SampledBlock], wait: Wait, dt: float) -> SampledController:
    """Wire the blocks as the diagram does, and solve it for u[k].

    Parameters
    ----------
    blocks : dict of str: SampledBlock
        "C", "F", "F/Gm", and "(1-F)Gm" or, for a model that waits, "Gm".
    wait : Wait
        Dead time of the model.
    dt : float
        Sampling time in seconds.

    Raises
    ------
    ValueError
        If the diagram has no solution for u[k].
    """
    controller, F, inner = blocks["C"], blocks["F"], inner_block(blocks)
    if wait:
        at_once = 0.0 if wait.samples else 1 - wait.fraction
        factor = (1 - F.D * at_once) * (1 + controller.D * inner.D)
    else:
        factor = 1 - F.D + controller.D * inner.D
    size = 1 + abs(F.D) + abs(controller.D * inner.D)
    if abs(factor) < SINGULAR * size:
        raise ValueError(
            f"the sampled loop is ill-posed: u[k] stands on both sides of the diagram with the "
            f"same factor, (1 - F)(1 + C·model) = {factor:.3g} at z = ∞; choose another dt or "
            "another controller gain"
        )
    return SampledController(dt, dict(blocks), wait, factor)


def inner_block(blocks: Mapping[str, SampledBlock]) -> SampledBlock:
    """Return the block of the model: "(1-F)Gm", or "Gm" for a model that waits."""
    return blocks["Gm"] if "Gm" in blocks else blocks["(1-F)Gm"]
