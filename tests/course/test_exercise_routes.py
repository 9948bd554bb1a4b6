"""Right answers by routes that nobody foresaw, in every dress; and wrong ones that look right."""

from __future__ import annotations

import re
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from math import inf, pi, radians
from typing import Any

import control as ct
import numpy as np
import pytest
from scipy.optimize import brentq

import benchroutes
import nrdob
from nrdob import NRDOB, LowPassFilter
from nrdob.analysis import encirclements
from nrdob_course.encoding import decode, encode
from nrdob_course.exercises import PROBLEMS, own_case, score
from nrdob_course.exercises.cases import s
from problemsets import SETS, Posed, once_a_case, posed, published, rounded

Route = Callable[[Any], Any]


def points(id: str, answer: Route, group: int) -> Any:
    """The share of the points, and the words, of an answer that is a function of a case."""
    value = answer(own_case(id, group)) if PROBLEMS[id].own else answer
    return score(id, value, group, points=1, seed=900_000 + group).feedback


# --- routes -------------------------------------------------------------------------------------


def settled_by_three_equations(case: Any) -> dict[str, Any]:
    left = [[1, 0, 1], [1 / case.Gm, 0, -case.C], [1, -case.G, 0]]
    right = {"R": (1, 0, 0), "delta": (0, 0, case.G), "d": (0, 0, 1), "eta": (-1, -1 / case.Gm, 0)}
    return {name: np.linalg.solve(left, column) for name, column in right.items()}


def nearly_settled(case: Any) -> dict[str, Any]:
    """Solve the lines with F(0) a hair below 1: what is zero comes out as nearly that."""
    F = 1 - 1e-9
    left = [[1, -case.G, 0], [F, (1 - F) * case.Gm, 1], [-F / case.Gm, F - 1, case.C]]
    right = {
        "R": (0, 1, 0),
        "delta": (case.G, 0, 0),
        "d": (1, 0, 0),
        "eta": (0, -F, F / case.Gm),
    }
    return {name: np.linalg.solve(left, column) for name, column in right.items()}


def by_control(case: Any) -> ct.TransferFunction:
    G, Gm = ct.tf(case.N, case.D), ct.tf(case.Nm, case.Dm)
    F = ct.tf([1], LowPassFilter(case.time_constant, case.order).den)
    return ct.tf((1 + F * (G / Gm - 1)).num[0][0], [1])


def by_its_roots(case: Any) -> Any:
    return np.poly(np.roots(by_control(case).num[0][0]).astype(complex)) + 1e-17j


def straight_line(case: Any) -> float:
    slope, offset = np.polyfit(np.log(case.omega[:50]), np.log(case.S_d[:50]), 1)
    at_one = np.exp(offset + slope * np.log(case.omega[0])) / case.omega[0]
    return float(case.model_gain * case.order * case.time_constant / at_one)


def weaker_twin(case: Any) -> tuple[float, ct.TransferFunction]:
    F = ct.tf([1], case.loop.filter.den)
    c = 0.25
    return c, c * F / (1 + (c - 1) * F)  # as python-control leaves it, with factors in common


def closed_by_control(case: Any) -> list[Any]:
    F = ct.tf([1], case.loop.filter.den)
    twin = ct.minreal(ct.feedback(1.5 * F / (1 - F), 1), verbose=False)  # F(0) is 1, nearly
    return [1.5, twin.num, twin.den]


def scanned_wishes(case: Any) -> tuple[float, int]:
    order, w = case.relative_degree + 1, np.linspace(0, case.omega_d, 101)
    for value in np.geomspace(1, 1e-3, 700) / case.omega_d:
        if np.abs(1 - 1 / (1 + 1j * w * value) ** order).max() <= 0.1:
            return float(value), order
    raise AssertionError


def spelled_counts(case: Any) -> list[str]:
    turns = encirclements(case.loop.FH).encirclements
    poles = np.concatenate([case.loop.process.poles(), case.loop.model.zeros()])
    P = int(np.sum(poles.real > 0))
    return [f"{turns:g}", str(P), f"{turns + P} "]


def unwrapped(case: Any) -> float:
    angle = np.unwrap(np.angle(1 + case.values))
    return (angle[0] - angle[-1]) / pi + (case.poles_at_zero + case.excess) / 2


