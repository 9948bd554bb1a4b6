r"""Stability charts: the borders of the stable region in two parameters, exactly.

The process may be multiplied by a gain k, may have another dead time θ and one more lag τ, and the
filter another time constant λ. Then

.. math:: p_B = (1 + \tau s)\, a\, E(\lambda) + k\, b\, N_f(\lambda)\, e^{-\theta s}

and roots cross the axis at :math:`s = j\omega` where
:math:`W = -(1 + j\tau\omega)\,a E/(b N_f)` equals :math:`k e^{-j\omega\theta}`. Of any two
parameters ω gives the values: :math:`|W| = k` and :math:`\theta = (2\pi m - \arg W)/\omega`, or k
where :math:`W e^{j\omega\theta}` is real, and so on; with λ, all of them on a curve in the plane of
ω and λ. A real root crosses at ω = 0 or at infinity. Between the borders the number of roots on the
right does not change (Neimark's D-partition); it is counted by the argument, at points of every
region.

.. rubric:: References

J. Neimark, D-subdivisions and spaces of quasipolynomials, Prikl. Mat. Mekh. 13 (1949) 349-380.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil, inf, isfinite, log, pi
from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from contourpy import contour_generator
from scipy.ndimage import distance_transform_edt, label

from ..diagram import (
    DelayedTransferFunction,
    FilterFamily,
    LowPassFilter,
    ObserverEquations,
    as_family,
)
from ..numerics import (
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    QuasiPolynomial,
    add,
    bisect,
    count_rhp,
)
from .familygrid import FamilyFrequencies
from .familymismatch import FamilyMismatch

__all__ = ["Axis", "Border", "Region", "StabilityChart", "stability_chart"]

if TYPE_CHECKING:
    from ..plotting import Figure

AXES = {
    "time_constant": "λ of the filter, in seconds",
    "gain": "factor of the process",
    "delay": "dead time of the process, in seconds",
    "lag": "time constant of one more lag of the process, in seconds",
}
"""What may be on an axis."""

PIXELS = 320
"""Regions narrower than this part of the chart may be left out."""

LOGARITHMIC = 20.0
"""Ratio of the ends of an axis from which it is logarithmic."""

PER_DECADE, LAMBDAS, PER_TURN = 48, 160, 24
"""Density of the frequencies, number of λ over an axis, frequencies to a turn of the dead time."""

MANY = 20_000
"""So many frequencies, or curves, are too many."""

STEPS, CLOSE = 5, 1e-9
"""Newton steps onto a border, and how well it must then be one."""

LARGEST = 300.0
"""Bound of the logarithm of a sensitivity, so that nothing overflows."""

MS_GRID = 44
"""Points to an axis at which Ms is computed."""


class Border(NamedTuple):
    """A curve on which roots are on the imaginary axis.

    Attributes
    ----------
    x, y : (N,) array of float
        Its points.
    omega : (N,) array of float
        Where the roots are, in rad/s: 0 or inf for a real root.
    """

    x: FloatArray
    y: FloatArray
    omega: FloatArray


@dataclass(frozen=True)
class Region:
    """A part of the chart in which the number of roots on the right is the same.

    Attributes
    ----------
    count : float
        Roots of p_B in the right half plane; infinite beyond a neutral border.
    x, y : float
        A point well inside.
    share : float
        Part of the chart that it covers, on its axes.
    """

    count: float
    x: float
    y: float
    share: float


class Axis(NamedTuple):
    """A parameter and its range."""

    name: str
    low: float
    high: float

    @property
    def logarithmic(self) -> bool:
        """Whether the ends are decades apart."""
        return self.low > 0 and self.high >= LOGARITHMIC * self.low

    def share(self, values: Any) -> FloatArray:
        """Position of values between the ends, 0 to 1 within."""
        values = np.asarray(values, dtype=float)
        if self.logarithmic:
            values = np.maximum(values, self.low / LOGARITHMIC)
            return np.asarray(np.log(values / self.low) / log(self.high / self.low))
        return np.asarray((values - self.low) / (self.high - self.low))

    def value(self, share: Any) -> FloatArray:
        """Values at positions."""
        share = np.asarray(share, dtype=float)
        if self.logarithmic:
            return np.asarray(self.low * (self.high / self.low) ** share)
        return np.asarray(self.low + share * (self.high - self.low))


@dataclass(frozen=True, eq=False, repr=False)
class StabilityChart:
    """Where an observer loop is stable, in two parameters.

    Attributes
    ----------
    x, y : Axis
        The parameters.
    borders : tuple of Border
        All curves on which the number of unstable roots may change.
    regions : tuple of Region
        What they leave, the largest first.
    ms_levels : dict
        For each level of Ms asked for, its lines within the stable regions, each (N, 2).
    labels : array of int
        Which region each cell of a raster belongs to, from 1 on; 0 on a border.
    count_at : callable
        What `count` asks.
    """

    x: Axis
    y: Axis
    borders: tuple[Border, ...]
    regions: tuple[Region, ...]
    ms_levels: dict[float, list[FloatArray]]
    labels: IntArray
    count_at: Callable[[float, float], float]

    def count(self, x: float, y: float) -> float:
        """Count the roots of p_B in the right half plane at one point, by the argument.

        Parameters
        ----------
        x, y : float
            Values of the two parameters.

        Raises
        ------
        ValueError
            If the parameters have no meaning.
        ArithmeticError
            On a border, where there are roots on the axis.
        """
        for axis, value in ((self.x, x), (self.y, y)):
            _check_value(axis.name, value)
        return self.count_at(float(x), float(y))

    def region(self, x: float, y: float) -> Region | None:
        """Return the region that holds a point; None on a border, or outside the chart.

        Parameters
        ----------
        x, y : float
            Values of the two parameters.
        """
        column, row = (
            int(np.floor(float(axis.share(value)) * PIXELS))
            for axis, value in ((self.x, x), (self.y, y))
        )
        if not (0 <= column < PIXELS and 0 <= row < PIXELS):
            return None
        found = int(self.labels[row, column])
        return self.regions[found - 1] if found else None

    def plot(self, *, title: str = "", ax: Any = None) -> Figure:
        """Draw borders, regions and levels: see `nrdob.plotting.chart_plot`.

        Parameters
        ----------
        title : str
            Written above the chart.
        ax : matplotlib axes, optional
            Where to draw.
        """
        from ..plotting import chart_plot

        return chart_plot(self, title=title, ax=ax)

    def __repr__(self) -> str:
        stable = sum(region.share for region in self.regions if region.count == 0)
        return (
            f"<stability chart in {self.x.name} and {self.y.name}: {len(self.regions)} regions, "
            f"{100 * stable:.3g} % of it stable>"
        )


def stability_chart(
    process: Any,
    model: Any,
    filter: Any,
    *,
    x: tuple[str, float, float],
    y: tuple[str, float, float],
    ms: tuple[float, ...] = (),
) -> StabilityChart:
    """Chart the stability of the observer loop in two parameters.

    Parameters
    ----------
    process, model : as for `nrdob.NRDOB`
        G, with or without dead time, and G̃.
    filter : as for `nrdob.NRDOB`, or FilterFamily, or int
        F; where its time constant is on an axis, a family, an order, or a LowPassFilter, whose
        order is taken.
    x, y : (name, low, high)
        Two of "time_constant" (λ of the filter, s), "gain" (a factor of the process), "delay" (its
        dead time, s, whatever it has) and "lag" (the time constant of one more lag, s).
    ms : tuple of float
        Levels of the peak of the sensitivity to be drawn.

    Returns
    -------
    StabilityChart
        Borders, regions with their counts, and levels of Ms; it can be drawn.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put, an axis is none, or the frequencies that a dead
        time asks for are too many.
    ArithmeticError
        If two counts within one region differ.
    NotImplementedError
        For gain and lag together with a dead time, whose borders can lie too close.

    Examples
    --------
    A dead time that the model leaves out: stable for λ > 2θ/π.

    >>> import control as ct
    >>> from nrdob import delay
    >>> lag = ct.tf([1], [1, 1])
    >>> chart = stability_chart(lag, lag, 1, x=("delay", 0.1, 1.0), y=("time_constant", 0.1, 1.0))
    >>> chart.count(0.5, 2 * 0.5 / 3.1), chart.count(0.5, 2 * 0.5 / 3.2)
    (0, 2)
    """
    axes = _axis("x", x), _axis("y", y)
    if axes[0].name == axes[1].name:
        raise ValueError(f"both axes are {axes[0].name}: choose two different parameters")
    for level in ms:
        if isinstance(level, bool) or not isinstance(level, Real) or not 1 < level < inf:
            raise ValueError(
                f"ms has the level {level!r}; give numbers above 1, such as (1.5, 2.0)"
            )
    loops = _Loops.of(process, model, filter, {axis.name for axis in axes})
    borders = tuple(_borders(loops, *axes))

    def count_at(x: float, y: float) -> float:
        return loops.count({axes[0].name: x, axes[1].name: y})

    labels = _labelled(axes, borders)
    regions, labels = _regions(axes, labels, count_at)
    lines = _ms_levels(loops, axes, labels, regions, ms) if ms else {}
    return StabilityChart(*axes, borders, regions, lines, labels, count_at)


def _axis(which: str, given: Any) -> Axis:
    if not (isinstance(given, tuple | list) and len(given) == 3):
        raise TypeError(f'{which} is {given!r}; give (name, low, high), as ("delay", 0.0, 1.0)')
    name, low, high = given
    if name not in AXES:
        known = ", ".join(f'"{each}" ({what})' for each, what in AXES.items())
        raise ValueError(f"{which} is {name!r}; it must be one of {known}")
    for end in (low, high):
        if isinstance(end, bool) or not isinstance(end, Real):
            raise TypeError(f"{which} reaches from {low!r} to {high!r}; give two real numbers")
    if not (isfinite(low) and isfinite(high) and 0 <= low < high):
        raise ValueError(
            f"{which} reaches from {low} to {high}; give two increasing numbers, 0 or above"
        )
    return Axis(name, float(low), float(high))


def _check_value(name: str, value: Any) -> None:
    positive = name not in ("delay", "lag")
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} is {value!r}; give a real number")
    number = float(value)
    if not (isfinite(number) and (number > 0 if positive else number >= 0)):
        raise ValueError(
            f"{name} is {value}; it must be {'positive' if positive else '0 or above'}"
        )


@dataclass(frozen=True, eq=False)
class _Loops:
    """All loops of a chart.

    Attributes
    ----------
    mismatch : FamilyMismatch
        The undelayed process over the model, and the filters.
    fixed : dict
        The parameters, as they are where they are on no axis.
    """

    mismatch: FamilyMismatch
    fixed: dict[str, float]

    @classmethod
    def of(cls, process: Any, model: Any, filter: Any, free: set[str]) -> _Loops:
        """Read the blocks."""
        delayed = isinstance(process, DelayedTransferFunction)
        undelayed = process.tf if delayed else process
        fixed = {"gain": 1.0, "delay": process.delay if delayed else 0.0, "lag": 0.0}
        if free == {"gain", "lag"} and fixed["delay"]:
            raise NotImplementedError(
                f"a chart of gain and lag with a dead time of {fixed['delay']:g} s: its borders "
                "can come closer than the chart can part them; put the time constant or the dead "
                "time on one axis, or ask nrdob.judge_observer at single points"
            )
        if "time_constant" in free:
            family = _family(filter)
            return cls(FamilyMismatch.for_family(undelayed, model, family), fixed)
        if isinstance(filter, FilterFamily | int):
            raise TypeError(
                "filter is a whole family, but time_constant is on no axis: give one filter, such "
                "as family.at(time_constant)"
            )
        fixed["time_constant"] = 1.0
        loop = ObserverEquations(undelayed, model, filter)
        if loop.model_delay:
            raise ValueError(
                f"model has a dead time of {loop.model_delay:g} s; a chart needs a model without: "
                "leave its dead time out, or ask stabilizing_time_constants, which takes both"
            )
        G, built = loop.fractions.G, loop.built
        a, b = np.convolve(G.den, built.Nm.q), np.convolve(G.num, built.Dm.q)
        factors = (G.num, G.den, built.Nm.q, built.Dm.q)
        E, Nf = built.E.q[None, :], built.Nf.q[None, :]
        order = int(loop.fractions.F.den.size - 1)
        return cls(FamilyMismatch(a, b, 0.0, order, factors, E=E, Nf=Nf), fixed)

    def count(self, given: dict[str, float]) -> float:
        """Count the roots on the right; an error where there are roots on the axis."""
        p = self.p_B(given)
        found = count_rhp(p)
        if found.count is None or p.zeros_at_origin:
            raise ArithmeticError(
                f"the loop is on the border of stability at {given}: {found.reason or 's = 0'}"
            )
        return found.count if found.count == inf else int(found.count)

    def p_B(self, given: dict[str, float]) -> QuasiPolynomial:
        """Characteristic function with given parameters."""
        values = self.fixed | given
        (ahead, behind), sizes = self.mismatch.built(values["time_constant"])
        lag = np.array([values["lag"], 1.0]) if values["lag"] else np.ones(1)
        k = values["gain"]
        scale = add(np.convolve(lag, sizes[0]), k * sizes[1])
        return QuasiPolynomial(np.convolve(lag, ahead), k * behind, values["delay"], scale)

    def peaks(self, given: dict[str, Any], omega: FloatArray) -> FloatArray:
        """Peak of the sensitivity of each stable loop, one a row."""
        values = self.fixed | given
        ahead, behind = self.mismatch.parts(omega, values["time_constant"])
        ahead = ahead * (1 + 1j * values["lag"] * omega)
        behind = behind * values["gain"] * np.exp(-1j * values["delay"] * omega)
        with np.errstate(all="ignore"):
            size = np.log(np.abs(ahead / (ahead + behind)))
        size = np.nan_to_num(size, nan=-LARGEST, neginf=-LARGEST, posinf=LARGEST)
        top = np.clip(size.argmax(axis=1), 1, omega.size - 2)
        before, at, after = (size[np.arange(top.size), top + k] for k in (-1, 0, 1))
        curvature = np.minimum(before - 2 * at + after, -1e-300)
        risen = at - (after - before) ** 2 / (8 * curvature)
        return np.asarray(np.exp(np.where((at >= before) & (at >= after), risen, size.max(axis=1))))

    def end_gains(self, lambdas: FloatArray) -> Iterator[tuple[float, FloatArray]]:
        """Gains with which p_B(0), and the leading coefficient of p_B, vanish, for each λ."""
        mismatch = self.mismatch
        columns = [np.polyval(table[::-1], lambdas[:, None]) for table in (mismatch.E, mismatch.Nf)]
        E, Nf = columns
        with np.errstate(all="ignore"):
            yield 0.0, -mismatch.a[-1] * E[:, -1] / (mismatch.b[-1] * Nf[:, -1])
            used = [int(np.flatnonzero(table.any(axis=0))[0]) for table in columns]
            degrees = [
                factor.size + table.shape[1] - first
                for factor, table, first in zip(
                    (mismatch.a, mismatch.b), columns, used, strict=True
                )
            ]
            if degrees[0] == degrees[1]:
                yield inf, -mismatch.a[0] * E[:, used[0]] / (mismatch.b[0] * Nf[:, used[1]])

    def frequencies(self, axes: tuple[Axis, Axis]) -> FloatArray:
        """Frequencies over all that there is to see, fine enough for a dead time that is fixed."""
        base = FamilyFrequencies(self.mismatch).base
        highs = [axis.high for axis in axes if axis.name != "gain"]
        lows = [max(axis.low, axis.high / 100) for axis in axes if axis.name != "gain"]
        sizes = np.concatenate([self.mismatch.speeds, 1 / np.array(highs), 1 / np.array(lows)])
        low, high = sizes.min() / 1e4, sizes.max() * 1e4
        count = int(PER_DECADE * np.log10(high / low))
        omega = np.union1d(base[(base > low) & (base < high)], np.geomspace(low, high, count))
        names = {axis.name for axis in axes}
        if "delay" in names or not self.fixed["delay"]:
            return omega[~self.mismatch.at_pole(omega)]
        last = self._last(omega, axes)
        step = 2 * pi / (self.fixed["delay"] * PER_TURN)
        if last > MANY * step or last == omega[-1]:
            raise ValueError(
                f"the dead time of {self.fixed['delay']:g} s would have to be followed up to "
                f"{last:.3g} rad/s: let the axes begin farther from 0"
            )
        omega = np.union1d(omega[omega <= last], np.arange(step, last, step))
        return omega[~self.mismatch.at_pole(omega)]

    def _last(self, omega: FloatArray, axes: tuple[Axis, Axis]) -> float:
        """Last frequency at which |W| may be as small as the gain."""
        lambdas = np.ones(1)
        most = 1.0
        for axis in axes:
            if axis.name == "time_constant":
                lambdas = np.geomspace(*_positive(axis), 40)
            if axis.name == "gain":
                most = axis.high
        ahead, behind = self.mismatch.parts(omega[:, None], lambdas)
        with np.errstate(all="ignore"):
            least = np.nanmin(np.abs(ahead / behind), axis=1)
        possible = np.flatnonzero(least <= 1.1 * most)
        return float(omega[min(possible[-1] + 1, omega.size - 1)]) if possible.size else 0.0


def _family(filter: Any) -> FilterFamily:
    if isinstance(filter, LowPassFilter):
        return as_family(filter.order)
    if isinstance(filter, FilterFamily) or not hasattr(filter, "num"):
        return as_family(filter)
    raise TypeError(
        "time_constant is on an axis, but filter is a single one: give an order, or a family from "
        "nrdob.filter_family"
    )


def _positive(axis: Axis) -> tuple[float, float]:
    """Widen the ends of an axis of a parameter that must be positive a little."""
    return max(axis.low / 1.1, axis.high / (10 * PIXELS)), 1.1 * axis.high


# The borders.


def _borders(loops: _Loops, x: Axis, y: Axis) -> Iterator[Border]:
    for flipped, axes in ((False, (x, y)), (True, (y, x))):
        names = axes[0].name, axes[1].name
        if names in PAIRS:
            for omega, first, second in _crossing_curves(loops, axes):
                points = (second, first) if flipped else (first, second)
                yield from _within(x, y, Border(*points, omega))
            for first, second, at in _end_curves(loops, axes):
                points = (second, first) if flipped else (first, second)
                yield from _within(x, y, Border(*points, np.full(first.size, at)))
            return


def _within(x: Axis, y: Axis, border: Border) -> Iterator[Border]:
    """Cut a curve into the parts that may be seen."""
    u, v = x.share(border.x), y.share(border.y)
    with np.errstate(invalid="ignore"):
        good = np.isfinite(u) & np.isfinite(v)
        seen = good & (u > -0.05) & (u < 1.05) & (v > -0.05) & (v < 1.05)
    near = seen.copy()
    near[1:] |= seen[:-1]
    near[:-1] |= seen[1:]
    near &= good
    edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        if after - first > 1:
            part = slice(first, after)
            yield Border(border.x[part], border.y[part], border.omega[part])


Curve = tuple[FloatArray, FloatArray, FloatArray]


def _crossing_curves(loops: _Loops, axes: tuple[Axis, Axis]) -> Iterator[Curve]:
    """Curves (ω, first, second) on which a pair of roots is on the axis."""
    first, second = axes
    omega = loops.frequencies(axes)
    if first.name != "time_constant":
        yield from _explicit(loops, axes, omega)
        return
    function = _IMPLICIT[second.name]
    for w, lam in _level_set(loops, function, omega, first):
        W = _W(loops, w, lam)
        if second.name == "delay":
            yield from ((w, lam, theta) for theta in _delays(second, w, W))
        elif second.name == "gain":
            gain = (W * np.exp(1j * w * loops.fixed["delay"])).real
            yield from _where(gain > 0, w, lam, gain)
        else:
            yield from _where(np.ones(w.size, dtype=bool), w, lam, _lag(loops, w, W))


def _W(loops: _Loops, omega: FloatArray, lam: Any) -> ComplexArray:
    ahead, behind = loops.mismatch.parts(omega, lam)
    with np.errstate(all="ignore"):
        return np.asarray(-ahead * (1 + 1j * loops.fixed["lag"] * omega) / behind)


def _lag(loops: _Loops, omega: FloatArray, W: ComplexArray) -> FloatArray:
    """τ for which (1 + jτω) W = k exp(-jωθ)."""
    with np.errstate(all="ignore"):
        return np.asarray((np.exp(-1j * omega * loops.fixed["delay"]) / W).imag / omega)


def _explicit(loops: _Loops, axes: tuple[Axis, Axis], omega: FloatArray) -> Iterator[Curve]:
    first, second = axes
    fixed = loops.fixed
    W = _W(loops, omega, np.ones(1))
    if (first.name, second.name) == ("gain", "delay"):
        yield from _turned(axes, omega, np.abs(W), W)
    elif (first.name, second.name) == ("gain", "lag"):
        omega = _closer(
            lambda w: (_W(loops, w, np.ones(1)) * np.exp(1j * w * fixed["delay"])).real, omega
        )
        V = _W(loops, omega, np.ones(1)) * np.exp(1j * omega * fixed["delay"])
        with np.errstate(all="ignore"):
            lag, gain = -V.imag / (omega * V.real), np.abs(V) ** 2 / V.real
        yield from _where(V.real > 0, omega, gain, lag)
    else:
        with np.errstate(all="ignore"):
            square = (fixed["gain"] / np.abs(W)) ** 2 - 1
        lag = np.sign(square) * np.sqrt(np.abs(square)) / omega
        yield from _turned(axes, omega, lag, W * (1 + 1j * np.maximum(lag, 0.0) * omega))


def _closer(function: Callable[[FloatArray], FloatArray], omega: FloatArray) -> FloatArray:
    """Add frequencies on both sides of each change of sign, where a curve runs off to infinity."""
    values = function(omega)
    k = np.flatnonzero((values[:-1] > 0) != (values[1:] > 0))
    at = bisect(function, omega[k], omega[k + 1])
    share = np.geomspace(1e-9, 1, 28)
    added = [at[:, None] + (omega[end] - at)[:, None] * share for end in (k, k + 1)]
    return np.unique(np.concatenate([omega, *(each.ravel() for each in added)]))


def _turned(
    axes: tuple[Axis, Axis], omega: FloatArray, values: FloatArray, W: ComplexArray
) -> Iterator[Curve]:
    """Curves with a dead time on the second axis, where the first is within the chart."""
    first, second = axes
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(W) & (values <= first.high) & (values >= first.low)
    near = seen.copy()
    near[1:] |= seen[:-1]
    near[:-1] |= seen[1:]
    for w, x, at in _where(near, omega, values, np.arange(omega.size, dtype=float)):
        for theta in _delays(second, w, W[at.astype(int)]):
            yield w, x, theta


def _where(good: BoolArray, *curve: FloatArray) -> Iterator[Curve]:
    """Break a curve where it has no points."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        omega, x, y = (values[first:after] for values in curve)
        yield omega, x, y


