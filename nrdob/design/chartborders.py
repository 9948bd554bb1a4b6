r"""All loops of a stability chart, and the curves on which roots are on the axis.

The process may be multiplied by a gain k, may have another dead time θ and an additional lag τ,
and the filter another time constant λ. Then

.. math:: p_B = (1 + \tau s)\,A(\lambda) + k\,B(\lambda)\,e^{-\theta s},
          \qquad A = D N_m' E, \quad B = N D_m' N_f',

where E is what is left of :math:`D_f - N_f`, or of :math:`D_f - N_f e^{-\theta_m s}`, whose dead
time is then one of A. A root is on the axis where W = -(1 + jτω) A/B equals
:math:`k e^{-j\omega\theta}`. Of any two parameters ω gives the values: :math:`|W| = k` and
:math:`\theta = (2\pi m - \arg W)/\omega`, or k where :math:`W e^{j\omega\theta}` is real, and so
on; with λ, all of them on a curve in the plane of ω and λ. A real root crosses at ω = 0 or at
infinity. With long dead times the curves get denser than a chart can show; they are drawn up to
where so many roots are in the right half plane that no more dead time brings all of them back
(`most_turns`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import reduce
from math import ceil, inf, pi
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
from .chartcurves import (
    BESIDE,
    PIXELS,
    Axis,
    Border,
    beside_changes,
    cut,
    drawn,
    drawn_together,
    level_set,
    parts,
    projected,
    within,
)
from .mismatch import Mismatch
from .mismatchgrid import Frequencies

__all__ = ["MANY_ROOTS", "ChartLoops", "borders_of", "most_turns"]

PER_DECADE, PER_TURN = 48, 24
"""Density of the frequencies, and frequencies to a turn of a dead time that is fixed."""

MANY = 20_000
"""So many frequencies, or curves, are too many."""

SLAB = 64
"""Loops whose roots are counted at once."""

MANY_ROOTS = 80
"""Where the curves of a dead time are too many, at least so many roots are unstable."""

LAMBDAS = 160
"""Number of λ over an axis."""

AT_ONCE = 256
"""Turns of the dead time whose curves are drawn at once."""

FEW = PIXELS // 2
"""Turns of the dead time up to which all curves are drawn."""

VALUES = 80
"""Number of values of the other parameter for which the turns are counted."""

Curve = tuple[FloatArray, FloatArray, FloatArray]


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
        return cls(
            Mismatch.in_loop(loop, FilterFamily("own", F.num[:, None], F.den[:, None])), fixed
        )

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
        """Count the roots in the right half plane; an error where there are roots on the axis."""
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

    # Where a real root crosses.

    def ends(
        self, lambdas: FloatArray, *, lagging: bool, turning: bool
    ) -> Iterator[tuple[float, FloatArray, FloatArray]]:
        """Give ω = 0 or infinity, and p and q: a real root crosses there where p = k q, for each λ.

        At 0 where p_B vanishes. At infinity where its leading coefficient does, or with dead time
        where those of the delayed terms together are as large as the one without: beyond, the dead
        time of a delayed model would have to be followed for ever.
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
                lambdas = np.geomspace(*axis.positive, 40)
            if axis.name == "gain":
                most = axis.high
        ahead, behind, waits = map(np.abs, self.mismatch.terms(omega[:, None], lambdas))
        with np.errstate(all="ignore"):
            least = np.nanmin(ahead / (1.1 * most * behind + waits), axis=1)
        possible = np.flatnonzero(least <= 1.0)
        return float(omega[min(possible[-1] + 1, omega.size - 1)]) if possible.size else 0.0


def _columns(terms: tuple[Term, ...]) -> ManyTerms:
    """Put terms beside each other, each a column."""
    q = np.zeros((max(term.q.size for term in terms), len(terms)))
    for k, term in enumerate(terms):
        q[q.shape[0] - term.q.size :, k] = term.q
    return ManyTerms(q, np.array([term.delay for term in terms]))


def _family(filter: Any) -> FilterFamily:
    family = filter.order if isinstance(filter, LowPassFilter) else filter
    if isinstance(family, FilterFamily) or not hasattr(family, "num"):
        return as_family(family)
    raise TypeError(
        "time_constant is on an axis, but filter is a single one: give an order, or a family from "
        "nrdob.filter_family"
    )


def borders_of(loops: ChartLoops, x: Axis, y: Axis, most: float) -> Iterator[Border]:
    """Give the curves on which the number of roots in the right half plane may change."""
    for flipped, axes in ((False, (x, y)), (True, (y, x))):
        if crossing := CROSSING.get((axes[0].name, axes[1].name)):
            for omega, first, second in (*crossing(loops, axes, most), *_ends(loops, axes)):
                points = (second, first) if flipped else (first, second)
                yield from cut(x, y, Border(*points, omega))


