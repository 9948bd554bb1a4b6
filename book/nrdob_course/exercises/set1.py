"""Set 1: the loop and its equations."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from math import log, log10, nan, pi
from typing import Any

import control as ct
import numpy as np

from nrdob.diagram import LowPassFilter
from nrdob.loop import NRDOB
from nrdob.numerics import FloatArray
from nrdob.plotting import Figure

from .cases import POINTS
from .comparing import FOUR_DIGITS, near, rounds
from .drawing import apart, draw, few, fitting
from .figures import draw_gains
from .problems import first_of, pose, put_right, reading
from .reading import UnreadableError, number, numbers, polynomial

__all__ = ["POLYNOMIAL", "READING", "SETTLED"]


def _gain_error(rng: np.random.Generator) -> float:
    """Draw a ratio that is surely not 1: a plant weaker or stronger than its model."""
    return float(rng.uniform(1.6, 2.4) ** rng.choice([-1, 1]))


# --- 1.1 What is left when all has settled ------------------------------------------------------


@dataclass(frozen=True, eq=False)
class SettledCase:
    """Gains at s = 0 of a stable loop with F(0) = 1.

    `G`, `Gm`, `C`: of the plant, the model and the controller.
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
    rows = np.full((len(INPUTS), 3), nan)
    for row, name in zip(rows, INPUTS, strict=True):
        with suppress(UnreadableError):
            row[:] = numbers(given.get(name), "y, u, e")
    return rows


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


def _ordinary_loop(case: SettledCase) -> Table:
    """Settle an ordinary loop of controller and plant, without an observer."""
    S = 1 / (1 + case.C * case.G)
    return {
        "R": (1 - S, case.C * S, S),
        "delta": (case.G * S, -case.C * case.G * S, -case.G * S),
        "d": (S, -case.C * S, -S),
        "eta": (S - 1, -case.C * S, -S),
    }


SETTLED = pose(
    "1.1",
    alike=lambda table, rows: np.allclose(_table(table), rows, rtol=1e-3, atol=1e-6),
    case=_settled_case,
    reads=_table,
    lacks=first_of(_unsettled),
    parts=_unsettled,
    rounded=lambda case, rows: rounds(_table(settled_table(case)), rows),
    misconceptions={
        "an ordinary loop of C and G": _ordinary_loop,
        "plant input taken for the controller's output": lambda case: (
            settled_table(case) | {"delta": (0.0, 0.0, 0.0)}
        ),
        "noise with a plus sign": lambda case: (
            settled_table(case) | {"eta": (1.0, 1 / case.G, 0.0)}
        ),
        "the observer tracks the reference": lambda case: (
            settled_table(case) | {"R": (1.0, 1 / case.G, 0.0)}
        ),
        "the model's gain in place of the plant's": lambda case: {
            name: (y, u if name == "delta" else u * case.G / case.Gm, e)
            for name, (y, u, e) in settled_table(case).items()
        },
    },
)


# --- 1.3 The polynomial of the observer ---------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PolynomialCase:
    """Polynomials of a loop, coefficients in descending powers of s.

    `N`, `D`, `Nm`, `Dm`: Plant N/D and model Nm/Dm; `time_constant`: λ of the filter, in seconds;
    `order`: n of the filter.
    """

    N: FloatArray
    D: FloatArray
    Nm: FloatArray
    Dm: FloatArray
    time_constant: float
    order: int

    def __repr__(self) -> str:
        blocks = (
            f"{name} = {np.round(getattr(self, name), 4).tolist()}"
            for name in ("N", "D", "Nm", "Dm")
        )
        return f"{', '.join(blocks)}, λ = {self.time_constant:g} s, n = {self.order}"


def _polynomial_case(rng: np.random.Generator) -> PolynomialCase:
    # Plant and model share the unstable pole exactly, as a careful modeller would have it.
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


def _filter(case: PolynomialCase) -> LowPassFilter:
    return LowPassFilter(case.time_constant, case.order)


def _first_term(case: PolynomialCase) -> FloatArray:
    return _product(case.D, case.Nm, np.polysub(_filter(case).den, [1.0]))


def _p_B(case: PolynomialCase) -> FloatArray:
    return np.polyadd(_first_term(case), _product(case.N, case.Dm))