def counted_on_a_ray(case: Any) -> int:
    """Count crossings of a half line from -1, on a curve whose closing pieces are drawn."""
    half = 1 + case.values
    arc = np.exp(-1j * np.linspace(0, 1, 801) * pi)
    infinity = half[-1] * arc**case.excess  # from ω to -ω the long way, clockwise
    # Around s = 0 on the right: from -ω to ω, clockwise too.
    detour = np.conj(half[0]) * arc**case.poles_at_zero
    turned = np.concatenate([half, infinity, np.conj(half[::-1]), detour])
    curve = turned * np.exp(0.3j)
    crossing = (curve[1:].imag > 0).astype(int) - (curve[:-1].imag > 0).astype(int)
    left = curve[1:].real < 0
    return int((crossing * left).sum())


def scanned_filter(case: Any) -> NRDOB:
    model = case.gain / ((s + case.pole) * (s + case.decay))
    controller = 0.5 * case.pole * case.decay / case.gain
    for value in np.geomspace(1 / case.pole, 1 / case.zero, 60):
        loop = NRDOB(case.process, model, controller, LowPassFilter(float(value), 2))
        if loop.stability().stable:
            return loop
    raise AssertionError


@once_a_case
def circles(case: Any) -> list[str]:
    """Find the three points by walking along the real axis and the unit circle."""
    far = 1 / case.ms
    high = brentq(lambda g: abs(1 - 1 / g) - far, 1, 100)
    low = brentq(lambda g: abs(1 - 1 / g) - far, 0.01, 1)
    angle = brentq(lambda a: abs(1 - np.exp(1j * radians(a))) - far, 0.1, 170)
    return [f"{value:.6f}".replace(".", ",") for value in (low, high, angle)]


def with_stability_margins(case: Any) -> float:
    response = ct.FRD(case.L, case.omega, smooth=True)
    _, phases, _, _, crossovers, _ = ct.stability_margins(response, returnall=True)
    return float(min((radians(p) % (2 * pi)) / w for p, w in zip(phases, crossovers, strict=True)))


def interpolated(case: Any) -> float:
    return float(np.interp(-1 / case.size, -case.S_eta[900:], case.omega[900:]))


def lost_gain(case: Any) -> float:
    L = case.loop.L
    w = np.geomspace(1e-2, 1e4, 20001)
    values = L(1j * w)
    k = np.flatnonzero((values.imag[:-1] < 0) & (values.imag[1:] >= 0) & (values.real[1:] < 0))
    return float(-1.02 / values.real[k[0]])


def scanned_margins(case: Any) -> tuple[float, int]:
    lag = 1 / float(np.abs(case.plant.poles()).max())
    for value in np.geomspace(lag, 20 * lag, 100):
        found = case.loop(LowPassFilter(float(value), 2)).margins().plant_loop
        if found.ms <= case.ms and found.delay_margin >= case.delay_margin:
            return float(value), 2
    raise AssertionError


@once_a_case
def asked_the_package(case: Any) -> Any:
    one = ct.tf([1], [1, 1])
    T = case.double_lag
    plants = [
        nrdob.delay(case.delay) * one,
        one * ct.tf([-1 / case.zero, 1], [1]),
        one * ct.tf([1], [case.lag, 1]),
        one * ct.tf([1], np.polymul([T, 1], [T, 1])),
    ]
    sets = (nrdob.stabilizing_time_constants(plant, one, case.order) for plant in plants)
    return np.array([found[-1][0] for found in sets])


@once_a_case
def scanned_orders(case: Any) -> tuple[int, float]:
    zero = float(case.plant.zeros().real.max())
    best = (0.0, 0, 0.0)
    for order in (2, 3, 4):
        for value in np.geomspace(5, 0.05, 150) / zero:
            F = LowPassFilter(float(value), order)
            found = NRDOB(case.plant, case.model, 0, F).margins().plant_loop
            if not found.stable or found.ms > case.max_ms:
                break
            best = max(best, (F.bandwidth, order, F.time_constant))
    return best[1], best[2]


def scanned_for_three(case: Any) -> LowPassFilter:
    zero = min(float(plant.zeros().real.max()) for plant in case.plants)

    def holds(F: LowPassFilter) -> bool:
        found = (NRDOB(plant, case.model, 0, F).margins().plant_loop for plant in case.plants)
        return all(each.stable and each.ms <= case.max_ms for each in found)

    good, step = LowPassFilter(12 / zero, case.order), 0.8
    while step < 0.99:  # in large steps down to where it fails, then on in smaller ones
        F = LowPassFilter(step * good.time_constant, case.order)
        assert F.time_constant > 1 / zero
        good, step = (F, step) if holds(F) else (good, step**0.5)
    return good


