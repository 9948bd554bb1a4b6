r"""The method of steps: a linear system driven by its own output one dead time ago.

    x' = A x + B z        (y, v) = C x + D z        z(t) = v(t - θ), zero before t = θ

In every interval between two multiples of θ the signal z is known from the interval before. The
interval is cut into panels on which signals are polynomials, the same panels in every interval, so
that no jump and no kink ever lies inside one. What a multiple of θ sets off is fast first and slow
afterwards: the panels start as short as the fastest mode asks, and grow as it dies out. Panels are
solved by Radau collocation, which damps what is too fast to be seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import lgamma, log

import numpy as np
from numpy.polynomial import chebyshev, legendre
from scipy.linalg import block_diag, schur

from .blocks import ComplexArray, FloatArray
from .timescales import Block

MAX_PANELS = 400_000
"""Panels that one march may take: a second or two."""

MAX_DELAYS = 1_000_000
"""Dead times that may be leapt over: rounding grows with each."""

_NODES = 17
_REACH = 2.0  # rate times length of a panel at which nothing but rounding is left
_LOG_ROUNDING = log(1e-16)
_MAX_STATE = 800
_LONG_MARCH = 20_000


@dataclass(frozen=True)
class _Interval:
    """What one interval of length θ does, panel by panel (P of them, m nodes in each).

    Attributes
    ----------
    edges : (P + 1,) array
        Borders of the panels, from 0 to θ.
    advance : (P, n, n) and (P, n, m) arrays
        To the state at the end of a panel, from the state at its start and z at its nodes.
    outputs : (P, 2, m, n) and (P, 2, m, m) arrays
        To y and v at its nodes, likewise.
    """

    edges: FloatArray
    advance: tuple[FloatArray, FloatArray]
    outputs: tuple[FloatArray, FloatArray]

    def step(self, x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """From x (n, c) and z (P, m, c) to the next x, and to y and v at the nodes (P, 2, m, c)."""
        (E, gamma), (from_x, from_z) = self.advance, self.outputs
        drive = gamma @ z
        starts = np.empty((E.shape[0], *x.shape))
        for j in range(E.shape[0]):
            starts[j] = x
            x = E[j] @ x + drive[j]
        values = from_x @ starts[:, np.newaxis] + from_z @ z[:, np.newaxis]
        return x, values

    @property
    def as_matrix(self) -> FloatArray:
        """Return the map of [x; z] over one interval."""
        panels, n = self.advance[0].shape[:2]
        size = n + panels * _NODES
        unit = np.eye(size)
        x, values = self.step(unit[:n], unit[n:].reshape(panels, _NODES, size))
        return np.vstack([x, values[:, 1].reshape(-1, size)])


def delayed_response(
    driven: Sequence[Block], free: Sequence[Block], delay: float, times: FloatArray
) -> FloatArray:
    """Outputs y and v at `times`, shape (2, N).

    Parameters
    ----------
    driven : sequence of Block
        What z does to (y, v), side by side, at rest at first.
    free : sequence of Block
        What the input does to (y, v): impulse responses of these blocks.
    delay : float
        θ > 0, seconds.
    times : (N,) array of float
        Increasing, from 0 or later, in seconds.

    Raises
    ------
    ValueError
        If `times` spans so many panels, or so many dead times, that no result could be given in
        reasonable time and with nine digits.
    """
    start = np.concatenate([np.zeros(sum(b.B.size for b in driven)), *(b.B for b in free)])
    idle = [Block(b.A, np.zeros_like(b.B), b.C, np.zeros_like(b.D)) for b in free]
    blocks = [*driven, *idle]
    for finer in (1.0, 2.0, 4.0):
        interval = _interval(blocks, _mesh(blocks, delay, finer), delay)
        edges = interval.edges
        # A time that only rounding puts before a border is meant to be on it.
        index = np.floor(times / delay + 1e-9).astype(int)
        local = np.clip(times - index * delay, 0.0, delay)
        panel = np.clip(np.searchsorted(edges, local, side="right") - 1, 0, edges.size - 2)
        intervals, which = np.unique(index, return_inverse=True)
        values, tail = _seen(interval, start, intervals)
        if tail <= 1e-11:
            break
    else:
        raise ArithmeticError(
            "the signals between two multiples of the dead time are too fast to be resolved; "
            "shorten timepts or slow the fastest block"
        )
    length = np.diff(edges)
    place = (local - edges[panel]) / length[panel]
    basis = chebyshev.chebvander(2 * place - 1, _NODES - 1) @ _to_chebyshev()
    outputs: FloatArray = np.einsum("im,iom->oi", basis, values[which, panel])
    return outputs


def _mesh(blocks: Sequence[Block], delay: float, finer: float) -> FloatArray:
    """Borders of panels: each mode is resolved, or has died out since the last multiple of θ."""
    poles = np.concatenate([np.linalg.eigvals(b.A) for b in blocks] or [np.zeros(0)])
    rate, decay = finer * np.abs(poles), np.maximum(-poles.real, 0.0) / finer
    edges = [0.0]
    while edges[-1] < delay:
        left = edges[-1]
        length = delay - left
        while length > 1e-14 * delay and not _resolved(rate * length, decay * left):
            length /= 1.5
        if delay - left - length < 1e-9 * delay:
            length = delay - left
        edges.append(left + length)
        if len(edges) > MAX_PANELS // 8 or length <= 1e-14 * delay:
            raise ValueError(_too_long(len(edges)))
    return np.array(edges)


def _resolved(reach: FloatArray, died_out: FloatArray) -> bool:
    """Tell whether all of exp(p t), |p| length = `reach`, are polynomials to rounding."""
    hard = reach > _REACH
    if not hard.any():
        return True
    # The coefficients of exp(z x/2) behind degree m - 1 start with about 2 (z/4)^m/m!.
    size = _NODES * np.log(reach[hard] / 4) - lgamma(_NODES + 1)
    return bool((size - died_out[hard] <= _LOG_ROUNDING).all())


def _too_long(panels: float) -> str:
    return (
        f"timepts spans over {panels:,} panels of the fastest mode that does not die out, more "
        f"than the {MAX_PANELS:,} that dead time allows; shorten timepts or slow the fastest block"
    )


def _interval(blocks: Sequence[Block], edges: FloatArray, delay: float) -> _Interval:
    """Solve every panel for every block."""
    lengths = np.diff(edges)
    solved = [_collocated(block, lengths) for block in blocks]
    advance = np.array([block_diag(*parts) for parts in zip(*(s[0] for s in solved), strict=True)])
    gamma = np.concatenate([s[1] for s in solved], axis=1)
    from_x = np.concatenate([s[2] for s in solved], axis=3)
    from_z = sum((s[3] for s in solved), np.zeros(1))
    return _Interval(edges, (advance, gamma), (from_x, from_z))


def _collocated(
    block: Block, lengths: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Panels of the given lengths for one block, in the order of `_Interval`."""
    panels, n, m = lengths.size, block.B.size, _NODES
    integral = _radau()[1]
    T, U = schur(block.A, output="complex")
    x = np.zeros((panels, n, m, n + m), dtype=complex)  # in the coordinates of Schur
    for i in reversed(range(n)):
        right = np.zeros((panels, m, n + m), dtype=complex)
        right[:, :, i] = 1.0
        slope = np.einsum("k,pkmc->pmc", T[i, i + 1 :], x[:, i + 1 :])
        slope[:, :, n:] += (U[:, i].conj() @ block.B) * np.eye(m)
        right += lengths[:, None, None] * (integral @ slope)
        left = np.eye(m) - (lengths * T[i, i])[:, None, None] * integral
        x[:, i] = np.linalg.solve(left, right)
    x[..., :n] = x[..., :n] @ U.conj().T
    states = np.real(np.einsum("ik,pkmc->pimc", U, x))
    values = np.einsum("oi,pimc->pomc", block.C, states)
    from_z = values[..., n:] + block.D[:, None, None] * np.eye(m)
    return states[:, :, -1, :n], states[:, :, -1, n:], values[..., :n], from_z


