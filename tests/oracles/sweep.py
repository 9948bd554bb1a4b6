"""Margins of a loop gain by a sweep: dense frequencies, and what decides looked at ever closer.

The blocks are evaluated as they were given, in long doubles, without multiplying any two of them.
"""

from __future__ import annotations

import numpy as np

from .plain import Plain

DEEPEST = 12
"""How many of the smallest values of a grid are looked at more closely."""

PARTS = 16
"""Parts into which what decides is cut in every round."""


def swept(gain, omega: np.ndarray) -> dict[str, float]:
    """Find the figures of a loop gain from dense frequencies."""

    def size(w):
        return np.log(np.abs(gain(1j * w)))

    def real(w):
        value = gain(1j * w)
        return value.imag / np.abs(value)

    def distance(w):
        return np.abs(1 + gain(1j * w))

    def disk(w):
        value = gain(1j * w)
        return np.abs((1 + value) / (1 - value))

    L = gain(1j * omega)
    crossings = _zeros(size, omega, np.log(np.abs(L)))
    at = gain(1j * crossings)
    angle = np.angle(-at)
    values = gain(1j * _zeros(real, omega, L.imag / np.abs(L), L.real < 0))
    ends = gain(1j * omega[[0, -1]] * np.array([1e-6, 1e6], dtype=np.longdouble))
    ends = ends[np.abs(ends.imag) < 1e-3 * np.abs(ends)]
    values = np.concatenate([values, ends[np.abs(ends) > 1e-12]])
    gains = -1 / values.real[values.real < 0]
    nearest = [_smallest(f, omega, f(omega)) for f in (distance, disk)]
    return {
        "ms": 1 / nearest[0],
        "disk_margin": 2 * nearest[1],
        "pm": float(np.degrees(np.abs(angle).min(initial=np.inf))),
        "delay_margin": float(np.min(np.mod(angle, 2 * np.pi) / crossings, initial=np.inf)),
        "gm_low": float(gains[gains < 1].max(initial=0.0)),
        "gm_high": float(gains[gains > 1].min(initial=np.inf)),
    }


def _zeros(function, omega: np.ndarray, values: np.ndarray, where=True) -> np.ndarray:
    """Zeros at which a function changes its sign, or nearly touches zero, on the grid."""
    where = np.broadcast_to(where, omega.shape)
    positive, size = values > 0, np.abs(values)
    inner = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:]) & (size[1:-1] < 0.3)
    inner &= (positive[1:-1] == positive[:-2]) & (positive[1:-1] == positive[2:]) & where[1:-1]
    k = 1 + np.flatnonzero(inner)
    omega = omega.astype(np.longdouble)
    low, high = omega[k - 1], omega[k + 1]
    sign = np.where(positive[k], 1, -1)[:, None]
    bottom = _closer(lambda w: sign * function(w), low, high)
    crossed = (function(bottom) > 0) != positive[k]
    change = np.flatnonzero((positive[1:] != positive[:-1]) & (where[1:] | where[:-1]))
    low = np.concatenate([omega[change], low[crossed], bottom[crossed]])
    high = np.concatenate([omega[change + 1], bottom[crossed], high[crossed]])
    steps = np.arange(PARTS + 1, dtype=np.longdouble) / PARTS
    for _ in range(14):
        w = low[:, None] + (high - low)[:, None] * steps
        sides = function(w) > 0
        k = np.argmax(sides[:, 1:] != sides[:, :-1], axis=1)[:, None]
        low, high = (np.take_along_axis(w, k + i, axis=1)[:, 0] for i in (0, 1))
    # At a pole on the axis the sign changes by a jump.
    return low[np.abs(function(low)) < 1e-4]


def _smallest(function, omega: np.ndarray, values: np.ndarray) -> float:
    """Find the smallest value, from the lowest places of the grid on."""
    inner = (values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])
    k = 1 + np.flatnonzero(inner & (values[1:-1] < 2 * values.min()))
    k = k[np.argsort(values[k])[:DEEPEST]]
    omega = omega.astype(np.longdouble)
    bottom = _closer(function, omega[k - 1], omega[k + 1])
    return float(min(values.min(), np.min(function(bottom), initial=np.inf)))


