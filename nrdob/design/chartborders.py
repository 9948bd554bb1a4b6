r"""All loops of a stability chart, and the curves on which roots are on the axis.

The process may be multiplied by a gain k, may have another dead time θ and an additional lag τ,
and the filter another time constant λ. Then

.. math:: p_B = (1 + \tau s)\,A(\lambda) + k\,B(\lambda)\,e^{-\theta s},
          \qquad A = D N_m' E, \quad B = N D_m' N_f',

where E is what is left of :math:`D_f - N_f`, or of :math:`D_f - N_f e^{-\theta_m s}`, whose dead
time is then one of A. A root is on the axis where W = -(1 + jτω) A/B equals
:math:`k e^{-j\omega\theta}`. Of any two parameters ω gives the values: :math:`|W| = k` and
:math:`\theta = (2\pi m - \arg W)/\omega`, and so on; with λ, all of them on a curve in the plane
of ω and λ. A real root crosses at ω = 0 or at infinity.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil, inf, pi
from typing import Any

import numpy as np
from scipy.ndimage import binary_dilation

from ..diagram import FilterFamily, LowPassFilter, ObserverEquations, as_family, undelayed
from ..numerics import ComplexArray, FloatArray, count_rhp, follow_together
from .chartcurves import (
    BESIDE,
    PIXELS,
    Axis,
    Border,
    beside_changes,
    cut,
    drawn,
    level_set,
    parts,
    projected,
)
from .mismatch import Mismatch
from .mismatchgrid import Frequencies

__all__ = ["ChartLoops", "borders_of"]

PER_DECADE, PER_TURN = 48, 24  # density of frequencies, and those to a turn of a fixed dead time
MANY = 20_000  # so many frequencies are too many
LAMBDAS = 160  # number of λ over an axis
TURNS = 2 * PIXELS  # turns of the dead time, each with a curve, that a chart may have

Curve = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class ChartLoops:
    """All loops of a chart; `fixed` has the parameters that are on no axis, with the dead time."""

    mismatch: Mismatch
    fixed: dict[str, float]

    @classmethod
    def of(cls, process: Any, model: Any, filter: Any, free: set[str]) -> ChartLoops:
        """Read the blocks; `free` are the parameters on the axes."""
        prompt, delay = undelayed(process)
        fixed = {"gain": 1.0, "delay": 0.0 if "delay" in free else delay, "lag": 0.0}
        if "time_constant" in free:
            return cls(Mismatch.of(prompt, model, _family(filter)), fixed)
        if isinstance(filter, FilterFamily | int):
            raise TypeError(
                "filter is a whole family, but time_constant is on no axis: give one filter, such "
                "as family.at(time_constant)"
            )
        loop = ObserverEquations(prompt, model, filter)
        F = loop.fractions.F
        family = FilterFamily("own", F.num[:, None], F.den[:, None])
        return cls(Mismatch.in_loop(loop, family), fixed | {"time_constant": 1.0})

    def counts(self, points: list[dict[str, float]]) -> list[float]:
        """Count roots in the right half plane; an error where there are roots on the axis."""
        functions = [self.mismatch.p_B(**self.fixed | point) for point in points]
        follow_together(functions)
        counts = []
        for p, point in zip(functions, points, strict=True):
            found = count_rhp(p)
            if found.count is None or p.zeros_at_origin:
                at = ", ".join(f"{name} = {value:.6g}" for name, value in point.items())
                raise ArithmeticError(
                    f"the loop is on the border of stability at {at}: {found.reason or 's = 0'}"
                )
            counts.append(found.count)
        return counts

    def ratio(self, omega: FloatArray, lam: Any = 1.0) -> ComplexArray:
        """W = -A/B, times exp(jωθ) where θ is on no axis."""
        ahead, behind, delayed = self.mismatch.terms(omega, np.asarray(lam))
        with np.errstate(all="ignore"):
            turned = np.exp(1j * omega * self.fixed["delay"])
            return np.asarray(-(ahead + delayed) / behind * turned)

    def frequencies(self, axes: tuple[Axis, Axis]) -> FloatArray:
        """Frequencies over all that there is to see, fine enough for dead times that are fixed."""
        mismatch = self.mismatch
        base = Frequencies(mismatch).base
        times = [axis for axis in axes if axis.name != "gain"]
        lows = [a.low if a.logarithmic else max(a.low, a.high / 100) for a in times]
        sizes = np.append(mismatch.speeds, 1 / np.array([*lows, *(a.high for a in times)]))
        low, high = sizes.min() / 1e4, sizes.max() * 1e4
        count = int(PER_DECADE * np.log10(high / low))
        omega = np.union1d(base[(base > low) & (base < high)], np.geomspace(low, high, count))
        longest = max(mismatch.model_delay, self.fixed["delay"])
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
        of = {axis.name: axis for axis in axes}
        timed, most = "time_constant" in of, of["gain"].high if "gain" in of else 1.0
        lambdas = np.geomspace(*of["time_constant"].positive, 40) if timed else np.ones(1)
        ahead, behind, delayed = map(np.abs, self.mismatch.terms(omega[:, None], lambdas))
        with np.errstate(all="ignore"):
            least = np.nanmin(ahead / (1.1 * most * behind + delayed), axis=1)
        possible = np.flatnonzero(least <= 1.0)
        return float(omega[min(possible[-1] + 1, omega.size - 1)]) if possible.size else 0.0


def _family(filter: Any) -> FilterFamily:
    family = filter.order if isinstance(filter, LowPassFilter) else filter
    if isinstance(family, FilterFamily) or not hasattr(family, "num"):
        return as_family(family)
    raise TypeError(
        "time_constant is on an axis, but filter is a single one: give an order, or a family from "
        "nrdob.filter_family"
    )


def borders_of(loops: ChartLoops, x: Axis, y: Axis) -> Iterator[Border]:
    """Give the curves on which the number of roots in the right half plane may change."""
    for flipped, axes in ((False, (x, y)), (True, (y, x))):
        if crossing := CROSSING.get((axes[0].name, axes[1].name)):
            for omega, first, second in (*crossing(loops, axes), *_ends(loops, axes)):
                points = (second, first) if flipped else (first, second)
                yield from cut(x, y, Border(*points, omega))


# Without λ: both parameters are functions of ω.


def _gain_and_lag(loops: ChartLoops, axes: tuple[Axis, Axis]) -> Iterator[Curve]:
    """Solve (1 + jτω) W = k."""

    def at(place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        omega = np.exp(place[0])
        W = loops.ratio(omega)
        with np.errstate(all="ignore"):
            return place, np.abs(W) ** 2 / W.real, -W.imag / (omega * W.real)

    omega = beside_changes(lambda w: loops.ratio(w).real, loops.frequencies(axes))
    places = [np.log(omega[part])[None] for part in parts(loops.ratio(omega).real > 0)]
    for place, gain, lag in drawn(axes, places, at, 1):
        yield np.exp(place[0]), gain, lag


def _with_delay(loops: ChartLoops, axes: tuple[Axis, Axis]) -> Iterator[Curve]:
    """Take the gain, or the lag, from the size of W, and the dead time from its angle."""
    first, omega = axes[0], loops.frequencies(axes)

    def curve(place: FloatArray) -> tuple[FloatArray, FloatArray, ComplexArray]:
        omega = np.exp(place[0])
        W = loops.ratio(omega)
        if first.name == "gain":
            return place, np.abs(W), W
        with np.errstate(all="ignore"):
            square = 1 / np.abs(W) ** 2 - 1
            lag = np.sign(square) * np.sqrt(np.abs(square)) / omega
        return place, lag, W * (1 + 1j * np.maximum(lag, 0.0) * omega)

    _, values, W = curve(np.log(omega)[None])
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(W) & (values <= first.high) & (values >= first.low)
    for part in parts(binary_dilation(seen) & np.isfinite(W)):
        yield from _turns(axes, np.log(omega[part])[None], curve)


def _turns(
    axes: tuple[Axis, Axis],
    place: FloatArray,
    curve: Callable[[FloatArray], tuple[FloatArray, FloatArray, ComplexArray]],
) -> Iterator[Curve]:
    """Give the dead times that turn 1 to the angle of W, which is a row of the places."""
    place, _, W = curve(place)
    omega, angle = np.exp(place[0]), np.unwrap(-np.angle(W))
    ends = axes[1].value(np.array([-BESIDE, 1 + BESIDE]))[:, None]
    turns = (ends * omega - angle) / (2 * pi)
    first, last = ceil(np.nanmin(turns)) - 1, int(np.nanmax(turns)) + 1
    if last - first > TURNS:
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
    for found, values, theta in drawn(axes, places, at, len(place)):
        yield np.exp(found[0]), values, theta


# With λ: where a function of ω and λ vanishes.
OFF: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
    "delay": (lambda W: np.log(np.abs(W)), lambda W, omega: W),
    "gain": (lambda W: W.imag / np.abs(W), lambda W, omega: W.real),
    "lag": (
        lambda W: ((1 / W).real - 1) / (1 + np.abs(1 / W)),
        lambda W, omega: (1 / W).imag / omega,
    ),
}
"""By the other axis: what of W vanishes where its parameter has a value, and that value.