def strong_and_backwards(case: Any) -> Any:
    plant = 30 * case.model * (2 - s) / (s + 2) / (0.1 * s + 1)
    return plant.num[0][0], plant.den[0][0]


def two_slow_poles(case: Any) -> ct.TransferFunction:
    n = case.model.poles().size
    w = np.geomspace(1e-3, 1e4, 4001) * case.fastest

    def price(F: ct.TransferFunction) -> float:
        F_w = F(1j * w)
        noise = np.trapezoid(np.abs(F_w) ** 2, w) / pi
        error = np.trapezoid(np.abs((1 - F_w) / w) ** 2, w) / pi
        return float(max(noise / case.noise, error / case.error))

    tried = []
    for slow in np.geomspace(0.08, 0.4, 60) * case.fastest:
        den = np.real(np.poly([-slow, *[-0.97 * case.fastest] * (n - 1)]))
        tried.append(ct.tf([den[-1]], den))
    return min(tried, key=price)


def parity_by_counting(case: Any) -> list[str]:
    found = []
    for process, model in case.pairs:
        roots = NRDOB(process, model, 0, LowPassFilter(0.01, 2)).p_B.roots
        found.append("+1" if np.sum(roots.real > 0) % 2 == 0 else "−1")
    return found


@once_a_case
def bisected(case: Any) -> float:
    low, high = 1e-3 * case.process.delay, 20 * case.process.delay
    while high / low > 1.0002:
        middle = (low * high) ** 0.5
        loop = NRDOB(case.process, case.model, 0, LowPassFilter(middle, case.order))
        stable = loop.stability().observer_loop.stable
        low, high = (low, middle) if stable else (middle, high)
    return high


@once_a_case
def edge_by_bisection(case: Any) -> list[Any]:
    def stable(value: float) -> bool | None:
        F = LowPassFilter(value, 2)
        return NRDOB(case.process, case.model, 0, F).stability().observer_loop.stable

    low, high = 1e-3, 1e2
    below = bool(stable(low))
    for _ in range(30):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if bool(stable(middle)) is below else (low, middle)
    return [np.array([high]), " Below" if below else "ABOVE"]


def more_lags(case: Any) -> tuple[Any, str]:
    k, p, a = case.gain, case.pole, case.decay
    den = np.real(np.poly([-p, -a, -20 * a, -20 * a]))
    return ([k], den / (20 * a) ** 2), "6"


@once_a_case
def turned_and_bisected(case: Any) -> float:
    """Bisect λ until the largest ``|F|·|1 - exp(-jωΔ)|`` is 1."""
    w = np.linspace(0, pi, 20_001)[1:] / case.error
    size = 2 * np.sin(w * case.error / 2)
    low, high = 1e-3 * case.error, 10 * case.error
    for _ in range(60):
        middle = (low * high) ** 0.5
        lost = (size / (1 + (middle * w) ** 2) ** (case.order / 2)).max() > 1
        low, high = (middle, high) if lost else (low, middle)
    return high


def worst_dead_time(case: Any) -> float:
    """Let the package find the edges for many dead times, and take the worst."""
    edges = []
    for dead_time in np.linspace(30, 33.2, 8) * case.error:  # a whole turn and more
        found = nrdob.critical_time_constants(
            nrdob.delay(dead_time + case.error) * case.prompt,
            nrdob.delay(dead_time) * case.prompt,
            case.order,
            floor=0.2 * case.error,
        )
        edges.append(found[-1].time_constant if found else 0.0)
    return max(edges)


@once_a_case
def scanned_design(case: Any, step: float = 0.9) -> NRDOB:
    """Slow a filter down, or speed it up, until the feared plant is held as it should be."""
    model = case.gain / ((s + case.pole) * (s / case.decay + 1))
    controller = case.pole * (s + case.pole) / (case.gain * s)
    w = np.geomspace(1e-3, 1e4, 2001) * case.pole
    value = 0.3 / case.pole
    while value > 0.01 / case.pole:
        loop = NRDOB(case.feared, model, controller, LowPassFilter(value, 2))
        found = loop.margins().plant_loop
        quiet = np.abs(loop.U_eta(1j * w)).max() <= case.max_noise
        if found.stable and found.ms <= case.max_ms and quiet:
            return NRDOB(case.process, model, controller, LowPassFilter(value, 2))
        value *= step
    raise AssertionError


