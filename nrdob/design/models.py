r"""Which model to put into the observer, when the right one is not the best one.

With the filter (1) a matched model makes p_B = N·D·Df, so it never works for a process with a pole
or a zero in the right half plane (`nrdob.interpolating_filter` is for such a model); a dead time
cannot be inverted. The candidates here differ from the process just there: zeros in the right half
plane are left out or mirrored, unstable poles are mirrored and the DC sign is chosen by parity,
dead time is left out or replaced by a lag. Integrators are moved to the left, or kept: then they
cancel inside (1 - F)·model, for which 1 - F needs as many zeros at s = 0, and one more if nothing
is to be left of a constant input disturbance; beyond one that takes a ramp filter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import inf, nan
from typing import Any

import control as ct
import numpy as np

from ..diagram import (
    FilterFamily,
    LowPassFilter,
    ObserverEquations,
    as_family,
    as_fraction,
    filter_family,
)
from ..numerics import ComplexArray, FloatArray, QuasiPolynomial
from .existence import roots_by_side
from .mismatch import Mismatch
from .search import FilterSearch, checked_ms

__all__ = ["ModelCandidate", "suggest_model"]

GAINS = (1.0, 0.5, 0.25)  # DC gains of the model tried where the process is unstable
DETUNING = 0.1  # how far a pole on the axis is moved to the left, against its size


@dataclass(frozen=True)
class ModelCandidate:
    """A model that one could use, and what it would allow.

    Attributes
    ----------
    model : control.TransferFunction
        G̃.
    how : str
        In what it differs from the process.
    order : int
        Of the filter, the lowest that is causal or one more, whichever does better.
    family : FilterFamily or None
        The ramp filters, where they are not those of eq. (1).
    time_constants : list of (low, high)
        Its stabilising set, in seconds.
    fastest : float or None
        Smallest λ at which the plant loop has a sensitivity peak of at most the one asked for;
        0 if every small λ does, None if none does.
    ms : float
        Smallest sensitivity peak found on the stabilising set; nan if it is empty.
    """

    model: ct.TransferFunction
    how: str
    order: int
    time_constants: list[tuple[float, float]]
    fastest: float | None
    ms: float
    family: FilterFamily | None = None

    @property
    def filters(self) -> int | FilterFamily:
        """The order or the family, to be given wherever an order is."""
        return self.family or self.order

    def __repr__(self) -> str:
        num, den = (_written(p[0][0]) for p in (self.model.num, self.model.den))
        if not self.time_constants:
            return f"({num})/({den}): {self.how}; no filter of order {self.order}"
        sets = " and ".join(f"{low:.4g} < λ < {high:.4g}" for low, high in self.time_constants)
        fastest = {None: "not met", 0.0: "met by every fast filter"}.get(
            self.fastest, f"met from λ = {self.fastest:.4g} s" if self.fastest else ""
        )
        return (
            f"({num})/({den}): {self.how}; n = {self.order}, {sets}; Ms down to {self.ms:.3g}, "
            f"specification {fastest}"
        )


def suggest_model(process: Any, *, max_ms: float = 2.0) -> list[ModelCandidate]:
    """Propose models for a process, each with what it allows, best first.

    Parameters
    ----------
    process : as for `nrdob.NRDOB`
        G, with or without dead time.
    max_ms : float
        Sensitivity peak of the plant loop by which the candidates are compared.

    Returns
    -------
    list of ModelCandidate
        Those that meet `max_ms` first, by what the fastest filter leaves of an input disturbance
        that begins slowly, (1 - F)·G̃/s at s = 0, which is nλ·G̃(0); last of them integrating ones
        that leave something of a constant one. Then the others, by the smallest peak. Also those
        that no filter stabilises are listed, last.

    Raises
    ------
    TypeError, ValueError
        If the process cannot stand in the loop, or has a zero at s = 0.

    Examples
    --------
    The unstable process of Example 3 of the paper:

    >>> import control as ct
    >>> best, *_ = suggest_model(ct.tf([4], [-1, -1, 2]), max_ms=2.0)
    >>> best.how
    'unstable poles mirrored'
    >>> [float(k) for k in best.model.num[0][0] / best.model.den[0][0][0]]
    [-4.0]
    """
    limit = checked_ms(max_ms)
    blocks = ObserverEquations(process, 1.0, LowPassFilter(1.0, 1))
    G = blocks.fractions.G
    if G.num[-1] == 0:
        raise ValueError(
            "process has a zero at s = 0, so that p_B(0) = 0 unless the model integrates: its "
            "output cannot be held against a constant disturbance; use another output"
        )
    candidates = [
        _judged(process, model, how, limit) for model, how in _models(G.num, G.den, blocks.delay)
    ]
    k = QuasiPolynomial(G.den).zeros_at_origin
    for model, how in _models(G.num, G.den[: G.den.size - k], blocks.delay) if k else ():
        kept = ct.tf(model.num[0][0], np.append(model.den[0][0], np.zeros(k)))
        candidates += [_with_integrators(process, kept, how, ramp, limit) for ramp in (k, k + 1)]
    return sorted(candidates, key=_rank)


def _rank(candidate: ModelCandidate) -> tuple[int, float, float]:
    """Those that meet the limit first, by S_δ ≈ nλ·G̃(0)·s, what is left of a slow disturbance."""
    if candidate.fastest is not None:
        return 0, _left(candidate, candidate.fastest), candidate.ms
    return (1, candidate.ms, 0.0) if candidate.time_constants else (2, 0.0, 0.0)


def _left(candidate: ModelCandidate, time_constant: float) -> float:
    """Size of (1 - F)·G̃/s at s = 0; inf if the model's integrators leave (1 - F)·G̃ a value."""
    family = as_family(candidate.filters)
    model = QuasiPolynomial(candidate.model.den[0][0])
    if model.zeros_at_origin == family.ramp:
        return inf
    gain = candidate.model.num[0][0][-1] / model.without_origin.constant
    return float(abs(gain) * family.ramp_coefficient(time_constant)) if time_constant else 0.0


