r"""The design card: what can be worked out once and for all, as functions.

Bounds on λ for one kind of mismatch at a time, and the price of a filter when the model is right.
The bounds are derived in the chapter on rules of thumb, the prices in the one on limits;
`nrdob.design.timeconstants` gives the exact set for any mismatch, and agrees.
"""

from __future__ import annotations

from math import comb, cos, pi, sin, sqrt, tan

from scipy.optimize import brentq

from ..diagram import LowPassFilter, real_number
from .fastandslow import gain_bound

__all__ = [
    "disturbance_index", "gain_bound", "noise_index", "sensitivity_floor", "smallest_for_delay",
    "smallest_for_double_lag", "smallest_for_rhp_zero",
]  # fmt: skip


def smallest_for_delay(delay: float, order: int) -> float:
    r"""Smallest λ for a model that is right but for a dead time θ: :math:`R = e^{-\theta s}`.

    At the border :math:`e^{-j\omega\theta} = 1 - (1 + j\lambda\omega)^n`. With
    :math:`\lambda\omega = \tan\varphi` both sides have size 1 if
    :math:`2\cos(n\varphi)\cos^n\varphi = 1`, and the same phase if
    :math:`\lambda = \theta\tan\varphi/(\pi - 2n\varphi)`. For n = 1 that is :math:`2\theta/\pi`.

    Parameters
    ----------
    delay : float
        θ > 0, in seconds.
    order : int
        n of the filter, up to 27.

    Examples
    --------
    >>> [round(smallest_for_delay(1.0, n), 4) for n in (1, 2, 3)]
    [0.6366, 0.3646, 0.2632]
    """
    _check(delay, "delay", order, largest=27)
    phi = brentq(lambda p: 2 * cos(order * p) * cos(p) ** order - 1, 0.0, pi / (2 * order))
    return float(delay * tan(phi) / (pi - 2 * order * phi))


def smallest_for_rhp_zero(zero: float, order: int) -> float:
    r"""Smallest λ for a model without the plant's zero in the right half plane: R = 1 - s/z.

    For n = 1 the real root passes through infinity at λ = 1/z. For n ≥ 2 a pair crosses at
    :math:`\varphi = \pi/(2n)`: :math:`\lambda = \tan\varphi\cos^n\varphi/z`.

    Parameters
    ----------
    zero : float
        z > 0, in rad/s.
    order : int
        n of the filter, up to 18.

    Examples
    --------
    >>> round(smallest_for_rhp_zero(100.0, 2), 9)
    0.005
    """
    _check(zero, "zero", order, largest=18)
    phi = pi / (2 * order)
    return 1 / zero if order == 1 else tan(phi) * cos(phi) ** order / zero


def smallest_for_double_lag(time_constant: float, order: int) -> float:
    r"""Smallest λ for a model without two equal lags of the plant: :math:`R = 1/(Ts + 1)^2`.

    At the border :math:`(1 + jT\omega)^2 = 1/(1 - (1 + jx)^n)` with :math:`x = \lambda\omega`: the
    root of the right-hand side must have real part 1, and its imaginary part is
    :math:`T\omega`. For n = 1 that gives λ = T/2.

    Parameters
    ----------
    time_constant : float
        T > 0, in seconds.
    order : int
        n of the filter, up to 8.

    Examples
    --------
    >>> [round(smallest_for_double_lag(1.0, n), 4) for n in (1, 2, 3, 4)]
    [0.5, 0.3247, 0.2419, 0.193]
    """
    _check(time_constant, "time_constant", order, largest=8)

    def root(x: float) -> complex:
        return complex((1 / (1 - (1 + 1j * x) ** order)) ** 0.5)

    x = float(brentq(lambda x: root(x).real - 1, 1e-6, 1.0, xtol=1e-15))
    return float(time_constant * x / abs(root(x).imag))


def noise_index(order: int) -> float:
    r"""Compute I_n: white noise reaches the output of a matched loop with power I_n/λ.

    :math:`\|F\|_2^2 = I_n/\lambda`, :math:`I_n = \binom{2n-2}{n-1}/2^{2n-1}`.

    Parameters
    ----------
    order : int
        n of the filter.

    Examples
    --------
    >>> [noise_index(n) for n in (1, 2, 3)]
    [0.5, 0.25, 0.1875]
    """
    LowPassFilter(1.0, order)  # the same refusals
    return float(comb(2 * order - 2, order - 1) / 2 ** (2 * order - 1))


def disturbance_index(order: int) -> float:
    r"""Compute J_n: a unit step of d costs a matched loop the integral square error J_n λ.

    :math:`\|(1 - F)/s\|_2^2 = J_n\lambda`,
    :math:`J_n = \sum_{i,j<n}\binom{i+j}{i}/2^{i+j+1}`. The product of noise power and error,
    :math:`I_nJ_n`, does not contain λ.

    Parameters
    ----------
    order : int
        n of the filter.

    Examples
    --------
    >>> [disturbance_index(n) for n in (1, 2, 3)]
    [0.5, 1.25, 2.0625]
    """
    LowPassFilter(1.0, order)  # the same refusals
    sizes = range(order)
    return float(sum(comb(i + j, i) / 2 ** (i + j + 1) for i in sizes for j in sizes))


def sensitivity_floor(order: int) -> float:
    r"""Compute the peak of ``|1 - F|``, the sensitivity peak of a matched loop, whatever λ.

    With :math:`\lambda\omega = \tan\varphi` it lies where
    :math:`\sin (n+1)\varphi = \cos^n\varphi\,\sin\varphi`.

    Parameters
    ----------
    order : int
        n of the filter.

    Examples
    --------
    >>> [round(sensitivity_floor(n), 6) for n in (1, 2, 3)]
    [1.0, 1.154701, 1.285714]
    """
    LowPassFilter(1.0, order)  # the same refusals
    if order == 1:
        return 1.0  # approached at infinite frequency
    ends = pi / (2 * order + 2), pi / (order + 1)
    phi = brentq(lambda p: sin((order + 1) * p) - cos(p) ** order * sin(p), *ends, xtol=1e-15)
    power = cos(phi) ** order
    return sqrt(1 - 2 * power * cos(order * phi) + power**2)


def _check(value: float, name: str, order: int, largest: int) -> None:
    LowPassFilter(1.0, order)  # the same refusals
    if order > largest:  # beyond it another branch may decide
        raise NotImplementedError(
            f"order is {order}; the closed form is for orders up to {largest}: use "
            "stabilizing_time_constants"
        )
    real_number(value, name, "it must be positive and finite", above=0.0)
