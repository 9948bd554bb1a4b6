r"""The method of steps: a linear system driven by its own output one dead time ago.

    x' = A x + B z        (y, v) = C x + D z        z(t) = v(t - θ), zero before t = θ

In every interval between two multiples of θ the signal z is known from the interval before. The
interval is cut into panels on which signals are polynomials, the same panels in every interval, so
that no jump and no kink ever lies inside one. What a multiple of θ sets off is fast first and slow
afterwards: the panels start as short as the fastest mode asks, and grow as it dies out. Panels are
solved by Radau collocation, which damps what is too fast to be seen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from math import lgamma, log, log2

import numpy as np
from numpy.polynomial import chebyshev, legendre
from scipy.linalg import schur

from ..numerics import Block, ComplexArray, FloatArray, IntArray

__all__ = [
    "MAX_DELAYS", "NODES", "across", "delayed_response", "panel_basis", "panel_lengths",
    "panel_matrices", "radau", "resolved_to", "side_by_side",
]  # fmt: skip

MAX_PANELS = 400_000  # panels that one march may take: a second or two
MAX_PANELS_PER_DELAY = 20_000  # panels of one dead time that fit into memory
MAX_DELAYS = 1_000_000  # dead times that may be leapt over: rounding grows with each
NODES = 17  # nodes of a panel
_GRID = np.arange(1, 33) / 32  # of the last time: where signals are looked at, too
_REACH = 2.0  # rate times length of a panel at which nothing but rounding is left
_LOG_ROUNDING = log(1e-16)
_MOST_GROWTH = 4.0  # of panels, from one to the next
_GROWING = 300  # panels, after which the rest of an interval is cut evenly
_PRODUCTS_PER_PANEL = 15_000  # of matrix elements, that take the time of one panel


@dataclass(frozen=True)
class _Interval:
    """One interval of length θ: the P + 1 borders of its panels, and the matrix of each panel."""

    edges: FloatArray
    matrices: FloatArray

    @cached_property
    def as_matrix(self) -> FloatArray:
        """Return the map of [x; z] over one interval."""
        panels, n = self.matrices.shape[0], self.matrices.shape[2] - NODES
        unit = np.eye(n + panels * NODES)
        z = unit[n:].reshape(panels, NODES, -1)
        x, values = across(self.matrices, unit[:n], z)
        return np.vstack([x, values[:, 1].reshape(-1, len(unit))])


def across(matrices: FloatArray, x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pass P panels: from x (n, c) and z at the nodes to the next x, and to both outputs there.

    z has the shape (P, k, c), the outputs (P, 2, m, c).
    """
    n, panels = x.shape[0], matrices.shape[0]
    drive = matrices[:, :n, n:] @ z
    starts = np.empty((panels, *x.shape))
    for j in range(panels):
        starts[j] = x
        x = matrices[j, :n, :n] @ x + drive[j]
    values = matrices[:, n:] @ np.concatenate([starts, z], axis=1)
    return x, values.reshape(panels, 2, NODES, -1)


def delayed_response(
    driven: Sequence[Block], free: Sequence[Block], delay: float
) -> Callable[[FloatArray], FloatArray]:
    """Prepare to march from dead time to dead time, in seconds.

    To (y, v) z does what the blocks in `driven` do, side by side, at rest at first; the input makes
    the impulse responses of the blocks in `free`. What is returned takes increasing times (N,) from
    0 on and gives y and v there, (2, N). It raises ValueError where times span too many panels or
    dead times, and ArithmeticError where signals are too fast for the panels.
    """
    blocks, start, poles = side_by_side([driven], free)

    @cache
    def refined(finer: float) -> _Interval:
        lengths = panel_lengths(poles, delay, finer)
        different, which = np.unique(lengths, return_inverse=True)
        found = panel_matrices(blocks, 1, different)
        return _Interval(np.append(0.0, np.cumsum(lengths)), found[which])

    def at(times: FloatArray) -> FloatArray:
        # Against the size that the signals had before the times asked for.
        seen, asked = np.unique(np.concatenate([times, times[-1] * _GRID]), return_inverse=True)
        # A time that only rounding puts before a border is meant to be on it.
        index = np.floor(seen / delay + 1e-9).astype(int)
        local = np.clip(seen - index * delay, 0.0, delay)
        intervals, which = np.unique(index, return_inverse=True)
        for finer in (1.0, 2.0, 4.0):
            interval = refined(finer)
            edges = interval.edges
            panel = np.clip(np.searchsorted(edges, local, side="right") - 1, 0, edges.size - 2)
            values = _seen(interval, start, intervals)[which, panel]
            if resolved_to(1e-11, values):
                break
        else:
            raise ArithmeticError(
                "the signals between two multiples of the dead time are too fast to be resolved; "
                "shorten timepts or slow the fastest block"
            )
        asked = asked[: times.size]
        place = (local - edges[panel]) / np.diff(edges)[panel]
        basis = panel_basis(place[asked])[..., np.newaxis]
        return np.asarray((values[asked] @ basis)[..., 0].T)

    return at