def _with_integrators(
    process: Any, model: ct.TransferFunction, how: str, ramp: int, max_ms: float
) -> ModelCandidate:
    """Judge a model that integrates, with the lowest filter for which 1 - F ~ s^ramp."""
    k = QuasiPolynomial(model.den[0][0]).zeros_at_origin
    kept = f"{'integrator' if k == 1 else f'{k} integrators'} kept, 1 - F ~ s^{ramp}"
    how = kept if how == "matched" else f"{kept}, {how}"
    if ramp == 1:
        return _judged(process, model, how, max_ms)
    degree = as_fraction(model, "model").relative_degree
    family = filter_family("ramp", degree + ramp - 1, ramp=ramp)
    return _allowed(FilterSearch.of(process, model, family, max_ms), how)


def _judged(process: Any, model: ct.TransferFunction, how: str, max_ms: float) -> ModelCandidate:
    """Try the lowest causal order and the next, and keep the better."""
    lowest = Mismatch.of(process, model).family.order
    searches = [FilterSearch.of(process, model, n, max_ms) for n in (lowest, lowest + 1)]
    # Where one is faster the peak need not choose.
    best = min(search.promise for search in searches)
    return min((_allowed(each, how) for each in searches if each.promise == best), key=_rank)


def _allowed(search: FilterSearch, how: str) -> ModelCandidate:
    """Say what a model allows."""
    fastest, ms = None, search.closest[1].ms if search.intervals else nan
    if search.admissible:
        fastest = 0.0 if search.all_fast_ones_do else search.admissible[0][0]
    order, family = search.family.order, None if search.family.is_binomial else search.family
    return ModelCandidate(search.model, how, order, search.intervals, fastest, ms, family)


def _models(
    num: FloatArray, den: FloatArray, delay: float
) -> Iterator[tuple[ct.TransferFunction, str]]:
    """Give every combination of what can be done about what cannot be matched."""
    gains = GAINS if roots_by_side(den)[0].size else (1.0,)
    lags = [(np.ones(1), "dead time left out" if delay else "")]
    if delay:
        lags.append((np.array([delay, 1.0]), "dead time replaced by a lag"))
    new_den, poles_how = _denominator(num, den, delay)
    for (new_num, zeros_how), (lag, delay_how), gain in product(_numerators(num), lags, gains):
        scaled = f"gain × {gain:g}" if gain != 1 else ""
        how = ", ".join(filter(None, (zeros_how, poles_how, delay_how, scaled)))
        yield ct.tf(gain * new_num, np.convolve(new_den, lag)), how or "matched"


def _numerators(num: FloatArray) -> list[tuple[FloatArray, str]]:
    """Numerators of the same DC gain, without zeros in the right half plane."""
    right, axis = roots_by_side(num)
    if not right.size + axis.size:
        return [(num, "")]
    wrong = np.concatenate([right, axis])
    left_out = _without(num, wrong)
    mirrored = np.convolve(left_out, _polynomial(np.concatenate([-right.conj(), _damped(axis)])))
    return [
        (num[-1] / left_out[-1] * left_out, "zeros in the right half plane left out"),
        (num[-1] / mirrored[-1] * mirrored, "zeros in the right half plane mirrored"),
    ]


def _denominator(num: FloatArray, den: FloatArray, delay: float) -> tuple[FloatArray, str]:
    """Denominator with all roots in the left half plane; mirrored poles have the parity needed."""
    right, axis = roots_by_side(den)
    if not right.size + axis.size:
        return den, ""
    moved, done = [-right.conj()], []
    if right.size:
        done.append("unstable poles mirrored")
    if axis.size:
        sizes = np.abs(np.concatenate([QuasiPolynomial(p).roots for p in (num, den)]))
        speeds = [*sizes[sizes > 0], *([1 / delay] if delay else [])]
        moved.append(np.where(axis == 0, -DETUNING * min(speeds, default=1.0), _damped(axis)))
        done.append("poles on the axis moved to the left")
    kept = _without(den, np.concatenate([right, axis]))
    return np.convolve(kept, _polynomial(np.concatenate(moved))), ", ".join(done)


def _without(p: FloatArray, roots: ComplexArray) -> FloatArray:
    """Divide a polynomial by some of its roots, those at 0 exactly, so that the others stay."""
    p = p[: p.size - int(np.sum(roots == 0))]
    divisor = _polynomial(roots[roots != 0])
    # Which end the division begins at decides whether slow or fast roots keep their accuracy.
    tried = [np.polydiv(p[::way], divisor[::way])[0][::way] for way in (1, -1)]
    return min(tried, key=lambda left: float(np.abs(np.convolve(left, divisor) - p).max()))


def _damped(roots: ComplexArray) -> ComplexArray:
    return np.asarray(roots - DETUNING * np.abs(roots))


def _polynomial(roots: ComplexArray) -> FloatArray:
    return np.atleast_1d(np.real(np.poly(roots)))


def _written(coefficients: FloatArray) -> str:
    """Write a polynomial in s."""
    powers = {0: "", 1: " s"}
    terms = [
        f"{value:.4g}{powers.get(power, f' s^{power}')}"
        for power, value in zip(reversed(range(coefficients.size)), coefficients, strict=True)
        if value
    ]
    return " + ".join(terms).replace("+ -", "- ")
