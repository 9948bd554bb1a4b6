"""Set 2: counting encirclements, and Lemma 1."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import control as ct
import numpy as np

from nrdob import NRDOB, LowPassFilter, stabilizing_time_constants
from nrdob.analysis import judge, resolved_frequencies
from nrdob.design import right_half_plane_parity
from nrdob.numerics import ComplexArray, FloatArray, QuasiPolynomial

from .cases import LoopCase, UnstablePlant, alike, around, factored, mirrored, on_the_right, s
from .comparing import same, unlike
from .drawing import apart, draw, either_sign, few, first_fitting, kept
from .problems import Misconception, first_of, lack_of, lacking, lacks_of, pose, reading
from .reading import number as one_number
from .reading import numbers

__all__ = ["CLOSING", "LITERAL", "READING", "TURNS", "UNTURNED"]


# --- 2.1 Turns from a list of roots -------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RootsCase:
    """A loop, taken apart into roots."""

    plant_zeros: ComplexArray  # of G and of the model, before anything cancels
    plant_poles: ComplexArray
    model_zeros: ComplexArray
    model_poles: ComplexArray
    closed_loop_roots: ComplexArray  # of p_B

    def __repr__(self) -> str:
        names = "plant_zeros", "plant_poles", "model_zeros", "model_poles", "closed_loop_roots"
        found = [f"{on_the_right(getattr(self, name))} {name.replace('_', ' ')}" for name in names]
        return f"in the right half plane: {', '.join(found)}"


def _roots_case(rng: np.random.Generator) -> RootsCase:
    """Draw a loop whose plot turns either way, once or more often, with equal chances."""
    low, high = ((-9, -1), (1, 1), (2, 9))[int(rng.integers(3))]

    def fits(drawn: tuple[RootsCase, NRDOB]) -> bool:
        case, loop = drawn
        return (
            low <= _turns(case) <= high
            and apart(_turns(case), *(wrong(case) for wrong in TURN_MISTAKES.values()))
            and loop.stability().observer_loop.stable is not None
        )

    def drawn() -> tuple[RootsCase, NRDOB]:
        return _draw_roots(rng, 2 if low < 0 else int(rng.integers(1, 3)))

    return first_fitting(drawn, fits)[0]


def _draw_roots(rng: np.random.Generator, unstable: int) -> tuple[RootsCase, NRDOB]:
    """Draw a loop with so many unstable poles of the plant, and as many zeros of the model."""
    plant_zeros = _draw_sides(rng, int(rng.integers(0, 3)), 1)
    plant_poles = _draw_sides(rng, unstable, 2)
    model_zeros = _draw_sides(rng, unstable, 1)
    model_poles = _draw_sides(rng, 3 - unstable, unstable + 1)
    gain = rng.choice([-1, 1]) * draw(rng, 0.5, 9)
    plant = gain * np.real(np.poly(plant_zeros)), np.real(np.poly(plant_poles))
    model = np.real(np.poly(model_zeros)), np.real(np.poly(model_poles))
    loop = NRDOB(plant, model, 0, LowPassFilter(draw(rng, 0.01, 2), 3))
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


def _roots_and_poles(case: RootsCase) -> tuple[int, int]:
    return on_the_right(case.closed_loop_roots), on_the_right(case.plant_poles, case.model_zeros)


def _turns(case: RootsCase) -> float:
    Z, P = _roots_and_poles(case)
    return Z - P


TURN_MISTAKES: dict[str, Callable[[RootsCase], float]] = {
    "counter-clockwise counted as positive": lambda case: -_turns(case),
    "Z and P added": lambda case: sum(_roots_and_poles(case)),
    "poles of the model for its zeros": lambda case: (
        _turns(case) + on_the_right(case.model_zeros) - on_the_right(case.model_poles)
    ),
    "zeros of the model forgotten": lambda case: _turns(case) + on_the_right(case.model_zeros),
    "the encirclements of a stable loop": lambda case: -_roots_and_poles(case)[1],
}

TURNS = pose(
    "2.1",
    case=_roots_case,
    reads=one_number,
    lacks=lambda case, got: (
        "" if same(_turns(case), got) else lack_of("2.1", "turns", ZP=_roots_and_poles(case))
    ),
    misconceptions=TURN_MISTAKES,
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
    filter = LowPassFilter(draw(rng, 0.05, 2), 3 if wanted == 2 else 2)
    return PlotCase(NRDOB(g * above / below * model, model, 0, filter))


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


Reading = tuple[float, float, float]


@kept
def _reading(case: PlotCase) -> Reading:
    found = case.loop.stability().observer_loop
    return found.encirclements or 0, found.open_loop_rhp, found.closed_loop_rhp or 0


def _misread(wrong: Callable[[float, float, float], Reading]) -> Callable[[PlotCase], Reading]:
    return lambda case: wrong(*_reading(case))


def _misread_numbers(case: PlotCase, got: FloatArray) -> dict[str, str]:
    return unlike(_reading(case), got, lacks_of("2.3"))


READING = pose(
    "2.3",
    case=_plot_case,
    reads=partial(numbers, names="N, P, Z", gaps=True),
    lacks=first_of(_misread_numbers),
    parts=_misread_numbers,
    own=True,
    misconceptions={
        "P counted after cancellation": _misread(lambda N, P, Z: (N, P - 1, Z - 1)),
        "Z = P - N for clockwise encirclements": _misread(lambda N, P, Z: (N, P, P - N)),
        "the other convention, used consistently": _misread(lambda N, P, Z: (-N, P, Z)),
        "encirclements counted in the wrong sense": _misread(lambda N, P, Z: (-N, P, P - N)),
    },
)


# --- 2.4 Close the curve ------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class HalfCurve:
    """What is known of a function H: its values, and how it behaves at both ends."""

    omega: FloatArray = field(repr=False)  # in rad/s, from far below all corners to far above
    values: ComplexArray = field(repr=False)  # H at j omega
    poles_at_zero: int  # of H, at s = 0
    excess: int  # degree of the numerator, less that of the denominator

    def __repr__(self) -> str:
        return (
            f"poles_at_zero = {self.poles_at_zero}, excess = {self.excess}, H at 1 rad/s about "
            f"{np.round(np.interp(1.0, self.omega, self.values), 2)}"
        )


def _half_curve(way: int, rng: np.random.Generator) -> HalfCurve:
    """Draw a curve that turns clockwise, 1, or the other way, -1."""

    def drawn() -> tuple[HalfCurve, FloatArray, FloatArray]:
        zeros, poles, integrators, size = first_fitting(
            lambda: _draw_ratio(rng), lambda r: way * (on_the_right(r[0]) - on_the_right(r[1])) > 0
        )
        above, below = np.poly(zeros), np.append(np.poly(poles), np.zeros(integrators))
        omega = np.geomspace(1e-5, 1e5, 5001)
        ratio = np.polyval(above, 1j * omega) / np.polyval(below, 1j * omega)
        # Small in the middle, so that the encirclements of -1 are not those of 0.
        gain = np.sign(size) * few(abs(size) / np.abs(ratio).min())
        curve = HalfCurve(omega, gain * ratio - 1, integrators, above.size - below.size)
        return curve, gain * above, below

    def fits(drawn: tuple[HalfCurve, FloatArray, FloatArray]) -> bool:
        case, above, below = drawn
        return _unambiguous(case) and _closed(case) == (
            judge("H", [QuasiPolynomial(below)], QuasiPolynomial(above)).encirclements
        )

    return first_fitting(drawn, fits)[0]


def _draw_ratio(rng: np.random.Generator) -> tuple[list[float], list[float], int, float]:
    """Draw a plant with integrators over a model with more lags: zeros, poles, and the size."""
    integrators, excess, others = (int(k) for k in rng.integers(1, 3, 3))
    poles, zeros = (
        [side * draw(rng, 0.3, 9) for side in rng.choice([-1, 1], degree, p=[0.6, 0.4])]
        for degree in (others, others + integrators + excess)
    )
    return zeros, poles, integrators, rng.choice([-1, 1]) * rng.uniform(0.1, 0.5)


def _unambiguous(case: HalfCurve) -> bool:
    """Whether every mistake gives a number of its own, which does not round to the right one."""
    right, found = _closed(case), _readings(case)
    names = ("axis only", "half circle missing", "around zero", "one half")
    return (
        apart(right, -right, *(found[name] for name in names), *_hints(case), by=0.05)
        and apart(right, found["detour missing"], *_hints(case), by=0.05)
        and all(abs(found[name] - right) > 0.4 for name in ("jumps", "one half"))
        # Clockwise curves of which this is true, too, are too rare to be found.
        and (right > 0 or apart(found["jumps"], found["around zero"], by=0.05))
    )


def _clockwise(values: ComplexArray) -> float:
    """Clockwise encirclements of 0 by a curve, by adding up small angles."""
    return float(-np.angle(values[1:] / values[:-1]).sum() / (2 * np.pi))


@kept
def _readings(case: HalfCurve) -> dict[str, float]:
    """Add up the turns, rightly but for rounding and wrongly, and those of the closing pieces."""
    detour, half_circle = case.poles_at_zero / 2, case.excess / 2
    on_page, pieces = _clockwise(1 + case.values), detour + half_circle
    first, last = np.angle(1 + case.values[[0, -1]])  # as NumPy gives them, between -π and π
    return {
        "right": 2 * on_page + pieces,
        "pieces": pieces,
        "axis only": 2 * on_page,
        "half circle missing": 2 * on_page + detour,
        "detour missing": 2 * on_page + half_circle,
        "around zero": 2 * _clockwise(case.values) + pieces,
        "one half": on_page + pieces,
        "jumps": float((first - last) / np.pi) + pieces,
    }


def _closed(case: HalfCurve) -> float:
    return round(_readings(case)["right"])


def _near(value: float, got: float) -> bool:
    """Tell whether a count is a value, or a value between two counts made whole."""
    return abs(got - value) < 0.05 or (
        abs(value - round(value)) > 0.05 and got in (np.floor(value), np.ceil(value))
    )


def _hints(case: HalfCurve) -> dict[float, str]:
    axis, pieces = _readings(case)["axis only"], _readings(case)["pieces"]
    slips = axis / 2, axis - pieces, axis + 2 * pieces, pieces - axis
    said = lacks_of("2.4", "half", "backwards", "whole", "sign").values()
    return dict(zip(slips, said, strict=True))


def _closing_lacks(case: HalfCurve, got: float) -> str:
    for value, hint in ({_closed(case): ""} | _hints(case)).items():
        if abs(got - value) < 0.05:
            return hint
    if abs(got - np.round(got)) > 0.05:
        return "a closed curve encircles a point a whole number of times"
    return "that many encirclements do not fit the unstable zeros of 1 + H and poles of H"


CLOSING = pose(
    "2.4",
    alike=_near,
    case=(partial(_half_curve, 1), partial(_half_curve, -1)),
    reads=one_number,
    lacks=_closing_lacks,
    misconceptions={
        "cut off instead of rounded": Misconception(
            lambda case: int(_readings(case)["right"]),
            lambda case, got: same(int(_readings(case)["right"]), got),
        ),
        "angles that jump": reading(_readings, "jumps"),
        # Before the curve left open: half a turn apart, one may be rounded to the other.
        "one of the two closing pieces forgotten": reading(
            _readings, "half circle missing", "detour missing"
        ),
        "the curve left open": reading(_readings, "axis only"),
        "counter-clockwise counted as positive": lambda case: -_closed(case),
        "encirclements of 0": reading(_readings, "around zero"),
        "negative frequencies forgotten": reading(_readings, "one half"),
    },
)


# --- 2.5 Lemma 1, read literally ----------------------------------------------------------------


def _unstable_plant(rng: np.random.Generator) -> UnstablePlant:
    pole = draw(rng, 0.5, 3)
    return UnstablePlant(draw(rng, 0.5, 5), pole, few(pole * rng.uniform(1.5, 4)))


@around
def _not_refuting(case: UnstablePlant, got: NRDOB) -> str:
    # After cancellation: what Lemma 1 read literally looks at.
    for kind, open_loop in (("A", got.CGm), ("B", got.FH)):
        if np.any(ct.feedback(1, open_loop.to_tf()).poles().real >= 0):
            return lack_of("2.5", kind)
    verdict = got.stability().stable
    if verdict is None:
        return AT_A_BORDER
    if verdict:
        return lack_of("2.5", "stable")
    if alike(got.G, got.Gm):
        return lack_of("2.5", "matched")
    return ""


AT_A_BORDER = "there is no verdict on this loop, it is at a border; move away from it"


def _around(case: UnstablePlant, model: ct.TransferFunction, controller: float) -> NRDOB:
    return NRDOB(case.process, model, controller, LowPassFilter(0.1 / case.pole, 2))


def _held(case: UnstablePlant, pole: float, gain: float) -> NRDOB:
    """Take a model with an unstable pole, and a controller that holds the model."""
    decay = case.decay + case.pole
    return _around(case, 1 / ((s - pole) * (s + decay)), gain * 2 * pole * decay)


def _around_mirrored(
    case: UnstablePlant, value: float, sign: float = 1.0, hold: float = 0.5
) -> NRDOB:
    """Take the mirrored model, and a controller that gives C Gm a gain."""
    controller = sign * hold * case.pole * case.decay / case.gain
    return NRDOB(case.process, sign * mirrored(case), controller, LowPassFilter(value, 2))


LITERAL = pose(
    "2.5",
    case=_unstable_plant,
    lacks=_not_refuting,
    misconceptions={
        "the model is the plant itself": lacking(
            "matched",
            lambda case: _around(case, case.process, 2 * case.pole * case.decay / case.gain),
        ),
        "a loop that is stable": lacking(
            "stable", lambda case: _around_mirrored(case, 0.1 / case.pole)
        ),
        "a root that is not hidden": lacking("B", lambda case: _held(case, 1.05 * case.pole, 1.0)),
        "the controller does not hold the model": lacking(
            "A", lambda case: _held(case, case.pole, -1.0)
        ),
        "another plant": lacking(
            "plant",
            lambda case: NRDOB(4 / (2 - s - s**2), 4 / (2 - s - s**2), -2, LowPassFilter(0.05, 2)),
        ),
    },
)


# --- 2.6 A loop that should not exist -----------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class DistantZero(UnstablePlant):
    """A plant gain (1 - s/zero)/((s - pole)(s + decay))."""

    zero: float  # positive, in rad/s, far beyond the pole

    @property
    def process(self) -> ct.TransferFunction:
        """The plant made of these numbers."""
        return (1 - s / self.zero) * super().process


def _distant_zero(rng: np.random.Generator) -> DistantZero:
    pole = draw(rng, 0.5, 3)
    gain = either_sign(rng) * draw(rng, 0.5, 5)
    decay, zero = few(pole * rng.uniform(2, 5)), few(pole * rng.uniform(60, 150))
    return DistantZero(gain, pole, decay, zero)


@around
def _not_held(case: DistantZero, got: NRDOB) -> str:
    """Tell why a loop is not the one that should not exist."""
    verdict = got.stability()
    if verdict.stable:
        return ""
    if verdict.observer_loop.stable:
        if verdict.stable is None:
            return AT_A_BORDER
        return lack_of("2.6", "controller")
    own = np.array([case.pole, case.zero])
    if np.any(np.abs(np.subtract.outer(verdict.observer_loop.roots, own)) < 1e-6 * own):
        return lack_of("2.6", "shared")
    if verdict.stable is None:
        return AT_A_BORDER
    if not right_half_plane_parity(got.process, got.model).holds:
        return lack_of("2.6", "sign")
    F = got.filter
    lowpass = isinstance(F, LowPassFilter)
    works = lowpass and stabilizing_time_constants(got.process, got.model, F.order)
    if not works:
        return lack_of("2.6", "filter")
    return lack_of("2.6", "fast" if F.time_constant <= works[0][0] else "slow")


UNTURNED = pose(
    "2.6",
    case=_distant_zero,
    lacks=_not_held,
    misconceptions={
        "a root shared in the right half plane": lacking(
            "shared", lambda case: _around(case, (1 - s / case.zero) * mirrored(case), 0)
        ),
        "the DC sign of the plant": lacking(
            "sign", lambda case: _around_mirrored(case, 0.1 / case.pole, sign=-1.0)
        ),
        "the controller does not hold the model": lacking(
            "controller", lambda case: _around_mirrored(case, 0.1 / case.pole, hold=-2.0)
        ),
        "a filter that is too fast": lacking(
            "fast", lambda case: _around_mirrored(case, 0.2 / case.zero)
        ),
        "a filter that is too slow": lacking(
            "slow", lambda case: _around_mirrored(case, 2 / case.pole)
        ),
    },
)
