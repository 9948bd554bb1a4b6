r"""Linear active disturbance rejection control: an NR-DOB whose model is a chain of integrators.

ADRC of order m knows of the process that :math:`y^{(m)} = b_0 u + f`, and estimates y, its
derivatives and f by an observer whose m + 1 poles are at :math:`-\omega_o`::

    z1' = z2 + l1 (y - z1)    …    zm' = b0 u + z(m+1) + lm (y - z1)    z(m+1)' = l(m+1) (y - z1)
    b0 u = ωc^m (R - z1) - … - m ωc zm - z(m+1)

Its feedback from y is the K of an NR-DOB with the model and the filter

.. math:: \tilde G = \frac{b_0}{s^m}, \qquad
          F = \frac{\text{the } m+1 \text{ lowest terms of the denominator}}
                   {(s/\omega_c + 1)^m (s/\omega_o + 1)^{m+1}},

so that :math:`1 - F \sim s^{m+1}`. For every :math:`\omega_c` these are a family of filters with
the time constant :math:`\lambda = 1/\omega_o`, and :math:`1/b_0` is a gain: the sets of
:math:`\omega_o` and of :math:`b_0` that stabilise a process are exact.

.. rubric:: References

Han, J., From PID to active disturbance rejection control, IEEE Trans. Ind. Electron. 56 (2009)
900-906.

Gao, Z., Scaling and bandwidth-parameterization based controller tuning, Proc. American Control
Conference 2003, 4989-4996.

Herbst, G., A simulative study on active disturbance rejection control (ADRC) as a control tool for
practitioners, Electronics 2 (2013) 246-279.
"""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from math import inf, isfinite
from typing import Any

import control as ct
import numpy as np
from scipy.signal import convolve2d

from ..design import Axis, Border, StabilityChart, stability_chart, stabilizing_time_constants
from ..diagram import FilterFamily, real_number
from ..loop import NRDOB
from ..numerics import is_whole
from ..uncertain import gain_intervals

__all__ = [
    "adrc_chart", "adrc_filters", "adrc_stabilizing_bandwidths", "adrc_stabilizing_gains",
    "linear_adrc",
]  # fmt: skip

DECADE_AND_MORE = 20.0  # ratio of the ends of an axis of the chart, at least: both are logarithmic


def linear_adrc(
    process: Any, order: int, b0: float, observer_bandwidth: float, controller_bandwidth: float
) -> NRDOB:
    r"""Close a process with linear ADRC, written as the NR-DOB with the model b0/s^m.

    d, δ and η meet the same loop, and so does R for order 1. For order 2 the model loop must bring
    its own zero, :math:`C = \omega_c^2(3s + \omega_c)/(b_0(s + 3\omega_c))`: ADRC with its observer
    responds to R as this loop does behind the prefilter :math:`(s + \omega_c)/(3s + \omega_c)`.

    Parameters
    ----------
    process : as for `nrdob.NRDOB`
        The process G.
    order : {1, 2}
        m, as a rule the relative degree of G.
    b0 : float
        What is known of G: :math:`G \approx b_0/s^m` at high frequency. Of either sign.
    observer_bandwidth, controller_bandwidth : float
        ωo and ωc, in rad/s.

    Raises
    ------
    TypeError, ValueError
        If the order is not 1 or 2, b0 is 0, or a bandwidth is not positive.

    Examples
    --------
    >>> import control as ct
    >>> loop = linear_adrc(ct.tf([2], [1, 1]), 1, 2.0, 20.0, 4.0)
    >>> loop.stability().stable, round(loop.margins().plant_loop.ms, 3)
    (True, 1.202)
    """
    family = adrc_filters(order, controller_bandwidth)
    model = _model(order, b0)
    wo = _bandwidth(observer_bandwidth, "observer_bandwidth")
    wc = _bandwidth(controller_bandwidth, "controller_bandwidth")
    C: Any = wc / b0 if order == 1 else ct.tf([3 * wc**2, wc**3], [b0, 3 * wc * b0])
    return NRDOB(process, model, C, family.at(1 / wo))


def adrc_filters(order: int, controller_bandwidth: float) -> FilterFamily:
    """Return the filters of linear ADRC, ωc in rad/s: a family with the time constant 1/ωo."""
    m, wc = _order(order), _bandwidth(controller_bandwidth, "controller_bandwidth")
    # Tables with a row for each power of s and a column for each power of λ, both descending.
    lag, observer = np.array([[1 / wc], [1.0]]), np.array([[1.0, 0.0], [0.0, 1.0]])
    den = reduce(convolve2d, [lag] * m + [observer] * (m + 1))
    return FilterFamily("own", den[-(m + 1) :], den)


def adrc_stabilizing_bandwidths(
    process: Any,
    order: int,
    b0: float,
    controller_bandwidth: float,
    *,
    highest: float | None = None,
) -> list[tuple[float, float]]:
    r"""Find all bandwidths ωo of the observer with which linear ADRC stabilises a process.

    Parameters
    ----------
    process, order, b0, controller_bandwidth : as for `linear_adrc`
        G, m, b0 and ωc.
    highest : float, optional
        Largest ωo of interest, in rad/s; by default, with dead time, one over the default floor of
        `nrdob.critical_time_constants`.

    Returns
    -------
    list of (low, high)
        Open intervals in rad/s, increasing; `high` may be inf. Empty where none works.

    Raises
    ------
    TypeError, ValueError, ArithmeticError
        As `linear_adrc` and `nrdob.stabilizing_time_constants`; or if `highest` is not positive.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import delay
    >>> (low, high), = adrc_stabilizing_bandwidths(delay(0.1) * ct.tf([1], [1, 0]), 1, 1.0, 2.0)
    >>> low, round(high, 3)
    (0.0, 21.079)
    """
    family, model = adrc_filters(order, controller_bandwidth), _model(order, b0)
    floor = None if highest is None else 1 / _bandwidth(highest, "highest")
    try:
        found = stabilizing_time_constants(process, model, family, floor=floor)
    except ValueError as refusal:
        if highest is None:
            raise
        raise ValueError(f"highest is {highest:g} rad/s, 1/floor: {refusal}") from refusal
    return _inverted(found)


