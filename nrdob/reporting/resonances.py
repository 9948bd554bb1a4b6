"""How wrong the frequency of a resonance may be: margins do not show it, since the peak moves."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from ..diagram import DelayedTransferFunction
from ..loop import NRDOB
from ..numerics import FloatArray, number

__all__ = ["CERTAIN", "LIGHT", "moved", "resonance_warnings"]

LIGHT = 0.2  # damping ratio below which a pair of roots is a resonance
CERTAIN = 0.02  # relative error of its frequency that every plant has
SHIFTS = (CERTAIN, 0.05, 0.1)  # relative errors of its frequency that are tried


def resonance_warnings(loop: NRDOB) -> Iterator[tuple[float, str]]:
    """Say which small error of a resonance's frequency makes a stable loop unstable.

    Given are the relative error and the sentence, for each lightly damped pair of poles or zeros of
    the process of which the frequency may not be wrong by a tenth.

    Examples
    --------
    >>> import control as ct
    >>> plant = ct.tf([100], [1, 0.4, 100])
    >>> loop = NRDOB(plant, plant, 0, ct.tf([1], [0.0316**2, 2 * 0.0316, 1]))
    >>> [(error, said)] = resonance_warnings(loop)
    >>> print(error, said)  # doctest: +NORMALIZE_WHITESPACE
    0.05 With the process' resonance at 10 rad/s 5 % lower the loop is unstable; its margins do not
    show it.
    """
    fraction = loop.fractions.G
    for part, name in enumerate(("antiresonance", "resonance")):
        for root in np.roots(fraction[part]):
            frequency, damping = abs(root), abs(root.real) / abs(root) if root else 1.0
            if root.imag <= 0 or damping >= LIGHT:
                continue
            for shift, sign in product(SHIFTS, (-1, 1)):
                parts = [*fraction]
                parts[part] = moved(fraction[part], root, 1 + sign * shift)
                plant = DelayedTransferFunction(tuple(parts), loop.delay)
                others = loop.model, loop.controller, loop.filter, loop.keep_factors
                if not NRDOB(plant, *others).stability().stable:
                    way = "higher" if sign > 0 else "lower"
                    where = f"{name} at {number(frequency)} rad/s {100 * shift:g} % {way}"
                    tail = "the loop is unstable; its margins do not show it."
                    yield shift, f"With the process' {where} {tail}"
                    break


def moved(polynomial: FloatArray, root: complex, factor: float) -> FloatArray:
    """Move a pair of complex roots along its rays by a factor, and keep the value at 0.

    Examples
    --------
    >>> moved([1, 2, 5], -1 + 2j, 2.0)
    array([0.25, 1.  , 5.  ])
    """
    pair = np.array([1.0, -2 * root.real, abs(root) ** 2])
    rest, _ = np.polydiv(polynomial, pair)
    return np.asarray(np.polymul(rest, pair * [factor**-2, 1 / factor, 1.0]))