def _delays(axis: Axis, omega: FloatArray, W: ComplexArray) -> Iterator[FloatArray]:
    """Dead times that turn 1 to the angle of W, one turn after the other."""
    good = np.isfinite(W) & (W != 0)
    angle = np.full(omega.size, np.nan)
    angle[good] = np.unwrap(-np.angle(W[good]))
    turns = (axis.value(np.array([0.0, 1.0]))[:, None] * omega - angle) / (2 * pi)
    first, last = ceil(np.nanmin(turns)) - 1, int(np.nanmax(turns)) + 1
    if last - first > MANY:
        raise ValueError(
            f"the dead time makes {last - first} turns within the chart: let the axes begin "
            "farther from 0, or end earlier"
        )
    for m in range(first, last + 1):
        if np.any((turns[0] <= m) & (m <= turns[1])):
            yield (angle + 2 * pi * m) / omega


# With λ on an axis: where a function of ω and λ vanishes.


def _size_off(loops: _Loops, omega: FloatArray, lam: FloatArray) -> FloatArray:
    """For θ on the other axis: ln|W/k|."""
    with np.errstate(all="ignore"):
        return np.log(np.abs(_W(loops, omega, lam)) / loops.fixed["gain"])


def _angle_off(loops: _Loops, omega: FloatArray, lam: FloatArray) -> FloatArray:
    """For k on the other axis: sine of the angle of W exp(jωθ)."""
    V = _W(loops, omega, lam) * np.exp(1j * omega * loops.fixed["delay"])
    with np.errstate(all="ignore"):
        return np.asarray(V.imag / np.abs(V))


