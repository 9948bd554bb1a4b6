"""Random plants and models of every kind that the searches for filters must bear."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

import nrdob

KINDS = ("lags", "resonant", "integrating", "undamped", "unstable", "right-hand zero")


def plant_and_model(rng: np.random.Generator) -> tuple[str, Any, ct.TransferFunction]:
    """Draw the name of a family, a process, with dead time in two of five, and a model."""
    kind = str(rng.choice(KINDS))
    poles = _poles(rng, kind)
    zeros = np.array([-_size(rng)] if rng.random() < 0.3 and len(poles) > 1 else [])
    if kind == "right-hand zero":
        zeros = np.array([_size(rng)])
    detuned = _detuned(rng, poles)
    model = _block(_left(detuned), _left(zeros) if rng.random() < 0.5 else zeros[:0])
    if kind == "unstable" and np.sum(poles.real > 0) % 2:
        model = -model
    process = _block(poles, zeros) * 10 ** rng.uniform(-0.3, 0.3)
    if rng.random() < 0.4:
        process = nrdob.delay(10 ** rng.uniform(-2, 0.5)) * process
        kind += ", dead time"
    return kind, process, model


def _size(rng: np.random.Generator) -> float:
    return float(10 ** rng.uniform(-1, 1))


def _poles(rng: np.random.Generator, kind: str) -> np.ndarray:
    poles = [-_size(rng) + 0j for _ in range(rng.integers(1, 4))]
    if kind == "resonant":
        damping = 10 ** rng.uniform(-4, -0.5)
        poles += _pair(_size(rng), damping)
    if kind == "integrating":
        poles.append(0j)
    if kind == "undamped":
        poles += _pair(_size(rng), 0.0)
    if kind == "unstable":
        poles.append(_size(rng) + 0j)
    return np.array(poles)


def _pair(size: float, damping: float) -> list[complex]:
    root = size * complex(-damping, np.sqrt(1 - damping**2))
    return [root, root.conjugate()]


def _detuned(rng: np.random.Generator, poles: np.ndarray) -> np.ndarray:
    """Stretch all, and leave out the fastest real one now and then."""
    detuned = poles * 10 ** rng.uniform(-0.1, 0.1)
    real = np.flatnonzero(detuned.imag == 0)
    if rng.random() < 0.3 and detuned.size > 1 and real.size:
        detuned = np.delete(detuned, real[np.abs(detuned[real]).argmax()])
    return detuned


def _left(roots: np.ndarray) -> np.ndarray:
    slow = np.where(roots == 0, -0.05, roots)
    slow = slow - np.where(slow.real == 0, 0.1 * np.abs(slow), 0.0)
    return np.where(slow.real > 0, -slow.conj(), slow)


def _block(poles: np.ndarray, zeros: np.ndarray) -> ct.TransferFunction:
    num, den = (
        np.atleast_1d(np.real(np.poly(r))) if r.size else np.ones(1) for r in (zeros, poles)
    )
    last = den[np.flatnonzero(den)[-1]]
    return ct.tf(num / num[-1], den / last)
