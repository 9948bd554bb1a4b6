r"""PI and PID control by Skogestad's rules, which are those of internal model control made simple.

For a process :math:`k e^{-\theta s}/((\tau_1 s + 1)(\tau_2 s + 1))` one asks that R arrive as
:math:`e^{-\theta s}/(\tau_c s + 1)`. With :math:`e^{-\theta s} \approx 1 - \theta s` that is a
PID controller in series form, for :math:`\tau_2 = 0` a PI,

.. math:: K = K_c\,\frac{(\tau_I s + 1)(\tau_D s + 1)}{\tau_I s},\qquad
          K_c = \frac{\tau_1}{k(\tau_c + \theta)},\quad \tau_I = \tau_1,\quad \tau_D = \tau_2 .

Load disturbances then die out as slowly as :math:`\tau_1`, so that :math:`\tau_I` is held to
:math:`4(\tau_c + \theta)`, which leaves an integrating process just without oscillation. Every
other process is brought into that form by the half rule: half of the largest neglected lag is added
to the dead time and half to the lag before it; further lags, and the time constants of zeros in the
right half plane, are added to the dead time. So is the lag that filters the derivative of a PID:
:math:`\tau_D/10`, or :math:`\tau_c/2` where that is shorter.

.. rubric:: References

Rivera, D. E., M. Morari, S. Skogestad, Internal model control. 4. PID controller design, Ind. Eng.
Chem. Process Des. Dev. 25 (1986) 252-265.

Skogestad, S., Simple analytic rules for model reduction and PID controller tuning, J. Process
Control 13 (2003) 291-309.
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import control as ct
import numpy as np

from ..diagram import as_fraction, nonzero, real_number, undelayed
from ..loop import NRDOB
from ..numerics import ComplexArray, FloatArray, QuasiPolynomial, written
from .structures import controller_alone

__all__ = ["LagModel", "half_rule", "simc_pi", "simc_pid"]

REAL = 0.01  # imaginary part of a root, against its size, left out: a damping of 0.99995
CLOSE = 1.6  # ratio of a zero's time constant to a smaller lag from which it is not close any more
ROUNDED = 1e-3  # how well a time constant is known that is one of several equal ones
SHORT = 5.0  # times θ: a zero's time constant from which a lag and a zero are both slow
DERIVATIVE, LOOP = 10.0, 2.0  # τD, and τc, over the derivative's filter, at least


class LagModel(NamedTuple):
    """A process as the rules want it: k exp(-θs)/((τ1 s + 1)(τ2 s + 1)).

    Attributes
    ----------
    gain : float
        k; k/τ1 for an integrating process, whose τ1 is infinite.
    first, second, delay : float
        τ1, the longer one, τ2 and θ in seconds.
    """

    gain: float
    first: float
    second: float
    delay: float

    @property
    def slope(self) -> float:
        """k/τ1."""
        return self.gain if self.first == inf else self.gain / self.first


def half_rule(process: Any, order: int, closed_loop_time: float) -> LagModel:
    """Reduce a process to one or two lags and a dead time by Skogestad's half rule.

    Parameters
    ----------
    process : as for `nrdob.NRDOB`
        G with real stable poles, or one of them at s = 0, and real zeros.
    order : {1, 2}
        How many lags are kept.
    closed_loop_time : float
        τc in seconds, against which zeros in the left half plane are slow or fast.

    Raises
    ------
    TypeError, ValueError
        If the process is unstable, oscillates, or has no lag; if τc is not positive, or the order
        another one.

    Examples
    --------
    Skogestad's first example:

    >>> import control as ct
    >>> s = ct.tf('s')
    >>> G = (1 - 0.3*s) * (0.08*s + 1) / ((2*s + 1) * (s + 1) * (0.4*s + 1) * (0.2*s + 1)
    ...                                   * (0.05*s + 1)**3)
    >>> [round(float(x), 3) for x in half_rule(G, 2, 0.5)]
    [1.0, 2.0, 1.2, 0.77]
    """
    if order not in (1, 2):
        raise ValueError(f"order is {order}; the rule keeps one lag or two")
    tc = _closed_loop_time(closed_loop_time)
    prompt, delay = undelayed(process)
    G = nonzero(as_fraction(prompt, "process"), "process")
    lags, zeros = _lags(G.den), _zeros(G.num)
    gain = float(G.num[-1] / QuasiPolynomial(G.den).without_origin.constant)
    for zero in sorted((z for z in zeros if z > 0), reverse=True):
        gain *= _cancel(zero, lags, tc)
    delay += sum(-zero for zero in zeros if zero < 0)
    lags.sort(reverse=True)
    if not lags:
        raise ValueError(
            "no lag of the process is left for the rule to work on: give a process that falls off"
        )
    kept = lags[:order]
    if rest := lags[order:]:
        kept[-1] += rest[0] / 2
        delay += rest[0] / 2 + sum(rest[1:])
    first, second, *_ = *sorted(kept, reverse=True), 0.0
    return LagModel(gain, first, second, float(delay))


def simc_pi(process: Any, closed_loop_time: float) -> NRDOB:
    """Close a process with a PI controller by Skogestad's rule, as all its feedback.

    Parameters
    ----------
    process, closed_loop_time : as for `half_rule`
        G, and τc, as large as the dead time for tight control.

    Raises
    ------
    TypeError, ValueError
        If the rule does not fit, see `half_rule`, or τc is not positive.

    Examples
    --------
    For one lag without dead time the rule gives the observer with F = 1/(τc s + 1):

    >>> import control as ct
    >>> loop = simc_pi(ct.tf([2], [5, 1]), 2.0)
    >>> loop.filter.num[0][0].round(6).tolist(), loop.filter.den[0][0].round(6).tolist()
    ([1.0], [2.0, 1.0])
    """
    return _closed(process, 1, closed_loop_time)


def simc_pid(process: Any, closed_loop_time: float) -> NRDOB:
    """Close a process with a PID controller by Skogestad's rule, its derivative filtered.

    Parameters
    ----------
    process, closed_loop_time : as for `half_rule`
        G, and τc, as large as dead time and derivative's filter together for tight control.

    Raises
    ------
    TypeError, ValueError
        As `simc_pi`, and if the process has only one lag.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import delay
    >>> loop = simc_pid(delay(1.0) * ct.tf([1], [10, 7, 1]), 1.2)    # lags of 5 s and 2 s
    >>> round(loop.margins().plant_loop.ms, 3)
    1.575
    """
    return _closed(process, 2, closed_loop_time)


def _closed(process: Any, order: int, closed_loop_time: Any) -> NRDOB:
    tc = _closed_loop_time(closed_loop_time)
    found = half_rule(process, order, tc)
    if order == 2 and not found.second:
        raise ValueError("the process has one lag, and a PID needs two: take a PI")
    filtered = min(found.second / DERIVATIVE, tc / LOOP)
    total = tc + found.delay + filtered
    gain, integral = 1 / (found.slope * total), min(found.first, 4 * total)
    num, den = np.array([gain * integral, gain]), np.array([integral, 0.0])
    model = [found.slope], [1.0, 0.0 if found.first == inf else 1 / found.first]
    if order == 2:
        num = np.convolve(num, [found.second, 1.0])
        den = np.convolve(den, [filtered, 1.0])
    return controller_alone(process, model, ct.tf(num, den))


def _closed_loop_time(value: Any) -> float:
    remedy = "τc is positive and finite, in seconds"
    return real_number(value, "closed_loop_time", remedy, above=0.0)


def _lags(den: FloatArray) -> list[float]:
    """Time constants of the poles, infinite for an integrator."""
    p = QuasiPolynomial(den)
    if p.zeros_at_origin > 1:
        raise ValueError(
            f"the process has {p.zeros_at_origin} integrators; these rules take one: use "
            "nrdob.alternatives.linear_adrc of order 2, or an observer with a ramp filter"
        )
    poles = p.without_origin.roots
    if (poles.real >= 0).any():
        raise ValueError(
            f"the process has a pole at {written(complex(poles[0]))}; these rules are for stable "
            "or integrating processes: use an observer, or nrdob.alternatives.linear_adrc"
        )
    refusal = (
        "poles at {}; these rules are for lags, without oscillation: design for a process with "
        "real poles"
    )
    return _times(poles, refusal) + [inf] * p.zeros_at_origin


def _zeros(num: FloatArray) -> list[float]:
    """Time constants T of zeros, in (T s + 1): negative for zeros in the right half plane."""
    p = QuasiPolynomial(num)
    if p.zeros_at_origin:
        raise ValueError("the process has a zero at s = 0: no controller holds a load there")
    return _times(
        p.roots, "zeros at {}; these rules take real ones: design for a process without them"
    )


def _times(roots: ComplexArray, refusal: str) -> list[float]:
    """-1/s of real roots, or say what the process has."""
    odd = roots[np.abs(roots.imag) > REAL * np.abs(roots)]
    if odd.size:
        raise ValueError(f"the process has {refusal.format(written(complex(odd[0])))}")
    return [float(-1 / root) for root in roots.real]


def _cancel(zero: float, lags: list[float], closed_loop_time: float) -> float:
    """Cancel a stable zero against a lag by rules T1 to T3; return the gain that is left."""
    if not lags:
        return 1.0
    above = min((lag for lag in lags if lag >= zero), default=0.0)
    below = max((lag for lag in lags if lag < zero), default=0.0)
    close = below and zero / below < min(CLOSE * (1 - ROUNDED), above / zero)
    lag = below if close else above or below
    lags.remove(lag)
    if lag < zero:  # T1, T1a, T1b
        return zero / max(lag, closed_loop_time) if zero >= closed_loop_time else 1.0
    if zero >= SHORT * closed_loop_time:  # T2
        return zero if lag == inf else zero / lag
    shorter = min(lag, SHORT * closed_loop_time)  # T3
    if shorter > zero:
        lags.append(shorter - zero)
    return shorter if lag == inf else shorter / lag
