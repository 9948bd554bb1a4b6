"""Other routes through set 7, and answers to it that only look right."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import control as ct
import numpy as np
from scipy.signal import cont2discrete

from nrdob import NRDOB, LowPassFilter, delay
from nrdob.digital import ActuatorLimits
from nrdob.drives import Counting, Encoder, encoded
from problemsets import once_a_case

Route = Callable[[Any], Any]

s = ct.tf("s")


def counted_by_the_package(case: Any) -> list[Any]:
    step = Encoder(case.counts).step / case.dt
    for m in range(1, 100):
        if case.inertia * step / m / case.time_constant <= case.ripple:
            return [step, m, Counting(m).delay(case.dt)]
    raise AssertionError


def counted_on_a_ramp(case: Any) -> tuple[float, float, float]:
    """Find the delay on an angle t²/2, whose speed is t."""
    step, m, _ = counted_by_the_package(case)
    then = 10 * m * case.dt
    seen = (then**2 - (then - m * case.dt) ** 2) / 2 / (m * case.dt)
    return step, m, then - seen


def by_scipy(case: Any) -> Any:
    block = [case.inertia, case.friction], [case.time_constant, 1]
    num, den, _ = cont2discrete(block, case.dt, "bilinear")
    return np.array([num[0, 0], num[0, 1], -den[1]])


def by_trapezoids(case: Any) -> tuple[float, float, float]:
    """Integrate λw' + w = Jy' + by over a sample, after an impulse of y, with trapezoids."""
    J, b, value, h = case.inertia, case.friction, case.time_constant, case.dt

    def following(w: float, y: float, y_next: float) -> float:
        right = J * (y_next - y) + h * (b * (y + y_next) - w) / 2 + value * w
        return float(right / (value + h / 2))

    first = following(0, 0, 1)
    second = following(first, 1, 0)
    third = following(second, 0, 0)
    a = third / second
    return first, second - a * first, a


@once_a_case
def behind(case: Any) -> tuple[NRDOB, float, float]:
    """Put the loop together that a program was made of, on the drive's own plant."""
    h, tables = case.dt, case.module
    pole = 1 - tables["FILTER"][0][3]
    value = h / 2 * (1 + pole) / (1 - pole)
    b0, b1, *_ = tables["INVERSE"][0]
    # At z = -1 the block is J/λ; there D is -2.
    inertia = value * (b0 * -2 + b1) / (-2 + 1 - pole)
    friction = tables["INVERSE"][0][5]
    kp, ki = tables["CONTROLLER"][0][0], tables["CONTROLLER"][0][1] / h
    model = 1 / (inertia * s + friction)
    plant = delay(case.delay) / (case.drive.inertia.inertia * s + case.drive.friction.viscous)
    C = ((kp - ki * h / 2) * s + ki) / s
    return NRDOB(plant, model, C, LowPassFilter(value, 1)), value, inertia


def by_the_linear_verdict(case: Any) -> tuple[float, float, Any]:
    loop, value, inertia = behind(case)
    return value, inertia, encoded(loop.sampled(case.dt), Counting()).stability().stable


def by_the_packages_simulation(case: Any) -> list[Any]:
    loop, value, inertia = behind(case)
    limits = ActuatorLimits(-case.limit, case.limit)
    run = case.drive.simulate(
        loop.sampled(case.dt), {"R": case.reference}, timepts=case.time, limits=limits
    )
    late = run.speed[run.time > 0.8 * case.time] / case.reference
    return [value, inertia, "yes" if np.abs(late - 1).max() < 0.05 else "no"]


def by_responses(case: Any) -> tuple[float, float]:
    """Read S_δ(0) and the area under the response off steps of the load."""
    force = case.friction.breakaway
    slow = 40 * float(np.max(-1 / case.keen.p_B.roots.real))
    time = np.linspace(0, slow, 20_001)
    calm, keen = (
        each.step_response("delta", time).outputs[0, 0] for each in (case.calm, case.keen)
    )
    return abs(calm[-1]) * force, 2 * force * np.trapezoid(keen, time) / case.error


