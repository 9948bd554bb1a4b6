r"""Fast filters where the model waits: what becomes of the loop as λ tends to 0.

There :math:`p_B = a\,(D_f - e^{-\theta_m s}) + b\,e^{-\theta s}` tends to

.. math:: p_0 = a\,(1 - e^{-\theta_m s}) + b\,e^{-\theta s},

which λ is not in. A root of p_0 on the right is one of every fast loop. If p_0 has none, the rest
is decided at high frequency, where :math:`R = b/a \to c\,s^m`:

- With equal dead times :math:`p_B = a D_f + (b - a)e^{-\theta s}`, and the second term is below the
  first on the axis if :math:`|1 - R| < 1 \le |D_f|` there.
- With two that differ, :math:`1 - e^{-\theta_m s} + R\,e^{-\theta s}` has chains of roots, and some
  on the right, because :math:`|e^{-j\omega\theta_m} - R e^{-j\omega\theta}|` reaches 1 + c > 1
  where the phases allow it, as they do unless the ratio of the dead times is a simple fraction.
- Without dead time in the process the fast roots are those of
  :math:`(x + 1)^n = e^{-\theta_m x/\lambda} - c`, x = λs: on the left if
  :math:`|(1 + j\xi)^n + c| > 1` for every ξ > 0, as long as c < M_n - 1.
"""

from __future__ import annotations

from fractions import Fraction
from math import cos, inf, pi

import numpy as np

from ..numerics import ROUNDING, QuasiPolynomial, Term, count_rhp
from .answer import Answer
from .mismatch import Mismatch

__all__ = ["fast_where_the_model_waits"]

FAR = 1e3
"""Frequency, against the largest pole or zero, at which R is only its leading terms."""

SIMPLE, EXACT = 12, 1e-9
"""Largest denominator of a simple ratio of dead times, and how closely it must be met."""

SCANNED = 20_001
"""Points at which the curve (1 + jξ)^n is looked at."""

WAITING_ENDS = "ever more roots are on the right as λ falls"


def fast_where_the_model_waits(mismatch: Mismatch) -> Answer:
    """Tell whether the loop is stable for every small enough λ; p_B(0) is not 0."""
    if not mismatch.delay:
        return _without_delay(mismatch)
    return _same_delay(mismatch) if mismatch.delay == mismatch.wait else _two_delays(mismatch)


def _of_limit(mismatch: Mismatch) -> Answer:
    """Tell whether p_0 has roots on the right."""
    a, b = mismatch.a, mismatch.b
    waits = (Term(-a, mismatch.wait),)
    found = count_rhp(QuasiPolynomial(a, b, mismatch.delay, more=waits))
    if found.count is None:
        return Answer(None, f"the limit for λ = 0 has {found.reason}")
    if found.count:
        how = "infinitely many roots" if found.count == inf else f"{found.count:g} root(s)"
        return Answer(False, f"with λ = 0 there are {how} on the right, and so with fast filters")
    return Answer(True, "with λ = 0 no root is on the right, and none comes from infinity")


def _same_delay(mismatch: Mismatch) -> Answer:
    if mismatch.excess == 0:
        off = abs(1 - float(mismatch.b[0] / mismatch.a[0]))
    else:
        off = inf if mismatch.excess > 0 else 1.0
    if off > 1 + ROUNDING:
        return Answer(
            False,
            f"process and model differ by {off:.4g} times the model at high frequency: with dead "
            f"time {WAITING_ENDS}",
        )
    if off < 1 - ROUNDING or np.array_equal(mismatch.a, mismatch.b):
        return _of_limit(mismatch)
    R = _far_ratio(mismatch)
    if abs(R) ** 2 - 2 * R.real > 0:
        return Answer(False, f"|1 - G/model| tends to 1 from above: {WAITING_ENDS}")
    return Answer(
        None,
        "|1 - G/model| tends to 1 at high frequency; take a model of the same relative degree as "
        "the process",
    )


def _two_delays(mismatch: Mismatch) -> Answer:
    ratio = mismatch.delay / mismatch.wait
    simple = Fraction(ratio).limit_denominator(SIMPLE)
    exact = simple > 0 and abs(float(simple) / ratio - 1) <= EXACT
    reason = (
        f"the dead times differ, {mismatch.delay:g} s and {mismatch.wait:g} s: {WAITING_ENDS}; "
        "keep λ above the error of the dead time"
    )
    if mismatch.excess > 0 or not exact:
        return Answer(False, reason)
    late, waits = simple.numerator, simple.denominator
    if mismatch.excess == 0:
        # With w = exp(-s θm/waits) the chains are at the roots of 1 - w^waits + c w^late.
        chains = np.zeros(max(late, waits) + 1)
        chains[0] = 1.0
        chains[waits] -= 1.0
        chains[late] += float(mismatch.b[0] / mismatch.a[0])
        lost = bool(np.any(np.abs(np.roots(chains[::-1])) < 1 - EXACT))
    else:
        lost = waits > 2  # then R turns through so many directions that some lead to the right
    if lost:
        return Answer(False, reason)
    return Answer(
        None,
        f"the ratio of the dead times is exactly {simple}; with the smallest change of either "
        f"{WAITING_ENDS}",
    )


def _without_delay(mismatch: Mismatch) -> Answer:
    n, m = mismatch.order, mismatch.excess
    c = float(mismatch.b[0] / mismatch.a[0])
    if m < 0:
        R = _far_ratio(mismatch)
        if abs(R) ** 2 + 2 * R.real < 0:
            return Answer(False, f"|1 + G/model| tends to 1 from below: {WAITING_ENDS}")
        return Answer(
            None,
            "|1 + G/model| tends to 1 at high frequency; take a model of the same relative degree "
            "as the process",
        )
    if c < 0 and m < n:
        return Answer(
            False,
            f"process and model have opposite signs at high frequency (ratio {c:.4g}): a fast "
            "root is real and positive",
        )
    if 0 < m < n - 2:
        return Answer(
            False,
            f"the model has relative degree {m} more than the process, and the filter's order is "
            f"{n - m} more than that; a difference of two is the most that is borne",
        )
    if m == 0 and n >= 3:
        xi = np.tan(np.linspace(0, pi / 2, SCANNED, endpoint=False)[1:])
        nearest = float(np.min(np.abs((1 + 1j * xi) ** n + c)))
        if c >= cos(pi / n) ** -n or nearest < 1:
            return Answer(
                False,
                f"the gain ratio at high frequency is {c:.4g}: a filter of order {n} that is fast "
                "against the dead time of the model does not bear it",
            )
    return _of_limit(mismatch)


def _far_ratio(mismatch: Mismatch) -> complex:
    """R at a high frequency, without dead times."""
    s = 1j * FAR * float(mismatch.speeds.max())
    return complex(np.polyval(mismatch.b, s) / np.polyval(mismatch.a, s))
