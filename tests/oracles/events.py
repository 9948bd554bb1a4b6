"""A sampled loop in continuous time, from event to event: y is read, a held u arrives, δ arrives.

The moments are exact fractions of a second, and between two of them the process moves by the
exponential of a matrix. The processor runs Tustin's difference equations of F, F/Gm, (1 - F) Gm and
C, written out from the coefficients, and renews them with the u that has been applied. The model
has no dead time.
"""

from __future__ import annotations

from fractions import Fraction
from math import comb, inf
from typing import Any

import numpy as np
from scipy.linalg import expm

from .plain import Block, Plain


def tustin(block: Block, dt: float) -> Block:
    """Substitute s = (2/dt) (z - 1)/(z + 1); coefficients in descending powers of z."""
    n = len(block.den) - 1

    def part(p: Any) -> np.ndarray:
        total = np.zeros(n + 1)
        for k, c in enumerate(reversed(p)):
            down = [comb(k, i) * (-1.0) ** i for i in range(k + 1)]
            up = [float(comb(n - k, i)) for i in range(n - k + 1)]
            total += c * (2 / dt) ** k * np.convolve(down, up)
        return total

    num, den = part(block.num), part(block.den)
    return Block(num / den[0], den / den[0])


class Recursion:
    """A difference equation, whose output at once and from the past can be told apart."""

    def __init__(self, block: Block, dt: float) -> None:
        self.num, self.den = tustin(block, dt)
        self.inputs, self.outputs = (np.zeros(self.den.size - 1) for _ in range(2))

    def past(self) -> float:
        return float(self.num[1:] @ self.inputs - self.den[1:] @ self.outputs)

    def renew(self, value: float) -> None:
        output = self.past() + self.num[0] * value
        if self.inputs.size:
            self.inputs = np.append(value, self.inputs[:-1])
            self.outputs = np.append(output, self.outputs[:-1])


class Process:
    """The process, without its dead time, between events; v is what is held at its input."""

    def __init__(self, block: Block) -> None:
        den = np.asarray(block.den, dtype=float)
        num = np.pad(np.asarray(block.num, dtype=float), (den.size - len(block.num), 0)) / den[0]
        den = den / den[0]
        n = den.size - 1
        self.held = np.zeros((n + 1, n + 1))
        self.held[: n - 1, 1:n] = np.eye(n - 1) if n > 1 else 0.0
        if n:
            self.held[n - 1, :n], self.held[n - 1, n] = -den[:0:-1], 1.0
        self.row = np.append((num[1:] - num[0] * den[1:])[::-1], num[0])
        self.state = np.zeros(n + 1)

    def output(self) -> float:
        return float(self.row @ self.state)

    def move(self, span: Fraction) -> None:
        self.state = expm(self.held * float(span)) @ self.state


def step(
    loop: Plain,
    dt: float,
    samples: int,
    input: str,
    computation_delay: float = 0.0,
    limit: float = inf,
    size: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """y, just before u is written, and u at the samples, after a step of R, d, delta or eta."""
    (Nm, Dm), (Nf, Df) = loop.Gm, loop.F
    less = np.polysub(Df, Nf)
    inverse = Block(np.convolve(Nf, Dm), np.convolve(Df, Nm))
    rest = Block(np.convolve(less, Nm), np.convolve(Df, Dm))
    C, F_u, F_y, q, m = (Recursion(b, dt) for b in (loop.C, loop.F, loop.F, inverse, rest))
    factor = 1 - F_u.num[0] + C.num[0] * m.num[0]
    process = Process(loop.G)
    late = Fraction(loop.delay)
    r, d, delta, eta = (size * (input == name) for name in ("R", "d", "delta", "eta"))
    arrivals: list[tuple[Fraction, int, float]] = [(late, 0, delta)] if delta else []
    now, held, added, ys, us = Fraction(0), 0.0, 0.0, [], []
    for k in range(samples):
        moment = k * Fraction(dt)
        while True:  # what arrives before y is read; at the same moment the reading comes first
            first = min(arrivals, default=None)
            then = moment if first is None or first[0] >= moment else first[0]
            process.move(then - now)
            now = then
            if first is None or first[0] >= moment:
                break
            arrivals.remove(first)
            held, added = (held, first[2]) if first[1] == 0 else (first[2], added)
            process.state[-1] = held + added
        y = process.output() + d
        read = y + eta
        past = C.past() + C.num[0] * (r - F_y.past() - F_y.num[0] * read - m.past())
        u = (past + F_u.past() - q.past() - q.num[0] * read) / factor
        applied = min(max(u, -limit), limit)
        yf = F_y.past() + F_y.num[0] * read + m.past() + m.num[0] * applied
        for block, value in ((C, r - yf), (F_u, applied), (F_y, read), (q, read), (m, applied)):
            block.renew(value)
        arrivals.append((moment + Fraction(computation_delay) + late, 1 + k, applied))
        ys.append(y)
        us.append(applied)
    return np.array(ys), np.array(us)