def package_design(case: Any, suggested: bool = False) -> NRDOB:
    """Let the package find the filter, and the model, too."""
    model = case.gain / ((s + case.pole) * (s / case.decay + 1))
    if suggested:
        model = nrdob.suggest_model(case.process)[0].model
    controller = nrdob.design_controller(model, bandwidth=case.pole, phase_margin=60)
    F = nrdob.design_filter(case.feared, model, order=2, max_ms=case.max_ms)
    w = np.geomspace(1e-3, 1e4, 2001) * case.pole
    value = F.time_constant
    while value < 1 / case.pole:
        loop = NRDOB(case.feared, model, controller, LowPassFilter(value, 2))
        if np.abs(loop.U_eta(1j * w)).max() <= case.max_noise:
            break
        value *= 1.05
    return NRDOB(case.process, model, controller, LowPassFilter(value, 2))


def measured_rejection(case: Any) -> float:
    w = 1e-4 * float(np.abs(case.plant.poles()).min())

    def size(model: Any, F: LowPassFilter) -> float:
        return float(abs(NRDOB(case.plant, model, 0, F).S_d(1j * w)))

    wanted, one = size(case.model, case.filter), LowPassFilter(1e-3, case.order)
    return 1e-3 * wanted / size(case.other, one)


@once_a_case
def scanned_down(case: Any) -> float:
    edge = nrdob.stabilizing_time_constants(case.modified, case.model, 3)[-1][1]
    for value in np.linspace(0.98, 0.2, 60) * edge:
        F = LowPassFilter(float(value), 3)
        loops = [NRDOB(plant, case.model, 0, F) for plant in (case.plant, case.modified)]
        if all(loop.margins().plant_loop.ms <= case.max_ms for loop in loops):
            return float(value)
    raise AssertionError


def searched_plants(case: Any) -> Any:
    for gain in np.linspace(1, case.gain, 6):
        for lag in np.linspace(case.lag, 0, 6):
            if case.changed(gain, lag).stability().stable is False:
                return np.array([gain, lag])
    raise AssertionError


@once_a_case
def peaks_on_a_grid(case: Any) -> Any:
    w = np.geomspace(1e-3, 1e4, 6000) * float(np.abs(case.model.poles()).min())
    found = []
    for F in case.filters:
        loops = [NRDOB(plant, case.model, case.controller, F) for plant in case.plants]
        lost = any(loop.stability().stable is not True for loop in loops)
        peak = max(float(np.abs(loop.S_d(1j * w)).max()) for loop in loops)
        found.append(inf if lost else peak)
    return np.array(found)


@once_a_case
def another_design(case: Any) -> list[Any]:
    model = ct.tf([case.gain * case.pole * case.decay], np.poly([-case.pole, -case.decay]))
    controller = nrdob.design_controller(model, bandwidth=case.pole, phase_margin=60)
    for value in np.geomspace(0.05, 0.1, 25) / case.pole:
        F = LowPassFilter(float(value), 3)
        if all(goal.met for goal in case.goals(model, controller, F)):
            return [model, controller, F]
    raise AssertionError


ROUTES: dict[str, list[Route]] = {
    "1.1": [settled_by_three_equations, nearly_settled],
    "1.3": [
        by_control,
        by_its_roots,
        lambda case: np.polynomial.Polynomial(by_control(case).num[0][0][::-1]),
    ],
    "1.4": [straight_line],
    "1.5": [weaker_twin, closed_by_control],
    "1.6": [scanned_wishes],
    "2.1": [
        lambda case: (
            sum(z.real > 0 for z in case.closed_loop_roots)
            - float(sum(z.real > 0 for z in (*case.plant_poles, *case.model_zeros)))
        )
    ],
    "2.3": [spelled_counts],
    "2.4": [unwrapped, counted_on_a_ray],
    "2.6": [scanned_filter],
    "3.1": [circles],
    "3.3": [with_stability_margins],
    "3.4": [interpolated],
    "3.5": [lost_gain],
    "3.6": [scanned_margins],
    "4.1": [asked_the_package],
    "4.2": [scanned_orders, lambda case: np.array(scanned_orders(case))],
    "4.3": [scanned_for_three],
    "4.5": [strong_and_backwards],
    "4.6": [two_slow_poles],
    "5.1": [parity_by_counting],
    "5.3": [bisected],
    "5.4": [edge_by_bisection],
    "5.5": [
        more_lags,
        lambda case: (model for model in more_lags(case)),
        lambda case: np.array(more_lags(case), dtype=object),
    ],
    "5.6": [scanned_design, package_design, partial(package_design, suggested=True)],
    "5.7": [turned_and_bisected, worst_dead_time],
    "6.1": [measured_rejection],
    "6.2": [scanned_down],
    "6.4": [searched_plants],
    "6.5": [peaks_on_a_grid],
    "6.6": [another_design],
}


