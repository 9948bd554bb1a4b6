"""Set 1: the loop and its equations; models and filters."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from math import log, log10, nan, pi
from typing import Any

import control as ct
import numpy as np

from nrdob.diagram import LowPassFilter, as_fraction
from nrdob.loop import NRDOB
from nrdob.numerics import ComplexArray, FloatArray
from nrdob.plotting import Figure

from .cases import POINTS, LoopCase
from .comparing import FOUR_DIGITS, near, rounds
from .drawing import apart, draw, few, fitting
from .figures import draw_gains
from .problems import Lack, Misconception, first_of, lack_of, lacking, pose, put_right, reading
from .reading import UnreadableError, block, lowpass, number, numbers, polynomial, things

__all__ = ["POLYNOMIAL", "READING", "SETTLED", "TWIN", "WISHES"]


def _gain_error(rng: np.random.Generator) -> float:
    """Draw a ratio that is surely not 1: a plant weaker or stronger than its model."""
    return float(rng.uniform(1.6, 2.4) ** rng.choice([-1, 1]))


# --- 1.1 What is left when all has settled ------------------------------------------------------


@dataclass(frozen=True, eq=False)
class SettledCase:
    """Gains at s = 0 of a stable loop with F(0) = 1."""

    G: float  # of the plant
    Gm: float  # of the model
    C: float  # of the controller

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
    y, u, e = map(float, row)
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
            return lack_of("1.1", "line", name=name, line=line, left=left, right=sum(terms))
    return ""


def _unsettled(case: SettledCase, rows: FloatArray) -> dict[str, str]:
    return {name: _unsatisfied(case, name, row) for name, row in zip(INPUTS, rows, strict=True)}


def _ordinary_loop(case: SettledCase) -> Table:
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
    """Polynomials of a loop, coefficients in descending powers of s."""

    N: FloatArray  # plant N/D
    D: FloatArray
    Nm: FloatArray  # model Nm/Dm
    Dm: FloatArray
    time_constant: float  # λ of the filter, in seconds
    order: int  # n of the filter

    def __repr__(self) -> str:
        names = ("N", "D", "Nm", "Dm")
        blocks = (f"{name} = {np.round(getattr(self, name), 4).tolist()}" for name in names)
        return f"{', '.join(blocks)}, λ = {self.time_constant:g} s, n = {self.order}"


def _polynomial_case(rng: np.random.Generator) -> PolynomialCase:
    # Plant and model share the unstable pole exactly, as a careful modeller would have it.
    shared = -draw(rng, 0.5, 3)
    plant, model, zero = draw(rng, 1, 2), draw(rng, 2.5, 5), draw(rng, 6, 12)
    N, Nm = np.array([draw(rng, 2, 9)]), draw(rng, 0.3, 0.8) * np.array([1, zero])
    D, Dm = (np.polymul([1, shared], [1, pole]) for pole in (plant, model))
    return PolynomialCase(N, D, Nm, Dm, draw(rng, 0.05, 0.4), int(rng.integers(2, 4)))


def _product(*factors: Any) -> FloatArray:
    return np.asarray(reduce(np.polymul, factors))


def _Df(case: PolynomialCase) -> FloatArray:
    return LowPassFilter(case.time_constant, case.order).den


def _first_term(case: PolynomialCase) -> FloatArray:
    return _product(case.D, case.Nm, np.polysub(_Df(case), [1.0]))


def _p_B(case: PolynomialCase) -> FloatArray:
    return np.polyadd(_first_term(case), _product(case.N, case.Dm))


def _disturbance_to_output(case: PolynomialCase, s: complex) -> complex:
    """Solve the three lines of the diagram at one s for y, after a unit of d."""
    G = np.polyval(case.N, s) / np.polyval(case.D, s)
    Gm = np.polyval(case.Nm, s) / np.polyval(case.Dm, s)
    F = 1 / np.polyval(_Df(case), s)
    C = 1.0  # any: it does not matter for y after d
    left = np.array([[1, (1 - F) * Gm, F], [-C, 1 - F, F / Gm], [0, -G, 1]])
    return complex(np.linalg.solve(left, np.array([0, 0, 1]))[2])


def _polynomial_lacks(case: PolynomialCase, p: FloatArray) -> str:
    degree = case.D.size + case.Nm.size - 2 + case.order
    if p.size - 1 != degree:
        return lack_of("1.3", "degree", found=p.size - 1, degree=degree)
    # What S_d is divided by: S_d p_B must be the numerator D Nm (Df - 1), but for a constant.
    S_d = np.array([_disturbance_to_output(case, s) for s in POINTS])
    share = S_d / np.polyval(_first_term(case), POINTS)
    factor = share * np.polyval(p, POINTS)
    # Where terms cancel, four digits of each are fewer of the sum.
    slack = 2 * FOUR_DIGITS * np.abs(share) * np.polyval(np.abs(p), np.abs(POINTS))
    if np.any(np.abs(factor - factor[-1]) > slack):
        return lack_of("1.3", "terms")
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
            _product(case.D, case.Nm, _Df(case)), _product(case.N, case.Dm)
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
    """A loop whose |S_d| was measured: `case.plot()` draws it."""

    model_gain: float  # Gm(0)
    time_constant: float  # λ of the filter, in seconds
    order: int  # n of the filter
    omega: FloatArray = field(repr=False)  # points of the curve, in rad/s
    S_d: FloatArray = field(repr=False)  # |S_d| there

    def __repr__(self) -> str:
        return f"Gm(0) = {self.model_gain:g}, λ = {self.time_constant:g} s, n = {self.order}"

    def plot(self) -> Figure:
        """Draw |S_d| over the frequency, both on log scales."""
        title = f"{self!r}".replace("Gm(0)", r"$\tilde{G}(0)$")
        alt = f"|S_d| of your loop: {self.S_d[150]:.3g} at {self.omega[150]:.3g} rad/s"
        return draw_gains(self.omega, {"S_d": self.S_d}, alt, title=title, ylabel="$|S_d|$")


def _told_apart(drawn: tuple[SensitivityCase, NRDOB]) -> bool:
    case, loop = drawn
    found = gain_readings(case)
    units = [found.pop(unit) for unit in ("hertz", "decibels")]
    no_unit = all(apart(unit, other, by=0.13) for unit in units for other in found.values())
    return no_unit and apart(*found.values(), by=0.3) and loop.stability().stable is True


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


READ_OFF = log(1.13)  # how far a number that is read off a figure may be from the true one


def _gain_lacks(case: SensitivityCase, got: float) -> str:
    if not got > 0:
        return "the plant's gain is positive, as its model's is"
    slope = case.order * case.time_constant * case.model_gain / got
    if near(float(case.S_d[0]), slope * case.omega[0], READ_OFF):
        return ""
    return lack_of("1.4", "slope", slope=slope)


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
        "decibels": put_right(
            lambda case: gain_readings(case)["decibels"], lambda got: 10 ** (got / 20)
        ),
    },
)


# --- 1.5 Find the error: three degrees of freedom -----------------------------------------------


class TwinCase(LoopCase):
    """A stable loop, for which a twin is to be found."""

    def __repr__(self) -> str:
        F = self.loop.filter
        return f"λ = {F.time_constant:g} s, n = {F.order}, Gm(0) = {self.loop.Gm.dc_gain:g}"


@fitting(lambda case: case.loop.stability().stable is True)
def _twin_case(rng: np.random.Generator) -> TwinCase:
    order, gain = int(rng.integers(2, 4)), draw(rng, 0.5, 5)
    poles = [draw(rng, 0.5, 2), draw(rng, 2.5, 8)]
    moved = [p * rng.uniform(1.1, 1.4) for p in poles]
    model, plant = (ct.tf([gain * p * q], np.poly([-p, -q])) for p, q in (poles, moved))
    return TwinCase(NRDOB(plant, model, 0.5 / gain, LowPassFilter(draw(rng, 0.05, 0.3), order)))


Twin = tuple[float, ct.TransferFunction]


def _twin(given: Any) -> Twin:
    """Read c and F', given as (c, num, den) or as (c, F')."""
    wanted = "three things are asked for, (c, num, den)"
    factor, *rest = things(given, wanted, (2, 3), names="c, num, den")
    if number(factor) == 0:
        raise UnreadableError("c is 0: a model of gain zero is none")
    return number(factor), block(rest[0] if len(rest) == 1 else tuple(rest))


def _stronger(case: TwinCase, got: Twin) -> ComplexArray:
    """Divide K of the new loop by K, at some points, whether the filter may be used or not."""
    F = got[1](POINTS)
    return np.asarray(F / ((1 - F) * got[0] * case.loop.Gm(POINTS)) / case.loop.K(POINTS))


LEAST = 0.009  # by how much the factor must differ from 1

SAME_K = 2e-3  # by how much K may differ: its filter may be given with four digits


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
        return lack_of("1.5", "K", s=POINTS[worst], times=abs(share[worst]))
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
    kept = np.allclose(got[1](POINTS), of * case.loop.F(POINTS), rtol=SAME_K, atol=0)
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


TWIN = pose(
    "1.5",
    case=_twin_case,
    reads=_twin,
    lacks=_twin_lacks,
    rounded=_nearly_a_twin,
    misconceptions={
        "nothing changed": Misconception(
            lambda case: (1.0, [1.0], _den(case)), lambda case, got: abs(got[0] - 1) < LEAST
        ),
        "filter kept": Misconception(
            lambda case: (2.0, [1.0], _den(case)), lambda case, got: _is_filter(case, got, of=1.0)
        ),
        "filter scaled along": Misconception(
            lambda case: (2.0, [2.0], _den(case)),
            lambda case, got: _is_filter(case, got, of=got[0]),
        ),
        "only the integral gain kept": Misconception(
            lambda case: (2.0, [1.0], _den(case, 2.0)), _same_integral_gain
        ),
        "a filter that is unstable": lacking(
            "unusable", lambda case: (-2.0, [-2.0], np.polyadd(case.loop.filter.den, [-3.0]))
        ),
    },
)


# --- 1.6 A filter for three wishes ----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class WishCase:
    """What a filter should do, for a plant that its model describes."""

    plant: ct.TransferFunction  # and its own model
    omega_d: float  # up to here (rad/s) disturbances at the output are to be a tenth
    omega_hum: float  # of a hum in the sensor, in rad/s
    hum: float  # how much of the hum may reach y

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
    plant = ct.tf(draw(rng, 0.5, 5) * np.array(num), np.polymul(*([1 / p, 1] for p in poles)))
    omega_d = draw(rng, 0.2, 2)
    order = 4 - len(num)  # an additional lag, beyond causality
    # The slowest filter that rejects enough has λ ω_d just above 0.1/n; a fifth less is allowed.
    fastest = LowPassFilter(0.8 * REJECTION / order / omega_d, order)
    omega_hum = few(omega_d * rng.uniform(60, 120))
    return WishCase(plant, omega_d, omega_hum, few(abs(fastest(1j * omega_hum))))


WITHIN = 1.01  # by what factor a limit may be exceeded: that is three digits of λ


def _most(case: WishCase, S_d: Callable[[ComplexArray], ComplexArray]) -> float:
    """Give the largest |S_d| where disturbances are to be reduced."""
    return float(np.abs(S_d(1j * np.linspace(0, case.omega_d, 201))).max())


def _rejects(case: WishCase, F: LowPassFilter) -> bool:
    return _most(case, lambda s: 1 - F(s)) <= REJECTION * WITHIN


def _wish_lacks(case: WishCase, F: LowPassFilter) -> str:
    loop = NRDOB(case.plant, case.plant, 0.1 / case.plant.dcgain(), F)
    rejection = _most(case, loop.S_d)
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


def _chosen(case: WishCase, rule: Callable[[int], float], more: int = 1) -> LowPassFilter:
    """Choose λ ω_d by a rule for the order, which is that of the model and some more."""
    order = case.relative_degree + more
    return LowPassFilter(rule(order) / case.omega_d, order)


def _gain_at_edge(case: WishCase, got: LowPassFilter) -> float:
    return float(abs(got(1j * case.omega_d)))


WISHES = pose(
    "1.6",
    case=_wish_case,
    reads=lowpass,
    lacks=_wish_lacks,
    rounded=_wish_rounded,
    misconceptions={
        "order just causal": Misconception(
            lambda case: _chosen(case, lambda n: REJECTION / n, more=0),
            lambda case, got: got.order == case.relative_degree and _rejects(case, got),
        ),
        "bandwidth put at the edge": Misconception(
            lambda case: _chosen(case, lambda n: LowPassFilter(1.0, n).bandwidth),
            lambda case, got: abs(_gain_at_edge(case, got) - np.sqrt(0.5)) < 0.01,
        ),
        "order forgotten in the bound": Misconception(
            lambda case: _chosen(case, lambda n: REJECTION),
            lambda case, got: (
                got.order > 1 and abs(got.time_constant * case.omega_d / REJECTION - 1) < 0.02
            ),
        ),
        "1 - |F| taken for |1 - F|": Misconception(
            lambda case: _chosen(case, lambda n: np.sqrt(0.9 ** (-2 / n) - 1)),  # |F| is 0.9 there
            lambda case, got: _gain_at_edge(case, got) >= 0.899 and not _rejects(case, got),
        ),
        "only the disturbance": Misconception(
            lambda case: _chosen(case, lambda n: 0.4 * REJECTION / n),
            lambda case, got: got.order > case.relative_degree and _rejects(case, got),
        ),
    },
)
