r"""Families of filters: one shape of F for every time constant.

Everything that is asked of a filter family needs only that the coefficients of

.. math:: F(s; \lambda)
          = \frac{\sum_i s^i \sum_k n_{ik} \lambda^k}{\sum_i s^i \sum_k d_{ik} \lambda^k}

are polynomials in the time constant λ. A prototype :math:`F(\lambda s)` has one power of λ to each
power of s; the interpolating filters of a model have several.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import comb, factorial
from typing import Any

import control as ct
import numpy as np
from scipy import signal

from ..numerics import FloatArray
from .filters import TYPED_IN, LowPassFilter
from .interpolation import check_ramp, interpolation

__all__ = ["FilterFamily", "as_family", "filter_family"]


@dataclass(frozen=True, eq=False, repr=False)
class FilterFamily:
    """A filter for every time constant; made by `filter_family`, or from tables of coefficients.

    Attributes
    ----------
    kind : str
        The name of the family; "own" for other tables than those of `filter_family`.
    num, den : (n, m) array of float
        A row for each power of s, a column for each power of λ, both descending. The last rows,
        which belong to s^0, are the same, so that F(0) = 1 for every λ.

    Examples
    --------
    >>> filter_family("binomial", 3).at(0.5).time_constant
    0.5

    A lag of a tenth of the time constant, as a sensor may have it, behind the one that is chosen:

    >>> num, den = np.ones((1, 1)), np.array([[0.1, 0, 0], [0, 1.1, 0], [0, 0, 1]])
    >>> FilterFamily("own", num, den).at(2.0).den[0][0].round(6).tolist()
    [0.4, 2.2, 1.0]
    """

    kind: str
    num: FloatArray
    den: FloatArray

    @property
    def order(self) -> int:
        """Degree of the denominator."""
        return int(self.den.shape[0]) - 1

    @property
    def is_binomial(self) -> bool:
        """Whether the filters are those of eq. (1)."""
        return self.kind == "binomial"

    @cached_property
    def difference(self) -> FloatArray:
        """Coefficients of Df - Nf, without what is only rounding."""
        shape = np.maximum(self.num.shape, self.den.shape)
        num, den = (
            np.pad(table, [(n - own, 0) for n, own in zip(shape, table.shape, strict=True)])
            for table in (self.num, self.den)
        )
        found = den - num
        return np.where(np.abs(found) <= TYPED_IN * (np.abs(den) + np.abs(num)), 0.0, found)

    @property
    def ramp(self) -> int:
        """Zeros of 1 - F at s = 0, whatever λ."""
        return self.order - int(np.flatnonzero(self.difference.any(axis=1))[-1])

    def ramp_coefficient(self, time_constant: float) -> float:
        """Return the c of 1 - F ~ c s^ramp, in seconds to the power ramp: nλ for eq. (1).

        Parameters
        ----------
        time_constant : float
            λ > 0, in seconds.
        """
        low = _at(self.difference, time_constant)[self.order - self.ramp]
        return float(low / _at(self.den, time_constant)[-1])

    def at(self, time_constant: float) -> LowPassFilter | ct.TransferFunction:
        """Return the filter with one time constant, as `nrdob.NRDOB` takes it.

        Parameters
        ----------
        time_constant : float
            λ > 0, in seconds; a TypeError or ValueError if it is no such number.
        """
        lag = LowPassFilter(time_constant, self.order)  # the same refusals
        if self.is_binomial:
            return lag
        return ct.tf(_at(self.num, time_constant), _at(self.den, time_constant))

    def __repr__(self) -> str:
        return f"<{self.kind} filters of order {self.order}>"


def filter_family(
    kind: str, order: int | None = None, *, ramp: int | None = None, model: Any = None
) -> FilterFamily:
    r"""Give a family of filters, to be taken wherever the order of eq. (1) is.

    Parameters
    ----------
    kind : str
        One of

        - "binomial": :math:`1/(\lambda s + 1)^n`, eq. (1), what an order means by itself;
        - "butterworth": maximally flat, :math:`|F| = 1/\sqrt2` at :math:`\omega = 1/\lambda`;
        - "bessel": maximally linear phase, with the delay λ at low frequency:
          :math:`1 - F \sim \lambda s`;
        - "ramp": the lowest terms of :math:`(\lambda s + 1)^n` over it, so many that
          :math:`1 - F \sim s^k` with k = `ramp`;
        - "interpolating": `nrdob.interpolating_filter` for a `model`.
    order : int, optional
        n, the degree of the denominator; may be left out for "interpolating".
    ramp : int, optional
        Zeros of 1 - F at s = 0, for "ramp" (by default 2) and "interpolating" (by default 1).
    model : as for `nrdob.NRDOB`, optional
        For "interpolating"; of a delayed one only integrators are interpolated.

    Returns
    -------
    FilterFamily
        `family.at(time_constant)` is a filter for `nrdob.NRDOB`.

    Raises
    ------
    TypeError, ValueError
        If there is no such kind; if it lacks something, or cannot take what is given.

    References
    ----------
    Thomson, W. E., Proc. IEE 96 (1949) 487-490; for the ramp filters T. Umeno, Y. Hori, IEEE Trans.
    Ind. Electron. 38 (1991).

    Examples
    --------
    >>> filter_family("ramp", 3, ramp=2).at(0.1).num[0][0].round(6).tolist()       # 3 λ s + 1
    [0.3, 1.0]
    """
    if kind not in MAKERS:
        known = ", ".join(f'"{name}"' for name in MAKERS)
        raise ValueError(f"there is no family {kind!r}; choose one of {known}")
    given = {"order": order, "ramp": ramp, "model": model}
    needed, possible, make = MAKERS[kind]
    for name, value in given.items():
        if value is None and name in needed:
            raise ValueError(f'the family "{kind}" needs {name}; see nrdob.filter_family')
        if value is not None and name not in needed + possible:
            raise ValueError(f'the family "{kind}" takes no {name}: leave it out')
    if order is not None:
        LowPassFilter(1.0, order)  # the same refusals
    used = {name: value for name, value in given.items() if value is not None}
    return FilterFamily(kind, *make(**used))


def as_family(order: int | FilterFamily) -> FilterFamily:
    """Return a family; an order is that of the filters of eq. (1).

    Parameters
    ----------
    order : int or FilterFamily
    """
    return order if isinstance(order, FilterFamily) else filter_family("binomial", order)


def _binomial(order: int) -> tuple[FloatArray, FloatArray]:
    return np.ones((1, 1)), np.diag(_lags(order))


def _butterworth(order: int) -> tuple[FloatArray, FloatArray]:
    _, poles, _ = signal.buttap(order)
    den = np.real(np.poly(poles))
    den[-1] = 1.0
    return np.ones((1, 1)), np.diag(den)


def _bessel(order: int) -> tuple[FloatArray, FloatArray]:
    n = int(order)
    den = [comb(n, k) * factorial(2 * n - k) * 2**k / factorial(2 * n) for k in range(n, -1, -1)]
    return np.ones((1, 1)), np.diag(den)


def _ramp(order: int, ramp: int = 2) -> tuple[FloatArray, FloatArray]:
    check_ramp(ramp)
    if ramp > order:
        raise ValueError(
            f"ramp is {ramp}; a filter of order {order} can have 1 - F ~ s^1 to s^{order}: take a "
            "ramp between, or a higher order"
        )
    den = _lags(order)
    return np.diag(den[-int(ramp) :]), np.diag(den)


def _interpolating(
    model: Any, order: int | None = None, ramp: int = 1
) -> tuple[FloatArray, FloatArray]:
    conditions = interpolation(model, order, ramp)
    lags = _lags(conditions.order)
    # The conditions are linear in the denominator: they are met for each of its terms by itself.
    num = np.array([conditions.numerator(term) for term in np.diag(lags)]).T
    return num[np.argmax(num.any(axis=1)) :], np.diag(lags)


MAKERS: dict[str, tuple[tuple[str, ...], tuple[str, ...], Callable[..., Any]]] = {
    "binomial": (("order",), (), _binomial),
    "butterworth": (("order",), (), _butterworth),
    "bessel": (("order",), (), _bessel),
    "ramp": (("order",), ("ramp",), _ramp),
    "interpolating": (("model",), ("order", "ramp"), _interpolating),
}
"""What each kind needs, what it may be given, and who makes it."""


def _lags(order: int) -> FloatArray:
    """Coefficients of (s + 1)^n."""
    return LowPassFilter(1.0, order).den


def _at(table: FloatArray, time_constant: float) -> FloatArray:
    """Coefficients for one λ."""
    return np.asarray(np.polyval(table.T, time_constant))