def side_by_side(
    groups: Sequence[Sequence[Block]], free: Sequence[Block]
) -> tuple[list[tuple[Block, int]], FloatArray, ComplexArray]:
    """All blocks, with the delayed signal that drives each, their states at t = 0, their poles."""
    blocks = [(block, k) for k, group in enumerate(groups) for block in group]
    at_rest = np.zeros(sum(block.B.size for block, _ in blocks))
    start = np.concatenate([at_rest, *(block.B for block in free)], dtype=float)
    # A free block is one that nothing drives.
    blocks += [(Block(b.A, np.zeros_like(b.B), b.C, np.zeros_like(b.D)), 0) for b in free]
    poles = [np.linalg.eigvals(block.A).astype(complex) for block, _ in blocks]
    return blocks, start, np.concatenate(poles)


def panel_basis(place: FloatArray) -> FloatArray:
    """Weights of a panel's nodes for values at places in [0, 1] of it."""
    return np.asarray(chebyshev.chebvander(2 * place - 1, NODES - 1) @ to_chebyshev())


def panel_lengths(poles: ComplexArray, delay: float, finer: float) -> FloatArray:
    """Lengths of panels on which each mode is resolved, or has died out since the last multiple."""
    rate, decay = finer * np.abs(poles), np.maximum(-poles.real, 0.0) / finer
    lengths: list[float] = []
    left, length = 0.0, delay
    while left < delay * (1 - 1e-12):
        length = min(delay - left, _MOST_GROWTH * length)
        while not resolved(rate * length, decay * left):
            length /= 1.5
        if len(lengths) >= _GROWING:  # what is left does not die out
            count = np.ceil((delay - left) / length)
            if count > MAX_PANELS_PER_DELAY:
                raise ValueError(
                    f"a mode turns so often in a dead time that {count:,.0f} panels would be "
                    f"needed for it, more than {MAX_PANELS_PER_DELAY:,}; damp the mode, or leave "
                    "it out of the blocks"
                )
            return np.append(lengths, np.full(int(count), (delay - left) / count))
        lengths.append(length)
        left += length
    return np.array(lengths)


def resolved(reach: FloatArray, died_out: FloatArray) -> bool:
    """Tell whether all of exp(p t), ``|p|`` length = `reach`, are polynomials to rounding."""
    hard = reach > _REACH
    if not hard.any():
        return True
    # The coefficients of exp(z x/2) behind degree m - 1 start with about 2 (z/4)^m/m!.
    size = NODES * np.log(reach[hard] / 4) - lgamma(NODES + 1)
    return bool((size - died_out[hard] <= _LOG_ROUNDING).all())


def panel_matrices(
    blocks: Sequence[tuple[Block, int]], groups: int, lengths: FloatArray
) -> FloatArray:
    """From the state and the delayed signals at the nodes to the next state and to both outputs.

    One matrix for each panel, (P, n + 2m, n + groups m).
    """
    n, m = sum(block.B.size for block, _ in blocks), NODES
    matrices = np.zeros((lengths.size, n + 2 * m, n + groups * m))
    first = 0
    for block, group in blocks:
        own, late = slice(first, first + block.B.size), slice(n + group * m, n + (group + 1) * m)
        E, gamma, from_x, from_z = _collocated(block, lengths)
        matrices[:, own, own] = E
        matrices[:, own, late] = gamma
        matrices[:, n:, own] = from_x.reshape(lengths.size, 2 * m, -1)
        matrices[:, n:, late] += from_z.reshape(lengths.size, 2 * m, m)
        first = own.stop
    return matrices


