r"""All loops of a stability chart: one characteristic function with four parameters.

The process may be multiplied by a gain k, may have another dead time θ and one more lag τ, and the
filter another time constant λ. Then

.. math:: p_B = (1 + \tau s)\,A(\lambda) + k\,B(\lambda)\,e^{-\theta s},
          \qquad A = D N_m' E, \quad B = N D_m' N_f',

where E is what is left of :math:`D_f - N_f`, or :math:`D_f - N_f e^{-\theta_m s}` in a model that
waits: its dead time is one of A, so that there are two.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from math import inf, pi
from typing import Any

import numpy as np

from ..diagram import (
    DelayedTransferFunction,
    FilterFamily,
    LowPassFilter,
    ObserverEquations,
    as_family,
)
from ..numerics import (
    ComplexArray,
    FloatArray,
    ManyTerms,
    QuasiPolynomial,
    Term,
    add,
    count_rhp,
    rhp_counts,
)
from .chartaxes import PIXELS, Axis
from .mismatch import Mismatch
from .mismatchgrid import Frequencies

__all__ = ["MANY", "ChartLoops", "positive"]

OWN = "own"

PER_DECADE, PER_TURN = 48, 24
"""Density of the frequencies, and frequencies to a turn of a dead time that is fixed."""

MANY = 20_000
"""So many frequencies, or curves, are too many."""

SLAB = 64
"""Loops whose roots are counted at once."""

LARGEST = 300.0
"""Bound of the logarithm of a sensitivity, so that nothing overflows."""


@dataclass(frozen=True, eq=False)
class ChartLoops:
    """All loops of a chart.

    Attributes
    ----------
    mismatch : Mismatch
        The process without dead time over the model, and the filters.
    fixed : dict
        The parameters, as they are where they are on no axis.
    """

    mismatch: Mismatch
    fixed: dict[str, float]

    @classmethod
    def of(cls, process: Any, model: Any, filter: Any, free: set[str]) -> ChartLoops:
        """Read the blocks; `free` are the parameters on the axes."""
        delayed = isinstance(process, DelayedTransferFunction)
        undelayed = process.tf if delayed else process
        fixed = {"gain": 1.0, "delay": process.delay if delayed else 0.0, "lag": 0.0}
        if "time_constant" in free:
            family = _family(filter)
            return cls(Mismatch.of(undelayed, model, family, waits=True), fixed)
        if isinstance(filter, FilterFamily | int):
            raise TypeError(
                "filter is a whole family, but time_constant is on no axis: give one filter, such "
                "as family.at(time_constant)"
            )
        fixed["time_constant"] = 1.0
        loop = ObserverEquations(undelayed, model, filter)
        F = loop.fractions.F
        return cls(Mismatch.in_loop(loop, FilterFamily(OWN, F.num[:, None], F.den[:, None])), fixed)

    # One loop.

    def p_B(self, given: dict[str, float]) -> QuasiPolynomial:
        """Characteristic function with given parameters."""
        values = self.fixed | given
        (ahead, behind, *waiting), sizes = self.mismatch.built(values["time_constant"])
        lag = np.array([values["lag"], 1.0]) if values["lag"] else np.ones(1)
        sizes = [np.convolve(lag, sizes[0]), values["gain"] * sizes[1], *sizes[2:]]
        sizes[2:] = [np.convolve(lag, size) for size in sizes[2:]]
        more = tuple(Term(np.convolve(lag, part), self.mismatch.wait) for part in waiting)
        ahead, behind = np.convolve(lag, ahead), values["gain"] * behind
        power = self.mismatch.divided
        scale = reduce(add, sizes)
        p = QuasiPolynomial(ahead, behind, values["delay"], scale, more, origin=power)
        return p.over_s(power)

    def count(self, given: dict[str, float]) -> float:
        """Count the roots on the right; an error where there are roots on the axis."""
        p = self.p_B(given)
        found = count_rhp(p)
        if found.count is None or p.zeros_at_origin:
            raise ArithmeticError(
                f"the loop is on the border of stability at {given}: {found.reason or 's = 0'}"
            )
        return found.count if found.count == inf else int(found.count)

    def counts(self, points: list[dict[str, float]]) -> list[float]:
        """Count for many loops at once, and for those alone that are too close to call."""
        every = [self.p_B(point) for point in points]
        alike: dict[tuple[int, ...], list[int]] = {}
        for k, p in enumerate(every):
            if p.q.size > p.degree and not (p.divided or p.zeros_at_origin):
                alike.setdefault((p.q.size, p.scale.size, len(p.delayed)), []).append(k)
        found = np.full(len(points), -1)
        for members in alike.values():
            for first in range(0, len(members), SLAB):
                few = [every[k] for k in members[first : first + SLAB]]
                terms = [_columns(each) for each in zip(*(p.terms for p in few), strict=True)]
                scale = np.array([p.scale for p in few]).T
                found[members[first : first + SLAB]] = rhp_counts(terms, scale)
        return [
            self.count(point) if count < 0 else int(count)
            for point, count in zip(points, found, strict=True)
        ]

    # Many of them on the axis.

    def ratio(self, omega: FloatArray, lam: Any = 1.0) -> ComplexArray:
        """W = -(1 + jτω) A/B without what is on the axes; k exp(-jωθ) where a root is at jω."""
        ahead, behind, waits = self.mismatch.terms(omega, np.asarray(lam))
        with np.errstate(all="ignore"):
            turned = -(ahead + waits) * (1 + 1j * self.fixed["lag"] * omega)
            return np.asarray(turned / behind)

    def turned(self, omega: FloatArray, lam: Any = 1.0) -> ComplexArray:
        """W exp(jωθ) with the dead time of the process."""
        return np.asarray(self.ratio(omega, lam) * np.exp(1j * omega * self.fixed["delay"]))

    def peaks(self, given: dict[str, Any], omega: FloatArray) -> FloatArray:
        """Peak of the sensitivity of each stable loop, one a row."""
        values = self.fixed | given
        ahead, behind, waits = self.mismatch.terms(omega, values["time_constant"])
        ahead = (ahead + waits) * (1 + 1j * values["lag"] * omega)
        behind = behind * values["gain"] * np.exp(-1j * values["delay"] * omega)
        with np.errstate(all="ignore"):
            size = np.log(np.abs(ahead / (ahead + behind)))
        size = np.nan_to_num(size, nan=-LARGEST, neginf=-LARGEST, posinf=LARGEST)
        top = np.clip(size.argmax(axis=1), 1, omega.size - 2)
        before, at, after = (size[np.arange(top.size), top + k] for k in (-1, 0, 1))
        curvature = np.minimum(before - 2 * at + after, -1e-300)
        risen = at - (after - before) ** 2 / (8 * curvature)
        return np.asarray(np.exp(np.where((at >= before) & (at >= after), risen, size.max(axis=1))))

    # Where a real root crosses.

    def ends(
        self, lambdas: FloatArray, *, lagging: bool, turning: bool
    ) -> Iterator[tuple[float, FloatArray, FloatArray]]:
        """Give ω = 0 or infinity, and p and q: a real root crosses there where p = k q, for each λ.

        At 0 where p_B vanishes. At infinity where its leading coefficient does, or with dead time
        where those of the delayed terms together are as large as the one without: beyond, the dead
        time of a model that waits would have to be followed for ever.
        """
        ahead, behind, waits = self.mismatch.lowest(lambdas)
        yield 0.0, -(ahead + waits), behind
        ahead, behind, waits = self.mismatch.highest(lambdas, lagging=lagging)
        late = np.abs(waits)
        ahead, behind = (np.abs(ahead), np.abs(behind)) if turning else (-ahead, behind)
        yield inf, ahead - late, behind

    # The frequencies.

    def frequencies(self, axes: tuple[Axis, Axis]) -> FloatArray:
        """Frequencies over all that there is to see, fine enough for dead times that are fixed."""
        mismatch = self.mismatch
        base = Frequencies(mismatch).base
        highs = [axis.high for axis in axes if axis.name != "gain"]
        lows = [
            axis.low if axis.logarithmic else max(axis.low, axis.high / 100)
            for axis in axes
            if axis.name != "gain"
        ]
        sizes = np.concatenate([mismatch.speeds, 1 / np.array(highs), 1 / np.array(lows)])
        low, high = sizes.min() / 1e4, sizes.max() * 1e4
        count = int(PER_DECADE * np.log10(high / low))
        omega = np.union1d(base[(base > low) & (base < high)], np.geomspace(low, high, count))
        names = {axis.name for axis in axes}
        longest = max(mismatch.wait, 0.0 if "delay" in names else self.fixed["delay"])
        if not longest:
            return omega[~mismatch.at_pole(omega)]
        last = self._last(omega, axes)
        step = 2 * pi / (longest * PER_TURN)
        if last > MANY * step or last == omega[-1]:
            raise ValueError(
                f"the dead time of {longest:g} s would have to be followed up to "
                f"{last:.3g} rad/s: let the axes begin farther from 0, or take a filter that rolls "
                "off"
            )
        omega = np.union1d(omega[omega <= last], np.arange(step, last, step))
        return omega[~mismatch.at_pole(omega)]

    def _last(self, omega: FloatArray, axes: tuple[Axis, Axis]) -> float:
        """Last frequency at which |A| may be as small as k |B|, whatever its dead time turns."""
        lambdas = np.ones(1)
        most = 1.0
        for axis in axes:
            if axis.name == "time_constant":
                lambdas = np.geomspace(*positive(axis), 40)
            if axis.name == "gain":
                most = axis.high
        ahead, behind, waits = map(np.abs, self.mismatch.terms(omega[:, None], lambdas))
        with np.errstate(all="ignore"):
            least = np.nanmin(ahead / (1.1 * most * behind + waits), axis=1)
        possible = np.flatnonzero(least <= 1.0)
        return float(omega[min(possible[-1] + 1, omega.size - 1)]) if possible.size else 0.0


def positive(axis: Axis) -> tuple[float, float]:
    """Widen the ends of an axis of a parameter that must be positive a little."""
    return (axis.low or axis.high / PIXELS / 9) / 1.1, 1.1 * axis.high


def _columns(terms: tuple[Term, ...]) -> ManyTerms:
    """Put terms beside each other, each a column."""
    q = np.zeros((max(term.q.size for term in terms), len(terms)))
    for k, term in enumerate(terms):
        q[q.shape[0] - term.q.size :, k] = term.q
    return ManyTerms(q, np.array([term.delay for term in terms]))


def _family(filter: Any) -> FilterFamily:
    if isinstance(filter, LowPassFilter):
        return as_family(filter.order)
    if isinstance(filter, FilterFamily) or not hasattr(filter, "num"):
        return as_family(filter)
    raise TypeError(
        "time_constant is on an axis, but filter is a single one: give an order, or a family from "
        "nrdob.filter_family"
    )
