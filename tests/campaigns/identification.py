"""Plants of known numbers, measured with noise, and how often the stated intervals hold them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.stats import binomtest

from nrdob.measured import STRUCTURES, identify
from nrdob.measured.structures import Structure

from .runner import print_tally

NAMES = {
    0: (),
    1: ("lag",),
    2: ("slow lag", "fast lag"),
}


Held = dict[str, bool]


@dataclass(frozen=True)
class Measured:
    """A record, and the truth behind it."""

    structure: Structure
    truth: dict[str, float]
    t: np.ndarray
    u: np.ndarray
    y: np.ndarray


def signal(kind: str, count: int, slow: float, rng: np.random.Generator) -> np.ndarray:
    """A test signal whose changes are about as slow as the plant."""
    if kind == "step":
        return np.where(np.arange(count) < count // 8, 0.0, 1.0) + 2.0
    if kind == "binary":
        return 1.0 + np.cumprod(np.where(rng.random(count) < 0.7 / slow, -1.0, 1.0))
    waves = np.arange(1, 16)
    phases = 2 * np.pi * rng.random(15)
    return np.sin(2 * np.pi * np.outer(np.arange(count), waves) * 0.02 / slow * 5 + phases).sum(1)


def response(den: np.ndarray, num: np.ndarray, delay: float, u: np.ndarray) -> np.ndarray:
    """The plant, with a modal sum in closed form: an own way, not that of the package.

    Time in samples; den has simple roots.
    """
    y = np.zeros(u.size)
    steps = np.diff(u, prepend=u[0])
    time = np.arange(u.size) - delay
    roots = np.roots(den)
    rest = np.polyder(den)
    answer = np.zeros(u.size, dtype=complex)
    late = np.maximum(time, 0.0)
    for root in roots:
        weight = np.polyval(num, root) / np.polyval(rest, root)
        answer += weight * (np.expm1(root * late) / root if root else late)
    answer[time < 0] = 0
    y = np.convolve(steps, answer.real)[: u.size]
    return np.asarray(y)


DISTURBANCES = ("white", "coloured", "drift", "rounded")
"""White noise; an autoregression with φ = 0.9; a random walk with white noise; a coarse sensor."""


def disturbance(kind: str, count: int, rng: np.random.Generator) -> np.ndarray:
    """A disturbance of about unit size."""
    white = rng.standard_normal(count + 200)
    if kind == "coloured":
        return np.asarray(lfilter([np.sqrt(1 - 0.81)], [1.0, -0.9], white)[200:])
    if kind == "drift":
        walk = np.cumsum(white[:count]) * rng.uniform(0.5, 3) / np.sqrt(count)
        return np.asarray(walk + 0.3 * rng.standard_normal(count))
    return white[200:] * (0.4 if kind == "rounded" else 1.0)


def measured(
    structure: Structure,
    kind: str,
    disturbed: str,
    rng: np.random.Generator,
    noise: float = 0.05,
) -> Measured:
    """A random plant of a structure, and a record of it; `noise` is relative to the output."""
    count = 600
    step = float(np.exp(rng.uniform(-4, 2)))
    slow = float(np.exp(rng.uniform(np.log(6), np.log(30))))
    fast = slow * rng.uniform(0.15, 0.5)
    delay = float(rng.uniform(0, 15))
    gain = float(np.exp(rng.uniform(-2, 2)) * rng.choice([-1, 1]))
    truth = {"gain": gain / step if structure.integrates else gain, "dead time": delay * step}
    den = np.ones(1)
    for lag, name in zip((slow, fast), NAMES[structure.lags], strict=False):
        den = np.convolve(den, [lag, 1.0])
        truth[name] = lag * step
    den = np.append(den, 0.0) if structure.integrates else den
    num = np.array([gain])
    if structure.zero:
        lead = float(rng.choice([-1, 1]) * rng.uniform(0.5, 1.5) * slow * 0.7)
        num = gain * np.array([lead, 1.0])
        truth["lead of the zero"] = lead * step
    u = signal(kind, count, slow, rng)
    clean = response(den / den[0], num / den[0], delay, u)
    # Of an integrator's long ramp a share would drown every change of its slope.
    size = 0.4 * abs(gain) * slow if structure.integrates else clean.std()
    y = 5.0 + clean + noise * size * disturbance(disturbed, count, rng)
    if structure.integrates:
        y += 0.01 * gain * np.arange(count)
    if disturbed == "rounded":
        y = 3 * noise * size * np.round(y / (3 * noise * size))
    return Measured(structure, truth, 3.0 + step * np.arange(count), u, y)


def held(structure: Structure, kind: str, disturbed: str, rng: np.random.Generator) -> Held:
    """Whether each interval of 95 % holds the truth, by name."""
    case = measured(structure, kind, disturbed, rng)
    found = identify(case.t, case.u, case.y, structure=structure.name, held_out=0)
    return {
        name: bool(p.low <= case.truth[name] <= p.high)
        for name, p in found.parameters.items()
        if name in case.truth
    }


def coverage(count: int, seed: int) -> dict[str, int]:
    """How often an interval of 95 % holds the truth."""
    tally: dict[str, int] = {}
    for structure in (STRUCTURES[1], STRUCTURES[3]):
        for kind in ("step", "binary"):
            for disturbed in DISTURBANCES:
                seeds = [seed, len(structure.name), len(kind), len(disturbed)]
                cases = [
                    held(structure, kind, disturbed, np.random.default_rng([*seeds, k]))
                    for k in range(count)
                ]
                for name in dict.fromkeys(name for case in cases for name in case):
                    told = [case[name] for case in cases if name in case]
                    low, high = binomtest(sum(told), len(told)).proportion_ci()
                    label = f"{structure.name}, {kind}, {disturbed}: {name} held"
                    label += f" of {len(told)} (between {100 * low:.0f} and {100 * high:.0f} %)"
                    tally[label] = sum(told)
    return tally


STEPS = {
    "step": ((0.1, 1.0),),
    "up and down": ((0.08, 1.0), (0.5, 0.0)),
    "three steps": ((0.07, 1.0), (0.3, 0.4), (0.65, 1.5)),
}
"""Tests of a thermal plant: from which share of the record on, which input."""


def thermal(kind: str, rng: np.random.Generator) -> Measured:
    """A slow plant on an ordinary day: the room drifts, and the sensor rounds."""
    count, step = int(rng.integers(300, 900)), float(rng.choice([0.5, 1.0, 2.0, 5.0]))
    slow = float(rng.uniform(0.06, 0.2) * count)
    fast = slow * rng.uniform(0.05, 0.4) * rng.integers(0, 2)
    delay = float(rng.uniform(0.0, 0.2) * slow)
    gain = float(np.exp(rng.uniform(-3, 1)) * rng.choice([-1, 1], p=[0.2, 0.8]))
    u, height = np.zeros(count), float(rng.choice([10.0, 50.0, 100.0]))
    for since, level in STEPS[kind]:
        u[round(since * count) :] = height * level
    den = np.convolve([slow, 1.0], [fast, 1.0]) if fast else np.array([slow, 1.0])
    clean = response(den / den[0], np.array([gain]) / den[0], delay, u)
    size = abs(gain) * height
    walk = np.cumsum(rng.standard_normal(count)) / np.sqrt(count)
    wave = np.sin(2 * np.pi * (rng.uniform(0.3, 2.0) * np.arange(count) / count + rng.random()))
    drift = rng.uniform(0.0, 0.06) * walk + rng.uniform(0.0, 0.03) * (wave - wave[0])
    y = 20.0 + clean + size * (drift + rng.uniform(0.0, 0.01) * rng.standard_normal(count))
    grain = size * rng.choice([0.002, 0.005, 0.015])
    truth = {"gain": gain, "dead time": delay * step, "lag": slow * step, "fast lag": fast * step}
    y = grain * np.round(y / grain)
    return Measured(STRUCTURES[3 if fast else 1], truth, step * np.arange(count), u, y)


def under_a_wave(kind: str, rng: np.random.Generator) -> Measured:
    """One lag under a slow wave alone, with hardly any noise: no walk, no rounding."""
    count = int(rng.integers(300, 900))
    slow = float(rng.uniform(0.06, 0.2) * count)
    delay = float(rng.uniform(0.0, 0.2) * slow)
    gain = float(np.exp(rng.uniform(-3, 1)) * rng.choice([-1, 1]))
    u = np.zeros(count)
    for since, level in STEPS[kind]:
        u[round(since * count) :] = 50 * level
    wave = np.sin(2 * np.pi * (rng.uniform(0.3, 2.0) * np.arange(count) / count + rng.random()))
    drift = rng.uniform(0.005, 0.03) * (wave - wave[0])
    clean = response(np.array([1.0, 1 / slow]), np.array([gain / slow]), delay, u)
    y = 20.0 + clean + 50 * abs(gain) * (drift + 1e-4 * rng.standard_normal(count))
    truth = {"gain": gain, "dead time": delay, "lag": slow}
    return Measured(STRUCTURES[1], truth, 1.0 * np.arange(count), u, y)


def heaters(
    count: int, seed: int, plant: Callable[..., Measured] = thermal, name: str = ""
) -> dict[str, int]:
    """How often the sign is right on thermal plants, and the gain, and the interval of the gain."""
    tally: dict[str, int] = {}
    counts = "wrong sign", "sign left open", "gain off by over a quarter"
    for kind in STEPS:
        found = dict.fromkeys([*counts, "held", "true structure", "held with it"], 0)
        for case in range(count):
            true = plant(kind, np.random.default_rng([seed, case, len(kind)]))
            told = identify(true.t, true.u, true.y)
            gain, sign = told.parameters["gain"], np.sign(true.truth["gain"])
            open_sign = gain.low <= 0 <= gain.high
            found["wrong sign"] += gain.value * sign < 0 and not open_sign
            found["sign left open"] += open_sign
            lasts = told.structure.startswith(("one lag", "two lags"))
            off = abs(gain.value / true.truth["gain"] - 1) > 0.25
            found["gain off by over a quarter"] += (off or not lasts) and not open_sign
            held = gain.low <= true.truth["gain"] <= gain.high and lasts
            found["held"] += held
            right = told.structure == true.structure.name
            found["true structure"] += right
            found["held with it"] += right and held
        tally |= {f"{name}{kind}: {k}": int(v) for k, v in [("records", count), *found.items()]}
    return tally


WAITS: dict[str, Callable[[np.random.Generator], np.ndarray]] = {
    "uniform": lambda rng: rng.uniform(0.4, 1.6, 400),
    "exponential": lambda rng: 1 + rng.exponential(0.6, 400),
    "now and then long": lambda rng: (
        1 + 0.1 * rng.standard_normal(400) ** 2 + 5 * (rng.random(400) < 0.02)
    ),
}
"""Times from one sample to the next of a logger that keeps no rate."""


def unevenly(count: int, seed: int) -> dict[str, int]:
    """How often the intervals of one lag hold the truth where the times have no order."""
    tally: dict[str, int] = {}
    for kind, waits in WAITS.items():
        found = {"refused": 0, "gain": 0, "lag": 0, "dead time": 0}
        for case in range(count):
            rng = np.random.default_rng([seed, case, len(kind)])
            t = np.cumsum(waits(rng))
            truth = {
                "gain": float(rng.uniform(0.5, 3) * rng.choice([-1, 1])),
                "lag": float(rng.uniform(15, 80)),
                "dead time": float(rng.uniform(2, 20)),
            }
            u, clean = np.zeros(t.size), np.zeros(t.size)
            for first, level in ((40, 1.0), (160, 0.0), (300, 0.6)):
                late = np.maximum(t - t[first] - truth["dead time"], 0.0) / truth["lag"]
                clean -= truth["gain"] * (level - u[first - 1]) * np.expm1(-late)
                u[first:] = level
            y = clean + 0.01 * abs(truth["gain"]) * rng.standard_normal(t.size)
            try:
                told = identify(t, u, y, structure=STRUCTURES[1].name).parameters
            except ValueError:
                found["refused"] += 1
                continue
            for name, true in truth.items():
                found[name] += told[name].low <= true <= told[name].high
        tally |= {f"uneven times, {kind}: {k}": v for k, v in [("records", count), *found.items()]}
    return tally


def every(count: int, seed: int) -> dict[str, int]:
    """Intervals on records without drift, and signs on thermal plants with it."""
    waves = heaters(count, seed, under_a_wave, "a wave alone, ")
    return coverage(count, seed) | heaters(count, seed) | waves | unevenly(count, seed)


if __name__ == "__main__":
    print_tally(every, __doc__ or "", 30)
