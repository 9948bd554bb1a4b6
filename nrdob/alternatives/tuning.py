r"""Candidates with one parameter each, and the parameter with which they are comparable.

Two schemes are compared fairly where each is as fast as the same limits let it be: the same peak
of the sensitivity, the same noise on u. The parameter is looked for from the fast end on, through
all the speeds of the plant and two decades beyond; where the limits are kept for the first time,
the border is solved for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import ceil, exp, log, log10
from typing import Any

import numpy as np

from ..analysis import noise_variance, quotient_margins
from ..design import Bracket, solved
from ..diagram import DelayedTransferFunction, LowPassFilter, as_fraction, real_number
from ..loop import NRDOB
from ..numerics import QuasiPolynomial, count_rhp
from .adrc import linear_adrc
from .simc import half_rule, simc_pi, simc_pid
from .structures import controller_alone, conventional_observer

__all__ = ["Scheme", "Tuned", "candidates", "checked_limits", "tune"]

PER_DECADE = 6  # values of the parameter tried in a decade

BEYOND = 100.0
"""How much faster than the fastest of the plant a candidate is tried, and slower than the slowest.

For the gain of C, how much larger and smaller than the one that is given."""

RATIO = 4.0  # ωo over ωc of ADRC; three to ten are usual
LOOKED_AT = 120  # frequencies at which a loop is looked at, before its peak is computed
UNSTABLE = -1e4  # slack of a loop that is not stable, below that of any stable one
ENDLESS = -1e3  # slack of a loop whose u is endlessly noisy


@dataclass(frozen=True)
class Scheme:
    """A scheme with one parameter.

    Attributes
    ----------
    parameter, unit : str
        As "λ" and "s"; no unit for a factor.
    build : callable
        Gives the loop for one value of the parameter.
    fastest, slowest : float
        Values between which `tune` looks.
    band : (float, float)
        Frequencies between which the plant lives, and a wide margin, in rad/s.
    """

    parameter: str
    unit: str
    build: Callable[[float], NRDOB]
    fastest: float
    slowest: float
    band: tuple[float, float]


@dataclass(frozen=True)
class Tuned:
    """A candidate with the parameter that was found.

    Attributes
    ----------
    loop : NRDOB
        The loop.
    value : float
        The parameter.
    text : str
        Name, value and unit; "no limit" where the fastest of all tried keeps to the limits.
    """

    loop: NRDOB
    value: float
    text: str


def candidates(
    process: Any, model: Any, controller: Any, order: int | None = None
) -> dict[str, Scheme]:
    """Return schemes that can control a plant, by name, each with one parameter.

    Parameters
    ----------
    process : as for `nrdob.NRDOB`
        G, from which PI, PID and b0 of ADRC follow; where G is not of relative degree 1 or 2, or
        has zeros in the right half plane, b0 follows from the model, or for more than two lags from
        the half rule.
    model, controller : as for `nrdob.NRDOB`
        G̃, without dead time, and C of the observers, whose gain is the parameter of C alone.
    order : int, optional
        n of the observers' filters; by default the lowest that is causal. ADRC has ωc = ωo/4; what
        does not fit the plant says so when it is built.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put.

    Examples
    --------
    >>> from nrdob import paper
    >>> loop = paper.example(4)
    >>> ", ".join(candidates(loop.process, loop.model, loop.controller, 3))
    'NR-DOB, conventional observer, Smith predictor, PI, PID, C alone, ADRC'
    """
    n = max(1, as_fraction(model, "model").relative_degree) if order is None else order
    probe = NRDOB(process, model, controller, LowPassFilter(1.0, n))
    m, b0 = _integrators(probe)
    speeds = _speeds(probe)
    band = slowest, fastest = min(speeds) / BEYOND, BEYOND * max(speeds)

    def timed(parameter: str, build: Callable[[float], NRDOB]) -> Scheme:
        return Scheme(parameter, "s", build, 1 / fastest, 1 / slowest, band)

    def observer(make: Callable[..., NRDOB], model: Any) -> Scheme:
        return timed("λ", lambda x: make(process, model, controller, LowPassFilter(x, n)))

    found = {
        "NR-DOB": observer(NRDOB, model),
        "conventional observer": observer(conventional_observer, model),
    }
    if probe.delay:
        delayed = model if probe.model_delay else DelayedTransferFunction(model, probe.delay)
        found["Smith predictor"] = observer(NRDOB, delayed)
    found["PI"] = timed("τc", partial(simc_pi, process))
    found["PID"] = timed("τc", partial(simc_pid, process))
    C, Gm = as_fraction(controller, "controller"), probe.fractions.Gm

    def alone(x: float) -> NRDOB:  # the model, which says nothing of this loop, stays stable
        return controller_alone(process, (Gm.num / x, Gm.den), (x * C.num, C.den))

    found["C alone"] = Scheme("gain of C", "", alone, BEYOND, 1 / BEYOND, band)
    found["ADRC"] = Scheme(
        "ωo", "rad/s", lambda x: linear_adrc(process, m, b0, x, x / RATIO), fastest, slowest, band
    )
    return found


def tune(
    candidate: Scheme,
    *,
    max_ms: float | None = None,
    max_noise: float | None = None,
    shaping: Any = None,
) -> Tuned:
    r"""Find the parameter with which a candidate is as fast as the limits let it be.

    With a slightly faster one, if one was tried, the limits are not kept.

    Parameters
    ----------
    candidate : Scheme
        A scheme with one parameter.
    max_ms, max_noise : float, optional
        Largest peak of the sensitivity :math:`|S_d|`; largest standard deviation of u for noise of
        unit density.
    shaping : as for `nrdob.NRDOB.noise_variance`, optional
        Colours that noise. White noise on a K with a direct term has no finite deviation.

    Raises
    ------
    TypeError, ValueError
        If nothing is asked for, if the candidate does not fit the plant, or if no value keeps to
        the limits; the message says which.

    Examples
    --------
    >>> from nrdob import paper
    >>> loop = paper.example(4)
    >>> each = candidates(loop.process, loop.model, loop.controller, 3)
    >>> tune(each["NR-DOB"], max_ms=1.6).text, tune(each["PI"], max_ms=1.6).text
    ('λ = 0.07705 s', 'τc = 0.1455 s')
    """
    if not isinstance(candidate, Scheme):
        raise TypeError(
            f"candidate is a {type(candidate).__name__}; give one of "
            "nrdob.alternatives.candidates(process, model, controller)"
        )
    checked_limits(max_ms, max_noise)
    refusals: list[ValueError] = []
    built: list[NRDOB] = []

    def slack(value: float) -> float:
        try:
            built.append(candidate.build(value))
        except ValueError as refusal:  # such as a C that is too large for the model
            refusals.append(refusal)
            return UNSTABLE
        return _slack(built[-1], candidate.band, max_ms, max_noise, shaping)

    decades = abs(log10(candidate.slowest / candidate.fastest))
    values = np.geomspace(candidate.fastest, candidate.slowest, ceil(PER_DECADE * decades) + 1)
    tried: dict[float, float] = {}
    for value in values.tolist():
        tried[value] = slack(value)
        if tried[value] >= 0:
            break
    else:
        if not built:
            raise refusals[-1]
        given = {"max_ms": max_ms, "max_noise": max_noise}
        limits = " and ".join(f"{name} = {x:g}" for name, x in given.items() if x is not None)
        raise ValueError(_refusal(candidate, limits, tried, built))
    unlimited = len(tried) == 1
    if not unlimited:
        value = solved(lambda x: max(slack(x), -1.0), Bracket(*list(tried)[-2:])) or value
    text = f"{candidate.parameter} = {_with_unit(candidate, value)}"
    return Tuned(candidate.build(value), value, f"{text}, no limit" if unlimited else text)


def checked_limits(max_ms: Any, max_noise: Any) -> None:
    """Refuse limits that are none."""
    if max_ms is None and max_noise is None:
        raise ValueError("nothing limits the candidates: give max_ms or max_noise")
    for name, value, least in (("max_ms", max_ms, 1.0), ("max_noise", max_noise, 0.0)):
        if value is not None:
            real_number(value, name, f"give a finite number above {least:g}", above=least)


def _slack(
    loop: NRDOB, band: tuple[float, float], max_ms: Any, max_noise: Any, shaping: Any
) -> float:
    """Logarithm of limit over value, or over what a few frequencies show if that is too high."""
    if loop.ill_posed or any(
        p.zeros_at_origin or count_rhp(p).count != 0 for p in (loop.p_A, loop.p_B)
    ):
        return UNSTABLE
    found = -UNSTABLE
    if max_ms is not None:
        seen = np.abs(loop.S_d(1j * np.geomspace(*band, LOOKED_AT))).max()
        if seen <= max_ms:
            seen = quotient_margins(loop.L, True).ms
        found = log(max_ms / seen)
    if max_noise is not None and found >= 0:
        variance = noise_variance(loop, shaping).u
        found = min(found, log(max_noise) - log(max(variance, 1e-300)) / 2)
    return max(found, ENDLESS)


def _refusal(candidate: Scheme, limits: str, tried: dict[float, float], built: list[NRDOB]) -> str:
    first, *_, last = tried
    span = f"{candidate.parameter} tried, from {first:.3g} to {_with_unit(candidate, last)}"
    best = max(tried, key=lambda each: tried[each])
    if tried[best] <= UNSTABLE:
        reason = built[len(built) // 2].stability().reason
        return f"the loop is unstable with every {span}, as one in the middle: {reason}"
    if tried[best] <= ENDLESS:
        closest = "white noise comes to u directly; give a shaping filter that colours it"
    else:
        with_best = f"{candidate.parameter} = {_with_unit(candidate, best)}"
        closest = (
            f"missed by a factor of {exp(-tried[best]):.3g} at best, with {with_best}; allow more"
        )
    return f"{limits} is not kept with any {span}: {closest}"


def _with_unit(candidate: Scheme, value: float) -> str:
    return f"{value:.4g} {candidate.unit}".rstrip()


def _integrators(loop: NRDOB) -> tuple[int, float]:
    """Return the order and b0 that fit a process, for linear ADRC."""
    for num, den in (loop.fractions.G, loop.fractions.Gm):
        order, b0 = den.size - num.size, float(num[0] / den[0])
        if 1 <= order <= 2 and not (QuasiPolynomial(num).roots.real > 0).any():
            return order, b0
    try:
        reduced = half_rule(loop.process, 2, 1 / max(_speeds(loop)))
    except ValueError:
        return order, b0
    return (2, reduced.slope / reduced.second) if reduced.second else (1, reduced.slope)


def _speeds(loop: NRDOB) -> list[float]:
    """Sizes of all poles and zeros of process, model and model loop, and one over the dead time."""
    blocks = (QuasiPolynomial(p) for p in (*loop.fractions.G, *loop.fractions.Gm))
    roots = [p.without_origin.roots for p in (*blocks, loop.p_A)]
    sizes = np.abs(np.concatenate(roots)).tolist()
    return [*sizes, *([1 / loop.delay] if loop.delay else [])] or [1.0]