def _closer(function, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Where a function is smallest between each low and high."""
    steps = np.arange(PARTS + 1, dtype=np.longdouble) / PARTS
    for _ in range(9):
        w = low[:, None] + (high - low)[:, None] * steps
        k = np.clip(np.argmin(function(w), axis=1), 1, PARTS - 1)[:, None]
        low, high = (np.take_along_axis(w, k + i, axis=1)[:, 0] for i in (-1, 1))
    return (low + high) / 2


def loop_gains(loop: Plain) -> dict:
    """Return the loop gains as functions of s, with frequencies dense enough for each.

    Where the model has a dead time F H is not what is encircled, and is left out.
    """
    delay, wait = loop.delay, loop.model_delay
    coefficients = [q for block in (loop.G, loop.Gm, loop.C, loop.F) for q in block]
    n, d, nm, dm, nc, dc, nf, df = ([np.longdouble(c) for c in q] for q in coefficients)
    rest = list(df)
    for k in range(1, len(nf) + 1):
        rest[-k] -= nf[-k]

    def late(s, T):
        return np.exp(-s.real.dtype.type(T) * s)

    def process(s):
        return _horner(n, s) / _horner(d, s) * late(s, delay)

    def left_over(s):
        return _horner(df, s) - _horner(nf, s) * late(s, wait) if wait else _horner(rest, s)

    def model(s):
        return _horner(nm, s) / _horner(dm, s)

    gains = {
        "model_loop": lambda s: _horner(nc, s) / _horner(dc, s) * model(s),
        "observer_loop": lambda s: _horner(nf, s) / _horner(df, s) * (process(s) / model(s) - 1),
        "plant_loop": lambda s: _horner(nf, s) / left_over(s) / model(s) * process(s),
    }
    if wait:
        del gains["observer_loop"]
    products = [np.polymul(np.polymul(d, nm), rest), np.polymul(np.polymul(n, dm), nf)]
    mixed = [rest, np.polyadd(*products), np.polysub(np.polymul(n, dm), np.polymul(d, nm))]
    mixed += [np.polyadd(np.polymul(nm, nc), np.polymul(dm, dc))]
    roots = [np.roots(np.array(q, dtype=float)) for q in (*coefficients, *mixed)]
    roots = np.concatenate(roots)
    longest = max(delay, wait)
    around = [gain for name, gain in gains.items() if name != "model_loop"]
    dense = _dense(around, roots, longest) if longest else None
    return {
        name: (gain, dense if longest and name != "model_loop" else _dense([gain], roots, 0.0))
        for name, gain in gains.items()
    }


def _dense(gains, roots: np.ndarray, delay: float) -> np.ndarray:
    roots = roots[np.abs(roots) > 0]
    size = np.abs(roots)
    close = np.concatenate([s * np.geomspace(2e-2, 30, 30) for s in (-1, 1)])
    around = (np.abs(roots.imag)[:, None] + np.abs(roots.real)[:, None] * close).ravel()
    wide = np.geomspace(size.min() / 1e6, 1e6 * size.max(), 4000)
    omega = np.unique(np.abs(np.concatenate([wide, around])))
    if delay:
        seen = np.max([np.abs(gain(1j * omega)) for gain in gains], axis=0)
        last = omega[np.flatnonzero(seen > 0.01 * min(seen.max(), 1.0))[-1]] + 12 * np.pi / delay
        omega = omega[omega < last]
        omega = np.append(omega, np.linspace(0, last, min(int(12 * last * delay), 60_000) + 2))
    omega = np.sort(omega[omega > 0])
    return omega[np.diff(omega, prepend=0.0) > 1e-12 * omega]


def _horner(coefficients: list[np.longdouble], s: np.ndarray) -> np.ndarray:
    value = np.full(s.shape, coefficients[0], dtype=s.dtype)
    for c in np.array(coefficients[1:], dtype=s.real.dtype):
        value *= s
        value += c
    return value
