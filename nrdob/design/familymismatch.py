r"""Process over model for a family of filters: the observer loop as a polynomial in λ.

What F/G̃ and (1 - F)G̃ share with themselves for every λ is in no block. Without it

.. math:: p_B(s; \lambda) = \sum_k \lambda^k \left( a\,e_k + b\,n_k\,e^{-\theta s} \right),
          \qquad a = D N_m', \quad b = N D_m',

where :math:`e_k` and :math:`n_k` are the coefficients of the powers of λ in what is left of
:math:`D_f - N_f` and of :math:`N_f`. Where the model waits, no pole of it is shared but m of its
integrators, and what waits stands with the same :math:`n_k`:

.. math:: p_B(s; \lambda) = s^{-m} \sum_k \lambda^k \left(
          a\,d_k + (b\,e^{-\theta s} - D N_m\,e^{-\theta_m s})\,n_k \right).

On the axis m of Taylor's terms of :math:`e^{-\theta_m s}` go to :math:`d_k`, so that both parts can
be divided.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from math import factorial, pi
from typing import Any, TypeVar

import numpy as np

from ..diagram import FilterFamily, ObserverEquations
from ..numerics import (
    ROUNDING,
    BoolArray,
    ComplexArray,
    FloatArray,
    QuasiPolynomial,
    Term,
    add,
    companion_roots,
    count_rhp,
    exponential_rest,
    shared_factor,
)
from .mismatch import ERROR, Mismatch, multiplied

__all__ = [
    "FamilyMismatch",
    "beyond_roots",
    "last_root",
    "positive_roots",
    "product",
    "root_near",
    "roots_of_columns",
    "size_squared",
    "slope_in_lambda",
]

GENERIC = (0.71, 1.93, 0.31)
"""Time constants, against the typical one, at which a factor must be shared to be so at all."""

NEWTON, FARTHEST = 2, 1e-5
"""Steps that polish a root, and how far one may lead, against the root."""

EPS = 16 * float(np.finfo(float).eps)
"""Value of a polynomial at a root, against the sum of its terms' sizes, that is but rounding."""

OWN, TRIED = "own", (1.0, 0.1, 10.0, 1e-2, 1e2, 1e-3, 1e3)
"""The only kind whose filters may be unstable, and the λ of which one should not be."""

SAME_PRODUCT = 1e-8
"""By how much the product of all roots may be off the one that the coefficients give."""

CUBE_ROOTS = np.exp(2j * pi / 3 * np.arange(3))

SETTLING, SETTLED, SAME_ROOT = 5, 1e-11, 0.05
"""Newton steps to a root from a guess, how small the last must be, and how far all may lead."""

NEARLY_REAL = 0.2
"""Imaginary part of a root, against the real one, with which it is near a real one."""

Columns = TypeVar("Columns", FloatArray, ComplexArray)
"""Coefficients of polynomials, ascending, each polynomial a column."""

