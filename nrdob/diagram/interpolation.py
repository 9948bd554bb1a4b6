r"""Filters that leave the unstable poles and zeros of a model in no block.

A model with zeros :math:`z` and poles :math:`p` on the axis or right of it has an observer whose
blocks F/G̃ and (1 - F)G̃, each built as one, are stable there if and only if

.. math:: F(z) = 0, \qquad F(p) = 1,

as often as the zero or pole is multiple. With the factors :math:`M` of these zeros and :math:`Q` of
these poles, and :math:`Q` holding :math:`s^k` for the zeros that 1 - F is to have at s = 0, that is
one equation between polynomials for :math:`F = M X/(\lambda s + 1)^n`:

.. math:: M X + Q E = (\lambda s + 1)^n .

X of lower degree than Q is unique. Where the model has a dead time θm,
:math:`1 - F e^{-\theta_m s}` takes the place of 1 - F: at its integrators F then has to meet
:math:`e^{\theta_m s}`, and :math:`M X + Q E = (\lambda s + 1)^n e^{\theta_m s}` to the power
:math:`s^{k-1}`. Other poles on the axis or right of it cannot be met (`nrdob.diagram.equations`).
X is computed in fractions, so that F meets the conditions to the rounding of its own coefficients.
"""

from __future__ import annotations

from fractions import Fraction as Exact
from math import factorial
from typing import Any, NamedTuple

import control as ct
import numpy as np
from numpy.polynomial.polynomial import polydiv

from ..numerics import (
    FloatArray,
    QuasiPolynomial,
    factor_near,
    is_whole,
    shared_factor,
    unstable_roots,
    written,
)
from .blocks import Fraction, as_fraction, nonzero
from .delay import undelayed
from .filters import LowPassFilter

__all__ = ["check_ramp", "interpolating_filter", "interpolation"]


def interpolating_filter(
    model: Any, time_constant: float, order: int | None = None, ramp: int = 1
) -> ct.TransferFunction:
    r"""Filter under which a matched model works for an unstable or non-minimum-phase process.

    :math:`F = N_f/(\lambda s + 1)^n` is 0 at the model's zeros and 1 at its poles on the axis and
    right of it, with their multiplicities, and :math:`1 - F \sim s^k` at s = 0. With
    :math:`G = \tilde G` the observer loop has the roots of D and N in the left half plane and n at
    :math:`-1/\lambda`; near a match it stays stable. The price is the peak of F: between a zero z
    and a pole p it is at least :math:`|(z + p)/(z - p)|`.

    Parameters
    ----------
    model : control.TransferFunction, StateSpace, DelayedTransferFunction or (num, den)
        Proper; with a dead time it may have no poles on the axis or right of it but integrators.
    time_constant : float
        λ > 0, in seconds.
    order : int, optional
        n; by default the lowest for which F/G̃ is causal and F falls off.
    ramp : int
        Zeros of 1 - F at s = 0, or of :math:`1 - F e^{-\theta_m s}`; at least as many as the model
        has integrators are taken. Against a constant input disturbance, :math:`S_\delta(0) = 0`, it
        takes one more than that.

    Returns
    -------
    control.TransferFunction
        F, with F(0) = 1 exactly; a filter for `nrdob.NRDOB`.

    Raises
    ------
    TypeError, ValueError
        If the model has a zero at s = 0, or a zero where it has a pole, because F cannot be 0 and 1
        there; if the order is too low for the conditions.

    Examples
    --------
    The unstable plant of Example 3 of the paper, under its own model:

    >>> from nrdob import judge_observer
    >>> G = ct.tf([4], [-1, -1, 2])
    >>> F = interpolating_filter(G, 0.5)
    >>> F.num[0][0].round(6).tolist()                       # ((λ + 1)³ - 1) s + 1
    [2.375, 1.0]
    >>> judge_observer(G, G, F).stable
    True
    """
    LowPassFilter(time_constant, 1)  # the same refusals
    conditions = interpolation(model, order, ramp)
    den = LowPassFilter(time_constant, conditions.order).den
    return ct.tf(conditions.numerator(den), den)


