"""Set 7: the bench, by calculation: encoder, difference equations, friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import ceil, exp, floor, inf, pi

import numpy as np

import nrdob
from nrdob.drives import Friction
from nrdob.loop import NRDOB
from nrdob.numerics import FloatArray

from .cases import s
from .comparing import rounds, same, unlike
from .drawing import apart, draw, few, fitting
from .problems import first_of, pose
from .reading import numbers

__all__ = ["COUNTING", "DIFFERENCE", "REST"]


# --- 7.1 What does one count cost? --------------------------------------------------------------

COUNTS = (500, 1000, 1024, 2000, 2048, 4000, 4096, 10_000)


@dataclass(frozen=True, eq=False)
class CountingCase:
    """A speed made of counts, and the observer that receives it.

    `counts`: of the encoder in one turn; `dt`: sampling time in s; `inertia`: of the model, in
    kg m²; `time_constant`: λ in s; `ripple`: largest jump of the torque, in N m.
    """

    counts: int
    dt: float
    inertia: float
    time_constant: float
    ripple: float

    def __repr__(self) -> str:
        return (
            f"{self.counts} counts, h = {1000 * self.dt:g} ms, J = {self.inertia:g} kg m², "
            f"λ = {1000 * self.time_constant:g} ms, ripple up to {self.ripple:g} N m"
        )


def _exact_window(case: CountingCase, turn: float = 2 * pi) -> float:
    """Give the window at which one count moves the torque by just the ripple, in samples."""
    return case.inertia / case.time_constant * turn / (case.counts * case.dt) / case.ripple


def _window(
    case: CountingCase,
    turn: float = 2 * pi,
    rounded: Callable[[float], int] = ceil,
    delay: Callable[[int], float] = lambda m: m / 2,
) -> tuple[float, int, float]:
    """Give the step, the window m, and its delay, which is asked for in samples here."""
    count = max(rounded(_exact_window(case, turn)), 1)
    return turn / (case.counts * case.dt), count, delay(count) * case.dt


@fitting(lambda case: 2 < _exact_window(case) < 25 and 0.03 < _exact_window(case) % 1 < 0.97)
def _counting_case(rng: np.random.Generator) -> CountingCase:
    counts, dt = int(rng.choice(COUNTS)), float(rng.choice([0.0005, 0.001, 0.002]))
    inertia, time_constant = draw(rng, 0.001, 0.03), draw(rng, 0.004, 0.03)
    jump = inertia / time_constant * 2 * pi / (counts * dt)
    return CountingCase(counts, dt, inertia, time_constant, few(jump / rng.uniform(3, 20)))


def _miscounted(case: CountingCase, got: FloatArray) -> dict[str, str]:
    jump = case.inertia / case.time_constant * got[0] / got[1] if got[1] > 0 else inf
    return unlike(
        _window(case),
        got,
        {
            "step": "the first number is not the speed, in rad/s, of one count in one sample",
            "m": f"with m = {got[1]:g} one count moves the torque by {jump:.3g} N m, and "
            f"{case.ripple:g} N m are allowed: m is the smallest whole number with which it keeps "
            "to that",
            "delay": "the last number is not the delay of that speed",
        },
    )


COUNTING = pose(
    "7.1",
    case=_counting_case,
    reads=partial(numbers, names="step, m, delay"),
    lacks=first_of(_miscounted),
    parts=_miscounted,
    rounded=lambda case, got: rounds(_window(case), got),
    misconceptions={
        "turns taken for radians": partial(_window, turn=1.0),
        "rounded down": partial(_window, rounded=floor),
        "the whole window taken for the delay": partial(_window, delay=lambda m: m),
        "the last difference taken as prompt": partial(_window, delay=lambda m: (m - 1) / 2),
    },
)


# --- 7.2 Tustin by hand -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DifferenceCase:
    """The block F/Gm with F = 1/(λs + 1) and Gm = 1/(Js + b), and a sampling time.

    `inertia`: J in kg m²; `friction`: b in N m s; `time_constant`: λ in s; `dt`: h in s.
    """

    inertia: float
    friction: float
    time_constant: float
    dt: float

    def __repr__(self) -> str:
        return (
            f"J = {self.inertia:g} kg m², b = {self.friction:g} N m s, "
            f"λ = {1000 * self.time_constant:g} ms, h = {1000 * self.dt:g} ms"
        )


Row = tuple[float, float, float]
"""c0, c1 and a of ``w[k] = c0 y[k] + c1 y[k-1] + a w[k-1]``."""


def _row(case: DifferenceCase, dz: float, one: float) -> Row:
    """Put s = dz (z - 1)/(1 + one (z - 1)) into (Js + b)/(λs + 1), both over the factor of z."""
    J, b, value = case.inertia, case.friction, case.time_constant
    lead = value * dz + one
    return (
        (J * dz + b * one) / lead,
        (b * (1 - one) - J * dz) / lead,
        (value * dz - (1 - one)) / lead,
    )


def _tustin(case: DifferenceCase) -> Row:
    return _row(case, 1 / case.dt, 0.5)


def _held(case: DifferenceCase) -> Row:
    """Give the block behind a hold: J/λ at once, and the rest with the pole exp(-h/λ)."""
    prompt, pole = case.inertia / case.time_constant, exp(-case.dt / case.time_constant)
    return prompt, case.friction * (1 - pole) - prompt, pole


DIFFERENCE_MISTAKES: dict[str, Callable[[DifferenceCase], Row]] = {
    "Euler's forward rule": lambda case: _row(case, 1 / case.dt, 0.0),
    "Euler's backward rule": lambda case: _row(case, 1 / case.dt, 1.0),
    "the 2 of 2/h left out": lambda case: _row(case, 0.5 / case.dt, 0.5),
    "a hold in front of the block": _held,
    "the old value with the sign of the denominator": lambda case: (
        *_tustin(case)[:2],
        -_tustin(case)[2],
    ),
}


@fitting(
    lambda case: apart(_tustin(case), *(wrong(case) for wrong in DIFFERENCE_MISTAKES.values()))
)
def _difference_case(rng: np.random.Generator) -> DifferenceCase:
    value = draw(rng, 0.004, 0.03)
    inertia = draw(rng, 0.001, 0.03)
    friction = few(inertia * rng.uniform(3, 20))
    return DifferenceCase(inertia, friction, value, few(value / rng.uniform(1.5, 6)))


def _difference_lacks(case: DifferenceCase, got: FloatArray) -> str:
    c0, c1, a = got
    if same(_tustin(case), (c0, c1, a)):
        return ""
    rest = (c0 + c1) / (1 - a) if a != 1 else inf
    if not same(case.friction, rest):
        return (
            f"for a constant y this comes to rest at w = {rest:.4g} y, and F/Gm at "
            f"{case.friction:g} y"
        )
    return (
        "for a constant y it is right, but it is not Tustin's rule: put 2/h (z - 1)/(z + 1) for s"
    )


DIFFERENCE = pose(
    "7.2",
    case=_difference_case,
    reads=partial(numbers, names="c0, c1, a"),
    lacks=_difference_lacks,
    rounded=lambda case, got: rounds(_tustin(case), got),
    misconceptions=DIFFERENCE_MISTAKES,
)


# --- 7.5 Where does it rest? --------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RestCase:
    """A motor with friction, and two position loops around the same model.

    `calm` and `keen`: NRDOB, 1 - F with one zero at s = 0 and with two; `friction`: what holds the
    motor; `error`: where it stands in the second loop, in rad beside the reference.
    """

    calm: NRDOB
    keen: NRDOB
    friction: Friction
    error: float

    def __repr__(self) -> str:
        J, b = self.calm.fractions.Gm.den[:2] / self.calm.fractions.Gm.num[-1]
        return (
            f"model 1/(s({J:g} s + {b:g})), breaks away at {self.friction.breakaway:g} N m, "
            f"moves at {self.friction.coulomb:g} N m + {self.friction.viscous:g} ω, "
            f"λ = {_constants(self)[0]:.3g} s, error {self.error:g} rad"
        )


def _constants(case: RestCase) -> tuple[float, float]:
    """Give λ of both filters, and the friction of the model."""
    den = case.calm.fractions.F.den  # (λs + 1)²
    Gm = case.calm.fractions.Gm
    return float((den[0] / den[-1]) ** 0.5), float(Gm.den[1] / Gm.num[-1])


def _rest(case: RestCase) -> tuple[float, float]:
    """Give the widest rest, ``|S_δ(0)|`` times stiction, and the time from -stiction to it.

    S_δ(0) is that of (1 - F)Gm, whatever the plant's own friction is: K(0)G(0) is infinite.
    """
    value, friction = _constants(case)
    holds = case.friction.breakaway
    return 2 * value / friction * holds, 2 * holds * 3 * value**2 / friction / case.error


def _times_rest(case: RestCase, widest: float, climb: float) -> tuple[float, float]:
    right = _rest(case)
    return right[0] * widest, right[1] * climb


def _by_the_controller(case: RestCase) -> tuple[float, float]:
    C = case.calm.fractions.C
    return case.friction.breakaway / float(C.num[-1] / C.den[-1]), _rest(case)[1]


REST_MISTAKES: dict[str, Callable[[RestCase], tuple[float, float]]] = {
    "friction in motion taken for the break-away": lambda case: _times_rest(
        case, *[case.friction.coulomb / case.friction.breakaway] * 2
    ),
    "the plant's friction taken for the model's": lambda case: _times_rest(
        case, *[_constants(case)[1] / case.friction.viscous] * 2
    ),
    "the controller's stiffness alone": _by_the_controller,
    "the torque starts from zero": lambda case: _times_rest(case, 1.0, 0.5),
}


def _tells_apart(case: RestCase) -> bool:
    return all(loop.stability().stable for loop in (case.calm, case.keen)) and apart(
        _rest(case), *(wrong(case) for wrong in REST_MISTAKES.values())
    )


@fitting(_tells_apart)
def _rest_case(rng: np.random.Generator) -> RestCase:
    inertia = draw(rng, 0.002, 0.02)
    friction = few(inertia * rng.uniform(5, 15))
    value = draw(rng, 0.01, 0.04)
    angle = 1 / (s * (inertia * s + friction))
    stiff = few(inertia * (0.3 / value) ** 2 * 9)
    lead = stiff + few(stiff * 0.04) * s / (0.2 * value * s + 1)
    own = few(friction * rng.uniform(1.3, 2.0))
    process = 1 / (s * (inertia * s + own))
    calm, keen = (
        NRDOB(process, angle, lead, nrdob.interpolating_filter(angle, value, ramp=ramp))
        for ramp in (1, 2)
    )
    dry = draw(rng, 0.05, 0.3)
    held = Friction(dry, few(dry * rng.uniform(1.3, 1.8)), 0.05, own)
    return RestCase(calm, keen, held, draw(rng, 0.005, 0.05))


def _unrested(case: RestCase, got: FloatArray) -> dict[str, str]:
    needed = got[0] / _rest(case)[0] * case.friction.breakaway
    return unlike(
        _rest(case),
        got,
        {
            "widest": f"at {got[0]:.3g} rad beside the reference the calm loop pushes with "
            f"{needed:.3g} N m, and the motor breaks away at {case.friction.breakaway:g} N m",
            "climb": "the widest rest is right, the time is not: while y stands, S_δ(s) ≈ A s says "
            "how fast the torque climbs that an error makes",
        },
    )


REST = pose(
    "7.5",
    case=_rest_case,
    reads=partial(numbers, names="widest, climb"),
    lacks=first_of(_unrested),
    parts=_unrested,
    rounded=lambda case, got: rounds(_rest(case), got),
    misconceptions=REST_MISTAKES,
)
