"""Set 1: the loop and its equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial, reduce
from math import log, log10, nan, pi
from typing import Any

import control as ct
import numpy as np

from nrdob.diagram import LowPassFilter, ObserverEquations, as_fraction
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray, FloatArray
from nrdob.plotting import SHORT, Figure, axes_for, colour_of, styled

from .cases import LoopCase, apart, draw, few, first_fitting
from .problems import (
    FOUR_DIGITS,
    Lack,
    Misconception,
    Problem,
    answers_like,
    lacking,
    near,
    read_as,
    rounds,
)
from .reading import UnreadableError, block, lowpass, number, numbers, polynomial, things

__all__ = ["INPUTS", "PROBLEMS", "PolynomialCase", "SettledCase", "TwinCase", "WishCase"]

POINTS = np.array([0.3 + 0.2j, 0.7j, 1 + 2j, 5j, 3 + 9j, 20j, 40 + 10j, 90j])
"""Where functions of s are compared."""


def _gain_error(rng: np.random.Generator) -> float:
    """Draw a ratio that is surely not 1: a plant weaker or stronger than its model."""
    return float(rng.uniform(1.6, 2.4) ** rng.choice([-1, 1]))


# --- 1.1 What is left when all has settled ------------------------------------------------------


@dataclass(frozen=True, eq=False)
class SettledCase:
    """Gains at s = 0 of a stable loop with F(0) = 1.

    Attributes
    ----------
    G, Gm, C : float
        Of the plant, the model and the controller.
    """

    G: float
    Gm: float
    C: float

    def __repr__(self) -> str:
        return f"G(0) = {self.G:g}, Gm(0) = {self.Gm:g}, C(0) = {self.C:g}"


INPUTS = ("R", "delta", "d", "eta")

Table = dict[str, tuple[float, float, float]]


def _settled_case(rng: np.random.Generator) -> SettledCase:
    model = draw(rng, 0.5, 4)
    return SettledCase(few(model * _gain_error(rng)), model, draw(rng, 0.4, 3))


def settled_table(case: SettledCase) -> Table:
    e = 1 / (1 + case.C * case.Gm)
    return {
        "R": (1 - e, (1 - e) / case.G, e),
        "delta": (0.0, -1.0, 0.0),
        "d": (0.0, -1 / case.G, 0.0),
        "eta": (-1.0, -1 / case.G, 0.0),
    }


def _table(given: Any) -> FloatArray:
    """Read a row for each input; a row that cannot be read is filled with nan."""
    if not isinstance(given, Mapping):
        raise UnreadableError(f"a dictionary is asked for, with the keys {', '.join(INPUTS)}")
    return np.array([_row(given.get(name)) for name in INPUTS])


def _row(given: Any) -> FloatArray:
    try:
        return numbers(given, "y, u, e")
    except UnreadableError:
        return np.full(3, nan)


def _unsatisfied(case: SettledCase, name: str, row: FloatArray) -> str:
    """Tell which line of the diagram a row does not satisfy."""
    R, delta, d, eta = (float(name == each) for each in INPUTS)
    y, u, e = (float(value) for value in row)
    if not np.isfinite(row).all():
        return f"under {name!r} three numbers are asked for, (y, u, e)"
    lines = {
        "e = R - yf, with yf = y + eta": (e, R, -y, -eta),
        "u = C e + F u - (F/Gm)(y + eta)": (u, case.C * e, u, -y / case.Gm, -eta / case.Gm),
        "y = G (u + delta) + d": (y, case.G * u, case.G * delta, d),
    }
    for line, (left, *terms) in lines.items():
        size = abs(left) + np.abs(terms).sum()
        if abs(left - sum(terms)) > FOUR_DIGITS * max(size, 0.1):  # no step but one, of size 1
            return (
                f"after a step of {name}, the line {line} is not satisfied, where F = 1: "
                f"{left:.4g} on the left, {sum(terms):.4g} on the right"
            )
    return ""


def _unsettled(case: SettledCase, rows: FloatArray) -> dict[str, str]:
    return {name: _unsatisfied(case, name, row) for name, row in zip(INPUTS, rows, strict=True)}


def _settled_lacks(case: SettledCase, rows: FloatArray) -> str:
    return next(filter(None, _unsettled(case, rows).values()), "")


def _same_table(expected: Table, rows: FloatArray) -> bool:
    return bool(np.allclose(_table(expected), rows, rtol=1e-3, atol=1e-6))


_settled_like = partial(answers_like, close=_same_table)


def _ordinary_loop(case: SettledCase) -> Table:
    """Settle an ordinary loop of controller and plant, without an observer."""
    S = 1 / (1 + case.C * case.G)
    return {
        "R": (1 - S, case.C * S, S),
        "delta": (case.G * S, -case.C * case.G * S, -case.G * S),
        "d": (S, -case.C * S, -S),
        "eta": (S - 1, -case.C * S, -S),
    }


SETTLED = Problem(
    id="1.1",
    title="What is left when all has settled",
    case=_settled_case,
    reads=_table,
    lacks=_settled_lacks,
    parts=lambda case, rows: {name: not lack for name, lack in _unsettled(case, rows).items()},
    rounded=lambda case, rows: rounds(_table(settled_table(case)), rows),
    praise=(
        "Right. The observer brings y back after both disturbances, follows the noise, and leaves "
        "the error of the reference to C and the model; e sees nothing but R."
    ),
    misconceptions=(
        _settled_like(
            "an ordinary loop of C and G",
            "This is the loop of C and G alone, without an observer: in it e is R - y - eta. In "
            "the NR-DOB the controller is told yf, and u has two more terms. Write the three "
            "lines of the diagram once more, with F = 1, and solve them.",
            _ordinary_loop,
            0.0,
        ),
        _settled_like(
            "plant input taken for the controller's output",
            "All is right but u after a load: 0 is what the plant gets, u + delta. The "
            "controller's output u itself must cancel the load. (Equation (7) of the paper has "
            "the same mix-up.)",
            lambda case: settled_table(case) | {"delta": (0.0, 0.0, 0.0)},
            0.75,
        ),
        _settled_like(
            "noise with a plus sign",
            "Look at the sign after a step of eta. The loop believes the sensor: if that reads "
            "one unit too much, by how much, and in which direction, does the loop move y?",
            lambda case: settled_table(case) | {"eta": (1.0, 1 / case.G, 0.0)},
            0.75,
        ),
        _settled_like(
            "the observer tracks the reference",
            "After a step of R you let y reach 1. The observer does integrate, but it acts on what "
            "the model did not foresee; the reference is foreseen. What remains of R is up to C "
            "and the model, and C(0) is finite here: solve e = R - Gm C e.",
            lambda case: settled_table(case) | {"R": (1.0, 1 / case.G, 0.0)},
            0.75,
        ),
        _settled_like(
            "the model's gain in place of the plant's",
            "y and e are right. But u is found from the true plant, y = G (u + delta) + d, and "
            "you divided by the gain of the model. Where the model is wrong, the observer makes "
            "u differ.",
            lambda case: {
                name: (y, u if name == "delta" else u * case.G / case.Gm, e)
                for name, (y, u, e) in settled_table(case).items()
            },
            0.5,
        ),
    ),
)


# --- 1.3 The polynomial of the observer ---------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PolynomialCase:
    """Polynomials of a loop, coefficients in descending powers of s.

    Attributes
    ----------
    N, D, Nm, Dm : array of float
        Plant N/D and model Nm/Dm.
    time_constant : float
        λ of the filter, in seconds.
    order : int
        n of the filter.
    """

    N: FloatArray
    D: FloatArray
    Nm: FloatArray
    Dm: FloatArray
    time_constant: float
    order: int

    def __repr__(self) -> str:
        blocks = (f"{name} = {np.round(getattr(self, name), 4).tolist()}" for name in _PARTS)
        return f"{', '.join(blocks)}, λ = {self.time_constant:g} s, n = {self.order}"


_PARTS = ("N", "D", "Nm", "Dm")


def _polynomial_case(rng: np.random.Generator) -> PolynomialCase:
    # Plant and model share the pole on the right, exactly, as a careful modeller would have it.
    shared = -draw(rng, 0.5, 3)
    plant, model, zero = draw(rng, 1, 2), draw(rng, 2.5, 5), draw(rng, 6, 12)
    return PolynomialCase(
        N=np.array([draw(rng, 2, 9)]),
        D=np.polymul([1, shared], [1, plant]),
        Nm=draw(rng, 0.3, 0.8) * np.array([1, zero]),
        Dm=np.polymul([1, shared], [1, model]),
        time_constant=draw(rng, 0.05, 0.4),
        order=int(rng.integers(2, 4)),
    )


def _product(*factors: Any) -> FloatArray:
    return np.asarray(reduce(np.polymul, factors))


def _lags(case: PolynomialCase) -> FloatArray:
    return LowPassFilter(case.time_constant, case.order).den


def _p_B(case: PolynomialCase) -> FloatArray:
    F = LowPassFilter(case.time_constant, case.order)
    return ObserverEquations((case.N, case.D), (case.Nm, case.Dm), F).p_B.q


def _disturbance_to_output(case: PolynomialCase, s: complex) -> complex:
    """Solve the three lines of the diagram at one s for y, after a unit of d."""
    G = np.polyval(case.N, s) / np.polyval(case.D, s)
    Gm = np.polyval(case.Nm, s) / np.polyval(case.Dm, s)
    F = 1 / np.polyval(_lags(case), s)
    C = 1.0  # any: it does not matter for y after d
    left = np.array([[1, (1 - F) * Gm, F], [-C, 1 - F, F / Gm], [0, -G, 1]])
    return complex(np.linalg.solve(left, np.array([0, 0, 1]))[2])


def _polynomial_lacks(case: PolynomialCase, p: FloatArray) -> str:
    degree = case.D.size + case.Nm.size - 2 + case.order
    if p.size - 1 != degree:
        return (
            f"it has degree {p.size - 1}; plant, inverse model and filter together have "
            f"{degree} modes, and all of them must be in p_B"
        )
    # What S_d is divided by: S_d p_B must be the numerator D Nm (Df - 1), but for a constant.
    numerator = _product(case.D, case.Nm, np.polysub(_lags(case), [1.0]))
    S_d = np.array([_disturbance_to_output(case, s) for s in POINTS])
    share = S_d / np.polyval(numerator, POINTS)
    factor = share * np.polyval(p, POINTS)
    # Where terms cancel, four digits of each are fewer of the sum.
    slack = 2 * FOUR_DIGITS * np.abs(share) * np.polyval(np.abs(p), np.abs(POINTS))
    if np.any(np.abs(factor - factor[-1]) > slack):
        return (
            "S_d, solved from the diagram at a few s, is not D Nm (Df - Nf) divided by it; check "
            "both terms of p_B, and their sign"
        )
    return ""


def _same_roots(expected: FloatArray, p: FloatArray) -> bool:
    """Compare up to a constant factor."""
    held = polynomial(expected)
    return p.size == held.size and bool(np.allclose(p / p[0], held / held[0], rtol=FOUR_DIGITS))


_polynomial_like = partial(answers_like, close=_same_roots)


def _without_shared(case: PolynomialCase) -> FloatArray:
    shared = polynomial(case.D - case.Dm)  # vanishes where both do
    return np.asarray(np.polydiv(_p_B(case), shared)[0])


def _of_sign(case: PolynomialCase, sign: float) -> FloatArray:
    """Give p_B with this sign before its second term."""
    first = _product(case.D, case.Nm, np.polysub(_lags(case), [1.0]))
    return np.polyadd(first, sign * _product(case.N, case.Dm))


POLYNOMIAL = Problem(
    id="1.3",
    title="The polynomial of the observer",
    case=_polynomial_case,
    reads=polynomial,
    lacks=_polynomial_lacks,
    rounded=lambda case, p: rounds(_p_B(case), p),
    praise=(
        "Right, and nothing is lost: the pole that plant and model share on the right is a root of "
        "p_B, so this loop is unstable with every filter 1/(λs + 1)^n."
    ),
    misconceptions=(
        _polynomial_like(
            "cancelled the unstable pole",
            "One root is missing: the pole that plant and model share. It cancels in the function "
            "1 + F H, but not in the loop: no filter 1/(λs + 1)^n reaches that mode, and here it "
            "runs away. "
            "Multiply polynomials, and divide nothing out.",
            _without_shared,
            0.25,
        ),
        _polynomial_like(
            "1 + F G/Gm taken for 1 + F (G/Gm - 1)",
            "Your first term has Df where Df - Nf belongs: this is the numerator of 1 + F G/Gm. "
            "The observer compares the measurement with the model's prediction, so H is "
            "G/Gm - 1, and 1 + F H has the numerator D Nm (Df - Nf) + N Dm Nf.",
            lambda case: np.polyadd(
                _product(case.D, case.Nm, _lags(case)), _product(case.N, case.Dm)
            ),
            0.25,
        ),
        _polynomial_like(
            "typed-in fractions",
            "There are too many roots: p_B times Dm. That comes of adding fractions, each of which "
            "brings its denominator along, as G - Gm or Gm + F (G - Gm) do. A mode of the model "
            "would count twice. Form the two products of polynomials first, then add once.",
            lambda case: _product(_p_B(case), case.Dm),
            0.25,
        ),
        _polynomial_like(
            "plant and model exchanged",
            "Plant and model have changed places: this belongs to Gm/G. The filter compares the "
            "true plant with the model by G/Gm = N Dm/(D Nm); so Nf stands beside N Dm.",
            lambda case: np.polyadd(
                _product(case.N, case.Dm, np.polysub(_lags(case), [1.0])),
                _product(case.D, case.Nm),
            ),
            0.25,
        ),
        _polynomial_like(
            "minus between the two terms",
            "Both terms are right, and a minus stands between them. 1 + F (G/Gm - 1) over one "
            "denominator is D Nm (Df - Nf) + N Dm Nf: the minus is inside the bracket only.",
            lambda case: _of_sign(case, -1.0),
            0.5,
        ),
        read_as(
            "ascending powers",
            "The coefficients are right, in ascending powers of s. Asked for are descending ones, "
            "as np.polymul and np.roots have them: turn the list round.",
            lambda case: _p_B(case)[::-1],
            lambda p: p[::-1],
            _polynomial_lacks,
            0.75,
        ),
    ),
)


# --- 1.4 The plant's gain, read off a curve -----------------------------------------------------


@dataclass(frozen=True, eq=False)
class SensitivityCase:
    """A loop whose |S_d| was measured: `case.plot()` draws it.

    Attributes
    ----------
    model_gain : float
        Gm(0).
    time_constant : float
        λ of the filter, in seconds.
    order : int
        n of the filter.
    omega, S_d : array of float
        The points of the curve: frequencies in rad/s, and |S_d| there.
    """

    model_gain: float
    time_constant: float
    order: int
    omega: FloatArray = field(repr=False)
    S_d: FloatArray = field(repr=False)

    def __repr__(self) -> str:
        return f"Gm(0) = {self.model_gain:g}, λ = {self.time_constant:g} s, n = {self.order}"

    def plot(self) -> Figure:
        """Draw |S_d| over the frequency, both on log scales."""
        with styled():
            (ax,) = axes_for(None, 1, SHORT)
            lines = ax.loglog(self.omega, self.S_d, color=colour_of("S_d"))
            ax.axhline(1, color=colour_of("S_d"), lw=0.8, ls=":")
            ax.grid(True, which="minor", alpha=0.15)
            ax.set(xlabel="frequency (rad/s)", ylabel=r"$|S_d|$")
            ax.set_title(f"{self!r}".replace("Gm(0)", r"$\tilde{G}(0)$"))
        k = 150
        seen = f"{self.S_d[k]:.3g} at {self.omega[k]:.3g} rad/s"
        return Figure(lines, ax, alt=f"|S_d| of your loop: {seen}")


def draw_sensitivity(rng: np.random.Generator) -> tuple[SensitivityCase, NRDOB]:
    """Draw a loop, and what is measured of it."""
    order, constant, gain = int(rng.integers(2, 4)), draw(rng, 0.05, 0.5), draw(rng, 2, 9)
    pole, lag = draw(rng, 0.3, 1) / constant, draw(rng, 0.1, 0.3) * constant
    model = ct.tf([gain], [1 / pole, 1])
    plant = model * ct.tf([_gain_error(rng)], [lag, 1])
    loop = NRDOB(plant, model, 1 / gain, LowPassFilter(constant, order))
    omega = np.geomspace(1e-3, 10, 600) / constant
    return SensitivityCase(gain, constant, order, omega, np.abs(loop.S_d(1j * omega))), loop


def _sensitivity_case(rng: np.random.Generator) -> SensitivityCase:
    def fits(drawn: tuple[SensitivityCase, NRDOB]) -> bool:
        case, loop = drawn
        found = gain_readings(case)
        units = [found.pop(unit) for unit in ("hertz", "decibels")]
        return (
            apart(*found.values(), by=0.3)
            and all(apart(unit, other, by=0.13) for unit in units for other in found.values())
            and loop.stability().stable is True
        )

    return first_fitting(lambda: draw_sensitivity(rng), fits)[0]


def gain_readings(case: SensitivityCase) -> dict[str, float]:
    """Read the low end of the curve, rightly and wrongly."""
    slope = case.S_d[0] / case.omega[0]
    ratio = float(case.order * case.time_constant / slope)
    gain = case.model_gain
    return {
        "right": gain * ratio,
        "model": gain,
        "inverse": gain / ratio,
        "order": gain * ratio / case.order,
        "ratio": ratio,
        "hertz": gain * ratio / (2 * pi),
        "decibels": 20 * log10(gain * ratio),
    }


READ_OFF = log(1.13)
"""How far a number that is read off a figure may be from the true one."""


def _gain_lacks(case: SensitivityCase, got: float) -> str:
    if not got > 0:
        return "the plant's gain is positive, as its model's is"
    slope = case.order * case.time_constant * case.model_gain / got
    if near(float(case.S_d[0]), slope * case.omega[0], READ_OFF):
        return ""
    return (
        "with this gain |S_d| would begin as "
        f"{slope:.3g} ω; compare that with your figure, at its left end"
    )


_misread = partial(answers_like, close=partial(near, tolerance=READ_OFF))


READING = Problem(
    id="1.4",
    title="The plant's gain, read off a curve",
    case=_sensitivity_case,
    reads=number,
    lacks=_gain_lacks,
    praise=(
        "Right. At low frequency S_d is n λ s/R(0), so the rejection tells how strong the plant "
        "is against its model."
    ),
    misconceptions=(
        _misread(
            "the model's gain",
            "This is the gain of the model. It would be the plant's if the curve began as n λ ω; "
            "but yours lies beside that line. The factor between the two is R(0) = G(0)/Gm(0).",
            lambda case: gain_readings(case)["model"],
            0.0,
        ),
        _misread(
            "ratio upside down",
            "The ratio is upside down. A plant that is stronger than its model makes the loop "
            "gain larger and |S_d| smaller: |S_d| = n λ ω/R(0), with R(0) = G(0)/Gm(0).",
            lambda case: gain_readings(case)["inverse"],
            0.5,
        ),
        _misread(
            "order forgotten",
            "You are off by the order of the filter. Each lag adds its λ to the delay of F: "
            "1 - F begins as n λ s, not as λ s.",
            lambda case: gain_readings(case)["order"],
            0.5,
        ),
        _misread(
            "ratio only",
            "This is R(0) = G(0)/Gm(0). Asked is G(0) itself: one step is left.",
            lambda case: gain_readings(case)["ratio"],
            0.75,
        ),
        _misread(
            "hertz for rad/s",
            "You are off by 2π: the slope nλ belongs to ω in rad/s, and so does the axis of the "
            "figure. Leave the frequency as it is.",
            lambda case: gain_readings(case)["hertz"],
            0.5,
        ),
        read_as(
            "decibels",
            "This is the plant's gain in decibels, 20 lg G(0). Asked for is the gain itself, as a "
            "factor: 10^(dB/20).",
            lambda case: gain_readings(case)["decibels"],
            lambda got: 10 ** (got / 20),
            _gain_lacks,
            0.75,
        ),
    ),
    own=True,
)


# --- 1.5 Find the error: three degrees of freedom -----------------------------------------------


class TwinCase(LoopCase):
    """A stable loop, for which a twin is to be found."""

    def __repr__(self) -> str:
        F = self.loop.filter
        return f"λ = {F.time_constant:g} s, n = {F.order}, Gm(0) = {self.loop.Gm.dc_gain:g}"


def _twin_case(rng: np.random.Generator) -> TwinCase:
    def drawn() -> TwinCase:
        order, gain = int(rng.integers(2, 4)), draw(rng, 0.5, 5)
        poles = [draw(rng, 0.5, 2), draw(rng, 2.5, 8)]
        moved = [p * float(rng.uniform(1.1, 1.4)) for p in poles]
        model, plant = (ct.tf([gain * p * q], np.poly([-p, -q])) for p, q in (poles, moved))
        F = LowPassFilter(draw(rng, 0.05, 0.3), order)
        return TwinCase(NRDOB(plant, model, 0.5 / gain, F))

    return first_fitting(drawn, lambda case: case.loop.stability().stable is True)


Twin = tuple[float, ct.TransferFunction]


def _twin(given: Any) -> Twin:
    """Read c and F', given as (c, num, den) or as (c, F')."""
    wanted = "three things are asked for, (c, num, den)"
    factor, *rest = things(given, wanted, (2, 3), names="c, num, den")
    return number(factor), block(rest[0] if len(rest) == 1 else tuple(rest))


def _stronger(case: TwinCase, got: Twin) -> ComplexArray:
    """Divide K of the new loop by K, at some points, whether the filter may be used or not."""
    factor, filter = got
    F = filter(POINTS)
    return np.asarray(F / ((1 - F) * factor * case.loop.Gm(POINTS)) / case.loop.K(POINTS))


LEAST = 0.009
"""By how much the factor must differ from 1."""

SAME_K = 2e-3
"""By how much K may differ: its filter may be given with four digits."""


def _twin_lacks(case: TwinCase, got: Twin) -> str:
    factor, filter = got
    if abs(filter(0) - 1) < FOUR_DIGITS:  # as near as python-control keeps it
        filter = filter * float(1 / filter(0).real)
    if abs(factor - 1) < LEAST:
        return "c is 1: give a model that differs from the given one by a hundredth or more"
    share = _stronger(case, got)
    worst = int(np.argmax(np.abs(share - 1)))
    same = abs(share[worst] - 1) <= SAME_K
    try:
        twin = NRDOB(case.loop.process, factor * case.loop.model, case.loop.controller, filter)
    except (TypeError, ValueError) as error:
        return Lack("unusable" if same else "filter", f"this filter cannot be used: {error}")
    if not same:
        words = f"at s = {POINTS[worst]:g} it is {abs(share[worst]):.3g} times it"
        return Lack("K", f"the feedback K is not the same: {words}")
    if twin.stability().observer_loop.stable is not True:
        return "K is the same, but p_B of the new loop is not stable"
    return ""


def _nearly_a_twin(case: TwinCase, got: Twin) -> bool:
    """Tell whether K is nearly the same, far nearer than the change of the model accounts for.

    Nothing else may be wrong: a filter that is unstable is no right one with fewer digits.
    """
    lack = _twin_lacks(case, got)
    if not isinstance(lack, Lack) or lack.kind != "K":
        return False
    off = float(np.abs(_stronger(case, got) - 1).max())
    return abs(got[0] - 1) >= LEAST and off < min(0.1, 0.3 * abs(got[0] - 1))


def _is_filter(case: TwinCase, got: Twin, of: float) -> bool:
    kept = np.allclose(got[1](POINTS), of * case.loop.F(POINTS), rtol=SAME_K)
    return bool(kept) and abs(got[0] - 1) > LEAST


def _same_integral_gain(case: TwinCase, got: Twin) -> bool:
    factor, filter = got
    given, tiny = case.loop.filter, 1e-6
    slope = (1 - filter(tiny).real) / tiny
    expected = given.order * given.time_constant / factor
    same = np.allclose(_stronger(case, got), 1, rtol=0.05)
    return abs(filter(0).real - 1) < 1e-6 and abs(slope / expected - 1) < 1e-3 and not same


def _den(case: TwinCase, factor: float = 1.0) -> list[float]:
    """Coefficients of (λs + 1)^n, with λ divided by a factor."""
    F = case.loop.filter
    return [float(a) for a in LowPassFilter(F.time_constant / factor, F.order).den]


TWIN = Problem(
    id="1.5",
    title="Find the error: three degrees of freedom",
    case=_twin_case,
    reads=_twin,
    lacks=_twin_lacks,
    rounded=_nearly_a_twin,
    praise=(
        "Right. Another model and another filter, and no plant can tell: K is the same. There are "
        "two functions to choose, V and K, and the model is not a third."
    ),
    misconceptions=(
        Misconception(
            "nothing changed",
            "With c = 1 this is the pair that you were given. Choose another c, 2 for instance, "
            "and find out which filter makes up for it.",
            example=lambda case: (1.0, [1.0], _den(case)),
            recognises=lambda case, got: abs(got[0] - 1) < LEAST,
        ),
        Misconception(
            "filter kept",
            "You changed the model and kept the filter. Then K = F/((1 - F) Gm) is divided by c: "
            "that the plant will notice. Solve F'/((1 - F') c Gm) = K for F'.",
            example=lambda case: (2.0, [1.0], _den(case)),
            recognises=lambda case, got: _is_filter(case, got, of=1.0),
        ),
        Misconception(
            "filter scaled along",
            "F' = c F keeps F/Gm, but F'(0) is c, and F stands in 1 - F as well: the integral "
            "action would be lost. Solve F'/((1 - F') c Gm) = F/((1 - F) Gm) for F', and check "
            "that F'(0) = 1.",
            example=lambda case: (2.0, [2.0], _den(case)),
            recognises=lambda case, got: _is_filter(case, got, of=got[0]),
            marks=0.25,
        ),
        Misconception(
            "only the integral gain kept",
            "The integral gain 1/(n λ Gm(0)) is the same, the rest of K is not. Dividing λ by c "
            "is exact for n = 1 only. The filter that you need leaves the family "
            "1/(λs + 1)^n: solve F'/((1 - F') c Gm) = K for F'.",
            example=lambda case: (2.0, [1.0], _den(case, 2.0)),
            recognises=_same_integral_gain,
            marks=0.25,
        ),
        lacking(
            "unusable",
            "a filter that is unstable",
            "K is the same, but F' is unstable, so this observer cannot be built. A negative c "
            "does that for every order, a large one from order 3 on. Look at the roots of "
            "(λs + 1)^n + c - 1, and choose a c for which all are on the left.",
            example=lambda case: (-2.0, [-2.0], np.polyadd(case.loop.filter.den, [-3.0])),
            marks=0.25,
        ),
    ),
)


# --- 1.6 A filter for three wishes ----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class WishCase:
    """What a filter should do, for a plant that its model describes.

    Attributes
    ----------
    plant : control.TransferFunction
        The plant, which is its own model.
    omega_d : float
        Up to this frequency (rad/s) disturbances at the output are to be reduced to a tenth.
    omega_hum : float
        Frequency (rad/s) of a hum in the sensor.
    hum : float
        How much of the hum may reach y.
    """

    plant: ct.TransferFunction
    omega_d: float
    omega_hum: float
    hum: float

    @property
    def relative_degree(self) -> int:
        """Poles minus zeros of the plant."""
        return as_fraction(self.plant, "plant").relative_degree

    def __repr__(self) -> str:
        return (
            f"a plant of relative degree {self.relative_degree}, |S_d| ≤ 0.1 up to "
            f"{self.omega_d:g} rad/s, |S_η| ≤ {self.hum:g} at {self.omega_hum:g} rad/s"
        )


REJECTION = 0.1


def _wish_case(rng: np.random.Generator) -> WishCase:
    zero, poles = draw(rng, 2, 6), [draw(rng, 0.5, 2), draw(rng, 2.5, 8)]
    num = [1.0] if rng.random() < 0.5 else [1 / zero, 1.0]
    plant = ct.tf(draw(rng, 0.5, 5) * np.array(num), _product(*([1 / p, 1] for p in poles)))
    omega_d = draw(rng, 0.2, 2)
    order = 4 - len(num)  # one lag more than causality asks for
    # The slowest filter that rejects enough has λ ω_d just above 0.1/n; a fifth less is allowed.
    fastest = LowPassFilter(0.8 * REJECTION / order / omega_d, order)
    omega_hum = few(omega_d * float(rng.uniform(60, 120)))
    return WishCase(plant, omega_d, omega_hum, few(abs(fastest(1j * omega_hum))))


WITHIN = 1.01
"""By what factor a limit may be exceeded: that is three digits of λ."""


def _rejects(case: WishCase, F: LowPassFilter) -> bool:
    w = np.linspace(0, case.omega_d, 201)
    return bool(np.abs(1 - F(1j * w)).max() <= REJECTION * WITHIN)


def _wish_lacks(case: WishCase, F: LowPassFilter) -> str:
    loop = NRDOB(case.plant, case.plant, 0.1 / case.plant.dcgain(), F)
    w = np.linspace(0, case.omega_d, 201)
    rejection = float(np.abs(loop.S_d(1j * w)).max())
    if rejection > REJECTION * WITHIN:
        return f"|S_d| reaches {rejection:.3g} below {case.omega_d:g} rad/s"
    if any(loop.U_eta.at_infinity):
        return "the noise reaches the actuator at every frequency: |U/η| does not fall to zero"
    hum = float(abs(loop.S_eta(1j * case.omega_hum)))
    if hum > case.hum * WITHIN:
        return f"|S_η| is {hum:.3g} at {case.omega_hum:g} rad/s"
    return "" if loop.stability().stable else "the loop is not stable"


def _wish_rounded(case: WishCase, F: LowPassFilter) -> bool:
    """Tell whether λ has so few digits that the last of them is what is too much."""
    few_digits = few(F.time_constant) == F.time_constant
    return few_digits and not _wish_lacks(case, LowPassFilter(0.95 * F.time_constant, F.order))


def _rule(case: WishCase, order: int, share: float = 1.0) -> LowPassFilter:
    """Choose λ = ε/(n ω_d), or a share of it."""
    return LowPassFilter(share * REJECTION / (order * case.omega_d), order)


def _band_edge(case: WishCase) -> LowPassFilter:
    order = case.relative_degree + 1
    return LowPassFilter(LowPassFilter(1.0, order).bandwidth / case.omega_d, order)


def _within_a_tenth(case: WishCase) -> LowPassFilter:
    """Choose λ so that |F| has fallen to 0.9 at ω_d."""
    order = case.relative_degree + 1
    return LowPassFilter(np.sqrt(0.9 ** (-2 / order) - 1) / case.omega_d, order)


def _gain_at_edge(case: WishCase, got: LowPassFilter) -> float:
    return float(abs(got(1j * case.omega_d)))


def _order_forgotten(case: WishCase, F: LowPassFilter) -> bool:
    return F.order > 1 and abs(F.time_constant * case.omega_d / REJECTION - 1) < 0.02


WISHES = Problem(
    id="1.6",
    title="A filter for three wishes",
    case=_wish_case,
    reads=lowpass,
    lacks=_wish_lacks,
    rounded=_wish_rounded,
    praise=(
        "Right: the disturbance, the hum and the actuator are all content. Between λ from the "
        "disturbance and λ from the hum there is not much room; look how much, for other orders."
    ),
    misconceptions=(
        Misconception(
            "order just causal",
            "Disturbance and λ are right. But with n equal to the relative degree F/Gm does not "
            "fall off: noise of every high frequency reaches the actuator, and its power is "
            "infinite. Take one lag more, and adapt λ.",
            example=lambda case: _rule(case, case.relative_degree),
            recognises=lambda case, got: got.order == case.relative_degree and _rejects(case, got),
            marks=0.5,
        ),
        Misconception(
            "bandwidth put at the edge",
            "You put the bandwidth of F at the frequency up to which the disturbance should be "
            "gone. There F has lost 3 dB and has turned, and |1 - F| is about 1: nothing is "
            "rejected. What counts is |1 - F| ≤ n λ ω; solve that for λ.",
            example=_band_edge,
            recognises=lambda case, got: abs(_gain_at_edge(case, got) - np.sqrt(0.5)) < 0.01,
        ),
        Misconception(
            "order forgotten in the bound",
            "λ = ε/ω would do for one lag. With n lags the delay of F is n λ, and |1 - F| is about "
            "n times what you wanted. Divide by n.",
            example=lambda case: LowPassFilter(REJECTION / case.omega_d, case.relative_degree + 1),
            recognises=_order_forgotten,
            marks=0.5,
        ),
        Misconception(
            "1 - |F| taken for |1 - F|",
            "|F| is within a tenth of 1, as you wanted, and yet |1 - F| is far larger: F has "
            "turned, and the difference of two complex numbers of equal size need not be small. "
            "Use the bound |1 - F| ≤ n λ ω.",
            example=_within_a_tenth,
            recognises=lambda case, got: (
                _gain_at_edge(case, got) >= 0.899 and not _rejects(case, got)
            ),
        ),
        Misconception(
            "only the disturbance",
            "The disturbance is rejected, with room to spare, and the hum comes through: the "
            "filter is faster than it need be. How slow may it be? Take the largest λ that still "
            "rejects enough, then look at the hum.",
            example=lambda case: _rule(case, case.relative_degree + 1, 0.4),
            recognises=lambda case, got: got.order > case.relative_degree and _rejects(case, got),
            marks=0.5,
        ),
    ),
)

PROBLEMS = (SETTLED, POLYNOMIAL, READING, TWIN, WISHES)
