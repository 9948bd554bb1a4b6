r"""Roots on the right counted by the crossings that a growing dead time makes.

As T grows from 0, the roots of :math:`q(s) + r(s)\,e^{-sT}` cross the imaginary axis only at the
frequencies where :math:`|q(j\omega)| = |r(j\omega)|`, which do not depend on T: at :math:`\omega`
for :math:`T = (\varphi + 2\pi m)/\omega` with :math:`e^{j\varphi} = -r/q` and m = 0, 1, 2, …, from
left to right if :math:`|q|^2 - |r|^2` grows with frequency there, else from right to left. With
the roots of :math:`q + r` that makes the number of roots on the right for every dead time.

.. rubric:: References

K. Walton, J. E. Marshall, Direct method for TDS stability analysis, IEE Proceedings D 134 (1987)
101-107.
"""

from __future__ import annotations

from math import floor, sqrt, tau
from typing import NamedTuple

import numpy as np

from .arrays import FloatArray
from .exact import Whole, positive_sign_changes, rhp_count, squared_size, total, whole
from .rootfinding import polynomial_roots

AT_ZERO = 1e-6
"""Angle in radians at which a crossing belongs to the dead time zero, where it starts."""


def count_by_crossings(q: FloatArray, r: FloatArray, delay: float) -> int | None:
    """Count the roots of q + r exp(-sT) in the open right half plane, after Walton and Marshall.

    Parameters
    ----------
    q, r : array of float
        Coefficients in descending powers; the leading one of q dominates.
    delay : float
        T > 0, in seconds.

    Returns
    -------
    int or None
        The number, or None where the equation without dead time has roots on the axis.

    Examples
    --------
    >>> import numpy as np
    >>> count_by_crossings(np.array([1.0, 0.0]), np.array([8.0]), 1.0)    # s + 8 exp(-s)
    4
    """
    Q, R = whole(q, r)
    changes = positive_sign_changes(_difference(squared_size(Q), squared_size(R)))
    crossings = [_crossing(q, r, sqrt(x), direction) for x, direction in changes]
    count = _count_without_delay(q, r, [each.omega for each in crossings if each.angle == 0])
    if count is None:
        return None
    for omega, angle, direction in crossings:
        # A pair that starts on the axis does not come from the right: it is not lost there.
        first = 0 if angle == 0 and direction < 0 else 1
        count += 2 * direction * (floor((omega * delay - angle) / tau) + first)
    return count


class _Crossing(NamedTuple):
    omega: float
    angle: float
    direction: int


def _crossing(q: FloatArray, r: FloatArray, omega: float, direction: int) -> _Crossing:
    s = 1j * omega
    angle = float(np.angle(-np.polyval(r, s) / np.polyval(q, s)))
    return _Crossing(omega, 0.0 if abs(angle) < AT_ZERO else angle % tau, direction)


def _count_without_delay(q: FloatArray, r: FloatArray, on_axis: list[float]) -> int | None:
    """Roots of q + r on the right, those on the axis not counted: they cross from there."""
    p = total(*whole(q, r))
    if not on_axis:
        return rhp_count(p)
    roots = polynomial_roots(np.polyadd(q, r))
    for omega in on_axis:
        for s in (1j * omega, -1j * omega):
            roots = np.delete(roots, np.argmin(np.abs(roots - s)))
    return int(np.sum(roots.real > 0))


def _difference(a: Whole, b: Whole) -> Whole:
    """Subtract polynomials."""
    return total(a, [-x for x in b])