# --- answers that look right --------------------------------------------------------------------


def row_for_row(change: Callable[[str, Any], Any]) -> Route:
    def table(case: Any) -> dict[str, Any]:
        return {name: change(name, row) for name, row in settled_by_three_equations(case).items()}

    return table


def promised(change: Callable[[float, float, float], Any]) -> Route:
    return lambda case: change(*(float(text.replace(",", ".")) for text in circles(case)))


def delays(pick: Callable[[Any], float]) -> Route:
    def found(case: Any) -> float:
        k = np.flatnonzero(np.diff(np.abs(case.L) > 1))
        return float(pick(np.mod(np.angle(-case.L[k]), 2 * pi) / case.omega[k]))

    return found


def mirrored(case: Any) -> Any:
    return case.gain / ((s + case.pole) * (s + case.decay))


def around(case: Any, model: Any, controller: float, value: float) -> NRDOB:
    return NRDOB(case.process, model, controller, LowPassFilter(value, 2))


def own_plant(case: Any) -> NRDOB:
    return around(case, case.process, 2 * case.pole * case.decay / case.gain, 0.1 / case.pole)


WRONG: dict[str, list[Route]] = {
    "1.1": [
        row_for_row(lambda name, row: -row),
        row_for_row(lambda name, row: row[[1, 0, 2]]),
        row_for_row(lambda name, row: row * (name != "d")),
        lambda case: dict.fromkeys(("R", "delta", "d", "eta"), (0, 0, 0)),
        row_for_row(lambda name, row: [*row[:2], row[2] + (name == "eta")]),
    ],
    "1.3": [
        lambda case: np.polymul(case.D, case.Nm),
        lambda case: np.polymul(by_control(case).num[0][0], [1, 1]),
        lambda case: -by_control(case).num[0][0] + np.eye(1, by_control(case).num[0][0].size)[0],
        lambda case: np.polymul(case.D, case.Dm),
        lambda case: np.polyadd(
            np.polymul(np.polymul(case.D, case.Nm), [case.time_constant**case.order, 0, 0]),
            np.polymul(case.N, case.Dm),
        ),
    ],
    "1.4": [
        lambda case: 1.0,
        lambda case: 0.75 * straight_line(case),
        lambda case: 1.25 * straight_line(case),
        lambda case: -straight_line(case),
    ],
    "1.5": [
        lambda case: (2.0, [1.0], np.polymul(case.loop.filter.den, [0.1, 1])),
        lambda case: (2.0, [2.0], np.polyadd(case.loop.filter.den, [2.0])),
        lambda case: (0.5, [2.0], np.polyadd(case.loop.filter.den, [1.0])),
        lambda case: (1.0001, [1.0], case.loop.filter.den),
    ],
    "1.6": [
        lambda case: LowPassFilter(0.01 / case.omega_d, case.relative_degree + 1),
        lambda case: LowPassFilter(1 / case.omega_hum, case.relative_degree + 1),
        lambda case: LowPassFilter(1 / case.omega_d, case.relative_degree + 1),
    ],
    "2.1": [
        lambda case: 0,
        lambda case: int(np.sum(case.closed_loop_roots.real > 0)),
        lambda case: -int(np.sum(case.plant_poles.real > 0)),
        lambda case: -int(np.sum(case.model_zeros.real > 0)),
    ],
    "2.3": [
        lambda case: (0, 0, 0),
        lambda case: (-1, 1, 0),
        lambda case: [float(text) + 1 for text in spelled_counts(case)],
        lambda case: [float(text) for text in spelled_counts(case)[::-1]],
    ],
    "2.4": [
        lambda case: 0,
        lambda case: (case.poles_at_zero + case.excess) / 2,
        lambda case: unwrapped(case) + 1,
        lambda case: round(unwrapped(case)) / 2,
        lambda case: -np.angle((1 + case.values)[-1] / (1 + case.values)[0]) / pi,
    ],
    "2.5": [
        lambda case: around(case, mirrored(case), 0.0, 0.1 / case.pole),
        lambda case: around(case, -mirrored(case), -1.0, 0.1 / case.pole),
        own_plant,
    ],
    "2.6": [
        lambda case: around(case, -mirrored(case), 0.0, 0.1 / case.pole),
        lambda case: around(case, mirrored(case), 0.0, 10 / case.pole),
        lambda case: around(case, mirrored(case), 0.0, 0.01 / case.zero),
        lambda case: around(case, case.process, 0.0, 0.1 / case.pole),
    ],
    "3.1": [
        promised(lambda low, high, angle: (low, high, -angle)),
        promised(lambda low, high, angle: (low, high, 360 - angle)),
        promised(lambda low, high, angle: (low, high, 360 + angle)),
        promised(lambda low, high, angle: (high, low, angle)),
    ],
    "3.3": [
        delays(lambda found: found[0]),
        delays(lambda found: found[1]),
        delays(lambda found: found[-1]),
        delays(lambda found: found.mean()),
        delays(lambda found: np.degrees(found.min())),
    ],
    "3.4": [
        lambda case: 1 / case.size,
        lambda case: float(case.omega[np.argmax(case.S_eta)]),
        lambda case: 2 * interpolated(case),
        lambda case: 0.5 * interpolated(case),
    ],
    "3.5": [
        lambda case: 2.0,
        lambda case: 10.0,
        lambda case: case.loop.margins().observer_loop.gm_high,
        lambda case: -1.0,
    ],
    "3.6": [
        lambda case: LowPassFilter(case.delay_margin, 2),
        lambda case: LowPassFilter(case.rejection / case.omega, 2),
        lambda case: LowPassFilter(case.rejection / case.omega / 4, 2),
        lambda case: LowPassFilter(scanned_margins(case)[0], 1),
    ],
    "4.1": [
        lambda case: [case.delay, 1 / case.zero, 0, case.double_lag],
        lambda case: asked_the_package(case)[::-1],
        lambda case: [1 / edge if edge else 0 for edge in asked_the_package(case)],
        lambda case: 1.03 * asked_the_package(case),
        lambda case: 0.97 * asked_the_package(case),
    ],
    "4.2": [
        lambda case: (3, scanned_orders(case)[1]),
        lambda case: (2, 2 * scanned_orders(case)[1]),
        lambda case: (2, 1 / float(case.plant.zeros().real.max())),
    ],
    "4.3": [
        lambda case: LowPassFilter(1 / float(case.plants[0].zeros().real.max()), case.order),
        lambda case: LowPassFilter(10 / float(case.plants[0].zeros().real.max()), case.order),
        lambda case: nrdob.design_filter(
            case.plants[1], case.model, order=case.order, max_ms=case.max_ms
        ),
    ],
    "4.5": [
        lambda case: case.model * (1 - s) / (1 + s),
        lambda case: 1.2 * case.model,
        lambda case: 20 * case.model / (s + 1) ** 3,
        lambda case: -20 * case.model * (1 - s) / (1 + s),
    ],
    "4.6": [
        lambda case: LowPassFilter(1 / case.fastest, case.model.poles().size),
        lambda case: LowPassFilter(4 / case.fastest, case.model.poles().size + 1),
        lambda case: ct.tf([1], [2 / case.fastest, 1]),
    ],
    "5.1": [
        lambda case: [1] * 5,
        lambda case: [-1] * 5,
        lambda case: [1, -1, 1, -1, 1],
        lambda case: [-np.sign(process.dcgain()) for process, _ in case.pairs],
    ],
    "5.3": [
        lambda case: case.process.delay,
        lambda case: case.process.delay / case.order,
        lambda case: 1.01 * bisected(case),
        lambda case: 0.99 * bisected(case),
    ],
    "5.4": [
        lambda case: (edge_by_bisection(case)[0], "above and below"),
        lambda case: (1.3 * edge_by_bisection(case)[0], edge_by_bisection(case)[1]),
        lambda case: (edge_by_bisection(case)[0] / 1.3, edge_by_bisection(case)[1]),
    ],
    "5.5": [
        lambda case: (mirrored(case), 4),
        lambda case: (mirrored(case) / (s + 1), 3),
        lambda case: (-mirrored(case) / (s + 1), 5),
    ],
    "5.6": [
        lambda case: around(case, case.process, 0.0, 0.1 / case.pole),
        lambda case: around(case, scanned_design(case).model, 0.0, 0.1 / case.pole),
        lambda case: around(case, scanned_design(case).model, 1.0, 2 / case.pole),
    ],
    "5.7": [
        lambda case: case.error,
        lambda case: case.dead_time / 2,
        lambda case: 1.01 * turned_and_bisected(case),
        lambda case: 0.99 * turned_and_bisected(case),
    ],
    "6.1": [
        lambda case: case.filter.time_constant / 2,
        lambda case: case.filter.order * case.filter.time_constant,
        lambda case: 1.02 * measured_rejection(case),
    ],
    "6.2": [
        lambda case: 1.2 * scanned_down(case),
        lambda case: 0.8 * scanned_down(case),
        lambda case: 1 / float(np.abs(case.plant.poles()).min()),
    ],
    "6.4": [
        lambda case: (1, 0),
        lambda case: (case.gain, case.lag / 2),
        lambda case: (1, 3 * case.lag),
        lambda case: (0.01, case.lag),
    ],
    "6.5": [
        lambda case: [inf] * len(case.filters),
        lambda case: [max(peaks_on_a_grid(case))] * len(case.filters),
        lambda case: 1.03 * peaks_on_a_grid(case),
        lambda case: peaks_on_a_grid(case)[::-1],
    ],
    "6.6": [
        lambda case: (case.plant, 0, LowPassFilter(0.07 / case.pole, 3)),
        lambda case: (another_design(case)[0], 0, LowPassFilter(0.07 / case.pole, 3)),
        lambda case: [*another_design(case)[:2], LowPassFilter(0.07 / case.pole, 2)],
    ],
}
ROUTES |= benchroutes.ROUTES
WRONG |= benchroutes.WRONG

