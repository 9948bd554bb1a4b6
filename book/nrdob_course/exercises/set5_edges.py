"""Set 5: edges of stabilising filters, most of them under dead time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from math import asin, inf, log, pi
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq, minimize_scalar

from nrdob.design import critical_time_constants, stabilizing_time_constants
from nrdob.diagram import LowPassFilter, delay
from nrdob.loop import NRDOB
from nrdob.plotting import Figure

from .cases import factored, observer_stable, s
from .comparing import near, rounds, same
from .drawing import apart, draw, few, first_fitting, fitting, kept
from .figures import draw_crossing
from .problems import Misconception, any_of, pose, reading
from .reading import UnreadableError, things
from .reading import number as one_number

__all__ = ["BORDER", "EDGE", "WAITING", "draw_edge"]

# --- 5.3 How fast may the filter be? ------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class FilterCase:
    """A plant, a model and the order of the filter.

    `process`: the plant; a dead time is `process.delay`, in seconds.
    """

    process: Any
    model: ct.TransferFunction
    order: int

    def __repr__(self) -> str:
        return f"plant {factored(self.process)}, model {factored(self.model)}, n = {self.order}"


@kept
def _stable(case: FilterCase, time_constant: float) -> bool | None:
    """Judge p_B with a filter."""
    return observer_stable(case.process, case.model, LowPassFilter(time_constant, case.order))


@kept
def borders_read(case: FilterCase) -> dict[str, float]:
    """Give the true border, and what one would take for it."""
    edges = critical_time_constants(case.process, case.model, case.order)
    late, rational = case.process.delay, case.process.tf
    by_order = {
        f"Padé {k}": stabilizing_time_constants(
            ct.tf(*ct.pade(late, k)) * rational, case.model, case.order
        )[-1][0]
        for k in (1, 2)
    }
    return {
        "true": edges[-1].time_constant,
        "first edge": edges[0].time_constant,
        "bandwidth": 1 / edges[-1].time_constant,
        "frequency": edges[-1].frequency,
        "2θ/π": 2 * late / pi,
        "small gain": _small_gain(case),
        **by_order,
    }


def _small_gain(case: FilterCase) -> float:
    """Find the fastest filter with ``|FH| < 1`` at all frequencies."""
    late = case.process.delay
    omega = np.geomspace(1e-3, 1e3, 4001) / late
    size = np.abs(NRDOB(case.process, case.model, 0, LowPassFilter(1.0, 3)).H(1j * omega))

    def excess(value: float) -> float:
        return float((size * np.abs(LowPassFilter(value, case.order)(1j * omega))).max() - 1)

    return float(brentq(excess, 1e-3 * late, 100 * late, xtol=1e-9))


def _tells_apart(case: FilterCase) -> bool:
    found = borders_read(case)
    rough = [value for name, value in found.items() if name not in ("Padé 2", "frequency")]
    sets = stabilizing_time_constants(case.process, case.model, case.order)
    return (
        len(sets) == 1
        and sets[0][1] == inf
        and apart(*rough, by=0.05)
        and apart(found["true"], found["Padé 2"], by=0.0025)
        and apart(found["true"], found["frequency"], by=0.5)
    )


@fitting(_tells_apart)
def _late_case(rng: np.random.Generator) -> FilterCase:
    """Draw a plant of two lags and a dead time, and a model whose poles are a little off."""
    poles = [draw(rng, 1, 6) for _ in range(2)]
    close = [few(pole * rng.uniform(0.75, 1.35)) for pole in poles]
    gain = few(rng.uniform(0.85, 1.2) * poles[0] * poles[1])
    return FilterCase(
        delay(draw(rng, 0.06, 0.4)) * (gain / ((s + poles[0]) * (s + poles[1]))),
        few(close[0] * close[1]) / ((s + close[0]) * (s + close[1])),
        int(rng.integers(2, 4)),
    )


def _border_lacks(case: FilterCase, value: float) -> str:
    if not 0 < value < inf:
        return "a time constant is a positive number"
    slower = (50.0, 5.0, 1.5, 1.001)
    if not all(_stable(case, k * value) for k in slower):
        return "there is a slower filter that does not stabilise the loop"
    if _stable(case, 0.999 * value) is not False:
        return "a slightly faster filter stabilises the loop, too"
    return ""


BORDER = pose(
    "5.3",
    alike=partial(same, rtol=1.2e-3),
    case=_late_case,
    reads=one_number,
    lacks=_border_lacks,
    rounded=lambda case, got: rounds(borders_read(case)["true"], got),
    misconceptions={
        "Padé trusted": any_of(
            lambda case: [borders_read(case)["Padé 1"], borders_read(case)["Padé 2"]]
        ),
        "the closed form of a pure dead time": reading(borders_read, "2θ/π"),
        "small gain taken for the border": reading(borders_read, "small gain"),
        "the first edge taken for the last": reading(borders_read, "first edge"),
        "a frequency given for the time constant": any_of(
            lambda case: [borders_read(case)["bandwidth"], borders_read(case)["frequency"]]
        ),
    },
)


# --- 5.4 Read an edge off a picture -------------------------------------------------------------


@kept
def edge_of(case: FilterCase) -> tuple[float, float]:
    """Give the time constant of the edge, and the frequency of the roots there."""
    ((value, omega, _),) = critical_time_constants(case.process, case.model, case.order)
    return value, omega


@kept
def side_of(case: FilterCase) -> str:
    """Tell whether the loop is stable "below" or "above" the edge."""
    return "below" if _stable(case, 0.9 * edge_of(case)[0]) else "above"


def _edge_case(rng: np.random.Generator) -> FilterCase:
    """Draw an unstable pole that the model mirrors, or an unstable zero that it leaves out."""
    unstable = bool(rng.random() < 0.5)

    def drawn() -> FilterCase:
        gain, lag, speed = (draw(rng, low, high) for low, high in ((1.3, 5), (2, 9), (0.6, 6)))
        size = draw(rng, 0.5, 4)
        stronger = 1.0 if unstable else rng.uniform(0.7, 1.4)
        model = size / ((s + few(speed * rng.uniform(0.6, 1.6))) * (s + lag))
        if unstable:
            return FilterCase(few(gain * size) / ((s - speed) * (s + lag)), model, 2)
        process = few(size * stronger) * (1 - s / few(2 * speed)) / ((s + speed) * (s + lag))
        return FilterCase(process, model, 2)

    return first_fitting(drawn, lambda case: _legible(case, unstable))


def _legible(case: FilterCase, unstable: bool) -> bool:
    """Whether there is one edge, in the picture, and every misreading leads elsewhere."""
    if len(critical_time_constants(case.process, case.model, case.order)) != 1:
        return False
    value, omega = edge_of(case)
    x = value * omega
    verdicts = [_stable(case, k * value) for k in (0.9, 1.1)]
    return (
        verdicts == [unstable, not unstable]
        and 0.5 < x < 2.2
        and 0.5 < omega < 30
        and apart(value, x, 1 / value, by=0.3)
        and apart(value, x, omega, by=0.3)
    )


def draw_edge(case: FilterCase) -> Figure:
    """Draw H, marked at round frequencies, and the curve of order 2, marked at round x.

    Parameters
    ----------
    case : FilterCase
        What is asked for.
    """
    return draw_crossing(NRDOB(case.process, case.model, 0, LowPassFilter(1.0, 2)), *edge_of(case))


Edge = tuple[float, str]


def _read_edge(given: Any) -> Edge:
    wanted = 'two things are asked for, the time constant and "below" or "above"'
    value, given_side = things(given, wanted)
    side = str(given_side).strip().lower()
    if side not in ("below", "above"):
        raise UnreadableError('the second entry must be "below" or "above"')
    return one_number(value), side


def _edge_lacks(case: FilterCase, got: Edge) -> str:
    value, side = got
    if not value > 0:
        return "a time constant is a positive number"
    low, high = (_stable(case, k * value) for k in (1 / NEAR_EDGE, NEAR_EDGE))
    if low is high:
        return (
            f"the verdict is the same on both sides of {value:.3g} s, so the edge is elsewhere. "
            "Where the two curves cross, read x off the one and the frequency off the other"
        )
    return "" if bool(low) is (side == "below") else "it is stable on the other side"


NEAR_EDGE = 1.12
"""How well an edge can be read off a picture."""


def _read_alike(expected: Edge, got: Edge) -> bool:
    """Compare the time constants."""
    return near(expected[0], got[0], log(NEAR_EDGE))


def _other_side(case: FilterCase) -> Edge:
    return edge_of(case)[0], "above" if side_of(case) == "below" else "below"


EDGE = pose(
    "5.4",
    alike=_read_alike,
    case=_edge_case,
    reads=_read_edge,
    lacks=_edge_lacks,
    own=True,
    misconceptions={
        "the wrong side": Misconception(
            _other_side,
            lambda case, got: (
                _read_alike(_other_side(case), got) and got[1] == _other_side(case)[1]
            ),
        ),
        "x taken for the time constant": lambda case: (
            edge_of(case)[0] * edge_of(case)[1],
            side_of(case),
        ),
        "a frequency taken for the time constant": any_of(
            lambda case: [(1 / edge_of(case)[0], side_of(case)), (edge_of(case)[1], side_of(case))]
        ),
    },
)


# --- 5.7 How well must the dead time be known? --------------------------------------------------


@dataclass(frozen=True, eq=False)
class DelayedCase:
    """A plant whose model has nearly the right dead time.

    `prompt`: What stands before the dead time, in the plant and in the model; `dead_time`: that of
    the model today, in seconds; `error`: by how much that of the plant may be another one, in
    seconds, up or down; `order`: order of the filter.
    """

    prompt: ct.TransferFunction
    dead_time: float
    error: float
    order: int

    def __repr__(self) -> str:
        late = delay(self.dead_time) * self.prompt
        return f"model {factored(late)}, dead time wrong by {self.error:g} s, n = {self.order}"


@cache
def _tolerated(order: int) -> float:
    """Error of the dead time, relative to λ, tolerated whatever the dead time: c_n.

    Roots reach the axis where Df = exp(-jωθm) - exp(-jωθ), of size 2 sin(ω|θ - θm|/2) at most.
    """
    last = (2 ** (2 / order) - 1) ** 0.5  # where |Df| = 2

    def error(x: float) -> float:
        return 2 * asin(min((1 + x * x) ** (order / 2) / 2, 1.0)) / x

    return float(minimize_scalar(error, bounds=(0, last), method="bounded").fun)


@kept
def _today(case: DelayedCase) -> float:
    """Find the fastest filter that tolerates the error with the dead time of today."""
    model = delay(case.dead_time) * case.prompt
    return max(
        critical_time_constants(
            delay(case.dead_time + off) * case.prompt, model, case.order, floor=0.1 * case.error
        )[-1].time_constant
        for off in (-case.error, case.error)
    )


@kept
def _unwaited(case: DelayedCase) -> float:
    """Find the fastest filter where the error is all the dead time and the model has none."""
    process = delay(case.error) * case.prompt
    return float(stabilizing_time_constants(process, case.prompt, case.order)[-1][0])


def _ramp_bound(case: DelayedCase) -> float:
    """Give λ with ``ω|error| |F| < 1``: the largest x/(1 + x²)^(n/2) is at x = 1/√(n - 1)."""
    n = case.order
    return float(case.error * (n - 1) ** ((n - 1) / 2) / n ** (n / 2))


WAITING_MISTAKES: dict[str, Callable[[DelayedCase], float]] = {
    "order forgotten": lambda case: case.error / _tolerated(1),
    "error taken for the whole dead time": _unwaited,
    "the dead time of today alone": _today,
    "sine taken for its angle": _ramp_bound,
    "upside down": lambda case: case.error * _tolerated(case.order),
}


def _differs(case: DelayedCase) -> bool:
    """Whether each mistake leads elsewhere; the one that seldom does is asked first."""
    right, each = case.error / _tolerated(case.order), WAITING_MISTAKES.values()
    return apart(right, _today(case), by=0.004) and apart(
        right, *(of(case) for of in each), by=0.004
    )


@fitting(_differs)
def _waiting_case(rng: np.random.Generator) -> DelayedCase:
    pole, other = draw(rng, 0.5, 4), draw(rng, 0.5, 4)
    prompt = few(rng.uniform(0.5, 4)) / ((s / pole + 1) * (s / other + 1))
    dead_time = draw(rng, 0.2, 1.5)
    error = few(dead_time * rng.uniform(0.08, 0.2))
    return DelayedCase(prompt, dead_time, error, int(rng.integers(2, 5)))


def _waiting_lacks(case: DelayedCase, got: float) -> str:
    if not 0 < got < inf:
        return "a time constant is a positive number"
    tolerated = _tolerated(case.order) * got
    if same(case.error, tolerated):
        return ""
    if tolerated > case.error:
        words = "it is stable, but a faster filter would be, too: this one tolerates"
        return f"{words} {tolerated:.4g} s"
    return (
        f"there are dead times with which it is not stable: this filter tolerates an error of "
        f"{tolerated:.4g} s, not of {case.error:g} s"
    )


WAITING = pose(
    "5.7",
    case=_waiting_case,
    reads=one_number,
    lacks=_waiting_lacks,
    rounded=lambda case, got: rounds(case.error / _tolerated(case.order), got),
    misconceptions=WAITING_MISTAKES,
)
