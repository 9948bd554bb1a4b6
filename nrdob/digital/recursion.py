r"""Linear recursions with decisions in them: many samples at once, one by one where it is decided.

A loop with a limit is linear in everything but the few numbers that a limit makes of others. With
x the states, w the inputs and v the *decisions* of a sample (the u that the actuator applies, a
reading that a converter rounds)::

    x[k+1] = A x[k] + B w[k] + G v[k]
    v[k] = rule(p[k], v[k-1])        p[k] = C x[k] + D w[k] + H v[k]        H strictly lower

Over a block of m samples all of p follows from x at its beginning, from w, and from the decisions
before: p = O x + T w + S v with S strictly lower triangular. The parts in w are computed for all
blocks at once, as products of matrices. If every rule leaves p as it is, v = (I - S)^{-1}(O x +
T w) is the answer for the whole block; where one does not, the block is gone through sample by
sample, at one scalar product for each. So the worst that limits can do, to chatter from one sample
to the next, costs no more than that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse import csr_array
from scipy.sparse.linalg import matrix_power

from ..numerics import FloatArray
from .limits import Rule

__all__ = ["March", "Recursion", "march"]

LONGEST = 64
"""Samples in one block: the work for a sample grows with it, the work for a block is spread."""

GROWTH = 1e3
"""By how much a block may multiply what has been decided in it: so many digits are lost."""


MOST_DENSE = 100
"""States up to which nothing is gained by leaving out zeros."""


@dataclass(frozen=True, eq=False)
class Recursion:
    """The matrices of one sample, for n states, q inputs, p decisions.

    Attributes
    ----------
    A, B, G : arrays of float, shapes (n, n), (n, q), (n, p)
        How the states are renewed.
    C, D, H : arrays of float, shapes (p, n), (p, q), (p, p)
        What is proposed; a decision may hang on those before it in the same sample.
    """

    A: FloatArray
    B: FloatArray
    G: FloatArray
    C: FloatArray
    D: FloatArray
    H: FloatArray


@dataclass(frozen=True, eq=False)
class March:
    """What came of it.

    Attributes
    ----------
    recursion : Recursion
        What was gone through.
    inputs : array of float, shape (b, m q)
        The inputs in b blocks of m samples, the last one filled up with zeros.
    starts : array of float, shape (b, n)
        States at the beginning of each block.
    decided : array of float, shape (b, m p)
        What was decided.
    samples : int
        How many samples there are, N.
    """

    recursion: Recursion
    inputs: FloatArray
    starts: FloatArray
    decided: FloatArray
    samples: int

    @property
    def decisions(self) -> FloatArray:
        """What was decided in each sample, shape (N, p)."""
        return self.decided.reshape(-1, self.recursion.G.shape[1])[: self.samples]

    def outputs(self, C: FloatArray, D: FloatArray, H: FloatArray) -> FloatArray:
        """Signals C x + D w + H v of each sample.

        Parameters
        ----------
        C, D, H : arrays of float, shapes (r, n), (r, q), (r, p)
            Rows over states, inputs and decisions.

        Returns
        -------
        (N, r) array of float
            The signals.
        """
        m = self.decided.shape[1] // self.recursion.G.shape[1]
        from_states, from_inputs, from_decisions = _lifted(self.recursion, m, C, D, H)
        found = self.starts @ from_states.T
        found += self.inputs @ from_inputs.T
        found += self.decided @ from_decisions.T
        return found.reshape(-1, len(C))[: self.samples]


@np.errstate(over="ignore", invalid="ignore")  # what overflows is looked for at the end
def march(
    recursion: Recursion,
    states: FloatArray,
    inputs: FloatArray,
    rules: Sequence[Rule],
    before: Sequence[float],
) -> March:
    """Go through all samples.

    Parameters
    ----------
    recursion : Recursion
        The matrices.
    states : (n,) array of float
        States at the first sample.
    inputs : (N, q) array of float
        Inputs at each sample.
    rules : sequence of p Rule
        How each decision is made.
    before : sequence of p floats
        What was decided in the sample before the first one.

    Returns
    -------
    March
        The decisions, and all other signals on demand.

    Raises
    ------
    ArithmeticError
        If a state leaves the range of floating-point numbers; the message says at which sample.

    Examples
    --------
    An integrator with -x[k] fed back, at most 0.4 in a sample:

    >>> import numpy as np
    >>> from nrdob.digital.limits import Limits, limited
    >>> one, none = np.ones((1, 1)), np.zeros((1, 0))
    >>> loop = Recursion(one, none, one, -one, none, 0 * one)
    >>> rules = [limited(Limits(-0.4, 0.4), 1.0)]
    >>> march(loop, np.ones(1), np.zeros((4, 0)), rules, [0.0]).decisions[:, 0].round(6).tolist()
    [-0.4, -0.4, -0.2, 0.0]
    """
    (n, p), samples = recursion.G.shape, len(inputs)
    m = _block_length(recursion, samples)
    blocks = -(-samples // m)
    padded = np.zeros((blocks * m, inputs.shape[1]))
    padded[:samples] = inputs
    grouped = padded.reshape(blocks, -1)

    from_states, from_inputs, from_decisions = _lifted(
        recursion, m, recursion.C, recursion.D, recursion.H
    )
    over = _power(recursion.A, m)
    to_end, decisions_to_end = _to_the_end(recursion, m)
    undecided = _all_free(from_decisions)
    from_outside, outside_to_end = grouped @ from_inputs.T, grouped @ to_end.T

    values = np.zeros(m * p)  # what is decided in the block at hand
    steps = [
        (from_decisions[i, :i].dot, values[:i], rules[i % p].apply, i, i % p) for i in range(m * p)
    ]
    starts, decided = np.zeros((blocks, n)), np.zeros((blocks, m * p))
    x, previous = states, [float(value) for value in before]
    for block in range(blocks):
        starts[block] = x
        proposed = from_outside[block] + from_states @ x
        values[:] = undecided @ proposed
        if not all(rule.leaves(values[r::p], previous[r]) for r, rule in enumerate(rules)):
            now = previous.copy()
            for own, (dot, past, apply, i, r) in zip(proposed.tolist(), steps, strict=True):
                values[i] = now[r] = apply(own + float(dot(past)), now[r])
        previous = values[-p:].tolist()
        decided[block] = values
        x = over @ x + outside_to_end[block] + decisions_to_end @ values
    _check_finite(starts, decided, m)
    return March(recursion, grouped, starts, decided, samples)


def _power(A: FloatArray, m: int) -> Any:
    """Raise to the power m; long dead times are mostly zeros, which are left out."""
    if len(A) <= MOST_DENSE:
        return np.linalg.matrix_power(A, m)
    return matrix_power(csr_array(A), m)


def _block_length(recursion: Recursion, samples: int) -> int:
    """Choose the samples that go together, few where decisions grow from one to the next."""
    p = len(recursion.H)
    m = min(LONGEST, samples)
    while m > 1:
        from_states, _, coupling = _lifted(recursion, m, recursion.C, recursion.D, recursion.H)
        growth = np.abs(_all_free(coupling)) @ np.abs(coupling)
        # Decisions of one kind among themselves: that does not hang on their units.
        largest = max(growth[r::p, r::p].max() for r in range(p))
        if largest <= GROWTH and np.isfinite(from_states).all():
            break
        m //= 2
    return m


def _all_free(coupling: FloatArray) -> FloatArray:
    """Solve for decisions that are all left as proposed, none of them by way of a later one."""
    unit = np.eye(len(coupling))
    return np.asarray(
        solve_triangular(unit - coupling, unit, lower=True, unit_diagonal=True, check_finite=False)
    )


def _lifted(
    recursion: Recursion, m: int, C: FloatArray, D: FloatArray, H: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Write signals C x + D w + H v of m samples over the first x, all w and all v."""
    powers = [C]
    for _ in range(m - 1):
        powers.append(powers[-1] @ recursion.A)
    observed = np.array(powers)  # C A^k

    def lower(direct: FloatArray, into: FloatArray) -> FloatArray:
        # The answer k samples after an impulse, and last of all none before it.
        answers = np.concatenate([direct[None], observed[:-1] @ into, 0 * direct[None]])
        lag = np.subtract.outer(np.arange(m), np.arange(m))
        grid = answers[np.where(lag >= 0, lag, m)]
        return np.asarray(grid.transpose(0, 2, 1, 3).reshape(m * direct.shape[0], -1))

    return (
        observed.reshape(-1, C.shape[1]),
        lower(D, recursion.B),
        lower(H, recursion.G),
    )


def _to_the_end(recursion: Recursion, m: int) -> tuple[FloatArray, FloatArray]:
    """How the inputs and the decisions of m samples move the states at their end."""
    inputs, decisions = [recursion.B], [recursion.G]
    for _ in range(m - 1):
        inputs.append(recursion.A @ inputs[-1])
        decisions.append(recursion.A @ decisions[-1])
    return np.hstack(inputs[::-1]), np.hstack(decisions[::-1])


def _check_finite(starts: FloatArray, decided: FloatArray, m: int) -> None:
    lost = ~(np.isfinite(starts).all(axis=1) & np.isfinite(decided).all(axis=1))
    if lost.any():
        raise ArithmeticError(
            "the signals leave the range of floating-point numbers near sample "
            f"{int(np.argmax(lost)) * m}: the loop is unstable, or the limits are too narrow for "
            "an unstable process; simulate fewer samples"
        )
