"""Plants of known numbers, measured with noise, and how often the stated intervals hold them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from nrdob.measured import STRUCTURES, Structure, identify

from .runner import print_tally

NAMES = {
    0: (),
    1: ("lag",),
    2: ("slow lag", "fast lag"),
}


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


def measured(
    structure: Structure,
    kind: str,
    colour: float,
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
    white = rng.standard_normal(count + 200)
    coloured = lfilter([np.sqrt(1 - colour**2)], [1.0, -colour], white)[200:]
    # Of an integrator's long ramp a share would drown every change of its slope.
    size = 0.4 * abs(gain) * slow if structure.integrates else clean.std()
    y = 5.0 + clean + noise * size * coloured
    if structure.integrates:
        y += 0.01 * gain * np.arange(count)
    return Measured(structure, truth, 3.0 + step * np.arange(count), u, y)


def sure(structure: Structure, kind: str, colour: float, rng: np.random.Generator) -> list[bool]:
    """Whether each interval of 95 % holds the truth, and last whether the dead time is good."""
    case = measured(structure, kind, colour, rng)
    found = identify(case.t, case.u, case.y, structure=structure.name, held_out=0)
    inside = [
        p.low <= case.truth[name] <= p.high
        for name, p in found.parameters.items()
        if name in case.truth
    ]
    off = abs(found.parameters["dead time"].value - case.truth["dead time"])
    return [*inside, off < 0.5 * found.record.sampling_time]


def coverage(count: int, seed: int) -> dict[str, int]:
    """How often an interval of 95 % holds the truth, and the dead time is half a sample right."""
    tally: dict[str, int] = {}
    for structure in STRUCTURES:
        for kind in ("step", "binary", "waves"):
            for colour in (0.0, 0.8):
                rng = np.random.default_rng([seed, len(structure.name), len(kind), int(colour * 9)])
                told = [sure(structure, kind, colour, rng) for _ in range(count)]
                inside = np.concatenate([each[:-1] for each in told])
                label = f"{structure.name}, {kind}, memory {colour:g}"
                tally[f"{label}: intervals"] = inside.size
                tally[f"{label}: intervals that hold"] = int(inside.sum())
                tally[f"{label}: dead times"] = count
                tally[f"{label}: dead times within half a sample"] = sum(e[-1] for e in told)
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


def heaters(count: int, seed: int) -> dict[str, int]:
    """How often the sign is right on thermal plants, and the gain, and the interval of the gain."""
    tally: dict[str, int] = {}
    for kind in STEPS:
        found = {"wrong sign": 0, "sign left open": 0, "gain off by over a quarter": 0, "held": 0}
        for case in range(count):
            true = thermal(kind, np.random.default_rng([seed, case, len(kind)]))
            told = identify(true.t, true.u, true.y)
            gain, sign = told.parameters["gain"], np.sign(true.truth["gain"])
            open_sign = gain.low <= 0 <= gain.high
            found["wrong sign"] += gain.value * sign < 0 and not open_sign
            found["sign left open"] += open_sign
            lasts = told.structure.startswith(("one lag", "two lags"))
            off = abs(gain.value / true.truth["gain"] - 1) > 0.25
            found["gain off by over a quarter"] += (off or not lasts) and not open_sign
            found["held"] += gain.low <= true.truth["gain"] <= gain.high and lasts
        tally |= {f"{kind}: records": count} | {f"{kind}: {k}": int(v) for k, v in found.items()}
    return tally


def both(count: int, seed: int) -> dict[str, int]:
    """Intervals on records without drift, and signs on thermal plants with it."""
    return coverage(count, seed) | heaters(count, seed)


if __name__ == "__main__":
    print_tally(both, __doc__ or "", 30)