Of a dead time W itself: its angle gives one for each turn.
"""


def _with_lambda(loops: ChartLoops, axes: tuple[Axis, Axis]) -> Iterator[Curve]:
    second = axes[1].name
    off, other = OFF[second]

    def vanishing(u: FloatArray, v: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            return np.asarray(off(loops.ratio(np.exp(u), np.exp(v))))

    def at(place: FloatArray) -> tuple[FloatArray, FloatArray, Any]:
        place = projected(vanishing, place)
        omega, lam = np.exp(place)
        with np.errstate(all="ignore"):
            return place, lam, other(loops.ratio(omega, lam), omega)

    low, high = axes[0].positive
    lambdas = axes[0].value(np.linspace(0, 1, LAMBDAS))
    lambdas = np.concatenate([[low], lambdas[lambdas > low], [high]])
    for line in level_set(vanishing, np.log(loops.frequencies(axes)), np.log(lambdas)):
        if second == "delay":
            yield from _turns(axes, line, at)
            continue
        ((place, lam, values),) = drawn(axes, [line], at, 2)
        for part in parts(values > 0 if second == "gain" else np.isfinite(values)):
            yield np.exp(place[0, part]), lam[part], values[part]


CROSSING: dict[tuple[str, str], Callable[..., Iterator[Curve]]] = {
    **{("time_constant", second): _with_lambda for second in OFF},
    ("gain", "delay"): _with_delay,
    ("gain", "lag"): _gain_and_lag,
    ("lag", "delay"): _with_delay,
}
"""What gives the curves, by the two axes in the order in which they are read."""


def _ends(loops: ChartLoops, axes: tuple[Axis, Axis]) -> Iterator[Curve]:
    """Lines on which p_B(0), or its leading coefficient, vanishes: p = k q, for each λ.

    At infinity the delayed terms together are as large as the one without dead time.
    """
    first, second = axes
    values = first.value(np.linspace(0, 1, 8 * PIXELS + 1))
    if first.name == "time_constant":
        values = values[values >= first.positive[0]]
    lambdas = values if first.name == "time_constant" else np.ones(1)
    whole = np.array([second.low, second.high])
    names, mismatch = {first.name, second.name}, loops.mismatch
    ahead, behind, delayed = mismatch.lowest(lambdas)
    ends: list[tuple[float, FloatArray, FloatArray]] = [(0.0, -(ahead + delayed), behind)]
    ahead, behind, delayed = mismatch.highest(lambdas, lagging="lag" in names)
    if loops.fixed["delay"] or "delay" in names:
        ahead, behind = -np.abs(ahead), np.abs(behind)
    ends.append((inf, -ahead - np.abs(delayed), behind))
    for at, p, q in ends:
        with np.errstate(all="ignore"):
            gain = p / q
        if second.name == "gain":
            for part in parts(np.isfinite(gain) & (gain > 0)):
                yield np.full(values[part].size, at), values[part], gain[part]
        elif first.name == "gain":
            if np.isfinite(gain[0]) and gain[0] > 0:
                yield np.full(2, at), np.full(2, gain[0]), whole
        elif first.name == "time_constant":
            off = p - q
            for i in np.flatnonzero((off[:-1] < 0) != (off[1:] < 0)):
                share = off[i] / (off[i] - off[i + 1])
                lam = values[i] + share * (values[i + 1] - values[i])
                yield np.full(2, at), np.full(2, lam), whole