def _disturbance_to_output(case: PolynomialCase, s: complex) -> complex:
    """Solve the three lines of the diagram at one s for y, after a unit of d."""
    G = np.polyval(case.N, s) / np.polyval(case.D, s)
    Gm = np.polyval(case.Nm, s) / np.polyval(case.Dm, s)
    F = 1 / np.polyval(_filter(case).den, s)
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
    S_d = np.array([_disturbance_to_output(case, s) for s in POINTS])
    share = S_d / np.polyval(_first_term(case), POINTS)
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


POLYNOMIAL = pose(
    "1.3",
    alike=_same_roots,
    case=_polynomial_case,
    reads=polynomial,
    lacks=_polynomial_lacks,
    rounded=lambda case, p: rounds(_p_B(case), p),
    misconceptions={
        "cancelled the unstable pole": lambda case: np.polydiv(
            _p_B(case),
            polynomial(case.D - case.Dm),  # vanishes where both do
        )[0],
        "1 + F G/Gm taken for 1 + F (G/Gm - 1)": lambda case: np.polyadd(
            _product(case.D, case.Nm, _filter(case).den), _product(case.N, case.Dm)
        ),
        "typed-in fractions": lambda case: _product(_p_B(case), case.Dm),
        "plant and model exchanged": lambda case: _p_B(
            replace(case, N=case.D, D=case.N, Nm=case.Dm, Dm=case.Nm)
        ),
        "minus between the two terms": lambda case: np.polysub(
            _first_term(case), _product(case.N, case.Dm)
        ),
        "ascending powers": put_right(lambda case: _p_B(case)[::-1], lambda p: p[::-1]),
    },
)


# --- 1.4 The plant's gain, read off a curve -----------------------------------------------------


@dataclass(frozen=True, eq=False)
class SensitivityCase:
    """A loop whose |S_d| was measured: `case.plot()` draws it.

    `model_gain`: Gm(0); `time_constant`: λ of the filter, in seconds; `order`: n of the filter;
    `omega`, `S_d`: the points of the curve: frequencies in rad/s, and |S_d| there.
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
        k = 150
        seen = f"{self.S_d[k]:.3g} at {self.omega[k]:.3g} rad/s"
        title = f"{self!r}".replace("Gm(0)", r"$\tilde{G}(0)$")
        alt = f"|S_d| of your loop: {seen}"
        return draw_gains(self.omega, {"S_d": self.S_d}, alt, title=title, ylabel="$|S_d|$")


def _told_apart(drawn: tuple[SensitivityCase, NRDOB]) -> bool:
    case, loop = drawn
    found = gain_readings(case)
    units = [found.pop(unit) for unit in ("hertz", "decibels")]
    return (
        apart(*found.values(), by=0.3)
        and all(apart(unit, other, by=0.13) for unit in units for other in found.values())
        and loop.stability().stable is True
    )


@fitting(_told_apart)
def draw_sensitivity(rng: np.random.Generator) -> tuple[SensitivityCase, NRDOB]:
    """Draw a loop, and what is measured of it."""
    order, constant, gain = int(rng.integers(2, 4)), draw(rng, 0.05, 0.5), draw(rng, 2, 9)
    pole, lag = draw(rng, 0.3, 1) / constant, draw(rng, 0.1, 0.3) * constant
    model = ct.tf([gain], [1 / pole, 1])
    plant = model * ct.tf([_gain_error(rng)], [lag, 1])
    loop = NRDOB(plant, model, 1 / gain, LowPassFilter(constant, order))
    omega = np.geomspace(1e-3, 10, 600) / constant
    return SensitivityCase(gain, constant, order, omega, np.abs(loop.S_d(1j * omega))), loop


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


READING = pose(
    "1.4",
    alike=partial(near, tolerance=READ_OFF),
    case=lambda rng: draw_sensitivity(rng)[0],
    reads=number,
    lacks=_gain_lacks,
    own=True,
    misconceptions={
        "the model's gain": reading(gain_readings, "model"),
        "ratio upside down": reading(gain_readings, "inverse"),
        "order forgotten": reading(gain_readings, "order"),
        "ratio only": reading(gain_readings, "ratio"),
        "hertz for rad/s": reading(gain_readings, "hertz"),
        "decibels": put_right(reading(gain_readings, "decibels"), lambda got: 10 ** (got / 20)),
    },
)
