"""A certificate of a verdict: what a checker needs to prove it again, and nothing else."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction as Ratio
from itertools import product
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..diagram import Fraction, LoopEquations, LowPassFilter
from ..numerics import FloatArray, Term
from .checker import build, check, times
from .points import half_plane_points

__all__ = ["Certificate", "W", "certify"]

Interval = tuple[float, float]
Exact = list[Ratio]
Blocks = dict[str, Any]

W = "w = c (z - 1)/(z + 1)"
"""The variable of a sampled loop, c > 0: the unit circle is the imaginary axis of w."""

SHORTEST = 1e-4  # share of the longest dead time below which no part of an interval is cut


@dataclass(frozen=True)
class Certificate:
    """Proof of how many roots of a loop are in the right half plane, which prints what it proves.

    Attributes
    ----------
    content : dict or list of dict
        What is written as JSON: `blocks`, of which there may be several processes and filters, in
        exact fractions; `within`, by how much the dead time of the process may differ; `cancelled`,
        what cancels inside the blocks F/Gm (`zeros`) and (1 - F)·Gm (`poles`); `claim`, the number
        of roots of D_F, p_A and p_B in the right half plane; `points` of the imaginary axis in
        rad/s, between which each function keeps to a half plane. An interval of dead time may have
        several parts.
    proved : str
        What the checker says.
    """

    content: Blocks | list[Blocks]
    proved: str

    def __str__(self) -> str:
        return self.proved

    def __repr__(self) -> str:
        return f"Certificate({self.proved!r})"

    def save(self, path: str | PathLike[str]) -> None:
        """Write the certificate as JSON, to be checked by ``python checker.py PATH``.

        Parameters
        ----------
        path : str or path
            File to write, such as "certificate.json".
        """
        Path(path).write_text(json.dumps(self.content, indent=1) + "\n", encoding="utf-8")


def certify(
    loop: LoopEquations,
    counts: tuple[float | None, float | None],
    *,
    gains: Interval | None = None,
    delays: Interval | None = None,
    time_constants: Interval | None = None,
    variable: str = "s",
    model_delay: Fraction | None = None,
) -> Certificate:
    r"""Find the points that prove a verdict, and have them checked.

    p_B is linear in the numerator and denominator of the process, and in those of the filter. So
    what holds at both ends in the same half planes holds between them: a gain is between two
    processes, and 1/(λs + 1)^n between the n + 1 filters 1/((as + 1)^{n-k} (bs + 1)^k) if λ is
    between a and b, whose denominators are the Bézier points of (λs + 1)^n. Intervals of the dead
    time are cut until each part has its points.

    Parameters
    ----------
    loop : LoopEquations
    counts : tuple of two float
        Roots of p_A and p_B in the right half plane.
    gains, delays, time_constants : as for `nrdob.analysis.Stability.certificate`
    variable : {"s", W}
        Of a sampled loop the blocks are in w.
    model_delay : Fraction, optional
        By which the model of a sampled loop is delayed. With it no pole cancels in (1 - F)·Gm.

    Raises
    ------
    ValueError, ArithmeticError
        If an interval is none, or the filter is not of eq. (1) where `time_constants` are given; if
        there is none: a root on the imaginary axis or too close to it, infinitely many roots in the
        right half plane, or a loop that is ill-posed.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import LowPassFilter, delay
    >>> blocks = delay(0.1) * ct.tf([2], [1, 1]), ct.tf([1], [1, 1]), 2, LowPassFilter(0.5, 1)
    >>> certify(LoopEquations(*blocks), (0, 0), delays=(0, 0.2)).proved.split(". ")[0]
    'Proved: the loop is internally stable for every dead time from 0 to 0.2'
    """
    if reason := loop.ill_posed:
        raise ArithmeticError(f"no certificate: {reason}")
    fractions, one = loop.fractions, np.ones(1)
    num, den = map(_exact, fractions.G)
    factors = sorted({Ratio(k) for k in _interval("gains", gains or (1.0, 1.0))})
    others = {
        "model": _fraction(fractions.Gm),
        "model_delay": _fraction(model_delay or Fraction(one, one), loop.model_delay),
        "controller": _fraction(fractions.C),
    }
    common = loop.built.poles
    poles: FloatArray
    if model_delay:
        poles = one
    elif time_constants:  # of what cancels at one of them only the power of s cancels at all
        poles = np.append(one, np.zeros(common.zeros_at_origin))
    else:
        poles = common.q
    cancelled = {"zeros": _texts(_exact(loop.built.zeros.q)), "poles": _texts(_exact(poles))}

    def part(delay: Interval, lag: Interval) -> Blocks:
        middle, within = sum(map(Ratio, delay)) / 2, (Ratio(delay[1]) - Ratio(delay[0])) / 2
        process = [_block([k * c for c in num], den, middle) for k in factors]
        blocks = {"process": process, **others, "filter": _filters(loop, lag)}
        points = _points(blocks, cancelled, within)
        claims = (None if count is None else int(count) for count in (0, *counts))
        return {
            "format": "nrdob certificate",
            "version": 1,
            "variable": variable,
            "blocks": blocks,
            "within": str(within),
            "cancelled": cancelled,
            "claim": dict(zip(points, claims, strict=True)),
            "points": points,
        }

    delay = _interval("delays", delays or (loop.delay, loop.delay))
    lag = _interval("time_constants", time_constants or (0.0, 0.0))
    if delay[0] < 0:
        raise ValueError(f"delays are {delays}; a dead time is zero or positive")
    moving = delay if delays else lag
    content = _cut(lambda cut: part(cut, lag) if delays else part(delay, cut), moving)
    found = content[0] if len(content) == 1 else content
    try:
        return Certificate(found, check(found))
    except ValueError as error:
        raise ArithmeticError(f"no certificate: {error}") from error


def _cut(part: Callable[[Interval], Blocks], interval: Interval) -> list[Blocks]:
    """Certify an interval, or its halves, or theirs."""
    try:
        return [part(interval)]
    except ArithmeticError:
        low, high = interval
        if high - low <= SHORTEST * high:
            raise
        middle = (low + high) / 2
        return [*_cut(part, (low, middle)), *_cut(part, (middle, high))]


def _points(blocks: Blocks, cancelled: Blocks, within: Ratio) -> dict[str, list[str]]:
    """Find the points for all processes and filters, whose dead time may differ by `within`."""
    others = [blocks[name] for name in ("model", "model_delay", "controller")]
    try:
        built = [
            build([G, *others, F], cancelled)
            for G, F in product(blocks["process"], blocks["filter"])
        ]
    except ValueError as error:
        raise ArithmeticError(f"no certificate: {error}") from error
    (functions, _, _, delay, model_delay, _), *_ = built
    if within and delay == model_delay:
        # There one term of p_B would hold both, of which only one moves: a shorter part has not.
        raise ArithmeticError("no certificate: the dead time is that of the model in the middle")
    points, moved = {}, {"delay": float(delay), "within": float(within)}
    for name, (_, power) in functions.items():
        try:
            every = [_terms(made[name][0]) for made, *_ in built]
            found = half_plane_points(every, power, **moved)
        except OverflowError:
            raise ArithmeticError(
                f"no certificate for {name}: its coefficients leave the range of floating-point "
                "numbers; choose another unit of time, or a longer dt"
            ) from None
        except ArithmeticError as error:
            raise ArithmeticError(f"no certificate for {name}: {error}") from error
        points[name] = _texts(_exact(found))
    return points


def _terms(function: dict[Ratio, Exact]) -> tuple[Term, ...]:
    """Give a function in floating point, the term without dead time first."""
    return tuple(Term(np.array(q, dtype=float), float(t)) for t, q in sorted(function.items()))


def _filters(loop: LoopEquations, time_constants: Interval) -> list[Blocks]:
    """Give the loop's filter, or those between which all with these time constants are."""
    F = loop.filter
    if not any(time_constants):
        return [_fraction(loop.fractions.F)]
    if not isinstance(F, LowPassFilter):
        raise ValueError(f"time_constants are those of a LowPassFilter; the filter is {F!r}")
    if time_constants[0] <= 0:
        raise ValueError(f"time_constants are {time_constants}; they are to be positive")
    low, high = ([[Ratio(value), Ratio(1)]] for value in time_constants)
    lags = (low * (F.order - k) + high * k for k in range(F.order + 1))
    return [_block([Ratio(1)], times([Ratio(1)], *each)) for each in lags]


def _interval(name: str, given: Interval) -> Interval:
    try:
        low, high = map(float, given)
    except (TypeError, ValueError):
        raise TypeError(f"{name} is {given!r}; give the lowest and the highest") from None
    if not (isfinite(low) and isfinite(high) and low <= high):
        raise ValueError(f"{name} are {given}; give the lowest and the highest")
    return low, high


def _fraction(given: Fraction, delay: float = 0.0) -> Blocks:
    return _block(_exact(given.num), _exact(given.den), delay)


def _block(num: Exact, den: Exact, delay: float | Ratio = 0.0) -> Blocks:
    return {"num": _texts(num), "den": _texts(den), "delay": str(Ratio(delay))}


def _texts(values: Exact) -> list[str]:
    return [str(value) for value in values]


def _exact(values: Any) -> Exact:
    return [Ratio(value) for value in values.tolist()]
