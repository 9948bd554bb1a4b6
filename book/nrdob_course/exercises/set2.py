"""Set 2: counting turns, and Lemma 1."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import control as ct
import numpy as np

from nrdob.analysis import judge, resolved_frequencies
from nrdob.design import right_half_plane_parity, stabilizing_time_constants
from nrdob.diagram import LowPassFilter, Quotient
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray, FloatArray, QuasiPolynomial, number
from nrdob.plotting import Figure

from .cases import (
    LoopCase,
    UnstablePlant,
    alike,
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
from .problems import Lack, Problem, answers_like, answers_like_any, lacking, same
from .reading import number as one_number
from .reading import numbers

__all__ = ["CLOSING", "LITERAL", "PROBLEMS", "READING", "UNTURNED", "draw_without_count"]

# --- 2.1 Turns from a list of roots -------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RootsCase:
    """A loop, taken apart into roots.

    Attributes
    ----------
    plant_zeros, plant_poles, model_zeros, model_poles : array of complex
        Of G and of the model, before anything cancels.
    closed_loop_roots : array of complex
        Roots of p_B.
    """

    plant_zeros: ComplexArray
    plant_poles: ComplexArray
    model_zeros: ComplexArray
    model_poles: ComplexArray
    closed_loop_roots: ComplexArray

    def __repr__(self) -> str:
        names = "plant_zeros", "plant_poles", "model_zeros", "model_poles", "closed_loop_roots"
        found = [f"{on_the_right(getattr(self, name))} {name.replace('_', ' ')}" for name in names]
        return f"on the right: {', '.join(found)}"


def _roots_case(rng: np.random.Generator) -> RootsCase:
    """Draw a loop whose plot turns either way, once or more often, with equal chances."""
    low, high = ((-9, -1), (1, 1), (2, 9))[int(rng.integers(3))]

    def fits(drawn: tuple[RootsCase, NRDOB]) -> bool:
        case, loop = drawn
        return (
            low <= _turns(case) <= high
            and apart(_turns(case), *(wrong(case) for wrong in _TURN_MISTAKES))
            and observer_stable(loop.process, loop.model, loop.filter) is not None
        )

    return first_fitting(lambda: _draw_roots(rng, 2 if low < 0 else int(rng.integers(1, 3))), fits)[
        0
    ]


def _draw_roots(rng: np.random.Generator, unstable: int) -> tuple[RootsCase, NRDOB]:
    """Draw a loop with so many unstable poles of the plant, and as many zeros of the model."""
    plant_zeros = _draw_sides(rng, int(rng.integers(0, 3)), 1)
    plant_poles = _draw_sides(rng, unstable, 2)
    model_zeros = _draw_sides(rng, unstable, 1)
    model_poles = _draw_sides(rng, 3 - unstable, unstable + 1)
    gain = rng.choice([-1, 1]) * draw(rng, 0.5, 9)
    loop = NRDOB(
        process=(gain * np.real(np.poly(plant_zeros)), np.real(np.poly(plant_poles))),
        model=(np.real(np.poly(model_zeros)), np.real(np.poly(model_poles))),
        controller=0,
        filter=LowPassFilter(draw(rng, 0.01, 2), 3),
    )
    return RootsCase(plant_zeros, plant_poles, model_zeros, model_poles, loop.p_B.roots), loop


def _draw_sides(rng: np.random.Generator, right: int, left: int) -> ComplexArray:
    """Draw roots on either side of the axis, some of them in pairs."""
    roots: list[complex] = []
    for side, count in ((1.0, right), (-1.0, left)):
        while count:
            size = draw(rng, 0.2, 9)
            pair = count >= 2 and rng.random() < 0.6
            damping = rng.uniform(0.1, 0.9)
            root = complex(few(side * size * damping), few(size * (1 - damping**2) ** 0.5))
            roots += [root, root.conjugate()] if pair else [complex(side * size)]
            count -= 2 if pair else 1
    return np.array(roots)


def _poles(case: RootsCase) -> int:
    return on_the_right(case.plant_poles, case.model_zeros)


def _turns(case: RootsCase) -> float:
    return on_the_right(case.closed_loop_roots) - _poles(case)


def _counter_clockwise(case: RootsCase) -> float:
    return -_turns(case)


def _sum_of_both(case: RootsCase) -> float:
    return on_the_right(case.closed_loop_roots) + _poles(case)


def _poles_of_both(case: RootsCase) -> float:
    return on_the_right(case.closed_loop_roots) - on_the_right(case.plant_poles, case.model_poles)


def _plant_only(case: RootsCase) -> float:
    return on_the_right(case.closed_loop_roots) - on_the_right(case.plant_poles)


def _as_if_stable(case: RootsCase) -> float:
    return -_poles(case)


_TURN_MISTAKES = (_counter_clockwise, _sum_of_both, _poles_of_both, _plant_only, _as_if_stable)

TURNS = Problem(
    id="2.1",
    title="Turns from a list of roots",
    case=_roots_case,
    reads=one_number,
    lacks=lambda case, got: (
        ""
        if same(_turns(case), got)
        else f"that many turns do not turn P = {_poles(case)} poles into Z = "
        f"{on_the_right(case.closed_loop_roots)} roots of p_B on the right"
    ),
    praise=(
        "Right: N = Z - P, clockwise turns counted as positive, and P counts the poles of the "
        "plant and the zeros of the model."
    ),
    misconceptions=(
        answers_like(
            "counter-clockwise counted as positive",
            "The size is right, the sign is not: here, as in python-control, clockwise turns count "
            "as positive, so N = Z - P. Which way does the plot turn for a stable loop with an "
            "unstable plant?",
            _counter_clockwise,
            marks=0.5,
        ),
        answers_like(
            "Z and P added",
            "You have added the two counts. A zero of 1 + FH on the right turns the plot "
            "clockwise, a pole turns it the other way: the turns are the difference, N = Z - P.",
            _sum_of_both,
            marks=0.25,
        ),
        answers_like(
            "poles of the model for its zeros",
            "You have counted the poles of the plant and the poles of the model. But H contains "
            "the model upside down, H = G/Gm - 1: which roots of the model are poles of H?",
            _poles_of_both,
            marks=0.25,
        ),
        answers_like(
            "zeros of the model forgotten",
            "P is not only the plant's: H = G/Gm - 1 has the model in the denominator, so a zero "
            "of the model on the right is a pole of FH. Count it, too.",
            _plant_only,
            marks=0.5,
        ),
        answers_like(
            "the turns of a stable loop",
            "-P is what the plot would have to do if the loop were stable. Is it? Look at the "
            "roots of p_B, and use them.",
            _as_if_stable,
            marks=0.25,
        ),
    ),
)


# --- 2.3 Read a plot ----------------------------------------------------------------------------


class PlotCase(LoopCase):
    """A loop whose plot of FH is to be read."""

    def __repr__(self) -> str:
        F = self.loop.filter
        return (
            f"G = {factored(self.loop.process)}, Gm = {factored(self.loop.model)}, "
            f"F = 1/({F.time_constant:g}s + 1)^{F.order}"
        )


def _plot_case(rng: np.random.Generator) -> PlotCase:
    wanted = int(rng.choice([-2, -1, 1, 2]))
    return first_fitting(lambda: _draw_plot(rng, wanted), lambda case: _readable(case, wanted))


def _draw_plot(rng: np.random.Generator, wanted: int) -> PlotCase:
    """Draw a loop whose plot may turn as wanted, and which has one root that cancels in it."""
    g, lag, other, hidden = (draw(rng, low, high) for low, high in ((2, 7), (2, 9), (2, 9), (1, 9)))
    omega = draw(rng, 0.5, 3)
    above, below = {
        2: (ct.tf(few(omega), 1), s + few(omega)),
        -2: (s**2 + omega * s + few(omega**2), s**2 - 0.5 * omega * s + few(omega**2)),
    }.get(wanted, (s + draw(rng, 0.5, 3), s - omega))
    if rng.random() < 0.5:
        model = 1 / ((s - hidden) * (s + lag))
    else:
        model = (s - hidden) / ((s + lag) * (s + other))
    process = ct.tf(*_product(g * above / below, model))
    filter = LowPassFilter(draw(rng, 0.05, 2), 3 if wanted == 2 else 2)
    return PlotCase(NRDOB(process, model, 0, filter))


def _product(first: ct.TransferFunction, second: ct.TransferFunction) -> tuple[Any, Any]:
    return tuple(
        np.polymul(a, b)
        for a, b in (
            (first.num_array[0, 0], second.num_array[0, 0]),
            (first.den_array[0, 0], second.den_array[0, 0]),
        )
    )


def _readable(case: PlotCase, wanted: int) -> bool:
    """Whether the plot turns as wanted and shows it: not too large, not too near the point."""
    unstable = np.concatenate([case.loop.process.poles(), case.loop.model.zeros()])
    if on_the_right(case.loop.p_B.roots) - on_the_right(unstable) != wanted:
        return False  # most are dropped here, without asking for a verdict
    found = case.loop.stability().observer_loop
    shared = np.unique(np.abs(unstable.real))
    if found.stable is None or found.encirclements != wanted or not apart(*shared):
        return False
    values = case.loop.FH(1j * np.append(0, resolved_frequencies(case.loop.FH)))
    return bool(np.abs(values).max() < 6.5 and np.abs(1 + values).min() > 0.3)


def draw_without_count(loop: NRDOB) -> Figure:
    """Draw the Nyquist plot of FH as the book does, but let the reader count.

    The alt text says where the plot crosses the real axis, which is what the eye would see.

    Parameters
    ----------
    loop : NRDOB
        The loop of a case.
    """
    figure = loop.plot_nyquist("FH")
    for ax in np.ravel(figure.axes):
        ax.set_title("", loc="right")
    return Figure(figure.lines, figure.axes, alt=f"Nyquist plot of F·H: {_crossings(loop)}")


def _crossings(loop: NRDOB) -> str:
    omega = resolved_frequencies(loop.FH)
    values = loop.FH(1j * omega)
    found = [f"it starts at {number(loop.FH.dc_gain)} for zero frequency"]
    for k in np.flatnonzero(np.diff(np.sign(values.imag))):
        weight = values.imag[k] / (values.imag[k] - values.imag[k + 1])
        real = float(values.real[k] + weight * (values.real[k + 1] - values.real[k]))
        way = "upwards" if values.imag[k + 1] > 0 else "downwards"
        if abs(real) > 0.01:
            found.append(f"crosses the real axis at {number(real)} {way}")
    found[0] += f" and leaves {'up' if values.imag[0] > 0 else 'down'}wards"
    last = "and ends at 0; the half for negative frequencies is its mirror image"
    return ", ".join([*found, last])


Reading = tuple[float, float, float]


@kept
def _reading(case: PlotCase) -> Reading:
    found = case.loop.stability().observer_loop
    return found.encirclements or 0, found.open_loop_rhp, found.closed_loop_rhp or 0


def _other_sense(case: PlotCase) -> Reading:
    N, P, _ = _reading(case)
    return -N, P, P - N


def _other_convention(case: PlotCase) -> Reading:
    N, P, Z = _reading(case)
    return -N, P, Z


def _mixed_conventions(case: PlotCase) -> Reading:
    N, P, _ = _reading(case)
    return N, P, P - N


def _after_cancellation(case: PlotCase) -> Reading:
    N, P, Z = _reading(case)
    return N, P - 1, Z - 1


def _plot_lacks(case: PlotCase, got: FloatArray) -> str:
    N, P, _ = _reading(case)
    if got[0] != N:
        return (
            "the first number is not what the plot does around -1. Draw a ray from -1 to the far "
            "left: where the plot crosses it upwards it has made a clockwise turn, where downwards "
            "an anticlockwise one. Both halves count, the solid and the dashed"
        )
    if got[1] != P:
        return (
            "N is right, P is not: it counts the poles of the plant and the zeros of the model on "
            "the right, whether they cancel or not"
        )
    if got[2] != N + P:
        return "N and P are right, and Z does not follow from them: Z = N + P"
    return ""


READING = Problem(
    id="2.3",
    title="Read a plot",
    case=_plot_case,
    reads=partial(numbers, names="N, P, Z", gaps=True),
    lacks=_plot_lacks,
    parts=lambda case, got: dict(
        zip("NPZ", (same(*each) for each in zip(_reading(case), got, strict=True)), strict=True)
    ),
    praise=(
        "Right, all three. The plot shows N and nothing else: P comes from the factors of plant "
        "and model, and one of them never appears in the plot."
    ),
    own=True,
    misconceptions=(
        answers_like(
            "P counted after cancellation",
            "N is right, but one root is missing from P, and so from Z. A factor that plant and "
            "model share cancels in FH, not in the loop: count the poles of the plant and the "
            "zeros of the model before anything cancels.",
            _after_cancellation,
            marks=0.5,
        ),
        answers_like(
            "Z = P - N for clockwise turns",
            "N and P are right. The formula Z = P - N belongs to books that count anticlockwise "
            "turns as positive; here they are negative, and it is Z = N + P.",
            _mixed_conventions,
            marks=2 / 3,
        ),
        answers_like(
            "the other convention, used consistently",
            "P and Z are right, and your N counts anticlockwise turns as positive. That is a good "
            "convention, but not that of this book: clockwise is positive here, and Z = N + P.",
            _other_convention,
            marks=0.75,
        ),
        answers_like(
            "turns counted in the wrong sense",
            "P is right, and you have applied Z = N + P; but the sign of N is not right, so Z is "
            "not either. Follow the arrowheads: which way does a walker go around -1? Clockwise is "
            "positive.",
            _other_sense,
            marks=1 / 3,
        ),
    ),
)


# --- 2.4 Close the curve ------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class HalfCurve:
    """What is known of a function H: its values, and how it behaves at both ends.

    Attributes
    ----------
    omega : array of float
        Frequencies in rad/s, growing, densely from far below all corner frequencies to far above.
    values : array of complex
        H at j omega.
    poles_at_zero : int
        How many poles H has at s = 0.
    excess : int
        By how much the degree of its numerator exceeds that of its denominator.
    """

    omega: FloatArray = field(repr=False)
    values: ComplexArray = field(repr=False)
    poles_at_zero: int
    excess: int

    def __repr__(self) -> str:
        return (
            f"poles_at_zero = {self.poles_at_zero}, excess = {self.excess}, H at 1 rad/s about "
            f"{np.round(np.interp(1.0, self.omega, self.values), 2)}"
        )


def _half_curve(way: int, rng: np.random.Generator) -> HalfCurve:
    """Draw a curve that turns clockwise, 1, or the other way, -1."""

    def fits(drawn: tuple[HalfCurve, FloatArray, FloatArray]) -> bool:
        case, above, below = drawn
        return (
            way * _closed(case) > 0
            and _unambiguous(case)
            and judge("H", [QuasiPolynomial(below)], QuasiPolynomial(above)).encirclements
            == _closed(case)
        )

    return first_fitting(lambda: _draw_half_curve(rng), fits)[0]


def _unambiguous(case: HalfCurve) -> bool:
    """Whether every mistake gives a number of its own, which does not round to the right one."""
    right = _closed(case)
    mistakes = [wrong(case) for wrong in _CLOSING_MISTAKES]
    return (
        apart(right, *mistakes, *_hints(case), by=0.05)
        and apart(right, _detour_missing(case), *_hints(case), by=0.05)
        and all(abs(value - right) > 0.4 for value in (_jumps(case), _one_half(case)))
        # Clockwise curves of which this is true, too, are too rare to be found.
        and (right > 0 or apart(_jumps(case), _around_zero(case), by=0.05))
    )


def _draw_half_curve(rng: np.random.Generator) -> tuple[HalfCurve, FloatArray, FloatArray]:
    """Draw H = G/Gm - 1 of a plant with integrators and a model with more lags than the plant."""
    integrators, excess, others = (int(k) for k in rng.integers(1, 3, 3))

    def polynomial(degree: int) -> FloatArray:
        sides = rng.choice([-1, 1], degree, p=[0.6, 0.4])
        return np.atleast_1d(np.poly([side * draw(rng, 0.3, 9) for side in sides]))

    below = np.append(polynomial(others), np.zeros(integrators))
    above = polynomial(below.size - 1 + excess)
    omega = np.geomspace(1e-5, 1e5, 5001)
    ratio = np.polyval(above, 1j * omega) / np.polyval(below, 1j * omega)
    # Small in the middle, so that the turns around -1 are not those around 0.
    gain = rng.choice([-1, 1]) * few(rng.uniform(0.1, 0.5) / np.abs(ratio).min())
    above = gain * above
    return HalfCurve(omega, gain * ratio - 1, integrators, excess), above, below


def _clockwise(values: ComplexArray) -> float:
    """Clockwise turns of a curve around 0, by adding up small angles."""
    return float(-np.angle(values[1:] / values[:-1]).sum() / (2 * np.pi))


def _pieces(case: HalfCurve) -> float:
    """Count the turns of the detour around 0 and of the large half circle."""
    return (case.poles_at_zero + case.excess) / 2


@kept
def _on_page(case: HalfCurve) -> float:
    return _clockwise(1 + case.values)


def _sum(case: HalfCurve) -> float:
    """Add up what there is: the right number, but for rounding."""
    return 2 * _on_page(case) + _pieces(case)


def _closed(case: HalfCurve) -> float:
    return round(_sum(case))


def _axis_only(case: HalfCurve) -> float:
    return 2 * _on_page(case)


def _half_circle_missing(case: HalfCurve) -> float:
    return _axis_only(case) + case.poles_at_zero / 2


def _detour_missing(case: HalfCurve) -> float:
    return _axis_only(case) + case.excess / 2


def _anticlockwise(case: HalfCurve) -> float:
    return -_closed(case)


def _around_zero(case: HalfCurve) -> float:
    return 2 * _clockwise(case.values) + _pieces(case)


def _one_half(case: HalfCurve) -> float:
    return _on_page(case) + _pieces(case)


def _jumps(case: HalfCurve) -> float:
    """Take the difference of two angles as NumPy gives them, between -π and π."""
    first, last = np.angle(1 + case.values[[0, -1]])
    return float((first - last) / np.pi) + _pieces(case)


_CLOSING_MISTAKES = (_axis_only, _half_circle_missing, _anticlockwise, _around_zero, _one_half)


def _near(value: float, got: float) -> bool:
    """Tell whether a count is a value, or a value between two counts made whole."""
    return abs(got - value) < 0.05 or (
        abs(value - round(value)) > 0.05 and got in (np.floor(value), np.ceil(value))
    )


_turning_like = partial(answers_like_any, close=_near)


def _hints(case: HalfCurve) -> dict[float, str]:
    """Say what other slips look like."""
    axis, pieces = _axis_only(case), _pieces(case)
    return {
        axis / 2: "it is what positive frequencies alone give. Where are the mirror image, the "
        "detour, and the half circle?",
        axis - pieces: "the two closing pieces seem to go the wrong way: both are clockwise",
        axis + 2 * pieces: "each pole at 0 and each degree of excess adds half a turn, not a whole",
        pieces - axis: "the closing pieces seem right; but numpy's angles grow counter-clockwise, "
        "so their sum needs a minus sign",
    }


def _closing_lacks(case: HalfCurve, got: float) -> str:
    if abs(got - _closed(case)) < 0.05:
        return ""
    for value, hint in _hints(case).items():
        if abs(got - value) < 0.05:
            return hint
    if abs(got - np.round(got)) > 0.05:
        return "a closed curve turns a whole number of times"
    return "that many turns do not fit the zeros of 1 + H and the poles of H on the right"


CLOSING = Problem(
    id="2.4",
    title="Close the curve",
    case=(partial(_half_curve, 1), partial(_half_curve, -1)),
    reads=one_number,
    lacks=_closing_lacks,
    praise=(
        "Right: half the turns are on the page, its mirror image makes as many, each pole at 0 "
        "adds half a turn by the detour, and each degree of excess half a turn at infinity."
    ),
    misconceptions=(
        answers_like(
            "cut off instead of rounded",
            "One turn is missing where the sum is a little below a whole number: int() cuts off, "
            "and 3.99999 becomes 3. Use round(). (If there is no int() in your answer, look for a "
            "piece of the path that you have left out.)",
            lambda case: int(_sum(case)),
            marks=0.75,
        ),
        _turning_like(
            "angles that jump",
            "You have taken the difference of two angles, and np.angle gives every angle between "
            "-π and π: whole turns are lost on the way. Add up the small angles from one "
            "frequency to the next, or use np.unwrap.",
            lambda case: [_jumps(case)],
            marks=0.5,
        ),
        _turning_like(
            "the curve left open",
            "You have counted what is on the page, positive and negative frequencies, and left the "
            "curve open. Poles at 0 make the path take a detour, and an excess of the numerator "
            "makes the large half circle count: how much does each add, and which way round?",
            lambda case: [_axis_only(case)],
            marks=0.25,
        ),
        _turning_like(
            "one of the two closing pieces forgotten",
            "One piece of the closed path is missing. There are two: the detour around the poles "
            "at 0, and the large half circle, which counts because H is improper. Each adds half a "
            "turn, clockwise, for each pole at 0 and for each degree of excess.",
            lambda case: [_half_circle_missing(case), _detour_missing(case)],
            marks=0.5,
        ),
        _turning_like(
            "counter-clockwise counted as positive",
            "The number is right, the sign is not. numpy's angles grow counter-clockwise, turns "
            "here are positive clockwise: there must be a minus sign in front of the sum.",
            lambda case: [_anticlockwise(case)],
            marks=0.5,
        ),
        _turning_like(
            "turns around 0",
            "These are the turns of H around 0. We want those around -1, which are the turns of "
            "1 + H around 0: add up the angles of 1 + H.",
            lambda case: [_around_zero(case)],
            marks=0.25,
        ),
        _turning_like(
            "negative frequencies forgotten",
            "The values are given for positive frequencies only. The other half of the plot is the "
            "mirror image, and turns as much: count what is on the page twice. The detour and the "
            "half circle are whole already.",
            lambda case: [_one_half(case)],
            marks=0.5,
        ),
    ),
)


# --- 2.5 Lemma 1, read literally ----------------------------------------------------------------


def _unstable_plant(rng: np.random.Generator) -> UnstablePlant:
    pole = draw(rng, 0.5, 3)
    return UnstablePlant(draw(rng, 0.5, 5), pole, few(pole * rng.uniform(1.5, 4)))


def _visible(open_loop: Quotient) -> ComplexArray:
    """Zeros of 1 + L on the right after cancellation: what Lemma 1 read literally looks at."""
    if not open_loop.numerator.q.any():
        return np.empty(0, dtype=complex)
    tf = open_loop.to_tf()
    roots = np.roots(np.polyadd(tf.num_array[0, 0], tf.den_array[0, 0]))
    return np.asarray(roots[roots.real >= 0], dtype=complex)


def _not_refuting(case: UnstablePlant, got: Any) -> str:
    """Tell what keeps a loop from being a counterexample."""
    if lack := not_around(case.process, got):
        return lack
    for kind, term, open_loop in (("A", "C Gm", got.CGm), ("B", "FH", got.FH)):
        if _visible(open_loop).size:
            return Lack(
                kind,
                f"1 + {term} has a zero on the right, so the lemma does not call this loop stable",
            )
    verdict = got.stability().stable
    if verdict is None:
        return AT_A_BORDER
    if verdict:
        return Lack("stable", "this loop is stable, as the lemma says")
    if alike(got.G, got.Gm):
        return Lack("matched", "the model is the plant itself, which was excluded")
    return ""


AT_A_BORDER = "there is no verdict on this loop, it is at a border; move away from it"


def _held(case: UnstablePlant, pole: float, gain: float) -> NRDOB:
    """Take a model with an unstable pole, and a controller that holds the model."""
    decay = case.decay + case.pole
    model = 1 / ((s - pole) * (s + decay))
    return NRDOB(case.process, model, gain * 2 * pole * decay, LowPassFilter(0.1 / case.pole, 2))


def _around_mirrored(
    case: UnstablePlant, value: float, sign: float = 1.0, hold: float = 0.5
) -> NRDOB:
    """Take the mirrored model, and a controller that gives C Gm a gain."""
    controller = sign * hold * case.pole * case.decay / case.gain
    return NRDOB(case.process, sign * mirrored(case), controller, LowPassFilter(value, 2))


LITERAL = Problem(
    id="2.5",
    title="Lemma 1, read literally",
    case=_unstable_plant,
    lacks=_not_refuting,
    praise=(
        "Right. Neither 1 + C Gm nor 1 + FH has a zero on the right, and yet the loop is not "
        "stable: a root of p_A or p_B has cancelled in the fraction and stays in the loop."
    ),
    misconceptions=(
        lacking(
            "matched",
            "the model is the plant itself",
            "A counterexample it is: with a matched model B = 1 has no zeros at all. But the "
            "problem asks for a model that differs from the plant. What is the least that the two "
            "must have in common?",
            lambda case: NRDOB(
                case.process,
                case.process,
                2 * case.pole * case.decay / case.gain,
                LowPassFilter(0.1 / case.pole, 2),
            ),
            marks=0.5,
        ),
        lacking(
            "stable",
            "a loop that is stable",
            "This loop is stable, so it does not contradict the lemma. You need the opposite: a "
            "loop that is not stable, and two fractions that do not show it. What makes a root "
            "disappear from a fraction?",
            lambda case: _around_mirrored(case, 0.1 / case.pole),
            marks=0.0,
        ),
        lacking(
            "B",
            "a root that is not hidden",
            "The loop is not stable, and 1 + FH shows it: it has a zero on the right, so the lemma "
            "gives the right warning. A root hides only where plant and model have it in "
            "common, to the last digit: near it, or elsewhere, nothing cancels.",
            lambda case: _held(case, 1.05 * case.pole, 1.0),
            marks=0.25,
        ),
        lacking(
            "A",
            "the controller does not hold the model",
            "1 + C Gm has a zero on the right: condition (i) of the lemma is not met, and then the "
            "lemma says nothing. Choose a controller that stabilises your model.",
            lambda case: _held(case, case.pole, -1.0),
            marks=0.25,
        ),
        lacking(
            "plant",
            "another plant",
            "This loop is not built around your plant. Take process=case.process, which is another "
            "one in every case, and compute the model from its pole, case.pole.",
            lambda case: NRDOB(4 / (2 - s - s**2), 4 / (2 - s - s**2), -2, LowPassFilter(0.05, 2)),
            marks=0.0,
        ),
    ),
)


# --- 2.6 A loop that should not exist -----------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class DistantZero(UnstablePlant):
    """A plant gain (1 - s/zero)/((s - pole)(s + decay)).

    Attributes
    ----------
    gain, pole, decay, zero : float
        The gain of either sign; the others positive, in rad/s. The zero is far beyond the pole.
    """

    zero: float

    @property
    def process(self) -> ct.TransferFunction:
        """The plant made of these numbers."""
        return (1 - s / self.zero) * super().process


def _distant_zero(rng: np.random.Generator) -> DistantZero:
    pole = draw(rng, 0.5, 3)
    return DistantZero(
        either_sign(rng) * draw(rng, 0.5, 5),
        pole,
        few(pole * rng.uniform(2, 5)),
        few(pole * rng.uniform(60, 150)),
    )


def _not_held(case: DistantZero, got: Any) -> str:
    """Tell why a loop is not the one that should not exist."""
    if lack := not_around(case.process, got):
        return lack
    verdict = got.stability()
    if verdict.stable:
        return ""
    if verdict.observer_loop.stable:
        if verdict.stable is None:
            return AT_A_BORDER
        return Lack("controller", "the controller does not stabilise the model (condition i)")
    shared = [
        root
        for root in verdict.observer_loop.roots
        if root.real > 0 and any(abs(root - r) < 1e-6 * abs(r) for r in (case.pole, case.zero))
    ]
    if shared:
        return Lack(
            "shared", "the model shares a root on the right with the plant, which stays in the loop"
        )
    if verdict.stable is None:
        return AT_A_BORDER
    if not right_half_plane_parity(got.process, got.model).holds:
        return Lack("sign", "p_B has an odd number of roots on the right for every λ and n")
    F = got.filter
    works = isinstance(F, LowPassFilter) and stabilizing_time_constants(
        got.process, got.model, F.order
    )
    if not works:
        return "with this model and order the filter does not stabilise p_B"
    kind = "fast" if F.time_constant <= works[0][0] else "slow"
    return Lack(kind, f"the filter is too {kind}, p_B has roots on the right")


def _with_shared_zero(case: DistantZero) -> NRDOB:
    model = (1 - s / case.zero) * mirrored(case)
    return NRDOB(case.process, model, 0, LowPassFilter(0.1 / case.pole, 2))


UNTURNED = Problem(
    id="2.6",
    title="A loop that should not exist",
    case=_distant_zero,
    lacks=_not_held,
    praise=(
        "Stable, in two ways. H does not make the turn of its unstable pole, because it must turn "
        "back for the plant's zero; FH makes it, because the filter has rolled off by then."
    ),
    misconceptions=(
        lacking(
            "shared",
            "a root shared on the right",
            "The model has a root on the right in common with the plant. In H it cancels, and the "
            "turns look better; in the loop it stays, for every filter 1/(λs + 1)^n. Leave the "
            "zero out of the model, and mirror the pole.",
            _with_shared_zero,
            marks=0.0,
        ),
        lacking(
            "sign",
            "the DC sign of the plant",
            "p_B has an odd number of roots on the right, and no λ and n change that: parity. One "
            "unstable pole of H asks for a model whose DC gain has the opposite sign of the "
            "plant's.",
            lambda case: _around_mirrored(case, 0.1 / case.pole, sign=-1.0),
            marks=0.25,
        ),
        lacking(
            "controller",
            "the controller does not hold the model",
            "The observer loop is stable, and that is the hard part. But the controller does not "
            "stabilise the model: condition (i). Look at p_A.",
            lambda case: _around_mirrored(case, 0.1 / case.pole, hold=-2.0),
            marks=0.5,
        ),
        lacking(
            "fast",
            "a filter that is too fast",
            "The model is good, and some filters stabilise this loop. Yours is too fast: it still "
            "works where the plant's distant zero does, and turns back as H does. Let it roll off "
            "before the zero.",
            lambda case: _around_mirrored(case, 0.2 / case.zero),
            marks=0.5,
        ),
        lacking(
            "slow",
            "a filter that is too slow",
            "The model is good, and some filters stabilise this loop. Yours is too slow: it has "
            "rolled off before FH has made the turn that the unstable pole needs. Make it faster "
            "than the pole.",
            lambda case: _around_mirrored(case, 2 / case.pole),
            marks=0.5,
        ),
    ),
)

PROBLEMS = (TURNS, READING, CLOSING, LITERAL, UNTURNED)