LONG = ("4.3", "5.6", "7.6")
"""Problems whose scans take seconds."""

each_route = pytest.mark.parametrize(
    ("id", "number"),
    [
        pytest.param(id, k, marks=[pytest.mark.slow] * (id in LONG))
        for id, routes in ROUTES.items()
        for k in range(len(routes))
    ],
)
each_wrong = pytest.mark.parametrize(
    ("id", "number"), [(id, k) for id, wrong in WRONG.items() for k in range(len(wrong))]
)


@pytest.mark.thorough
@each_route
def test_another_route_gets_full_marks(id: str, number: int) -> None:
    found = points(id, ROUTES[id][number], group=2)
    assert found.share == 1, found.text


@pytest.mark.thorough
@each_wrong
def test_what_only_looks_right_fails(id: str, number: int) -> None:
    found = points(id, WRONG[id][number], group=2)
    assert found.share < 1, found.text
    assert found.recognised != "rounded"


CHEAP = [id for id in WRONG if id not in ("4.1", "4.2", "5.3", "5.6", "6.2", "6.5", "6.6", "7.6")]


# Two groups besides that of the test above; tests/campaigns/misconceptions.py has many.
@pytest.mark.thorough
@pytest.mark.parametrize("id", CHEAP)
def test_what_only_looks_right_fails_in_other_groups(id: str) -> None:
    for wrong in WRONG[id]:
        assert not [group for group in (1, 8) if points(id, wrong, group).share == 1]