def most_turns(loops: ChartLoops, x: Axis, y: Axis) -> float:
    r"""Count the turns θω/2π up to which the curves of a dead time are drawn; inf for all of them.

    Whatever θ is, a pair of roots goes right where :math:`|W| = k` and :math:`|W|` rises with ω,
    and left where it falls: up to one, so many times as θω/2π. After t seconds at least
    t Σ ±ω/2π - K pairs are in the right half plane, for K such frequencies.
    """
    if y.name != "delay":
        x, y = y, x
    if y.name != "delay":
        return inf
    omega = loops.frequencies((x, y))
    first, last = x.positive if x.name in ("time_constant", "gain") else (x.low, x.high)
    values = np.linspace(first, last, VALUES)
    if x.logarithmic:
        values = np.geomspace(first, last, VALUES)
    values = values[:, None]
    size = np.abs(loops.ratio(omega, values if x.name == "time_constant" else 1.0))
    size = size * np.abs(1 + 1j * omega * values) if x.name == "lag" else size
    large = size < (values if x.name == "gain" else loops.fixed["gain"])
    steps = large[:, :-1] * 1.0 - large[:, 1:]
    rate, crossings = (steps * omega[:-1]).sum(axis=1), np.abs(steps).sum(axis=1)
    fastest = (np.abs(steps) * omega[:-1]).max(axis=1)
    if fastest.max() * y.high / (2 * pi) <= FEW:
        return inf
    turning = crossings > 0
    needed = (MANY_ROOTS / 2 + 2 * crossings) * fastest
    return float(np.max(needed[turning] / np.maximum(rate[turning], 1e-300)))


# Without λ: both parameters are functions of ω.


