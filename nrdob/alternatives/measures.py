r"""What a loop does with a step: the integrals of its error, and the peak of u.

The energy :math:`\int y^2 dt` is an integral over frequencies (`Quotient.step_energy`), exact. The
area :math:`\int |y|\,dt` has no such form; it is summed up over an exact response. The same sum
gives :math:`\int y\,dt`, which is :math:`S_\delta(s)/s` at s = 0, and the energy: times
are added until both come out.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from ..analysis import step_response
from ..diagram import LoopEquations, Quotient
from ..numerics import FloatArray, QuasiPolynomial

__all__ = ["LoadErrors", "load_errors", "step_peak"]

ACCURACY = 1e-4  # how well the known integrals must come out, against the area and the energy
TIMES, ROUNDS = 500, 6  # times in the first sum, and how often their number is doubled

SETTLING, DEAD_TIMES = 16.0, 10.0
"""Length of the response, in time constants of the slowest mode and in dead times."""

EARLIEST = 1e-6  # first time after 0, against the last
EVENLY, CLOSER, ACROSS = 1001, 2, 65  # times of a peak: evenly, how often closely, and then


class LoadErrors(NamedTuple):
    r"""Errors of y after a unit step of the load δ at the plant's input.

    Attributes
    ----------
    iae, ise : float
        :math:`\int |y|\,dt`, to 1e-4 of itself, and :math:`\int y^2\,dt`.
    """

    iae: float
    ise: float


def load_errors(loop: LoopEquations) -> LoadErrors:
    """Integrate the error after a unit step of the load δ.

    Parameters
    ----------
    loop : LoopEquations
        A stable loop; both are infinite where an offset stays.

    Raises
    ------
    ValueError, ArithmeticError
        If the loop is not stable; if the response cannot be had over long enough a time.

    Examples
    --------
    Without a change of sign the area is that of the error itself, S_δ(s)/s at s = 0, here λ:

    >>> import control as ct
    >>> from nrdob import NRDOB, LowPassFilter
    >>> G = ct.tf([1], [1, 1])
    >>> found = load_errors(NRDOB(G, G, 1.0, LowPassFilter(0.5, 1)))
    >>> round(found.iae, 4), round(found.ise, 6)
    (0.5, 0.083333)
    """
    ise = loop.S_delta.step_energy()
    if ise == inf:
        return LoadErrors(inf, inf)
    # The integral of y is S_δ(s)/s at s = 0.
    s = QuasiPolynomial(np.array([1.0, 0.0]))
    area = Quotient(loop.S_delta.num, (*loop.S_delta.den, s)).dc_gain
    roots = loop.p_B.roots
    late = DEAD_TIMES * (loop.delay + loop.model_delay)
    if roots.size and roots[0].real < 0:
        last = SETTLING / float(-roots[0].real) + late
    else:
        last = 4 * float(step_response(loop, "delta").time[-1]) + late
    breaks = loop.delay * np.arange(1, 9)
    for doubled in range(ROUNDS):
        count = TIMES << doubled
        early, evenly = last * np.geomspace(EARLIEST, 1, count), np.linspace(0, last, 2 * count)
        times = np.unique(np.concatenate([early, evenly, breaks[breaks < last]]))
        times = times[np.append(True, np.diff(times) > 1e-9 * last / count)]
        y = step_response(loop, "delta", times).outputs[0, 0]
        iae, found_area, found_ise = _integrals(times, y)
        if abs(found_area - area) <= ACCURACY * iae and abs(found_ise - ise) <= ACCURACY * ise:
            return LoadErrors(iae, ise)
    raise ArithmeticError(
        f"the response to a load over {last:g} s has more swings than {3 * count} times resolve: "
        "the loop is all but unstable"
    )


def _integrals(times: FloatArray, y: FloatArray) -> tuple[float, float, float]:
    """Integrals of |y|, y and y², of a piecewise cubic through the samples."""
    spline = CubicSpline(times, y)
    whole = spline.antiderivative()
    zeros = spline.roots(discontinuity=False, extrapolate=False)
    ends = np.concatenate([[times[0]], zeros[np.isfinite(zeros)], [times[-1]]])
    areas = np.diff(whole(ends))
    nodes, weights = np.polynomial.legendre.leggauss(4)
    half = np.diff(times) / 2
    points = (times[:-1] + half)[:, None] + half[:, None] * nodes
    square = half @ (spline(points) ** 2 @ weights)
    return float(np.abs(areas).sum()), float(areas.sum()), float(square)


def step_peak(loop: LoopEquations) -> float:
    """Largest ``|u|`` of a stable loop after a unit step of d."""
    last = step_response(loop, "d").time[-1]
    # A slow end must not hide a fast beginning.
    times = last * np.union1d(np.linspace(0, 1, EVENLY), np.geomspace(EARLIEST, 1, EVENLY))
    largest = 0.0
    for _ in range(1 + CLOSER):
        size = np.abs(step_response(loop, "d", times).outputs[1, 0])
        k = int(np.nanargmax(size))
        largest = max(largest, float(size[k]))
        if k == 0:
            break
        times = np.linspace(times[k - 1], times[min(k + 1, times.size - 1)], ACROSS)
    return largest