# --- the published answers, with fewer digits and in another dress ------------------------------


ALL = [problem for path in SETS for problem in posed(path)]
each_problem = pytest.mark.parametrize("this", ALL, ids=lambda this: this.id)


def changed(this: Posed, group: int, change: Route) -> Any:
    """What comes of the published answer with every result changed."""
    right = published(this, group)
    answer = change(right) if this.problem.own else lambda case: change(right(case))
    return score(this.id, answer, group, points=1, seed=900_000 + group).feedback


@pytest.mark.thorough
@each_problem
@pytest.mark.parametrize("digits", [3, 4, 6])
def test_a_rounded_right_answer_is_right_or_told_so_and_never_accused(
    this: Posed, digits: int
) -> None:
    found = changed(this, 2, partial(rounded, digits=digits))
    if digits >= 4:
        assert found.share == 1, found.text
    elif digits == 3:
        assert found.share == 1 or (found.share > 0.5 and "rounded" in found.text), found.text
        assert found.share == 1 or "four digits" in found.text
    assert found.recognised in ("", "rounded")


def dressed(dress: Route, value: Any) -> Any:
    """Dress every number of an answer."""
    if isinstance(value, dict):
        return {key: dressed(dress, each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [dressed(dress, each) for each in value]
    if isinstance(value, int | float | np.number):
        return dress(float(value))
    return value


DRESSES: dict[str, Route] = {
    "list": lambda x: [x],
    "array": lambda x: np.array([x]),
    "array without axes": lambda x: np.array(x),
    "text": lambda x: f" {x!r}",
    "text with a comma": lambda x: f"{x!r}".replace(".", ",").replace("-", "−"),
    "complex": lambda x: complex(x, 1e-17 if np.isfinite(x) else 0.0),
    "python-control": lambda x: ct.tf([x], [1]) if np.isfinite(x) else x,
    "numpy.polynomial": lambda x: np.polynomial.Polynomial([x]),
    "poly1d": lambda x: np.poly1d([x]),
    "object": lambda x: Fraction(x) if np.isfinite(x) else x,
}


USUAL = ("array", "text with a comma")
"""Dresses that make quick looks at, too."""

BLOCKS = ("1.6", "2.5", "2.6", "3.6", "4.3", "4.5", "4.6", "5.6", "6.6", "7.6")
"""Problems that ask for a filter, a plant or a loop, and not for numbers."""


@pytest.mark.thorough
@pytest.mark.parametrize(
    "this", [this for this in ALL if this.id not in BLOCKS], ids=lambda this: this.id
)
@pytest.mark.parametrize(
    "dress",
    [pytest.param(dress, marks=[pytest.mark.slow] * (dress not in USUAL)) for dress in DRESSES],
)
def test_a_right_answer_may_wear_any_dress(this: Posed, dress: str) -> None:
    found = changed(this, 2, partial(dressed, DRESSES[dress]))
    assert found.share == 1, found.text


MISFITS = [
    True, None, "two", "2 s", 1 + 1j, {}, {1.0}, [], [1, 2, 3, 4, 5, 6, 7], b"x", object(), print,
    ct.tf([1], [1, 1]), np.polynomial.Polynomial([1, 1]), LowPassFilter(1.0, 1), np.nan, np.inf,
    np.array([[1, 2], [3, 4]]), 10**400, NRDOB(ct.tf([1], [1, 1]), ct.tf([1], [1, 1]), 1,
    LowPassFilter(1.0, 1)),
]  # fmt: skip


@pytest.mark.thorough
@each_problem
def test_what_is_no_answer_is_told_kindly(this: Posed) -> None:
    for misfit in MISFITS:
        answer = misfit if this.problem.own else lambda case, misfit=misfit: misfit
        found = score(this.id, answer, 2, points=1, seed=900_002).feedback
        assert found.share < 1, misfit
        assert not re.search(r"Error\b", found.text), (misfit, found.text)
        assert len(found.text) < 1000


def filled(data: Any, value: float) -> Any:
    """Write one number in the place of every number of an answer, as it is sent to the graders."""
    match data:
        case {"tf": [num, den, dt]}:
            return {"tf": [filled(num, value), filled(den, value), dt]}
        case {"filter": _}:
            return {"filter": [value, 1]}
        case dict():
            return {k: part if k == "shape" else filled(part, value) for k, part in data.items()}
        case list():
            return [filled(each, value) for each in data]
        case str() | bool() | None:
            return data
    return value


@pytest.mark.thorough
@pytest.mark.parametrize("value", [1e308, 1.7e308])
@each_problem
def test_numbers_whose_sums_overflow_earn_nothing(this: Posed, value: float) -> None:
    try:
        found = changed(this, 2, lambda right: decode(filled(encode(right), value)))
    except ValueError:  # blocks that cannot be built are refused where they arrive
        assert this.id in BLOCKS
        return
    assert found.share == 0, found.text
