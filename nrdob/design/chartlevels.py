"""Curves on which a function of two variables vanishes: found on a grid, solved for, followed.

A tongue that becomes narrower than the grid seems to end there. So wherever a step of a curve leads
across it and not along, the curve is followed from both ends of that step, by its tangent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from contourpy import contour_generator

from ..numerics import BoolArray, FloatArray, bisect
from .chartcurves import parts

__all__ = ["Vanishing", "level_set", "projected"]

STEPS, FARTHEST, CLOSE = 9, 0.1, 1e-9
"""Newton steps onto a curve, how far one leads at most, and how well it must then be on it."""

NUDGE = 1e-6
BESIDE = np.array([[0.0, 1.0, 0.0, -1.0, 0.0], [0.0, 0.0, 1.0, 0.0, -1.0]])
"""Distance and directions in which a slope is taken."""

ALONG = 0.9
"""Cosine of the angle between a step and the curve from which the step leads along."""

LONGEST, SHORTEST, MOST = 0.05, 1e-7, 400
"""Lengths of the steps by which a curve is followed, and how many there may be."""

TURN, ASTRAY = 0.85, 0.3
"""Cosine of the angle by which a curve may turn in a step, and how far beside its tangent a step
may end."""

Vanishing = Callable[[FloatArray, FloatArray], FloatArray]
"""A function of two arrays of one shape."""


def level_set(function: Vanishing, u: FloatArray, v: FloatArray) -> Iterator[FloatArray]:
    """Give the points, shape (2, N), of all curves that can be told from each other on a grid.

    Parameters
    ----------
    function : callable
        Of u and v; where it is no number there is no curve.
    u, v : (N,) array of float
        The lines of the grid, increasing.
    """
    values = np.ma.masked_invalid(function(u[None, :], v[:, None]))
    lines = [np.asarray(line, dtype=float).T for line in contour_generator(u, v, values).lines(0.0)]
    if not lines:
        return
    every = _on_edges(function, (u, v), np.hstack(lines))
    ends: list[FloatArray] = []
    for point in np.split(every, np.cumsum([line.shape[1] for line in lines])[:-1], axis=1):
        for part in parts(np.isfinite(point[0])):
            if part.stop - part.start > 1:
                curve = point[:, part]
                across = ~_leads_along(function, curve)
                bounds = [0, *(np.flatnonzero(across) + 1).tolist(), curve.shape[1]]
                yield from (curve[:, a:b] for a, b in pairwise(bounds) if b - a > 1)
                k = np.flatnonzero(across)
                at = np.ravel([k, k + 1], order="F")
                other, back = (np.ravel(pair, order="F") for pair in ([k + 1, k], [k - 1, k + 2]))
                last = curve.shape[1] - 1
                closed = np.array_equal(curve[:, 0], curve[:, -1])
                back = back % last if closed else np.clip(back, 0, last)
                ends.append(np.vstack([curve[:, at], curve[:, other], curve[:, back]]))
    if ends:
        bounds_of = (u[0], u[-1]), (v[0], v[-1])
        yield from _followed(function, np.hstack(ends), bounds_of)


def _on_edges(
    function: Vanishing, grid: tuple[FloatArray, FloatArray], point: FloatArray
) -> FloatArray:
    """Solve for where a function vanishes on the edges of a grid, near where it seems to.

    Beside a narrow tongue that may be far off, but between the ends of the edge it changes sign.
    """
    low, high = point.copy(), point.copy()
    for k, lines in enumerate(grid):
        after = np.clip(np.searchsorted(lines, point[k]), 1, lines.size - 1)
        between = (lines[after] != point[k]) & (lines[after - 1] != point[k])
        low[k], high[k] = (np.where(between, lines[after - n], point[k]) for n in (1, 0))

    def at(share: FloatArray) -> FloatArray:
        return function(*(low + share * (high - low)))

    share = bisect(at, np.zeros(point.shape[1]), np.ones(point.shape[1]))
    return projected(function, low + share * (high - low))


def projected(function: Vanishing, start: FloatArray) -> FloatArray:
    """Step to where a function vanishes, at right angles to the curve; no number if that fails.

    Parameters
    ----------
    function : callable
        Of u and v.
    start : (2, N) array of float
        Points near the curve.
    """
    point = start
    for _ in range(STEPS):
        value, slope = _value_and_slope(function, point)
        with np.errstate(invalid="ignore"):
            good = np.abs(value) <= CLOSE
        if good.all():
            break
        with np.errstate(all="ignore"):
            step = -value * slope / (slope**2).sum(axis=0)
            step = step * np.minimum(1.0, FARTHEST / np.hypot(*step))
        point = np.where(good, point, point + np.nan_to_num(step))
    return np.where(good, point, np.nan)


def _value_and_slope(function: Vanishing, point: FloatArray) -> tuple[FloatArray, FloatArray]:
    u, v = (point[k] + NUDGE * BESIDE[k][:, None] for k in (0, 1))
    values = function(u, v)
    return values[0], (values[1:3] - values[3:]) / (2 * NUDGE)


def _tangent(function: Vanishing, point: FloatArray) -> FloatArray:
    """Give unit vectors along the curve."""
    _, (by_u, by_v) = _value_and_slope(function, point)
    with np.errstate(all="ignore"):
        return np.asarray(np.array([-by_v, by_u]) / np.hypot(by_u, by_v))


def _leads_along(function: Vanishing, curve: FloatArray) -> BoolArray:
    """Tell which steps of a curve lead along it, at both of their ends."""
    step, tangent = np.diff(curve), _tangent(function, curve)
    length = np.hypot(*step)
    with np.errstate(all="ignore"):
        first, last = (
            np.abs((step * end).sum(axis=0)) for end in (tangent[:, :-1], tangent[:, 1:])
        )
        return np.asarray((np.minimum(first, last) >= ALONG * length) | (length < SHORTEST))


def _followed(
    function: Vanishing, ends: FloatArray, bounds: tuple[tuple[float, float], ...]
) -> Iterator[FloatArray]:
    """Follow curves from both ends of steps that lead across, until they come to the other end.

    Or to the end of the grid. All at once: `ends` holds u and v of a point, of the other end, and
    of a point of the known curve, from which it leads away; two columns for each step.
    """
    point, other, back = ends[:2].copy(), ends[2:4], ends[4:]
    size = np.minimum(np.hypot(*(other - point)), LONGEST)
    way = _tangent(function, point)
    way *= np.where(((point - back) * way).sum(axis=0) < 0, -1.0, 1.0)
    alive: BoolArray = np.asarray(np.isfinite(way).all(axis=0))
    tracks: list[list[FloatArray]] = [[p.copy()] for p in point.T]
    for _ in range(MOST):
        k = np.flatnonzero(alive)
        if not k.size:
            break
        guess = point[:, k] + size[k] * way[:, k]
        found = projected(function, guess)
        ahead = _tangent(function, found)
        ahead = ahead * np.sign((ahead * way[:, k]).sum(axis=0))
        with np.errstate(invalid="ignore"):
            good = (ahead * way[:, k]).sum(axis=0) >= TURN
            good &= np.hypot(*(found - guess)) <= ASTRAY * size[k]
        gone = k[good]
        arrived = np.hypot(*(other[:, gone] - point[:, gone])) <= 1.5 * size[gone]
        point[:, gone], way[:, gone] = found[:, good], ahead[:, good]
        arrived = arrived & (np.hypot(*(other[:, gone] - point[:, gone])) <= size[gone])
        for n, last in zip(gone.tolist(), arrived.tolist(), strict=True):
            tracks[n].append(other[:, n] if last else point[:, n].copy())
        inside = np.ones(gone.size, dtype=bool)
        for axis, (low, high) in zip(point[:, gone], bounds, strict=True):
            inside &= (axis >= low) & (axis <= high)
        alive[gone[arrived | ~inside]] = False
        size[gone] = np.minimum(1.5 * size[gone], LONGEST)
        size[k[~good]] /= 2
        alive[size < SHORTEST] = False
    for one, two in zip(tracks[::2], tracks[1::2], strict=True):
        met = len(one) > 1 and np.array_equal(one[-1], two[0])
        for track in (one,) if met else (one, two):
            if len(track) > 1:
                yield np.array(track).T