class Interpolation(NamedTuple):
    """What an interpolating filter of a model has to meet: the monic M and Q, n, and θm."""

    zeros: FloatArray
    poles: FloatArray
    order: int
    delay: float

    def numerator(self, den: FloatArray) -> FloatArray:
        """Numerator M X of the F with a given denominator, exact until it is rounded once."""
        M, Q, right = (  # ascending
            np.array([Exact(value) for value in p[::-1].tolist()])
            for p in (self.zeros, self.poles, den)
        )
        size = Q.size - 1
        if self.delay:  # Q is a power of s, so that only the lowest terms of the series matter
            right = np.convolve(right, [Exact(self.delay) ** k / factorial(k) for k in range(size)])
        columns = [_remainder(np.append([Exact(0)] * k, M), Q) for k in range(size)]
        X = _solved(np.array([*columns, _remainder(right, Q)]).T)
        return np.convolve(M, X)[::-1].astype(float)


def interpolation(model: Any, order: int | None, ramp: int) -> Interpolation:
    """Read off a model what `interpolating_filter` has to meet, with the same refusals."""
    model, delay = undelayed(model)
    Gm = nonzero(as_fraction(model, "model"), "model")
    check_ramp(ramp)
    zeros, poles = _right_factor(Gm.num), _right_factor(Gm.den)
    _check_apart(Gm, zeros, poles)
    integrators = QuasiPolynomial(Gm.den).zeros_at_origin
    poles = np.append(poles, np.zeros(max(int(ramp), integrators)))
    if delay and poles[1:].any():
        p = complex(QuasiPolynomial(poles).without_origin.roots[0])
        raise ValueError(
            f"model has a pole at s = {written(p)} and a dead time of {delay:g} s: "
            "F(p) exp(-θm p) = 1 holds to rounding only, and the memory that the block "
            "(1 - F exp(-θm s))·model then takes is none that can be built safely; leave "
            "the dead time out of the model"
        )
    degree = zeros.size + poles.size - 3
    least = degree + max(Gm.relative_degree, 1)
    if order is None:
        return Interpolation(zeros, poles, least, delay)
    LowPassFilter(1.0, order)  # the same refusals
    if order < least:
        counts = f"{zeros.size - 1} times F = 0 and " if zeros.size > 1 else ""
        raise ValueError(
            f"order is {order}; F has {counts}{poles.size - 1} times F = 1 to meet, so that its "
            f"numerator has degree {degree}, and the model has relative degree "
            f"{Gm.relative_degree}: take order {least} or more"
        )
    return Interpolation(zeros, poles, int(order), delay)


def check_ramp(ramp: int) -> None:
    """Refuse what is no number of zeros of 1 - F at s = 0."""
    if not is_whole(ramp):
        raise TypeError(f"ramp is {ramp!r}; it counts zeros of 1 - F and must be a whole number")
    if ramp < 1:
        raise ValueError(f"ramp is {ramp}; 1 - F needs one zero at s = 0 at least: ramp >= 1")


def _check_apart(Gm: Fraction, zeros: FloatArray, poles: FloatArray) -> None:
    """Refuse models at one of whose zeros F would have to be 1."""
    if Gm.num[-1] == 0:
        raise ValueError(
            "model has a zero at s = 0, where F would have to be 0 for the zero and 1 as every "
            "filter: take a model without it"
        )
    common = shared_factor(QuasiPolynomial(zeros), QuasiPolynomial(poles)).common
    if common.degree:
        raise ValueError(
            f"model has a zero and a pole at s = {written(complex(common.roots[0]))}, where F "
            "would have to be 0 and 1: cancel them"
        )


def _right_factor(p: FloatArray) -> FloatArray:
    """Monic factor of a polynomial with its roots on the axis and right of it, but for s = 0."""
    q = QuasiPolynomial(p).without_origin
    right = unstable_roots(q)
    if right.size == q.degree:
        return np.asarray(q.q / q.q[0])
    return factor_near(q, np.atleast_1d(np.real(np.poly(right))))


def _remainder(p: Any, divisor: Any) -> Any:
    """Remainder in ascending powers, with as many coefficients as the degree of the divisor."""
    rest = polydiv(p, divisor)[1]
    return np.append(rest, [Exact(0)] * (divisor.size - 1 - rest.size))


def _solved(rows: Any) -> Any:
    """Solve linear equations, the right sides last in each row, by Gauss's elimination."""
    for k in range(len(rows)):
        at = k + np.flatnonzero(rows[k:, k])[0]
        rows[[k, at]] = rows[[at, k]]
        rows[k] /= rows[k, k]
        for i in range(len(rows)):
            if i != k:
                rows[i] -= rows[i, k] * rows[k]
    return rows[:, -1]