@lru_cache(maxsize=1)
def _radau() -> tuple[FloatArray, FloatArray]:
    """Nodes in (0, 1], the last one 1, and the integrals from 0 to each of them."""
    m = _NODES
    x = np.sort(legendre.legroots(np.append(np.zeros(m - 1), [1.0, -1.0])).real)
    x[-1] = 1.0
    nodes = (x + 1) / 2
    antiderivative = chebyshev.chebint(np.eye(m), lbnd=-1) / 2
    integral = chebyshev.chebvander(x, m) @ antiderivative @ np.linalg.inv(
        chebyshev.chebvander(x, m - 1)
    )
    return nodes, np.asarray(integral)


@lru_cache(maxsize=1)
def _to_chebyshev() -> FloatArray:
    """Chebyshev coefficients on a panel from values at its nodes."""
    return np.asarray(np.linalg.inv(chebyshev.chebvander(2 * _radau()[0] - 1, _NODES - 1)))


def _seen(
    interval: _Interval, start: FloatArray, intervals: FloatArray
) -> tuple[FloatArray, float]:
    """Values (k, P, 2, m) at the nodes of the k `intervals`, and what polynomials leave of them."""
    panels, n = interval.advance[0].shape[:2]
    last = int(intervals[-1])
    x, z = start[:, np.newaxis], np.zeros((panels, _NODES, 1))
    size = n + panels * _NODES
    jumps, which = np.unique(np.diff(intervals, prepend=0), return_inverse=True)
    leaps = last > 4 * intervals.size and last > 1000 and size <= _MAX_STATE
    if leaps and last > MAX_DELAYS:
        raise ValueError(
            f"timepts spans {last:,} dead times, more than the {MAX_DELAYS:,} after which "
            "rounding could show in the ninth digit; shorten timepts"
        )
    if not leaps and (last + 1) * panels > MAX_PANELS:
        raise ValueError(_too_long((last + 1) * panels))
    seen = []
    if leaps:
        matrix = interval.as_matrix
        powers = [np.linalg.matrix_power(matrix, int(jump)) for jump in jumps]
        state = np.vstack([x, z.reshape(-1, 1)])
        for i in which:
            state = powers[i] @ state
            x, z = state[:n], state[n:].reshape(panels, _NODES, 1)
            seen.append(interval.step(x, z)[1][..., 0])
    else:
        wanted = set(intervals.tolist())
        for k in range(last + 1):
            x, values = interval.step(x, z)
            z = values[:, 1]
            if k in wanted:
                seen.append(values[..., 0])
    values = np.array(seen)
    tail = np.abs(np.einsum("cm,kpom->kpoc", _to_chebyshev()[-2:], values)).max(axis=(1, 3))
    size = np.abs(values).max(axis=(1, 3))
    tail, size = (np.where(np.isfinite(each), each, 0.0).max(axis=0) for each in (tail, size))
    return values, float((tail / np.where(size > 0, size, 1.0)).max())