REAL = 1e-7
"""Imaginary part of a root, against its size, that may be rounding."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FamilyMismatch(Mismatch):
    """The ratio R = b/a · exp(-θs), and what is left of a family's Df - Nf and Nf.

    Attributes
    ----------
    E, Nf : (K, m) array of float
        Row k holds the coefficients of λ^k, descending in s. E is all of Df for a model that waits.
    Nm : array of float
        All zeros of a model that waits; 0 for one that does not.
    divided : int
        Power of s by which p_B is divided: integrators that a model that waits has more than the
        process, as far as they cancel inside (1 - F exp(-θm s))·model for every λ.
    """

    E: FloatArray
    Nf: FloatArray
    Nm: FloatArray = field(default_factory=lambda: np.zeros(1))
    divided: int = 0

    @classmethod
    def for_family(cls, process: Any, model: Any, family: FilterFamily) -> FamilyMismatch:
        """Read process and model as the loop does, with the same refusals."""
        loop = ObserverEquations(process, model, _stable_member(family))
        if loop.model_delay:
            return cls.that_waits(loop, family.num, family.den)
        G, Gm = loop.fractions.G, loop.fractions.Gm
        E, Dm = _without_shared(family.difference, Gm.den)
        Nf, Nm = _without_shared(family.num, Gm.num)
        return cls.of_tables(E, Nf, (*G, Nm, Dm), loop.delay, family.order)

    @classmethod
    def that_waits(
        cls, loop: ObserverEquations, num: FloatArray, den: FloatArray
    ) -> FamilyMismatch:
        """Take the process and model of a loop whose model waits; the filters as tables."""
        G, Gm = loop.fractions.G, loop.fractions.Gm
        Nf, Nm = _without_shared(num, Gm.num)
        held = min(QuasiPolynomial(Gm.den).zeros_at_origin, _ramp(num, den, loop.model_delay))
        both = min(held, QuasiPolynomial(G.den).zeros_at_origin)
        D, Dm = (p[: p.size - both] for p in (G.den, Gm.den))
        found = cls.of_tables(den, Nf, (G.num, D, Nm, Dm), loop.delay, den.shape[0] - 1)
        return replace(found, wait=loop.model_delay, Nm=Gm.num, divided=held - both)

    @classmethod
    def of_tables(
        cls,
        E: FloatArray,
        Nf: FloatArray,
        factors: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
        delay: float,
        order: int,
    ) -> FamilyMismatch:
        """Multiply N, D and what is left of Nm and Dm; the tables have descending powers of λ."""
        N, D, Nm, Dm = factors
        E, Nf = _by_powers(E, Nf)
        return cls(multiplied(D, Nm), multiplied(N, Dm), delay, order, factors, E=E, Nf=Nf)

    @cached_property
    def own_speeds(self) -> FloatArray:
        """Sizes of the roots that the family's coefficients have in s, in rad/s."""
        rows = [row for table in (self.E, self.Nf) for row in table if row.any()]
        parts = [QuasiPolynomial(np.trim_zeros(row, "f")).without_origin.roots for row in rows]
        return np.asarray(np.abs(np.concatenate(parts)))

    @cached_property
    def speeds(self) -> FloatArray:
        """Sizes of all roots, and one over the dead time, in rad/s; 1 where there is neither."""
        lags = [1 / delay for delay in (self.delay, self.wait) if delay]
        sizes = np.concatenate([np.abs(self.roots), lags, self.own_speeds])
        return sizes if sizes.size else np.ones(1)

    @cached_property
    def neutral_limit(self) -> float:
        """λ below which a dead time leaves infinitely many roots on the right; 0 if there is none.

        Raises
        ------
        ValueError
            If it does so for every large λ.
        """
        ahead = [(self.E, self.a)] + [(self.Nf, p) for p, delay in self.behind if not delay]
        behind = [(self.Nf, p) for p, delay in self.behind if delay]
        if not behind:
            return 0.0
        top = max(_degree(table) + p.size for table, p in (*ahead, *behind))
        leading, delayed = (
            [_wide(table)[::-1, 0] * p[0] for table, p in part if _degree(table) + p.size == top]
            for part in (ahead, behind)
        )
        if not delayed:
            return 0.0
        # Those with dead time are all multiples of the same polynomial in λ.
        least: FloatArray = reduce(add, leading, np.zeros(1))
        most: FloatArray = np.sign(delayed[0]) * sum(map(np.abs, delayed))
        square = add(np.convolve(least, least), -np.convolve(most, most))
        square = np.trim_zeros(square, "f")
        if not leading or not square.size or square[0] < 0:
            raise ValueError(
                "with dead time every slow filter of this family leaves infinitely many roots in "
                "the right half plane: take one of higher relative degree"
            )
        return float(positive_roots(square).max(initial=0.0))

    @property
    def degree(self) -> int:
        """Highest power of s in p_B for most λ."""
        parts = [(self.E, self.a), *((self.Nf, p) for p, _ in self.behind)]
        return max(_degree(table) + p.size for table, p in parts if p.any()) - 2 - self.divided

    @cached_property
    def waiting(self) -> FloatArray:
        """Coefficients of D Nm, which stand before the model's dead time."""
        return np.convolve(self.factors[1], self.Nm)

    @cached_property
    def behind(self) -> list[Term]:
        """What stands before Nf, by dead time; equal ones are added up."""
        if self.wait and self.wait == self.delay:
            return [Term(add(self.b, -self.waiting), self.delay)]
        return [Term(self.b, self.delay), *([Term(-self.waiting, self.wait)] if self.wait else [])]

    def p_B(self, time_constant: float) -> QuasiPolynomial:
        """Characteristic function for one filter."""
        (ahead, behind, *waiting), sizes = self.built(time_constant)
        more = tuple(Term(part, self.wait) for part in waiting)
        p = QuasiPolynomial(
            ahead, behind, self.delay, reduce(add, sizes), more, origin=self.divided
        )
        return p.over_s(self.divided)

    def built(self, time_constant: float) -> tuple[list[FloatArray], list[FloatArray]]:
        """Coefficients of a E, b Nf, and -D Nm Nf if the model waits; the sizes summed in each."""
        parts, sizes = [], []
        tables = [(self.E, self.a), (self.Nf, self.b)]
        tables += [(self.Nf, -self.waiting)] if self.wait else []
        for table, factor in tables:
            parts.append(np.convolve(factor, _in_lambda(table, time_constant)))
            sizes.append(np.convolve(np.abs(factor), _in_lambda(np.abs(table), time_constant)))
        if not all(np.isfinite(size).all() for size in sizes):
            raise ArithmeticError(
                f"time constant {time_constant:g} s to the power {self.order} leaves the range of "
                "floating-point numbers: choose another unit of time"
            )
        return parts, sizes

    # On the imaginary axis: a polynomial in λ at each frequency.

    def coefficients(self, omega: FloatArray) -> ComplexArray:
        """Coefficients of λ^k in p_B(jω), ascending, each frequency a column."""
        (a, b, waits), (E, Nf) = self._apart(omega), self._tables(omega)
        return np.asarray(a * E + (b + waits) * Nf)

    def uncertainty(self, omega: FloatArray) -> FloatArray:
        """Bounds of the rounding errors of the coefficients."""
        values, sizes = [np.abs(value) for value in self._values(omega)], self._sizes(omega)
        N, D, Nm, Dm = values
        off_a = sizes[1] * Nm + D * sizes[2]
        off_b = sizes[0] * Dm + N * sizes[3] + N * Dm * self.delay * omega / 8
        off_b = off_b / omega**self.divided
        if self.wait:
            zeros, size = np.abs(_at(self.Nm, omega)), np.polyval(np.abs(self.Nm), omega)
            lag = np.abs(self._lag(1j * omega))
            turned = D * zeros * self.wait * omega / 8
            off_b = off_b + lag * (sizes[1] * zeros + D * size) + turned / omega**self.divided
        E, Nf = (_rows(np.abs(table), omega) for table in (self._ahead, self.Nf))
        return np.asarray(ERROR * (off_a * E + off_b * Nf))

    def terms(
        self, omega: FloatArray, time_constant: FloatArray
    ) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return a E, b Nf exp(-jωθ), and what waits for the model, at points (ω, λ).

        Divided as p_B is. The arrays are broadcast against each other.
        """
        (a, b, waits), (E, Nf) = self._apart(omega), self._tables(omega)
        powers = [np.asarray(time_constant) ** k for k in range(len(E))]
        E, Nf = (
            sum(row * power for row, power in zip(table, powers, strict=True)) for table in (E, Nf)
        )
        return a * E, b * Nf, waits * Nf

    def filters(self, s: complex, time_constant: FloatArray) -> tuple[Any, Any]:
        """Values of E and Nf for many filters at one point."""
        powers = np.asarray(time_constant)[None, :] ** np.arange(len(self.E))[:, None]
        return (
            np.polyval(self.E.T, s) @ powers,
            np.polyval(self.Nf.T, s) @ powers,
        )

    def lowest(self, time_constant: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Values at s = 0 of a E, b Nf, and of what waits, for many filters, divided as p_B is."""
        E, Nf = (
            np.polyval(table[::-1, -1], np.asarray(time_constant))
            for table in (self._ahead, self.Nf)
        )
        lag = (-self.wait) ** self.divided / factorial(self.divided)
        return self.a[-1] * E, self.b[-1 - self.divided] * Nf, -self.waiting[-1] * lag * Nf

    def highest(
        self, time_constant: FloatArray, *, lagging: bool = False
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coefficients of the highest power of s in p_B of the same three, for many filters.

        D may be multiplied by one more lag, whose time constant is left out.
        """
        tables = [np.polyval(t[::-1], time_constant[:, None]) for t in (self.E, self.Nf, self.Nf)]
        leads, degrees = [], []
        factors = (self.a, self.b, -self.waiting)
        for table, factor, more in zip(tables, factors, (lagging, False, lagging), strict=True):
            used = int(np.flatnonzero(table.any(axis=0))[0])
            leads.append(factor[0] * table[:, used])
            degrees.append((factor.size + table.shape[1] - used if factor.any() else 0) + more)
        ahead, behind, waits = (
            lead * (degree == max(degrees)) for lead, degree in zip(leads, degrees, strict=True)
        )
        return ahead, behind, waits

    def roots_in_lambda(self, omega: FloatArray) -> ComplexArray:
        """All λ for which p_B(jω) = 0, complex ones too: shape (n, N)."""
        return roots_of_columns(self.coefficients(omega))

    def off_gain(self, omega: FloatArray, gain: float = 1.0) -> FloatArray:
        """Coefficients in λ, ascending, each frequency a column, of ``|a E|^2 - |b Nf/gain|^2``.

        Its last root bounds the λ with ``|L| = gain``; the critical λ are among those of gain 1.
        Two dead times are taken at their worst, so that the bound does not turn with them.
        """
        (a, b, waits), (E, Nf) = self._apart(omega), self._tables(omega)
        ahead, behind = a * E, (np.abs(b) / gain + np.abs(waits)) * Nf
        most = np.maximum(np.abs(ahead).max(axis=0), np.abs(behind).max(axis=0))
        with np.errstate(all="ignore"):
            ahead, behind = (np.nan_to_num(part / most) for part in (ahead, behind))
        return size_squared(ahead) - size_squared(behind)

    def _apart(self, omega: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Return D Nm', N Dm' exp(-jωθ), and -D Nm exp(-jωθm) or 0, divided as p_B is."""
        s = 1j * np.asarray(omega)
        N, D, Nm, Dm = self._values(omega)
        turned = N * Dm * np.exp(-self.delay * s)
        if not self.wait:
            return D * Nm, turned, np.zeros(1, dtype=complex)
        turned = turned / s**self.divided if self.divided else turned
        return D * Nm, turned, -D * _at(self.Nm, omega) * self._lag(s)

    def _lag(self, s: ComplexArray) -> ComplexArray:
        """exp(-θm s), or what is left of it without the first terms of its series."""
        m = self.divided
        if not m:
            return np.asarray(np.exp(-self.wait * s))
        return np.asarray((-self.wait) ** m * exponential_rest(-self.wait * s, m, divided=True))

    @cached_property
    def _ahead(self) -> FloatArray:
        """E less Nf times the first terms of the series of exp(-θm s), divided as p_B is."""
        m = self.divided
        if not m:
            return self.E
        lag = _taylor(self.wait, m)[::-1]
        late = np.array([np.convolve(row, lag) for row in self.Nf])
        columns = max(late.shape[1], self.E.shape[1])
        late, ahead = (np.pad(p, ((0, 0), (columns - p.shape[1], 0))) for p in (late, self.E))
        return np.asarray((ahead - late)[:, :-m])

    def _tables(self, omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        s = 1j * np.asarray(omega)
        return _rows(self._ahead, s), _rows(self.Nf, s)

    # At the ends of the axis: real polynomials in λ.

    @cached_property
    def at_ends(self) -> FloatArray:
        """Coefficients in λ, ascending, of s^0, s^1 and of the two highest powers of s in p_B.

        Those at s = 0 of the series of all, the highest only of what is before any dead time.
        """
        tables = [(self.E, self.a, 0.0)] + [(self.Nf, p, delay) for p, delay in self.behind]
        parts = [
            np.array([np.convolve(factor, row) for row in _wide(table)])
            for table, factor, _ in tables
        ]
        columns = self.divided + 1 + max(part.shape[1] for part in parts)
        parts = [np.pad(part, ((0, 0), (columns - part.shape[1], 0))) for part in parts]
        delays = [delay for *_, delay in tables]

        def at_zero(power: int) -> FloatArray:
            return _summed(
                [
                    part[:, -1 - k, None] * _taylor(delay, power + 1)[power - k]
                    for part, delay in zip(parts, delays, strict=True)
                    for k in range(power + 1)
                ]
            )[:, 0]

        top = _summed([part for part, delay in zip(parts, delays, strict=True) if not delay])
        first = int(np.flatnonzero(top.any(axis=0))[0])
        last = top[:, first + 1] if first + 1 < top.shape[1] else np.zeros(top.shape[0])
        return np.array([at_zero(self.divided), at_zero(self.divided + 1), top[:, first], last])


def roots_of_columns(coefficients: Any) -> ComplexArray:
    """Roots of polynomials, ascending coefficients in columns: shape (n, N), all at once."""
    coefficients = np.asarray(coefficients, dtype=complex)
    n = coefficients.shape[0] - 1
    scaled, scale = _scaled(coefficients)
    if n == 1:
        return np.asarray(-scaled[:1] * scale)
    if n > 3:
        return _polished(coefficients, _eigenvalues(scaled) * scale)[0]
    with np.errstate(all="ignore"):
        roots, known = _polished(coefficients, _by_formula(scaled) * scale)
        vieta = np.prod(roots, axis=0) * coefficients[-1] + (-1) ** (n + 1) * coefficients[0]
        known &= np.abs(vieta) <= SAME_PRODUCT * np.abs(coefficients[0])
    if not known.all():
        few = coefficients[:, ~known]
        every = _eigenvalues(scaled[:, ~known]) * scale[~known]
        roots[:, ~known] = _polished(few, every)[0]
    return roots


def _scaled(coefficients: Columns) -> tuple[Columns, FloatArray]:
    """Make polynomials monic, with roots whose product is of size 1, and give their scales."""
    n = coefficients.shape[0] - 1
    first, last = np.abs(coefficients[0]), np.abs(coefficients[-1])
    tiny = 1e-290 + 1e-30 * np.abs(coefficients).max(axis=0, initial=0.0)
    with np.errstate(all="ignore"):
        scale = np.where(first > 0, first / np.maximum(last, tiny), 1.0) ** (1 / n)
        scaled = coefficients * scale ** np.arange(n + 1)[:, None]
        return scaled / np.where(last > 0, scaled[-1], 1.0), scale


def _eigenvalues(monic: Columns) -> ComplexArray:
    """Roots of monic polynomials as eigenvalues of their companion matrices."""
    n = monic.shape[0] - 1
    companion = np.zeros((monic.shape[1], n, n), dtype=monic.dtype)
    companion[:, np.arange(1, n), np.arange(n - 1)] = 1
    companion[:, :, -1] = -np.nan_to_num(monic[:-1].T)
    return np.asarray(np.linalg.eigvals(companion).T)


def _by_formula(monic: ComplexArray) -> ComplexArray:
    """Roots of monic quadratics or cubics, the last digits of the smallest lost where sizes differ.

    Of a cubic the largest one by Cardano's formula, the others of what it leaves.
    """
    if monic.shape[0] == 3:
        return _of_quadratic(monic[1], monic[0])
    p, q, r = monic[2] / 3, monic[1], monic[0]
    P, Q = p * p - q / 3, p**3 - (p * q - r) / 2
    root = np.sqrt(Q * Q - P**3)
    root = np.where((root * Q.conj()).real < 0, -root, root)
    A = -((Q + root) ** (1 / 3))
    every = np.array([A * turn + P / np.where(A == 0, 1.0, A * turn) - p for turn in CUBE_ROOTS])
    largest = np.take_along_axis(every, np.abs(every).argmax(axis=0)[None], axis=0)[0]
    product = -r / largest
    return np.vstack([largest, _of_quadratic((product - q) / largest, product)])


def _of_quadratic(p: ComplexArray, q: ComplexArray) -> ComplexArray:
    """Roots of x² + p x + q."""
    root = np.sqrt(p * p - 4 * q)
    larger = -(p + np.where((root * p.conj()).real < 0, -root, root)) / 2
    return np.array([larger, q / larger])


def _polished(coefficients: ComplexArray, roots: ComplexArray) -> tuple[ComplexArray, BoolArray]:
    """Take Newton's steps to roots, and tell where the last ones lead nowhere.

    Where the value is but rounding, as at roots that are nearly one, they could only do harm.
    """
    sizes = np.abs(coefficients)
    with np.errstate(all="ignore"):
        for _ in range(NEWTON):
            value, slope = _value_and_slope(coefficients, roots)
            there = np.abs(value) <= EPS * _value_and_slope(sizes, np.abs(roots))[0]
            step = np.nan_to_num(value / slope, posinf=0.0, neginf=0.0)
            small = np.abs(step) <= FARTHEST * np.abs(roots)
            roots = roots - np.where(small & ~there, step, 0.0)
    known = np.isfinite(roots) & (small | there)
    return np.asarray(roots), np.asarray(known.all(axis=0))


def last_root(columns: FloatArray) -> FloatArray:
    """Last positive root of polynomials, ascending coefficients in columns; 0 where none is.

    A pair that is not quite real counts, because between two frequencies it may become so. For a
    bound the roots need not be polished.
    """
    scaled, scale = _scaled(columns)
    roots = _eigenvalues(scaled) * scale
    real = np.abs(roots.imag) <= NEARLY_REAL * roots.real
    return np.asarray(np.where(real, roots.real, 0.0).max(axis=0, initial=0.0))


def beyond_roots(columns: FloatArray) -> FloatArray:
    """Bound the sizes of all roots of polynomials, ascending coefficients in columns (Fujiwara)."""
    n = columns.shape[0] - 1
    with np.errstate(all="ignore"):
        ratios = np.abs(columns[:-1] / columns[-1]) ** (1 / np.arange(n, 0, -1))[:, None]
    return np.asarray(2 * np.nan_to_num(ratios, nan=np.inf, posinf=np.inf).max(axis=0))


def _value_and_slope(
    coefficients: ComplexArray, x: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Polynomials, ascending coefficients in columns, at the points of the same columns."""
    value = np.zeros_like(x) + coefficients[-1]
    slope = np.zeros_like(x)
    for k in range(coefficients.shape[0] - 2, -1, -1):
        slope = slope * x + value
        value = value * x + coefficients[k]
    return value, slope


def root_near(coefficients: ComplexArray, guess: ComplexArray) -> ComplexArray:
    """Root of each polynomial, ascending coefficients in columns, next to a guess.

    By Newton's steps, and where these do not settle the nearest of all.
    """
    found = guess[None]
    with np.errstate(all="ignore"):
        for _ in range(SETTLING):
            value, slope = _value_and_slope(coefficients, found)
            step = value / slope
            found = found - step
            settled = np.abs(step[0]) <= SETTLED * np.abs(found[0])
            if settled.all():
                break
        lost = ~(settled & (np.abs(found[0] - guess) <= SAME_ROOT * np.abs(guess)))
    found = found[0]
    if lost.any():
        every = roots_of_columns(coefficients[:, lost])
        nearest = np.abs(every - guess[lost]).argmin(axis=0)
        found[lost] = every[nearest, np.arange(nearest.size)]
    return np.asarray(found)


def slope_in_lambda(coefficients: ComplexArray, x: ComplexArray) -> ComplexArray:
    """Differentiate polynomials, ascending coefficients in columns."""
    return _value_and_slope(coefficients, x)[1]


def size_squared(columns: ComplexArray) -> FloatArray:
    """Square of the size of polynomials in a real λ, ascending coefficients in columns."""
    return product(columns, columns.conj()).real


def product(p: ComplexArray, q: ComplexArray) -> ComplexArray:
    """Multiply polynomials, ascending coefficients in columns."""
    total = np.zeros((p.shape[0] + q.shape[0] - 1, p.shape[1]), dtype=complex)
    for k in range(p.shape[0]):
        total[k : k + q.shape[0]] += p[k] * q
    return total


def positive_roots(p: FloatArray) -> FloatArray:
    """Real positive roots of a polynomial, descending coefficients, increasing."""
    p = np.trim_zeros(np.trim_zeros(p, "f"), "b")
    if p.size < 2:
        return np.empty(0)
    roots = companion_roots(p)
    real = np.abs(roots.imag) <= REAL * np.abs(roots)
    return np.sort(roots.real[real & (roots.real > 0)])


def _stable_member(family: FilterFamily) -> Any:
    """Give one filter of the family that is stable, if there is one, as all should be."""
    for time_constant in TRIED:
        filter = family.at(time_constant)
        if family.kind != OWN or count_rhp(QuasiPolynomial(filter.den[0][0])).count == 0:
            break
    return filter


def _ramp(num: FloatArray, den: FloatArray, wait: float) -> int:
    """Count the zeros at s = 0 that Df - Nf exp(-θm s) has for every λ."""
    rows = int(den.shape[0])
    columns = max(num.shape[1], den.shape[1])
    ahead, behind = (
        np.pad(table[::-1], ((0, rows - table.shape[0]), (columns - table.shape[1], 0)))
        for table in (den, num)
    )
    lag = _taylor(wait, rows)
    for k in range(rows):
        late = lag[k::-1] @ behind[: k + 1]
        sizes = np.abs(ahead[k]) + np.abs(lag[k::-1]) @ np.abs(behind[: k + 1])
        if np.any(np.abs(ahead[k] - late) > ROUNDING * sizes):
            return k
    return rows


def _taylor(delay: float, count: int) -> FloatArray:
    """First coefficients of the series of exp(-θs), ascending."""
    return np.array([(-delay) ** k / factorial(k) for k in range(count)])


def _without_shared(table: FloatArray, block: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Divide a family's polynomial and one of the model by what they share for every λ."""
    if block.size == 1:
        return table, block
    model = QuasiPolynomial(block)
    sizes = np.abs(model.without_origin.roots)
    typical = 1 / float(np.median(sizes)) if sizes.size else 1.0
    common = model
    for share in GENERIC:
        one = QuasiPolynomial(_trimmed(np.polyval(table.T, share * typical)))
        if not (common.degree and one.degree):
            return table, block
        common = shared_factor(common, one).common
    if not common.degree:
        return table, block
    divided = [_divided(column, common) for column in table.T]
    rows = max(column.size for column in divided)
    columns = [np.pad(column, (rows - column.size, 0)) for column in divided]
    return np.array(columns).T, _divided(block, common)


def _divided(p: FloatArray, divisor: QuasiPolynomial) -> FloatArray:
    """Divide a polynomial by a factor of it; roots at s = 0 stay exact."""
    if not p.any():
        return np.zeros(1)
    zeros, fewer = QuasiPolynomial(p).zeros_at_origin, divisor.zeros_at_origin
    quotient = np.polydiv(p[: p.size - zeros], divisor.without_origin.q)[0]
    return np.append(quotient, np.zeros(zeros - fewer))


def _by_powers(E: FloatArray, Nf: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Turn tables to ascending powers of λ in rows, as many in both as are used."""
    columns = max(E.shape[1], Nf.shape[1])
    E, Nf = (np.pad(table, ((0, 0), (columns - table.shape[1], 0))).T[::-1] for table in (E, Nf))
    used = np.flatnonzero(E.any(axis=1) | Nf.any(axis=1))
    return E[used[0] : used[-1] + 1], Nf[used[0] : used[-1] + 1]


def _wide(table: FloatArray) -> FloatArray:
    """Leave out the powers of s that no λ needs."""
    used = np.flatnonzero(table.any(axis=0))
    return table[:, used[0] :] if used.size else table[:, -1:]


def _degree(table: FloatArray) -> int:
    return int(_wide(table).shape[1])


def _rows(table: FloatArray, s: Any) -> Any:
    """Value of each row's polynomial, descending coefficients, at the same points."""
    value = np.zeros((table.shape[0], *s.shape), dtype=s.dtype)
    for column in table.T:
        value = value * s + column.reshape(-1, *[1] * s.ndim)
    return value


def _summed(tables: list[FloatArray]) -> FloatArray:
    """Add tables; what is only rounding is 0."""
    total, size = sum(tables), sum(map(np.abs, tables))
    return np.where(np.abs(total) <= ROUNDING * size, 0.0, total)


def _at(p: FloatArray, omega: FloatArray) -> ComplexArray:
    return np.asarray(np.polyval(p, 1j * np.asarray(omega)))


def _in_lambda(table: FloatArray, time_constant: float) -> FloatArray:
    """Coefficients for one λ, the rows ascending powers of it."""
    return np.asarray(np.polyval(table[::-1], time_constant))


def _trimmed(p: FloatArray) -> FloatArray:
    used = np.flatnonzero(p)
    return p[used[0] :] if used.size else p[-1:]