def _gain_and_lag(loops: ChartLoops, axes: tuple[Axis, Axis], most: float) -> Iterator[Curve]:
    """With V = W exp(jωθ): (1 + jτω) V = k."""

    def at(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        omega = np.exp(place[0])
        V = loops.turned(omega)
        with np.errstate(all="ignore"):
            return place, np.abs(V) ** 2 / V.real, -V.imag / (omega * V.real)

    omega = beside_changes(lambda w: loops.turned(w).real, loops.frequencies(axes))
    for part in parts(loops.turned(omega).real > 0):
        place, gain, lag = drawn(axes, np.log(omega[part])[None], at, 1)
        yield np.exp(place[0]), gain, lag


def _with_delay(loops: ChartLoops, axes: tuple[Axis, Axis], most: float) -> Iterator[Curve]:
    """Take the gain, or the lag, from the size of W, and the dead time from its angle."""
    first, omega = axes[0], loops.frequencies(axes)

    def read(omega: FloatArray) -> tuple[FloatArray, ComplexArray]:
        W = loops.ratio(omega)
        if first.name == "gain":
            return np.abs(W), W
        with np.errstate(all="ignore"):
            square = (loops.fixed["gain"] / np.abs(W)) ** 2 - 1
            lag = np.sign(square) * np.sqrt(np.abs(square)) / omega
        return lag, W * (1 + 1j * np.maximum(lag, 0.0) * omega)

    def curve(place: FloatArray) -> tuple[FloatArray, FloatArray, ComplexArray]:
        return (place, *read(np.exp(place[0])))

    values, W = read(omega)
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(W) & (values <= first.high) & (values >= first.low)
    for part in parts(within(seen) & np.isfinite(W)):
        yield from _turns(axes, np.log(omega[part])[None], curve, most)


def _turns(
    axes: tuple[Axis, Axis],
    place: FloatArray,
    curve: Callable[[FloatArray], tuple[FloatArray, FloatArray, ComplexArray]],
    most: float,
) -> Iterator[Curve]:
    """Give the dead times that turn 1 to the angle of W, one turn after the other.

    The angle is a row of the places, so that between two points it is followed from both.
    """
    place, _, W = curve(place)
    omega, angle = np.exp(place[0]), np.unwrap(-np.angle(W))
    ends = axes[1].value(np.array([-BESIDE, 1 + BESIDE]))[:, None]
    turns = (np.minimum(ends * omega, 2 * pi * most) - angle) / (2 * pi)
    first, last = ceil(np.nanmin(turns)) - 1, int(np.nanmax(turns)) + 1
    if last - first > MANY:
        raise ValueError(
            f"the dead time makes {last - first} turns within the chart: let the axes begin "
            "farther from 0, or end earlier"
        )

    def at(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        better, values, W = curve(place[:-1])
        angle = -np.angle(W)
        angle = angle + 2 * pi * np.round((place[-1] - angle) / (2 * pi))
        return np.vstack([better, angle]), values, angle / np.exp(better[0])

    places = []
    for m in range(first, last + 1):
        below, above = m < turns[0], m > turns[1]
        shown = ~((below[1:] & below[:-1]) | (above[1:] & above[:-1]))
        kept = np.append(shown, False) | np.append(False, shown)
        turned = np.vstack([place, angle + 2 * pi * m])
        places += [turned[:, part] for part in parts(kept)]
    for k in range(0, len(places), AT_ONCE):
        together = drawn_together(axes, places[k : k + AT_ONCE], at, len(place))
        yield from ((np.exp(found[0]), values, theta) for found, values, theta in together)


# With λ: where a function of ω and λ vanishes.

Function = Callable[[ChartLoops, FloatArray, FloatArray], FloatArray]


def _with_lambda(loops: ChartLoops, axes: tuple[Axis, Axis], most: float) -> Iterator[Curve]:
    second = axes[1].name
    function = FUNCTIONS[second]

    def vanishing(u: FloatArray, v: FloatArray) -> FloatArray:
        return function(loops, np.exp(u), np.exp(v))

    def on(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        place = projected(vanishing, place)
        return place, *np.exp(place)

    def with_gain(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        place, omega, lam = on(place)
        return place, lam, loops.turned(omega, lam).real

    def with_lag(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        place, omega, lam = on(place)
        with np.errstate(all="ignore"):
            return place, lam, (1 / loops.turned(omega, lam)).imag / omega

    def with_size(place: FloatArray) -> tuple[FloatArray, FloatArray, ComplexArray]:
        place, omega, lam = on(place)
        return place, lam, loops.ratio(omega, lam)

    for line in level_set(vanishing, np.log(loops.frequencies(axes)), _lambdas(axes[0])):
        if second == "delay":
            yield from _turns(axes, line, with_size, most)
            continue
        place, lam, other = drawn(axes, line, with_gain if second == "gain" else with_lag, 2)
        for part in parts(other > 0 if second == "gain" else np.isfinite(other)):
            yield np.exp(place[0, part]), lam[part], other[part]


def _size_off(loops: ChartLoops, omega: FloatArray, lam: FloatArray) -> FloatArray:
    """For θ on the other axis: ln|W/k|."""
    with np.errstate(all="ignore"):
        return np.log(np.abs(loops.ratio(omega, lam)) / loops.fixed["gain"])


def _angle_off(loops: ChartLoops, omega: FloatArray, lam: FloatArray) -> FloatArray:
    """For k on the other axis: sine of the angle of W exp(jωθ)."""
    V = loops.turned(omega, lam)
    with np.errstate(all="ignore"):
        return np.asarray(V.imag / np.abs(V))


def _real_part_off(loops: ChartLoops, omega: FloatArray, lam: FloatArray) -> FloatArray:
    """For τ on the other axis: the real part of k exp(-jωθ)/W, less 1."""
    with np.errstate(all="ignore"):
        U = 1 / loops.turned(omega, lam)
        return np.asarray((U.real - 1) / (1 + np.abs(U)))


FUNCTIONS: dict[str, Function] = {
    "delay": _size_off,
    "gain": _angle_off,
    "lag": _real_part_off,
}
"""What vanishes where the parameter on the other axis can have a value."""


CROSSING: dict[tuple[str, str], Callable[..., Iterator[Curve]]] = {
    ("time_constant", "delay"): _with_lambda,
    ("time_constant", "gain"): _with_lambda,
    ("time_constant", "lag"): _with_lambda,
    ("gain", "delay"): _with_delay,
    ("gain", "lag"): _gain_and_lag,
    ("lag", "delay"): _with_delay,
}
"""What gives the curves, by the two axes in the order in which they are read."""


def _lambdas(axis: Axis) -> FloatArray:
    """Give ln λ all over an axis."""
    lambdas = axis.value(np.linspace(0, 1, LAMBDAS))
    low, high = axis.positive
    return np.asarray(np.log(np.concatenate([[low], lambdas[lambdas > low], [high]])))


# Where a real root crosses.


def _ends(loops: ChartLoops, axes: tuple[Axis, Axis]) -> Iterator[Curve]:
    """Lines on which p_B(0), or its leading coefficient, vanishes."""
    first, second = axes
    names = {first.name, second.name}
    values = first.value(np.linspace(0, 1, 8 * PIXELS + 1))
    if first.name == "time_constant":
        values = values[values >= first.positive[0]]
    lambdas = values if first.name == "time_constant" else np.ones(1)
    whole = np.array([second.low, second.high])
    lagging = bool(loops.fixed["lag"]) or "lag" in names
    turning = bool(loops.fixed["delay"]) or "delay" in names
    for at, p, q in loops.ends(lambdas, lagging=lagging, turning=turning):
        with np.errstate(all="ignore"):
            gain = p / q
        if second.name == "gain":
            for part in parts(np.isfinite(gain) & (gain > 0)):
                yield np.full(values[part].size, at), values[part], gain[part]
        elif first.name == "gain":
            if np.isfinite(gain[0]) and gain[0] > 0:
                yield np.full(2, at), np.full(2, gain[0]), whole
        elif first.name == "time_constant":
            off = p - loops.fixed["gain"] * q
            for i in np.flatnonzero((off[:-1] < 0) != (off[1:] < 0)):
                share = off[i] / (off[i] - off[i + 1])
                lam = values[i] + share * (values[i + 1] - values[i])
                yield np.full(2, at), np.full(2, lam), whole
