"""Random loops for the property tests: unstable, non-minimum phase, resonant, delayed."""

from __future__ import annotations

import control as ct
import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

import nrdob


@st.composite
def root_sets(draw: st.DrawFn, degree: int, *, right: bool = True) -> np.ndarray:
    """`degree` roots over four decades, damping down to 1e-4, on both sides if `right`."""
    roots: list[complex] = []
    while len(roots) < degree:
        size = 10 ** draw(st.floats(-2, 2))
        side = draw(st.sampled_from([-1, -1, 1])) if right else -1
        if degree - len(roots) >= 2 and draw(st.booleans()):
            damping = 10 ** draw(st.floats(-4, 0))
            root = side * size * complex(damping, np.sqrt(1 - damping**2))
            roots += [root, root.conjugate()]
        else:
            roots.append(complex(side * size))
    return np.array(roots)


@st.composite
def fractions(draw: st.DrawFn, *, max_order: int = 3, right: bool = True) -> ct.TransferFunction:
    """Proper rational block with DC gain of either sign."""
    order = draw(st.integers(1, max_order))
    zeros = draw(root_sets(draw(st.integers(0, order)), right=right))
    poles = draw(root_sets(order, right=right))
    den = np.real(np.poly(poles))
    num = np.atleast_1d(np.real(np.poly(zeros)))
    gain = draw(st.sampled_from([-1, 1])) * 10 ** draw(st.floats(-1, 1))
    return ct.tf(gain * num / num[-1], den / den[-1])


@st.composite
def loops(draw: st.DrawFn, *, delayed: bool = False) -> nrdob.NRDOB:
    """A well-posed NR-DOB loop, stable or not."""
    process, model = draw(fractions()), draw(fractions())
    controller = draw(fractions(max_order=2))
    order = max(model.den[0][0].size - model.num[0][0].size, 1) + draw(st.integers(0, 1))
    filter = nrdob.LowPassFilter(10 ** draw(st.floats(-1.5, 1)), order)
    if delayed:
        process = nrdob.delay(10 ** draw(st.floats(-2, 0))) * process
    loop = nrdob.NRDOB(process, model, controller, filter)
    assume(not loop.ill_posed)
    return loop
