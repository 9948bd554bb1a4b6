"""Set 5: unstable and delayed plants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import asin, inf, log, pi
from typing import Any, NamedTuple

import control as ct
import numpy as np
from scipy.optimize import brentq, minimize_scalar

from nrdob.design import (
    critical_time_constants,
    right_half_plane_parity,
    stabilizing_time_constants,
)
from nrdob.diagram import DelayedTransferFunction, LowPassFilter, as_fraction, delay
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray, FloatArray, number, written
from nrdob.plotting import COLOURS, INK, TALL, Figure, axes_for, styled

from .cases import (
    UnstablePlant,
    apart,
    draw,
    either_sign,
    factored,
    few,
    first_fitting,
    kept,
    mirrored,
    not_around,
    observer_stable,
    on_the_right,
    s,
)
from .problems import (
    Lack,
    Misconception,
    Problem,
    answers_like,
    answers_like_any,
    lacking,
    near,
    rounds,
    same,
)
from .reading import UnreadableError, block, numbers, things, whole
from .reading import number as one_number

__all__ = ["ADVICE", "BORDER", "DESIGN", "EDGE", "PROBLEMS", "SIGN", "WAITING", "draw_edge"]

# --- 5.1 Which sign? ----------------------------------------------------------------------------


class Pair(NamedTuple):
    """A plant, and a stable model whose sign is still open."""

    process: ct.TransferFunction
    model: ct.TransferFunction

    def __str__(self) -> str:
        return f"plant {factored(self.process)}, model {factored(self.model)}"


@dataclass(frozen=True, eq=False)
class SignCase:
    """Five pairs.

    Attributes
    ----------
    pairs : tuple of Pair
        Each has a `process` and a `model`, both transfer functions; the model is stable and has a
        positive DC gain.
    """

    pairs: tuple[Pair, ...]

    def __repr__(self) -> str:
        return f"the five pairs of which the first is {self.pairs[0]}"


def _sign_case(rng: np.random.Generator) -> SignCase:
    """Draw five pairs, not all of whose plants have a positive DC gain."""
    return first_fitting(
        lambda: _draw_pairs(rng),
        lambda case: any(np.real(pair.process(0)) < 0 for pair in case.pairs),
    )


def _draw_pairs(rng: np.random.Generator) -> SignCase:
    def root() -> float:
        return draw(rng, 0.3, 5)

    def pair_of_poles() -> ct.TransferFunction:
        omega = draw(rng, 0.5, 3)
        return s**2 - few(rng.uniform(0.1, 0.9) * omega) * s + few(omega**2)

    def model(zero: bool) -> ct.TransferFunction:
        first, second = root(), root()
        over = root() - s if zero else 1
        return few(rng.uniform(0.5, 2)) * over / ((s + first) * (s + second))

    def plant(over: Any, under: Any) -> ct.TransferFunction:
        return either_sign(rng) * few(rng.uniform(0.5, 4)) * over / under

    zero = root()
    beside = first_fitting(root, lambda pole: apart(pole, zero, by=0.2))

    pairs = [
        Pair(plant(1, (s - root()) * (s + root())), model(False)),
        Pair(plant(1, pair_of_poles()), model(False)),
        Pair(plant(s - root(), (s + root()) * (s + root())), model(False)),
        Pair(plant(s - zero, (s - beside) * (s + root())), model(False)),
        Pair(plant(1, (s - root()) * (s + root())), model(True)),
    ]
    return SignCase(tuple(pairs[k] for k in rng.permutation(len(pairs))))


def _signs(case: SignCase, rule: Callable[[Pair], float]) -> list[int]:
    return [int(np.sign(rule(pair))) for pair in case.pairs]


def _dc(pair: Pair) -> float:
    return float(np.real(pair.process(0) / pair.model(0)))


def _same_dc_sign(pair: Pair) -> float:
    return _dc(pair)


def _opposite_if_unstable(pair: Pair) -> float:
    return -_dc(pair) if on_the_right(pair.process.poles()) else _dc(pair)


def _relative_to_the_plant(pair: Pair) -> float:
    return (-1.0) ** on_the_right(pair.process.poles(), pair.model.zeros())


def _zeros_of_the_model_forgotten(pair: Pair) -> float:
    return _dc(pair) * (-1.0) ** on_the_right(pair.process.poles())


def _high_frequency_sign(pair: Pair) -> float:
    (a, b), (c, d) = ((tf.num[0][0][0], tf.den[0][0][0]) for tf in pair)
    return float(a / b * c / d)


def _odd(pair: Pair, sign: float) -> bool:
    """Whether p_B has an odd number of roots on the right: by the rule, or counted for a filter."""
    loop = NRDOB(pair.process, sign * pair.model, 0, LowPassFilter(0.1, 2))
    counted = loop.stability().observer_loop.closed_loop_rhp
    return not right_half_plane_parity(loop.process, loop.model).holds or bool((counted or 0) % 2)


def _sign_lacks(case: SignCase, signs: FloatArray) -> str:
    if not np.all(np.abs(signs) == 1):
        return "give five numbers, each +1 or -1, in the order of the pairs"
    for k, (pair, sign) in enumerate(zip(case.pairs, signs, strict=True), start=1):
        if _odd(pair, float(sign)):
            return f"with your sign, p_B of pair {k} has an odd number of roots on the right"
    return ""


SIGN = Problem(
    id="5.1",
    title="Which sign?",
    case=_sign_case,
    reads=partial(numbers, names="first, second, third, fourth, fifth"),
    lacks=_sign_lacks,
    praise=(
        "Right, every one: the signs at DC agree if the poles of the plant and the zeros of the "
        "model on the right are even in number, and differ if they are odd. It is necessary, and "
        "costs a minute."
    ),
    misconceptions=(
        answers_like(
            "the DC sign of the plant, always",
            "You give every model the DC sign of its plant. That is right while no pole of H is on "
            "the right. One unstable pole turns the sign of the plant on its way from DC to high "
            "frequency, and the model must have turned with it: count the poles of H.",
            lambda case: _signs(case, _same_dc_sign),
            marks=0.25,
        ),
        answers_like(
            "the opposite sign for every unstable plant",
            "You turn the sign whenever the plant is unstable, as in Example 3. There it had one "
            "unstable pole. A pair turns the sign twice: what counts is whether the number is odd. "
            "And a zero of the model on the right counts, too.",
            lambda case: _signs(case, _opposite_if_unstable),
            marks=0.25,
        ),
        answers_like(
            "the sign of the plant left out",
            "You have found where plant and model must agree in sign and where not, and that is "
            "the idea. But your number multiplies a model of positive DC gain: a plant with a "
            "negative one turns it again.",
            lambda case: _signs(case, _relative_to_the_plant),
            marks=0.75,
        ),
        answers_like(
            "zeros of the plant counted",
            "You have matched the signs at high frequency, or counted the plant's zeros on the "
            "right along with its poles. For a plant without such zeros that is the same rule; in "
            "general only poles of H count, and a zero of the plant is none.",
            lambda case: _signs(case, _high_frequency_sign),
            marks=0.5,
        ),
        answers_like(
            "zeros of the model forgotten",
            "All right but where the model has a zero on the right. It is a pole of H = G/Gm - 1, "
            "and counts as an unstable pole of the plant does.",
            lambda case: _signs(case, _zeros_of_the_model_forgotten),
            marks=0.75,
        ),
    ),
)


# --- 5.3 How fast may the filter be? ------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class FilterCase:
    """A plant, a model and the order of the filter.

    Attributes
    ----------
    process : control.TransferFunction or DelayedTransferFunction
        The plant; a dead time is `process.delay`, in seconds.
    model : control.TransferFunction
    order : int
    """

    process: Any
    model: ct.TransferFunction
    order: int

    def __repr__(self) -> str:
        return f"plant {factored(self.process)}, model {factored(self.model)}, n = {self.order}"


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


def _late_case(rng: np.random.Generator) -> FilterCase:
    return first_fitting(lambda: _draw_late(rng), _tells_apart)


def _draw_late(rng: np.random.Generator) -> FilterCase:
    """Draw a plant of two lags and a dead time, and a model whose poles are a little off."""
    poles = [draw(rng, 1, 6) for _ in range(2)]
    close = [few(pole * rng.uniform(0.75, 1.35)) for pole in poles]
    gain = few(rng.uniform(0.85, 1.2) * poles[0] * poles[1])
    return FilterCase(
        delay(draw(rng, 0.06, 0.4)) * (gain / ((s + poles[0]) * (s + poles[1]))),
        few(close[0] * close[1]) / ((s + close[0]) * (s + close[1])),
        int(rng.integers(2, 4)),
    )


def _tells_apart(case: FilterCase) -> bool:
    found = borders_read(case)
    rough = [value for name, value in found.items() if name not in ("Padé 2", "frequency")]
    sets = stabilizing_time_constants(case.process, case.model, case.order)
    one_set = len(sets) == 1 and sets[0][1] == inf
    return (
        one_set
        and apart(*rough, by=0.05)
        and apart(found["true"], found["Padé 2"], by=0.0025)
        and apart(found["true"], found["frequency"], by=0.5)
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


_border_like = partial(answers_like_any, close=partial(same, rtol=1.2e-3))


BORDER = Problem(
    id="5.3",
    title="How fast may the filter be?",
    case=_late_case,
    reads=one_number,
    lacks=_border_lacks,
    rounded=lambda case, got: rounds(borders_read(case)["true"], got),
    praise=(
        "Right: one part in a thousand faster and the loop is lost, and every slower filter holds "
        "it. No fraction stands for the dead time in that statement."
    ),
    misconceptions=(
        _border_like(
            "Padé trusted",
            "This is the border of another loop, in which a Padé fraction stands for the dead "
            "time. It lies on the unsafe side: the true loop is lost before. On the axis "
            "exp(−jθω) is just a number; use it, or the package, which does.",
            lambda case: [borders_read(case)["Padé 1"], borders_read(case)["Padé 2"]],
            marks=0.25,
        ),
        _border_like(
            "the closed form of a pure dead time",
            "2θ/π is exact for a pure dead time and n = 1. Here plant and model differ in "
            "their poles, too, and n is not 1: the border must be computed for this loop.",
            lambda case: [borders_read(case)["2θ/π"]],
            marks=0.0,
        ),
        _border_like(
            "small gain taken for the border",
            "This is where |FH| reaches 1. Slower filters are safe, that is true; but small gain "
            "is sufficient, not necessary, and faster ones work as well. Where does FH reach -1?",
            lambda case: [borders_read(case)["small gain"]],
            marks=0.5,
        ),
        _border_like(
            "the first edge taken for the last",
            "You have found an edge, but not the one that matters. With a dead time there are "
            "many, crowding towards 0, and below the largest one roots are on the right.",
            lambda case: [borders_read(case)["first edge"]],
            marks=0.25,
        ),
        _border_like(
            "a frequency given for the time constant",
            "You have found the edge, and returned a frequency: 1/λ, or the one at which the "
            "roots cross. Asked for is the time constant λ itself, in seconds.",
            lambda case: [borders_read(case)["bandwidth"], borders_read(case)["frequency"]],
            marks=0.75,
        ),
    ),
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
    unstable = bool(rng.random() < 0.5)
    return first_fitting(lambda: _draw_edge(rng, unstable), lambda case: _legible(case, unstable))


def _draw_edge(rng: np.random.Generator, unstable: bool) -> FilterCase:
    """Draw an unstable pole that the model mirrors, or a zero on the right that it leaves out."""
    gain, lag, speed = (draw(rng, low, high) for low, high in ((1.3, 5), (2, 9), (0.6, 6)))
    size = draw(rng, 0.5, 4)
    if unstable:
        mirrored = few(speed * rng.uniform(0.6, 1.6))
        process = few(gain * size) / ((s - speed) * (s + lag))
        return FilterCase(process, size / ((s + mirrored) * (s + lag)), 2)
    process = (
        few(size * rng.uniform(0.7, 1.4)) * (1 - s / few(2 * speed)) / ((s + speed) * (s + lag))
    )
    return FilterCase(process, size / ((s + few(speed * rng.uniform(0.6, 1.6))) * (s + lag)), 2)


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
    value, omega = edge_of(case)
    loop = NRDOB(case.process, case.model, 0, LowPassFilter(1.0, 2))

    def H(w: Any) -> Any:
        return loop.H(1j * np.asarray(w))

    step = few(0.15 * omega, 1)
    frequencies = step * np.arange(np.ceil(0.5 * omega / step), 1 + 1.5 * omega // step)
    x = 0.2 * np.arange(1, 1 + 1.4 * value * omega // 0.2)
    seen = np.concatenate([H(frequencies), _gamma(x), [-1, 0]])
    low = complex(seen.real.min(), seen.imag.min())
    size = complex(seen.real.max(), seen.imag.max()) - low
    centre, half = low + size / 2, 0.62 * max(size.real / 1.7, size.imag)
    along_H, along_curve = H(omega * np.geomspace(1e-3, 1e3, 6001)), _gamma(np.linspace(0, 9, 3001))
    (ax,) = axes_for(None, 1, TALL)
    with styled():
        across, up = np.array([-1.7, 1.7]) * half, np.array([-1, 1]) * half
        ax.set(xlim=centre.real + across, ylim=centre.imag + up, aspect="equal")
        ax.set(xlabel="real part", ylabel="imaginary part")
        label = r"$H$, marked at $\omega$ in rad/s"
        lines = ax.plot(along_H.real, along_H.imag, color=COLOURS["process"], label=label)
        label = r"$\Gamma_2$, marked at $x$"
        ax.plot(along_curve.real, along_curve.imag, color=COLOURS["filter"], label=label)
        point = half / 125  # of type, about
        labels = _marks(ax, H, frequencies, "process", along_curve, point)
        _marks(ax, _gamma, x, "filter", np.concatenate([along_H, labels]), point)
        ax.plot(-1, 0, "+", color=COLOURS["critical"], ms=9, mew=2.2, zorder=6)
        ax.axhline(0, color=INK, lw=0.6)
        ax.axvline(0, color=INK, lw=0.6)
        ax.legend(loc="best")
    places = ", ".join(f"{number(w)} rad/s at {written(H(w), _two_digits)}" for w in frequencies)
    points = ", ".join(f"{number(v, 2)} at {written(_gamma(v), _two_digits)}" for v in x)
    return Figure(lines, ax, alt=f"H passes ω = {places}. Γ₂ passes x = {points}")


_two_digits = partial(number, digits=2)


def _gamma(x: Any) -> Any:
    return -((1 + 1j * np.asarray(x)) ** 2)


def _marks(
    ax: Any, curve: Any, values: FloatArray, role: str, others: ComplexArray, point: float
) -> ComplexArray:
    """Mark points of a curve, with their values on the roomier side; return where those stand."""
    places = []
    for value in values:
        here, ahead = complex(curve(value)), complex(curve(1.001 * value))
        sides = [turn * 10 * (ahead - here) / abs(ahead - here) for turn in (1j, -1j)]
        room = [float(np.abs(others - here - point * side).min()) for side in sides]
        ax.plot(here.real, here.imag, ".", color=COLOURS[role], ms=7)
        if max(room) < 8 * point:
            continue
        side = sides[int(np.argmax(room))]
        places.append(here + point * side)
        ax.annotate(
            number(value, 2),
            (here.real, here.imag),
            (1.2 * side.real, side.imag),
            textcoords="offset points",
            color=COLOURS[role],
            fontsize="small",
            ha="center",
            va="center",
        )
    return np.array(places, dtype=complex)


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


_edge_like = partial(answers_like_any, close=_read_alike)


def _other_side(case: FilterCase) -> Edge:
    return edge_of(case)[0], "above" if side_of(case) == "below" else "below"


EDGE = Problem(
    id="5.4",
    title="Read an edge off a picture",
    case=_edge_case,
    reads=_read_edge,
    lacks=_edge_lacks,
    praise=(
        "Right: x from the one curve, the frequency from the other, and λ = x/ω. The "
        "verdict is another one on the other side of it."
    ),
    own=True,
    misconceptions=(
        Misconception(
            "the wrong side",
            "The edge is right, the side is not. Ask for very slow filters: they are stable only "
            "if H has no pole on the right and the DC gains have the same sign. Has it, here?",
            _other_side,
            lambda case, got: (
                _read_alike(_other_side(case), got) and got[1] == _other_side(case)[1]
            ),
            marks=0.5,
        ),
        _edge_like(
            "x taken for the time constant",
            "That is x = λω, where the curves meet. It has no unit. Read off the "
            "frequency of H at the same point, too, and divide: λ = x/ω.",
            lambda case: [(edge_of(case)[0] * edge_of(case)[1], side_of(case))],
            marks=0.25,
        ),
        _edge_like(
            "a frequency taken for the time constant",
            "That is a frequency, in rad/s: the one of H where the curves meet, or ω/x. The "
            "time constant is λ = x/ω, in seconds.",
            lambda case: [
                (1 / edge_of(case)[0], side_of(case)),
                (edge_of(case)[1], side_of(case)),
            ],
            marks=0.25,
        ),
    ),
)


# --- 5.5 More lags in the model -----------------------------------------------------------------


def _unstable_plant(rng: np.random.Generator) -> UnstablePlant:
    pole = draw(rng, 0.5, 3)
    gain = either_sign(rng) * draw(rng, 0.5, 5)
    return UnstablePlant(gain, pole, few(pole * rng.uniform(1.5, 4)))


def _model_and_order(given: Any) -> tuple[ct.TransferFunction, int]:
    wanted = "two things are asked for, the model and the order, a whole number"
    given_model, order = things(given, wanted)
    model = block(given_model)
    if not isinstance(model, ct.TransferFunction):
        raise UnreadableError("the model has a dead time; give one without")
    return model, whole(order)


def _not_refuting(case: UnstablePlant, got: tuple[ct.TransferFunction, int]) -> str:
    """Tell what keeps a model and an order from refuting the advice."""
    model, order = got
    roots = np.concatenate([model.poles(), model.zeros()])
    if np.any(roots.real >= 0):
        return Lack(
            "right",
            "the model has a pole or a zero that is not on the left; the advice asks for neither",
        )
    falls = as_fraction(model, "model", proper=False).relative_degree
    if falls <= 2:
        return Lack(
            "lags",
            "the model must fall off faster than the plant: that is what over-parametrised is for",
        )
    if order < falls:
        return Lack("order", "F/model is not causal with this order")
    if not right_half_plane_parity(case.process, model).holds:
        return Lack(
            "sign",
            "the model has the wrong sign, so that no filter can work: that is not the advice",
        )
    works = stabilizing_time_constants(case.process, model, order)
    small = works[0][0] / 2 if works else 0.01 / float(np.abs(roots).max())
    fast = (LowPassFilter(k * small, order) for k in (1.0, 0.1)) if small else ()
    if not small or any(observer_stable(case.process, model, F) for F in fast):
        return Lack("works", "every filter that is fast enough stabilises this, as the advice says")
    return ""


def _over(case: UnstablePlant, lags: int = 1, sign: float = 1.0) -> ct.TransferFunction:
    """Mirror the pole of the plant, and add lags ten times as fast."""
    return sign * mirrored(case) / (s / (10 * case.decay) + 1) ** lags


ADVICE = Problem(
    id="5.5",
    title="Find the error: the faster the better",
    case=_unstable_plant,
    reads=_model_and_order,
    lacks=_not_refuting,
    praise=(
        "Right. The model is what the paper recommends, the order is more than enough, and every "
        "fast filter fails: the model may have m lags more than the plant only if n - m is at "
        "most 2."
    ),
    misconceptions=(
        lacking(
            "works",
            "an order that works",
            "With your order the advice is good: every filter that is fast enough stabilises the "
            "loop. Which orders does the paper's sentence allow besides? Count how many lags the "
            "filter has more than the model has more than the plant.",
            lambda case: (_over(case), 3),
            marks=0.5,
        ),
        lacking(
            "sign",
            "the DC sign of the plant",
            "All filters fail, but for another reason: parity. The paper's own model has the "
            "opposite DC sign of its plant, and so must yours, or you refute what nobody has "
            "claimed.",
            lambda case: (_over(case, sign=-1.0), 4),
            marks=0.25,
        ),
        lacking(
            "lags",
            "no lag more than the plant",
            "Your model falls off as the plant does, so it is not over-parametrised. Give it one "
            "stable pole more, or several.",
            lambda case: (_over(case, lags=0) / 20, 3),
            marks=0.25,
        ),
        lacking(
            "right",
            "an unstable pole in the model",
            "Your model has a pole or a zero that is not on the left. The advice is to "
            "over-parametrise with stable poles. Mirror the plant's pole first.",
            lambda case: (case.process / (s / (10 * case.decay) + 1), 4),
            marks=0.0,
        ),
        lacking(
            "order",
            "a filter that is not causal",
            "F/model is not causal: the order of the filter must be at least the number of lags "
            "that the model has more than zeros.",
            lambda case: (_over(case), 2),
            marks=0.0,
        ),
    ),
)


# --- 5.6 Hold it --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DesignCase:
    """A plant gain/((s - pole)(s/decay + 1)), with a dead time that may come on top.

    Attributes
    ----------
    gain, pole, decay : float
        All positive; `pole` and `decay` in rad/s.
    dead_time : float
        In seconds.
    max_ms, max_noise : float
        Largest sensitivity peak, and largest ``|U_eta|``, allowed with the dead time.
    """

    gain: float
    pole: float
    decay: float
    dead_time: float
    max_ms: float = inf
    max_noise: float = inf

    @property
    def process(self) -> ct.TransferFunction:
        """The plant without dead time."""
        return self.gain / ((s - self.pole) * (s / self.decay + 1))

    @property
    def feared(self) -> DelayedTransferFunction:
        """The plant with it."""
        return DelayedTransferFunction(self.process, self.dead_time)

    def __repr__(self) -> str:
        return (
            f"the plant {factored(self.process)}, feared with {self.dead_time:g} s of dead time, "
            f"Ms ≤ {self.max_ms:g}, |U_eta| ≤ {self.max_noise:g}"
        )


def _design_case(rng: np.random.Generator) -> DesignCase:
    """Draw a plant; the limits are such that the mirrored model of full size meets them."""
    pole = draw(rng, 0.5, 5)
    case = DesignCase(
        gain=draw(rng, 0.5, 4),
        pole=pole,
        decay=few(pole * rng.uniform(3, 6)),
        dead_time=few(rng.uniform(0.055, 0.065) / pole),
    )
    tempting = _with_dead_time(case, _design(case, 0.2, size=0.5))
    found = tempting.margins()
    max_ms = few((found.plant_loop.ms * found.observer_loop.ms) ** 0.5, 3)
    max_noise = few(1.6 * _noise(_with_dead_time(case, _design(case, 0.1))))
    return DesignCase(case.gain, case.pole, case.decay, case.dead_time, max_ms, max_noise)


def _design(case: DesignCase, value: float, size: float = 1.0, sign: float = 1.0) -> NRDOB:
    """Mirror the pole; the time constant is given in units of 1/pole."""
    model = sign * size * case.gain / ((s + case.pole) * (s / case.decay + 1))
    controller = sign * (s + case.pole) * case.pole / (size * case.gain * s)
    return NRDOB(case.process, model, controller, LowPassFilter(value / case.pole, 2))


def _with_dead_time(case: DesignCase, loop: NRDOB) -> NRDOB:
    return replace(loop, process=case.feared)


def _noise(loop: NRDOB) -> float:
    roots = np.abs(np.concatenate([loop.p_B.roots, loop.G.denominator.roots]))
    omega = np.geomspace(1e-3 * roots.min(), 1e3 * roots.max(), 3001)
    return float(np.abs(loop.U_eta(1j * omega)).max())


def _shortcoming(case: DesignCase, got: Any) -> str:
    """Tell what a design lacks, with numbers."""
    if lack := not_around(case.process, got):
        return lack
    verdict = got.stability()
    if np.any(np.abs(got.p_B.roots - case.pole) < 1e-6 * case.pole):
        return Lack("matched", "the plant's unstable pole is a root of p_B")
    if not right_half_plane_parity(got.process, got.model).holds:
        return Lack("sign", "p_B has an odd number of roots on the right")
    if verdict.model_loop.stable is not True:
        return "the controller does not stabilise the model"
    if verdict.stable is not True:
        return f"even without the dead time it is not stable: {_which_way(got)}"
    late = _with_dead_time(case, got)
    if late.stability().stable is not True:
        return Lack("feared", "with the dead time the loop is not stable")
    found, noise = late.margins(), _noise(late)
    if not found.plant_loop.ms <= case.max_ms * (1 + 1e-6):
        trusted = found.observer_loop.ms <= case.max_ms
        return Lack(
            "margin of FH" if trusted else "ms",
            f"with the dead time Ms is {found.plant_loop.ms:.3g}{_calmer(late)}",
        )
    if not noise <= case.max_noise * (1 + 1e-6):
        return Lack("noise", f"with the dead time |U_eta| reaches {noise:.3g}")
    if abs(late.T_R.dc_gain - 1) > 0.01:
        return f"y comes to rest at {late.T_R.dc_gain:.3g} after a unit step of R"
    return ""


def _which_way(loop: NRDOB) -> str:
    """Tell an unstable loop whether its filter is too fast or too slow."""
    F = loop.filter
    if not isinstance(F, LowPassFilter):
        return "the filter does not stabilise p_B"
    works = stabilizing_time_constants(loop.process, loop.model, F.order)
    if not works:
        return "no filter of this order stabilises p_B with this model"
    slow = F.time_constant >= works[0][1]
    return "the filter is too slow for the unstable pole" if slow else "the filter is too fast"


def _calmer(late: NRDOB) -> str:
    """Tell a loop whose sensitivity peak is too high which way is down."""
    F = late.filter
    if not isinstance(F, LowPassFilter):
        return ""
    peaks = []
    for factor in (0.9, 1.1):
        other = replace(late, filter=LowPassFilter(factor * F.time_constant, F.order))
        peaks.append(other.margins().plant_loop.ms)
    best = np.nanargmin(peaks) if not np.isnan(peaks).all() else 1
    return f"; a {('faster', 'slower')[int(best)]} filter lowers it"


def _matched_design(case: DesignCase) -> NRDOB:
    controller = 3 * (s + case.pole) * case.pole / (case.gain * s)
    return NRDOB(case.process, case.process, controller, LowPassFilter(0.1 / case.pole, 2))


DESIGN = Problem(
    id="5.6",
    title="Hold it",
    case=_design_case,
    lacks=_shortcoming,
    praise=(
        "Your loop holds the plant, with the dead time and without, with the margins that were "
        "asked for, quietly enough, and it follows its reference. That is a design."
    ),
    misconceptions=(
        lacking(
            "matched",
            "a model that matches the plant",
            "The plant's unstable pole is a root of p_B: your model has it, too, so that it "
            "cancels in FH and stays in the loop for every filter 1/(λs + 1)^n. Mirror it instead.",
            _matched_design,
            marks=0.0,
        ),
        lacking(
            "sign",
            "the DC sign of the plant",
            "p_B has an odd number of roots on the right for every λ and n. Before any tuning: one "
            "unstable pole asks for a model with the opposite DC sign.",
            lambda case: _design(case, 0.1, sign=-1.0),
            marks=0.0,
        ),
        lacking(
            "feared",
            "designed for the plant that is hoped for",
            "Your loop is stable without the dead time, and lost with it: the filter is too fast "
            "for what it does not know. Design for the plant that you fear, case.feared.",
            lambda case: _design(case, 0.02),
            marks=0.25,
        ),
        lacking(
            "margin of FH",
            "margin of FH taken for the plant's",
            "The peak of 1/(1 + FH) is within the limit, that of S_d = 1/(1 + L) is not, and S_d "
            "is what the plant feels. Look at margins().plant_loop of the loop with the dead time. "
            "Which size of the model makes it calmer?",
            lambda case: _design(case, 0.2, size=0.5),
            marks=0.5,
        ),
        lacking(
            "noise",
            "too much noise at the actuator",
            "Stable, with the margins asked for; but the sensor's noise reaches the actuator too "
            "loudly. |U_eta| at high frequency is |F/model|: a slower filter is quieter.",
            lambda case: _design(case, 0.065),
            marks=0.5,
        ),
    ),
)


# --- 5.7 How well must the dead time be known? --------------------------------------------------


@dataclass(frozen=True, eq=False)
class WaitingCase:
    """A plant whose model waits for nearly the right time.

    Attributes
    ----------
    prompt : control.TransferFunction
        What stands before the dead time, in the plant and in the model.
    dead_time : float
        For how long the model waits today, in seconds.
    error : float
        By how much the plant's dead time may be another one, in seconds, up or down.
    order : int
        Order of the filter.
    """

    prompt: ct.TransferFunction
    dead_time: float
    error: float
    order: int

    def __repr__(self) -> str:
        late = delay(self.dead_time) * self.prompt
        return f"model {factored(late)}, dead time wrong by {self.error:g} s, n = {self.order}"


def _borne(order: int) -> float:
    """Error of the dead time, against λ, that is borne whatever the dead time: c_n.

    Roots reach the axis where Df = exp(-jωθm) - exp(-jωθ), of size 2 sin(ω|θ - θm|/2) at most.
    """
    last = (2 ** (2 / order) - 1) ** 0.5  # where |Df| = 2

    def error(x: float) -> float:
        return 2 * asin(min((1 + x * x) ** (order / 2) / 2, 1.0)) / x

    return float(minimize_scalar(error, bounds=(0, last), method="bounded").fun)


@kept
def _today(case: WaitingCase) -> float:
    """Find the fastest filter that bears the error with the dead time of today."""
    model = delay(case.dead_time) * case.prompt
    return max(
        critical_time_constants(
            delay(case.dead_time + off) * case.prompt, model, case.order, floor=0.1 * case.error
        )[-1].time_constant
        for off in (-case.error, case.error)
    )


@kept
def _unwaited(case: WaitingCase) -> float:
    """Find the fastest filter where the error is all the dead time and the model does not wait."""
    process = delay(case.error) * case.prompt
    return float(stabilizing_time_constants(process, case.prompt, case.order)[-1][0])


def _ramp_bound(case: WaitingCase) -> float:
    """Give λ with ``ω|error| |F| < 1``: the largest x/(1 + x²)^(n/2) is at x = 1/√(n - 1)."""
    n = case.order
    return float(case.error * (n - 1) ** ((n - 1) / 2) / n ** (n / 2))


_WRONG_WAITING: tuple[Callable[[WaitingCase], float], ...] = (
    lambda case: case.error / _borne(1),
    _unwaited,
    _today,
    _ramp_bound,
    lambda case: case.error * _borne(case.order),
)


def _waiting_case(rng: np.random.Generator) -> WaitingCase:
    def drawn() -> WaitingCase:
        pole, other = draw(rng, 0.5, 4), draw(rng, 0.5, 4)
        prompt = few(rng.uniform(0.5, 4)) / ((s / pole + 1) * (s / other + 1))
        dead_time = draw(rng, 0.2, 1.5)
        error = few(dead_time * rng.uniform(0.08, 0.2))
        return WaitingCase(prompt, dead_time, error, int(rng.integers(2, 5)))

    def fits(case: WaitingCase) -> bool:
        right = case.error / _borne(case.order)
        return apart(right, *(of(case) for of in _WRONG_WAITING), by=0.004)

    return first_fitting(drawn, fits)


def _waiting_lacks(case: WaitingCase, got: float) -> str:
    if not 0 < got < inf:
        return "a time constant is a positive number"
    borne = _borne(case.order) * got
    if same(case.error, borne):
        return ""
    if borne > case.error:
        return f"it is stable, but a faster filter would be, too: this one bears {borne:.4g} s"
    return (
        f"there are dead times with which it is not stable: this filter bears an error of "
        f"{borne:.4g} s, not of {case.error:g} s"
    )


WAITING = Problem(
    id="5.7",
    title="How well must the dead time be known?",
    case=_waiting_case,
    reads=one_number,
    lacks=_waiting_lacks,
    rounded=lambda case, got: rounds(case.error / _borne(case.order), got),
    praise=(
        "Right: a filter bears an error of c_n λ in the dead time that the model waits for, "
        "however long that is. What counts is not the dead time, but how well you know it."
    ),
    misconceptions=(
        answers_like(
            "order forgotten",
            "You have found the idea, and for a filter of one lag the number. With n lags |Df| = "
            "(1 + λ²ω²)^(n/2) grows faster, and more is borne at the same λ.",
            _WRONG_WAITING[0],
            marks=0.5,
        ),
        answers_like(
            "error taken for the whole dead time",
            "You have judged a plant whose whole dead time is the error, with a model that does "
            "not wait. But Df = exp(-jωθm) - exp(-jωθ) turns with the dead time that is waited "
            "for, and at the worst angle less is borne.",
            _WRONG_WAITING[1],
            marks=0.5,
        ),
        answers_like(
            "the dead time of today alone",
            "That is right for the dead time of today. Asked is a filter that bears the error "
            "whatever the dead time is: at some other one the difference of the two exponentials "
            "comes at its worst angle.",
            _WRONG_WAITING[2],
            marks=0.5,
        ),
        answers_like(
            "sine taken for its angle",
            "Safe, but not the fastest: you have bounded the difference of the exponentials by "
            "ω times the error. It is 2 sin of half of that, and never above 2.",
            _WRONG_WAITING[3],
            marks=0.5,
        ),
        answers_like(
            "upside down",
            "You have multiplied by what you should divide by: an error of c_n λ is borne, so λ "
            "is the error over c_n.",
            _WRONG_WAITING[4],
            marks=0.25,
        ),
    ),
)

PROBLEMS = (SIGN, BORDER, EDGE, ADVICE, DESIGN, WAITING)
