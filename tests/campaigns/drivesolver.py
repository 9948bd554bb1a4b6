"""A drive integrated by SciPy, event by event: a second way, which shares no code with the first.

The friction is written anew here, as a function of the speed; SciPy's `solve_ivp` integrates it
with an adaptive rule and finds the events on its dense output.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from nrdob.drives import Friction, Motion, OneMass, TwoMasses

FINE = 20
"""Steps in a sample, at least: SciPy sees an event only where its sign differs at two steps."""


@dataclass
class Case:
    """A drive and the torques that it is moved by, each held for dt."""

    inertia: OneMass | TwoMasses
    friction: Friction
    dt: float
    torque: np.ndarray
    load: np.ndarray


def random_case(rng: np.random.Generator, samples: int = 60) -> Case:
    """Draw a drive and torques around its friction, so that it sticks and slips."""
    J = 10 ** rng.uniform(-4, -1)
    coulomb = 10 ** rng.uniform(-2, 0)
    dt = 10 ** rng.uniform(-3.5, -1.5)
    reached = coulomb / J * dt  # speed after a sample
    stiction = coulomb * rng.choice([1.0, rng.uniform(1, 2)])
    falling = rng.choice([0.0, 1.0]) * reached * 10 ** rng.uniform(0, 1.5)
    friction = Friction(coulomb, stiction, falling, rng.choice([0.0, 0.3]) * J / dt / 10)
    inertia: OneMass | TwoMasses = OneMass(J)
    if rng.random() < 0.5:
        Jl = J * 10 ** rng.uniform(-1, 1)
        turn = rng.uniform(0.1, 1.5) / dt  # antiresonance
        stiffness = Jl * turn**2
        inertia = TwoMasses(J, Jl, stiffness, rng.uniform(0, 0.05) * 2 * np.sqrt(stiffness * Jl))
    t = np.arange(samples)
    size = stiction * rng.uniform(1.0, 3.0)
    torque = size * np.sin(
        2 * np.pi * t / rng.uniform(8, 40)
    ) + 0.3 * coulomb * rng.standard_normal(samples)
    load = rng.choice([0.0, 0.3]) * coulomb * rng.standard_normal(samples)
    return Case(inertia, friction, dt, torque, load)


def exact(case: Case) -> np.ndarray:
    """Move by the package; states after each sample, shape (N, n)."""
    motion = Motion(case.inertia, case.friction, case.dt)
    rows = []
    for torque, load in zip(case.torque.tolist(), case.load.tolist(), strict=True):
        motion.advance(torque, load)
        rows.append(motion.states)
    return np.array(rows)


def moved(case: Case) -> int:
    """Count the events of friction."""
    motion = Motion(case.inertia, case.friction, case.dt)
    for torque, load in zip(case.torque.tolist(), case.load.tolist(), strict=True):
        motion.advance(torque, load)
    return motion.events


def integrated(case: Case) -> np.ndarray:
    """Move by SciPy; states after each sample, shape (N, n)."""
    two = isinstance(case.inertia, TwoMasses)
    x, direction, rows = np.zeros(4 if two else 2), 0, []
    for torque, load in zip(case.torque.tolist(), case.load.tolist(), strict=True):
        x, direction = _sample(case, x, direction, torque, load)
        rows.append(x)
    return np.array(rows)


def _sample(case, x, direction, torque, load):
    m, f = case.inertia, case.friction
    two = isinstance(m, TwoMasses)
    # A shaft that just breaks away has no acceleration yet: rounding is not to stop it.
    back = 1e-12 * f.breakaway / (m.motor if two else m.inertia) * case.dt

    def shaft(x):
        return m.stiffness * x[2] + m.damping * (x[1] - x[3]) if two else -load

    def slope(t, x):
        dry = 0.0
        if direction:
            part = max(0.0, 1 - direction * x[1] / f.stribeck_speed) if f.stribeck_speed else 0.0
            dry = direction * (f.coulomb + (f.breakaway - f.coulomb) * part)
        T = shaft(x)
        inertia = m.motor if two else m.inertia
        turning = (torque - dry - f.viscous * x[1] - T) / inertia if direction else 0.0
        return [x[1], turning, x[1] - x[3], (T + load) / m.load] if two else [x[1], turning]

    def stops(t, x):
        return direction * x[1] + back

    def breaks(t, x):
        return f.breakaway - abs(torque - shaft(x))

    def bends(t, x):
        return direction * x[1] - f.stribeck_speed

    stops.terminal = breaks.terminal = bends.terminal = True
    stops.direction = breaks.direction = -1
    t, bent = 0.0, 0
    for _ in range(200):
        if direction == 0 and abs(torque - shaft(x)) > f.breakaway * (1 + 1e-12):
            direction = 1 if torque > shaft(x) else -1
        if direction and direction * x[1] <= 0:
            # It was at rest, or turned back as the torque changed: is it held?
            push = torque - shaft(x)
            direction = int(np.sign(push)) if abs(push) > f.breakaway * (1 - 1e-9) else 0
        if not bent:
            bent = 1 if direction * x[1] < f.stribeck_speed else -1
        bends.direction = bent
        watched = [breaks] if not direction else [stops] + [bends] * bool(f.stribeck_speed)
        found = solve_ivp(
            slope, (t, case.dt), x, method="DOP853", rtol=1e-11, atol=1e-14 + 0 * np.abs(x),
            events=watched, max_step=case.dt / FINE,
        )  # fmt: skip
        t, x = found.t[-1], found.y[:, -1].copy()
        if found.status != 1:
            return x, direction
        if not direction:
            direction, bent = (1 if torque > shaft(x) else -1), 1
        elif len(found.t_events[0]):
            x[1] = 0.0
            push = torque - shaft(x)
            direction, bent = (int(np.sign(push)) if abs(push) > f.breakaway else 0), 1
        else:
            bent = -bent
    raise AssertionError("too many events")


def difference(case: Case) -> float:
    """Largest difference of the two, each state against its largest value."""
    ours, theirs = exact(case), integrated(case)
    size = np.abs(theirs).max(axis=0)
    return float((np.abs(ours - theirs) / np.where(size > 0, size, 1.0)).max())