def by_the_definition(case: Any) -> list[float]:
    """From the polynomials: (1 - F)Gm at zero, and its slope."""
    force, found = case.friction.breakaway, []
    for loop, power in ((case.calm, 1), (case.keen, 2)):
        num, den = loop.fractions.F.num, loop.fractions.F.den
        rest = np.polysub(den, num)[-1 - power] / den[-1]  # 1 - F = rest s^power + …
        Gm = loop.fractions.Gm
        found.append(rest * Gm.num[-1] / Gm.den[-2])
    return [found[0] * force, 2 * force * found[1] / case.error]


def largest_ms(case: Any, K: ct.TransferFunction) -> float:
    """Ms over the three loads, by python-control's own discrete systems; K is in the feedback."""
    w = np.geomspace(1e-4, 1, 4000) * np.pi / case.dt
    z = np.exp(1j * w * case.dt)
    K_z = ct.sample_system(K, case.dt, "tustin")(z)
    return float(max(
        np.max(1 / np.abs(1 + K_z * ct.sample_system(G, case.dt, "zoh")(z) / z))
        for G in case.processes
    ))  # fmt: skip


@once_a_case
def scanned_shaft(case: Any, extra: float = 0.0) -> NRDOB:
    """Speed the filter up until Ms is near its limit; the model may have a part of the load."""
    model = 1 / ((case.motor + extra * case.load) * s + case.friction)
    for share in (4.6, 4.3, 4.0, 3.8):
        value = share * case.dt * (1 + extra * case.load / case.motor)
        if largest_ms(case, 1 / (value * s * model)) <= 0.99 * case.max_ms:
            best = value
    C = 0.02 / (case.dt * s * model)
    return NRDOB(case.process, model, ct.minreal(C, verbose=False), LowPassFilter(best, 1))


ROUTES: dict[str, list[Route]] = {
    "7.1": [counted_by_the_package, counted_on_a_ramp],
    "7.2": [by_scipy, by_trapezoids],
    "7.4": [by_the_linear_verdict, by_the_packages_simulation],
    "7.5": [by_responses, by_the_definition],
    "7.6": [scanned_shaft, lambda case: scanned_shaft(case, 0.1)],
}


def changed_part(route: Route, k: int, factor: float) -> Route:
    def found(case: Any) -> list[Any]:
        answer = list(route(case))
        answer[k] *= factor
        return answer

    return found


WRONG: dict[str, list[Route]] = {
    "7.1": [
        lambda case: (Encoder(case.counts).step, 1, 0),
        changed_part(counted_by_the_package, 0, 60 / (2 * np.pi)),
        changed_part(counted_by_the_package, 2, 1000),
        lambda case: [60, *counted_by_the_package(case)[1:]],
    ],
    "7.2": [
        lambda case: by_scipy(case)[::-1],
        lambda case: (by_scipy(case)[0], -by_scipy(case)[1], by_scipy(case)[2]),
        lambda case: by_scipy(case) * [1, 1, 1.01],
        lambda case: (case.friction, 0, 0),
    ],
    "7.4": [
        lambda case: (*by_the_linear_verdict(case)[:2], False),
        changed_part(by_the_linear_verdict, 0, 1000),
        changed_part(by_the_linear_verdict, 1, 1.02),
        lambda case: (case.dt, case.drive.inertia.inertia, by_the_linear_verdict(case)[2]),
    ],
    "7.5": [
        lambda case: by_the_definition(case)[::-1],
        changed_part(by_the_definition, 0, 0.5),
        changed_part(by_the_definition, 1, 2.0),
        lambda case: (0.0, by_the_definition(case)[1]),
    ],
    "7.6": [
        lambda case: NRDOB(case.process, case.process, 0, LowPassFilter(4 * case.dt, 1)),
        lambda case: NRDOB(case.processes[0], *_parts(scanned_shaft(case))),
        lambda case: LowPassFilter(4 * case.dt, 1),
        lambda case: NRDOB(
            case.process, scanned_shaft(case).model, 1e-6 * scanned_shaft(case).controller,
            LowPassFilter(4 * case.dt, 1),
        ),
        lambda case: NRDOB(
            case.process, scanned_shaft(case).model, scanned_shaft(case).controller,
            LowPassFilter(0.6 * case.dt, 1),
        ),
    ],
}  # fmt: skip


def _parts(loop: NRDOB) -> tuple[Any, Any, Any]:
    return loop.model, loop.controller, loop.filter