def _collocated(
    block: Block, lengths: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Give E, Γ and the outputs from the state and from z, for one block, panel by panel."""
    panels, n, m = lengths.size, block.B.size, NODES
    integral = radau()[1]
    T, U = schur(block.A, output="complex")
    x = np.zeros((panels, n, m, n + m), dtype=complex)  # in the coordinates of Schur
    for i in reversed(range(n)):
        right = np.zeros((panels, m, n + m), dtype=complex)
        right[:, :, i] = 1.0
        slope = (T[i, i + 1 :] @ x[:, i + 1 :].reshape(panels, -1, m * (n + m))).reshape(
            panels, m, n + m
        )
        slope[:, :, n:] += (U[:, i].conj() @ block.B) * np.eye(m)
        right += lengths[:, None, None] * (integral @ slope)
        left = np.eye(m) - (lengths * T[i, i])[:, None, None] * integral
        x[:, i] = np.linalg.solve(left, right)
    x[..., :n] = x[..., :n] @ U.conj().T
    states = np.real(U @ x.reshape(panels, n, -1))
    values = (block.C @ states).reshape(panels, -1, m, n + m)
    states = states.reshape(x.shape)
    from_z = values[..., n:] + block.D[:, None, None] * np.eye(m)
    return states[:, :, -1, :n], states[:, :, -1, n:], values[..., :n], from_z


@lru_cache(maxsize=1)
def radau() -> tuple[FloatArray, FloatArray]:
    """Nodes in (0, 1], the last one 1, and the integrals from 0 to each of them."""
    m = NODES
    x = np.sort(legendre.legroots(np.append(np.zeros(m - 1), [1.0, -1.0])).real)
    x[-1] = 1.0
    nodes = (x + 1) / 2
    antiderivative = chebyshev.chebint(np.eye(m), lbnd=-1) / 2
    integral = (
        chebyshev.chebvander(x, m) @ antiderivative @ np.linalg.inv(chebyshev.chebvander(x, m - 1))
    )
    return nodes, np.asarray(integral)


@lru_cache(maxsize=1)
def to_chebyshev() -> FloatArray:
    """Chebyshev coefficients on a panel from values at its nodes."""
    return np.asarray(np.linalg.inv(chebyshev.chebvander(2 * radau()[0] - 1, NODES - 1)))


def _seen(interval: _Interval, start: FloatArray, intervals: FloatArray) -> FloatArray:
    """Values (k, P, 2, m) at the nodes of the k `intervals`."""
    panels = interval.edges.size - 1
    last, size = int(intervals[-1]), start.size + panels * NODES
    jumps = np.diff(intervals, prepend=0).astype(np.intp)
    marched = (last + 1) * (panels + 10)
    powers = sum(log2(2 * jump) for jump in set(jumps.tolist()) if jump)  # and the matrix itself
    leapt = (powers * size**3 + jumps.size * size**2) / _PRODUCTS_PER_PANEL
    if min(marched, leapt) > MAX_PANELS:
        raise ValueError(
            f"timepts spans {last:,} dead times of {panels:,} panels, more than the {MAX_PANELS:,} "
            "panels that take a second; shorten timepts or slow the fastest block"
        )
    walk = _leap if leapt < marched else _march
    return walk(interval, start, jumps)


def resolved_to(tolerance: float, values: FloatArray) -> bool:
    """Tell whether polynomials leave that little of the signals on the panels looked at."""
    tails = np.abs(values @ to_chebyshev()[-2:].T)
    tail, most = (
        np.where(np.isfinite(each), each, 0.0).max(axis=(0, 2)) for each in (tails, np.abs(values))
    )
    return bool((tail <= tolerance * most).all())


def _march(interval: _Interval, start: FloatArray, jumps: IntArray) -> FloatArray:
    """Take interval by interval, and keep the values after each of the jumps."""
    x: FloatArray = start[:, np.newaxis]
    z: FloatArray = np.zeros((interval.edges.size - 1, NODES, 1))
    seen = []
    for jump in jumps:
        for _ in range(jump):
            x, values = across(interval.matrices, x, z)
            z = values[:, 1]
        seen.append(across(interval.matrices, x, z)[1][..., 0])
    return np.array(seen)


def _leap(interval: _Interval, start: FloatArray, jumps: IntArray) -> FloatArray:
    """Take the same with powers of the matrix of one interval."""
    n, matrix = start.size, interval.as_matrix
    state: FloatArray = np.append(start, np.zeros(matrix.shape[0] - n))
    states = []
    powers = {jump: np.linalg.matrix_power(matrix, jump) for jump in set(jumps.tolist())}
    for jump in jumps.tolist():
        state = powers[jump] @ state
        states.append(state)
    x, z = np.split(np.array(states).T, [n])
    z = z.reshape(-1, NODES, len(states))
    return np.moveaxis(across(interval.matrices, x, z)[1], -1, 0)
