"""The loops that are timed, and what python-control is given for them."""

from __future__ import annotations

from typing import NamedTuple

import control as ct
import numpy as np

import nrdob
from nrdob import paper


class Case(NamedTuple):
    """The blocks of a loop, and its loop gains multiplied out as a user of control would."""

    name: str
    blocks: tuple
    CGm: ct.TransferFunction
    FH: ct.TransferFunction
    L: ct.TransferFunction

    def fresh(self) -> nrdob.NRDOB:
        """A loop that remembers nothing from the round before."""
        return nrdob.NRDOB(*self.blocks)


def case(name: str, loop: nrdob.NRDOB) -> Case:
    G, Gm, C, F = loop.process, loop.model, loop.controller, loop.filter.tf
    K = F / ((1 - F) * Gm)
    blocks = (G, Gm, C, loop.filter)
    return Case(name, blocks, C * Gm, F * (G / Gm - 1), K * G)


def random_loop(rng: np.random.Generator) -> nrdob.NRDOB:
    """A stable loop with a process and a model of order 6, a few per cent apart."""
    while True:
        size = 10 ** rng.uniform(-0.5, 0.5, 3)
        poles = size * np.exp(1j * rng.uniform(0.6, 0.95, 3) * np.pi)
        zeros = -(10 ** rng.uniform(-0.5, 0.5, 4))
        model_error = 0.05 * rng.standard_normal(3)
        G, Gm = _block(zeros, poles * (1 + model_error)), _block(zeros, poles)
        loop = nrdob.NRDOB(G, Gm, ct.tf([0.2, 0.1], [1, 0]), nrdob.LowPassFilter(0.3, 2))
        if loop.stability().stable:
            return loop


def _block(zeros: np.ndarray, poles: np.ndarray) -> ct.TransferFunction:
    num, den = np.poly(zeros), np.real(np.poly(np.concatenate([poles, poles.conj()])))
    return ct.tf(num / num[-1], den / den[-1])


_rng = np.random.default_rng(6)
CASES = [case(f"Example {k}", paper.example(k)) for k in (1, 2, 3)] + [
    case(f"random {k}, order 6", random_loop(_rng)) for k in (1, 2, 3)
]
