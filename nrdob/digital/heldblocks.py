r"""Model, controller and filter sampled as a zero-order hold samples, where that is sound.

The sampled model is then what a processor sees of it between hold and sampler, and F/Gm holds the
inverse of that. A model that falls off by two powers of s or more gets zeros from the sampling that
it has not in continuous time, at negative z, and with short sampling times on the unit circle or
outside it: near z = -1 for two powers, -3.73 for three (Åström, Hagander, Sternby). Their inverse
is an observer that rings or runs away from sample to sample, whatever the plant. Inverting the
sampled model is the trap of digital observers; Tustin's rule, which puts these zeros at z = -1 in
F/Gm as *zeros* of F, has none of it.

.. rubric:: References

Åström, K. J., P. Hagander, J. Sternby, Zeros of sampled systems, Automatica 20 (1984) 31-38.
"""

from __future__ import annotations

import numpy as np

from ..diagram import Fraction, LoopEquations
from ..numerics import QuasiPolynomial, written
from .wplane import held_in_w

__all__ = ["held_blocks"]

ON_CIRCLE = 1e-9
"""Distance from the unit circle at which a sampling zero lies on it."""


def held_blocks(loop: LoopEquations, dt: float) -> LoopEquations:
    """Sample model, controller and filter, each behind a hold, as blocks of w.

    Parameters
    ----------
    loop : LoopEquations
        In continuous time.
    dt : float
        Sampling time in seconds.

    Returns
    -------
    LoopEquations
        With these blocks in powers of w, α = dt/2, and the process as it is.

    Raises
    ------
    ValueError
        If F/Gm would invert a zero that only the sampling has made, on or outside the unit circle.
    """
    _, Gm, C, F = loop.fractions
    if loop.keep_factors:
        raise ValueError(
            "method='zoh' builds F/model as one block; for keep_factors=True use method='tustin'"
        )
    if loop.model_delay:
        raise ValueError(
            f"method='zoh' is not for a model with a dead time ({loop.model_delay:g} s); use "
            "method='tustin', whose model waits for whole samples and fractions of them"
        )
    model = held_in_w(Gm, dt, at_once=True)
    _check_sound(model, Gm, dt)
    blocks = LoopEquations(
        process=loop.process,
        model=model,
        controller=held_in_w(C, dt, at_once=True),
        filter=held_in_w(F, dt, at_once=True),
    )
    if Gm.relative_degree and not blocks.built.zeros.degree:
        raise ValueError(
            f"method='zoh' with dt = {dt:g} s: so long after a sample nothing is left in the "
            "filter, and F/model cannot be told from a prediction; choose a shorter dt"
        )
    return blocks


def _check_sound(held: Fraction, model: Fraction, dt: float) -> None:
    roots = QuasiPolynomial(held.num).roots * dt / 2
    at_infinity = held.den.size - held.num.size
    # Of a model without direct term one zero is at z = ∞, w = 2/dt: a sample of dead time.
    if model.relative_degree:
        roots = np.delete(roots, np.abs(roots - 1).argmin())
    z = np.append((1 + roots) / (1 - roots), np.full(at_infinity, -1.0))
    outside = z[np.abs(z) > 1 - ON_CIRCLE]
    own = QuasiPolynomial(model.num).roots
    made = outside.size - int(np.sum(own.real >= 0))
    if made > 0:
        worst = outside[outside.real.argmin()]
        raise ValueError(
            f"method='zoh' is unsound here: behind its hold the model, of relative degree "
            f"{model.relative_degree}, has a zero at z = {written(complex(worst))} that only the "
            f"sampling has made, and F/model, which inverts it, would go on as its powers; use "
            "method='tustin'"
        )