def _real_part_off(loops: _Loops, omega: FloatArray, lam: FloatArray) -> FloatArray:
    """For τ on the other axis: the real part of k exp(-jωθ)/W, less 1."""
    with np.errstate(all="ignore"):
        U = np.exp(-1j * omega * loops.fixed["delay"]) / _W(loops, omega, lam)
        return np.asarray((U.real - 1) / (1 + np.abs(U)))


_IMPLICIT = {"delay": _size_off, "gain": _angle_off, "lag": _real_part_off}

PAIRS = {
    ("time_constant", "delay"), ("time_constant", "gain"), ("time_constant", "lag"),
    ("gain", "delay"), ("gain", "lag"), ("lag", "delay"),
}  # fmt: skip
"""Which of two axes comes first."""


def _level_set(
    loops: _Loops,
    function: Callable[[_Loops, FloatArray, FloatArray], FloatArray],
    omega: FloatArray,
    axis: Axis,
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Follow the curves on which a function of ω and λ vanishes, on a grid and then exactly."""
    lambdas = axis.value(np.linspace(0, 1, LAMBDAS))
    low, high = _positive(axis)
    lambdas = np.concatenate([[low], lambdas[lambdas > low], [high]])
    u, v = np.log(omega), np.log(lambdas)
    values = np.ma.masked_invalid(function(loops, omega[None, :], lambdas[:, None]))
    for line in contour_generator(u, v, values).lines(0.0):
        point = np.asarray(line, dtype=float).T
        for _ in range(STEPS):
            point = point + _newton(loops, function, point)
        w, lam = np.exp(point)
        with np.errstate(invalid="ignore"):
            good = np.abs(function(loops, w, lam)) <= CLOSE
        for w_part, lam_part, _ in _where(good, w, lam, lam):
            if w_part.size > 1:
                yield w_part, lam_part


def _newton(
    loops: _Loops,
    function: Callable[[_Loops, FloatArray, FloatArray], FloatArray],
    point: FloatArray,
) -> FloatArray:
    """Step to where the linearised function vanishes, at right angles to the curve."""
    step = 1e-6

    def at(du: float, dv: float) -> FloatArray:
        return function(loops, np.exp(point[0] + du), np.exp(point[1] + dv))

    slope = np.array([at(step, 0) - at(-step, 0), at(0, step) - at(0, -step)]) / (2 * step)
    with np.errstate(all="ignore"):
        move = -at(0, 0) * slope / (slope**2).sum(axis=0)
    size = np.hypot(*move)
    with np.errstate(all="ignore"):
        shorter = np.minimum(1.0, 0.1 / size)
    return np.asarray(np.nan_to_num(move * shorter))


# Where a real root crosses.


def _end_curves(
    loops: _Loops, axes: tuple[Axis, Axis]
) -> Iterator[tuple[FloatArray, FloatArray, float]]:
    """Lines on which p_B(0), or its leading coefficient, vanishes."""
    first, second = axes
    values = first.value(np.linspace(0, 1, 8 * PIXELS + 1))
    if first.name == "time_constant":
        values = values[values >= _positive(first)[0]]
    lambdas = values if first.name == "time_constant" else np.ones(1)
    whole = np.array([second.low, second.high])
    for at, ratios in loops.end_gains(lambdas):
        # k = ratio(λ) for a real root at 0; at infinity only while nothing else is behind.
        lagging = loops.fixed["lag"] or "lag" in (first.name, second.name)
        turning = loops.fixed["delay"] or "delay" in (first.name, second.name)
        if at == inf and lagging:
            continue
        signs = (1.0, -1.0) if at == inf and turning else (1.0,)
        for sign in signs:
            gain = sign * ratios
            if second.name == "gain":
                good = np.isfinite(gain) & (gain > 0)
                for _, lam, k in _where(good, values, values, gain):
                    yield lam, k, at
            elif first.name == "gain":
                if gain.size and gain[0] > 0:
                    yield np.full(2, gain[0]), whole, at
            elif first.name == "time_constant":
                off = gain - loops.fixed["gain"]
                crossed = np.flatnonzero((off[:-1] < 0) != (off[1:] < 0))
                for i in crossed[np.isfinite(off[crossed]) & np.isfinite(off[crossed + 1])]:
                    share = off[i] / (off[i] - off[i + 1])
                    lam = values[i] + share * (values[i + 1] - values[i])
                    yield np.full(2, lam), whole, at


# The regions.


def _labelled(axes: tuple[Axis, Axis], borders: tuple[Border, ...]) -> IntArray:
    """Give a number to the parts that the borders leave, on a raster; 0 on a border."""
    drawn = np.zeros((PIXELS, PIXELS), dtype=bool)
    for border in borders:
        u, v = axes[0].share(border.x) * PIXELS, axes[1].share(border.y) * PIXELS
        steps = np.maximum(np.abs(np.diff(u)), np.abs(np.diff(v)))
        count = np.minimum(np.ceil(3 * steps).astype(int), 40 * PIXELS) + 1
        begin = np.repeat(np.arange(count.size), count)
        share = (np.arange(begin.size) - np.repeat(np.cumsum(count) - count, count)) / count[begin]
        columns, rows = (
            np.floor(values[begin] + share * (values[begin + 1] - values[begin])).astype(int)
            for values in (u, v)
        )
        inside = (columns >= 0) & (columns < PIXELS) & (rows >= 0) & (rows < PIXELS)
        drawn[rows[inside], columns[inside]] = True
    found: IntArray = label(~drawn)[0]
    return found


def _regions(
    axes: tuple[Axis, Axis], labels: IntArray, count_at: Callable[[float, float], float]
) -> tuple[tuple[Region, ...], IntArray]:
    """Count in every part, at two points of the larger ones."""
    depth = distance_transform_edt(np.pad(labels > 0, 1))[1:-1, 1:-1]
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    order = [int(k) for k in np.argsort(-sizes) if sizes[k] >= SMALLEST]
    regions, numbers = [], np.zeros(sizes.size, dtype=labels.dtype)
    for k in order:
        rows, columns = np.nonzero(labels == k)
        deep = depth[rows, columns]
        points = [int(deep.argmax())]
        if sizes[k] > 40 * SMALLEST:
            far = np.abs(rows - rows[points[0]]) + np.abs(columns - columns[points[0]])
            points.append(int(np.where(deep >= 2, far, -1).argmax()))
        places = [
            (float(axes[0].value((columns[i] + 0.5) / PIXELS)),
             float(axes[1].value((rows[i] + 0.5) / PIXELS)))
            for i in points
        ]  # fmt: skip
        counts = {count_at(*place) for place in places}
        if len(counts) > 1:
            raise ArithmeticError(
                f"within one region of the chart, {counts} roots are counted, at {places}: a "
                "border is too fine for it; let the axes be shorter"
            )
        regions.append(Region(counts.pop(), *places[0], float(sizes[k]) / PIXELS**2))
        numbers[k] = len(regions)
    return tuple(regions), numbers[labels]


SMALLEST = 4
"""Pixels of the smallest region that is counted."""


def _ms_levels(
    loops: _Loops,
    axes: tuple[Axis, Axis],
    labels: IntArray,
    regions: tuple[Region, ...],
    levels: tuple[float, ...],
) -> dict[float, list[FloatArray]]:
    """Lines of equal Ms in the stable regions."""
    places = (np.arange(MS_GRID) + 0.5) / MS_GRID
    x, y = axes[0].value(places), axes[1].value(places)
    counts = np.array([np.nan, *(region.count for region in regions)])
    pixel = np.floor(places * PIXELS).astype(int)
    stable = counts[labels[np.ix_(pixel, pixel)]] == 0
    omega = loops.frequencies(axes)
    found = np.full((MS_GRID, MS_GRID), np.nan)
    for row in range(MS_GRID):
        columns = np.flatnonzero(stable[row])
        if columns.size:
            given = {axes[0].name: x[columns, None], axes[1].name: y[row]}
            found[row, columns] = loops.peaks(given, omega)
    generator = contour_generator(x, y, np.ma.masked_invalid(found))
    return {float(level): [np.asarray(p) for p in generator.lines(level)] for level in levels}