def adrc_stabilizing_gains(
    process: Any, order: int, observer_bandwidth: float, controller_bandwidth: float
) -> list[tuple[float, float]]:
    """Find all b0, of either sign, with which linear ADRC stabilises a process.

    Parameters
    ----------
    process, order, observer_bandwidth, controller_bandwidth : as for `linear_adrc`
        G, m, ωo and ωc.

    Returns
    -------
    list of (low, high)
        Open intervals, increasing; `low` may be -inf and `high` inf.

    Raises
    ------
    TypeError, ValueError, ArithmeticError
        As `linear_adrc`; or if a verdict cannot be given.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import delay
    >>> (low, high), = adrc_stabilizing_gains(delay(0.1) * ct.tf([1], [1, 0]), 1, 7.0, 2.0)
    >>> round(low, 3), high
    (0.462, inf)
    """
    # With b0 = ±1 a factor of the process acts as 1/b0.
    bandwidths = observer_bandwidth, controller_bandwidth
    loops = (linear_adrc(process, order, b0, *bandwidths) for b0 in (-1.0, 1.0))
    negative, positive = (_inverted(gain_intervals(loop)) for loop in loops)
    return [(-high, -low) for low, high in reversed(negative)] + positive


def _inverted(intervals: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [(1 / high, 1 / low if low else inf) for low, high in reversed(intervals)]


def adrc_chart(
    process: Any,
    order: int,
    controller_bandwidth: float,
    *,
    observer_bandwidth: tuple[float, float],
    b0: tuple[float, float],
    ms: tuple[float, ...] = (),
) -> StabilityChart:
    """Chart the stability of linear ADRC over ωo and b0.

    Parameters
    ----------
    process, order, controller_bandwidth : as for `linear_adrc`
        G, m and ωc.
    observer_bandwidth, b0 : (low, high)
        The axes: positive, the ends a factor of 20 or more apart. For a process that needs a
        negative b0 chart its negative.
    ms : tuple of float
        Levels of the peak of the sensitivity to be drawn.

    Raises
    ------
    TypeError, ValueError
        As `linear_adrc` and `nrdob.stability_chart`; or if an axis is not as it must be.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import delay
    >>> late = delay(0.1) * ct.tf([1], [1, 0])
    >>> chart = adrc_chart(late, 1, 2.0, observer_bandwidth=(1, 100), b0=(0.2, 20))
    >>> chart.count(7.0, 0.46), chart.count(7.0, 0.47)
    (2, 0)
    """
    family, model = adrc_filters(order, controller_bandwidth), _model(order, 1.0)
    bandwidths, gains = _range("observer_bandwidth", observer_bandwidth), _range("b0", b0)
    x = ("time_constant", 1 / bandwidths.high, 1 / bandwidths.low)
    y = ("gain", 1 / gains.high, 1 / gains.low)
    chart = stability_chart(process, model, family, x=x, y=y, ms=ms)
    return StabilityChart(
        bandwidths,
        gains,
        tuple(Border(1 / p.x[::-1], 1 / p.y[::-1], p.omega[::-1]) for p in chart.borders),
        tuple(replace(r, x=1 / r.x, y=1 / r.y) for r in chart.regions),
        {level: [1 / line for line in lines] for level, lines in chart.ms_levels.items()},
        chart.labels[::-1, ::-1],  # on logarithmic axes an inverse is a mirror image
        lambda bandwidth, gain: chart.count_at(1 / bandwidth, 1 / gain),
    )


def _order(order: Any) -> int:
    if not is_whole(order):
        raise TypeError(f"order is {order!r}; linear ADRC has a whole number as order: 1 or 2")
    if order not in (1, 2):
        raise ValueError(
            f"order is {order}; linear ADRC is here of order 1 or 2: take the relative degree of "
            "the process, or 2 where it is higher"
        )
    return int(order)


def _model(order: Any, b0: Any) -> Any:
    m = _order(order)
    gain = real_number(b0, "b0", "give what is known of the process, G ≈ b0/s^order, as a number")
    if not (isfinite(gain) and gain != 0):
        raise ValueError(
            f"b0 is {b0}; it must be finite and not 0: take the leading coefficient of the process"
        )
    return [gain], [1.0, *[0.0] * m]


def _bandwidth(value: Any, name: str) -> float:
    return real_number(value, name, "it is a frequency in rad/s, positive and finite", above=0.0)


def _range(name: str, given: Any) -> Axis:
    if not (isinstance(given, tuple | list) and len(given) == 2):
        raise TypeError(f"{name} is {given!r}; give (low, high), such as (1.0, 100.0)")
    low, high = (real_number(end, name, "give two numbers") for end in given)
    if not (0 < DECADE_AND_MORE * low <= high < inf):
        raise ValueError(
            f"{name} reaches from {low} to {high}; both ends must be positive and a factor of "
            f"{DECADE_AND_MORE:g} or more apart"
        )
    return Axis(name, low, high)
