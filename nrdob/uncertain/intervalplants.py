r"""Plants whose coefficients lie in intervals: Kharitonov's polynomials, and edges.

At each frequency the values of an interval polynomial fill a rectangle, whose corners are those of
Kharitonov's four polynomials. Two tests follow, of which the second is exact:

- The coefficients of :math:`p_B = D A + N B`, as if each were free in its interval: four
  polynomials decide (Kharitonov). They are not free, so that this refuses too much.
- Numerator and denominator as they are, fixed A and B: the loop is stable with all if and only if
  it is on 32 segments, from one corner to a neighbour in one of N and D, at a corner in the other
  (Chapellat and Bhattacharyya). A segment is tested by the frequencies at which both of its ends
  have one direction.

.. rubric:: References

Kharitonov, V. L., Asymptotic stability of an equilibrium position of a family of systems of linear
differential equations, Differ. Uravn. 14 (1978) 2086-2088.

Chapellat, H., S. P. Bhattacharyya, A generalization of Kharitonov's theorem: robust stability of
interval plants, IEEE Trans. Automatic Control 34 (1989) 306-311.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np

from ..loop import NRDOB
from ..numerics import ROUNDING, FloatArray, add, hurwitz

__all__ = ["IntervalShares", "interval_plants", "largest_share"]

HALVINGS = 50  # how often shares are halved
REAL = 0.01  # imaginary part, against the real one, up to which a root of few digits may be real

Ends = tuple[FloatArray, FloatArray]
Corner = tuple[int, int]

CORNERS: list[Corner] = [(0, 0), (0, 1), (1, 1), (1, 0)]  # largest even, odd part, or least
VERTICES = list(product(CORNERS, repeat=2))  # corners of D and of N
EDGES = list(pairwise([*CORNERS, CORNERS[0]]))
SEGMENTS = [
    ends for (a, b), c in product(EDGES, CORNERS) for ends in (((a, c), (b, c)), ((c, a), (c, b)))
]
"""From vertex to vertex, along an edge in one of D and N."""


class IntervalShares(NamedTuple):
    """Up to which share of a box of coefficients all loops are stable.

    Attributes
    ----------
    kharitonov, exact : float
        What Kharitonov's theorem on the coefficients of p_B grants, and by the 32 segments.
    """

    kharitonov: float
    exact: float


def interval_plants(
    loop: NRDOB, num: Sequence[tuple[float, float]], den: Sequence[tuple[float, float]]
) -> IntervalShares:
    """Find up to which share of a box of coefficients all loops are stable, by two theorems.

    Parameters
    ----------
    loop : NRDOB
        A stable loop, with its nominal plant, without dead time.
    num, den : sequence of (low, high)
        Intervals of the coefficients of numerator and denominator, in descending powers, around
        those of the process.

    Returns
    -------
    IntervalShares
        Parts of the way from the nominal coefficients to the ends of the intervals; 1 if all of
        it is stable.

    Raises
    ------
    ValueError
        If the loop has a dead time or is not stable, there are more or fewer intervals than
        coefficients, or one leaves the nominal coefficient out.

    Examples
    --------
    >>> import nrdob
    >>> loop = nrdob.paper.example(3)                                   # 4/(-s² - s + 2)
    >>> shares = interval_plants(loop, [(1, 7)], [(-1.9, -0.1), (-1.9, -0.1), (0.2, 3.8)])
    >>> round(shares.kharitonov, 4), shares.exact
    (0.6944, 1.0)
    """
    if loop.delay or loop.model_delay:
        raise ValueError("these theorems are about polynomials: leave out the dead time")
    if not bool(loop.stability()):
        raise ValueError(f"the nominal loop is not stable: {loop.stability().reason}")
    G = loop.fractions.G
    N, D = _box(G.num, num, "num"), _box(G.den, den, "den")
    A, B = loop.K.denominator.q, loop.K.numerator.q

    def free(share: float) -> bool:
        of_D, of_N = _times(_part(D, share), A), _times(_part(N, share), B)
        return _all_left(_corners((add(of_D[0], of_N[0]), add(of_D[1], of_N[1]))))

    def along_edges(share: float) -> bool:
        of_D, of_N = (_corners(_part(box, share)) for box in (D, N))
        p = {(d, n): add(np.convolve(of_D[d], A), np.convolve(of_N[n], B)) for d, n in VERTICES}
        return _all_left(p) and all(_stays(p[start], p[end]) for start, end in SEGMENTS)

    return IntervalShares(largest_share(free), largest_share(along_edges))


def _box(nominal: FloatArray, given: Sequence[tuple[float, float]], name: str) -> list[FloatArray]:
    """Nominal coefficients, and how far each may go down and up."""
    if len(given) != nominal.size:
        raise ValueError(
            f"{name} has {len(given)} intervals, the process {nominal.size} coefficients there: "
            f"{nominal.tolist()}"
        )
    for (low, high), c in zip(given, nominal.tolist(), strict=True):
        if not low <= c <= high:
            raise ValueError(f"{name} has ({low:g}, {high:g}), without the nominal {c:g}")
    return [nominal, *(np.array(given, dtype=float) - nominal[:, None]).T]


def _part(box: list[FloatArray], share: float) -> Ends:
    nominal, down, up = box
    return nominal + share * down, nominal + share * up


def _times(ends: Ends, fixed: FloatArray) -> Ends:
    """Multiply an interval polynomial by one: the interval of each coefficient."""
    positive, negative = np.maximum(fixed, 0.0), np.minimum(fixed, 0.0)
    low, high = ends
    return (
        np.convolve(low, positive) + np.convolve(high, negative),
        np.convolve(high, positive) + np.convolve(low, negative),
    )


def _corners(ends: Ends) -> dict[Corner, FloatArray]:
    """Kharitonov's polynomials, by least or largest real and imaginary part at every frequency."""
    low, high = (end[::-1] for end in ends)  # ascending
    k = np.arange(low.size)
    rising = (k // 2) % 2 == 0  # powers whose coefficient adds to its part
    corners = {}
    for even, odd in CORNERS:
        largest = np.where(k % 2 == 0, even, odd).astype(bool) == rising
        corners[even, odd] = np.where(largest, high, low)[::-1]
    return corners


def _all_left(polynomials: Mapping[Any, FloatArray]) -> bool:
    p = np.array(list(polynomials.values())).T
    return bool(hurwitz(p, ROUNDING * np.abs(p))[0].all())


def _stays(start: FloatArray, end: FloatArray) -> bool:
    """Whether all between a stable polynomial and another one are stable, too."""
    if start[0] * end[0] <= 0 or start[-1] * end[-1] <= 0:
        return False
    k = np.arange(start.size)[::-1]
    # In the unit of frequency in which the first coefficient is as large as the last.
    unit = (start[-1] / start[0]) ** (1 / max(start.size - 1, 1))
    start, step = (p * unit**k / start[-1] for p in (start, end - start))
    at, by = (c * 1j**k for c in (start, step))  # polynomials in ω
    roots = np.roots(np.imag(np.convolve(at, by.conj())))
    omega = roots.real[(np.abs(roots.imag) <= 1e-6 * np.abs(roots)) & (roots.real > 0)]
    with np.errstate(all="ignore"):
        t = -np.polyval(start, 1j * omega) / np.polyval(step, 1j * omega)
        crossed = (t.real >= 0) & (t.real <= 1) & (np.abs(t.imag) <= REAL * (1 + np.abs(t.real)))
    return not crossed.any()


def largest_share(stable: Callable[[float], bool]) -> float:
    """Find the share of the way up to which something holds, 1 for all of it."""
    if stable(1.0):
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low
