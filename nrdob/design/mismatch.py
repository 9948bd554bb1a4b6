r"""Process over model, and the observer loop as a polynomial in the time constant λ.

With :math:`R = G/\tilde G = b/a`, a = D·Nm, b = N·Dm, and the coefficients :math:`e_k`,
:math:`n_k` and :math:`d_k` of the powers of λ in :math:`D_f - N_f`, :math:`N_f` and :math:`D_f`

.. math:: p_B(s; \lambda)
          = s^{-m} \sum_k \lambda^k \left( a\,e_k + b\,n_k\,e^{-\theta s} \right):

m integrators, which the model has more than the process, cancel inside (1 - F)·model. Whatever else
F/G̃ and (1 - F)G̃ share with themselves for every λ is divided out. With a dead time in the model no
pole but integrators cancels, and m of Taylor's terms of :math:`e^{-\theta_m s}` go to :math:`d_k`:

.. math:: p_B(s; \lambda) = s^{-m} \sum_k \lambda^k \left(
          a\,d_k + (b\,e^{-\theta s} - D N_m\,e^{-\theta_m s})\,n_k \right).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, reduce
from math import factorial, log10
from typing import Any

import numpy as np

from ..diagram import FilterFamily, ObserverEquations, as_family, as_fraction, undelayed
from ..numerics import (
    ROUNDING,
    BoolArray,
    ComplexArray,
    FloatArray,
    QuasiPolynomial,
    Term,
    add,
    convolved,
    count_rhp,
    exponential,
    exponential_rest,
    padded_sum,
    shared_factor,
    values_on_axis,
)
from .columns import size_squared

__all__ = ["Mismatch", "multiplied", "summed"]

ERROR = 64 * float(np.finfo(float).eps)  # rounding error of a value, against its terms' sizes

GENERIC = (0.71, 1.93, 0.31)  # λ, against the typical one, at all of which a factor is shared

OWN, TRIED = "own", (1.0, 0.1, 10.0, 1e-2, 1e2, 1e-3, 1e3)
"""The only kind whose filters may be unstable, and the λ of which one should not be."""

Factors = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
Parts = tuple[ComplexArray, ComplexArray, ComplexArray]


@dataclass(frozen=True, eq=False, kw_only=True)
class Mismatch:
    """The ratio R = G/G̃ = b/a · exp(-(θ - θm)s) and a family of filters.

    The factors N, D, Nm and Dm are without what cancels inside the blocks but for m integrators;
    those that process and model have in common are in no factor. `zeros` is all of Nm, `delay` and
    `model_delay` are θ and θm, `divided` is m. Row k of E and Nf holds the coefficients of λ^k,
    descending in s; E is all of Df where the model has a dead time, else Df - Nf.
    """

    factors: Factors
    zeros: FloatArray
    delay: float
    model_delay: float
    family: FilterFamily
    E: FloatArray
    Nf: FloatArray
    divided: int

    @classmethod
    def of(cls, process: Any, model: Any, filters: int | FilterFamily | None = None) -> Mismatch:
        """Read process and model as the loop does, with the same refusals.

        Without filters, those of eq. (1) of the lowest order that is causal.
        """
        if filters is None:
            filters = max(1, as_fraction(undelayed(model)[0], "model").relative_degree)
        family = as_family(filters)
        return cls.in_loop(ObserverEquations(process, model, _stable_member(family)), family)

    @classmethod
    def in_loop(cls, loop: ObserverEquations, family: FilterFamily) -> Mismatch:
        """Take process and model of a loop, and a family in place of its filter."""
        G, Gm, model_delay = loop.fractions.G, loop.fractions.Gm, loop.model_delay
        held = min(QuasiPolynomial(Gm.den).zeros_at_origin, _common_ramp(family, model_delay))
        both = min(held, QuasiPolynomial(G.den).zeros_at_origin)
        D, Dm = (p[: p.size - both] for p in (G.den, Gm.den))
        Nf, Nm = _without_shared(family.num, Gm.num)
        E = family.den
        if not model_delay:
            integrators = np.zeros(held - both)
            E, rest = _without_shared(family.difference, Dm[: Dm.size - integrators.size])
            Dm = np.concatenate([rest, integrators])
        E, Nf = _by_powers(E, Nf)
        return cls(
            factors=(G.num, D, Nm, Dm), zeros=Gm.num, delay=loop.delay, model_delay=model_delay,
            family=family, E=E, Nf=Nf, divided=held - both,
        )  # fmt: skip

    def __post_init__(self) -> None:
        self.a, self.b  # noqa: B018 - those out of range are refused at once

    # The ratio R.

    @cached_property
    def a(self) -> FloatArray:
        """Coefficients of D·Nm."""
        return multiplied(self.factors[1], self.factors[2])

    @cached_property
    def b(self) -> FloatArray:
        """Coefficients of N·Dm."""
        return multiplied(self.factors[0], self.factors[3])

    @property
    def longest_delay(self) -> float:
        """The longer of the two dead times, in seconds."""
        return max(self.delay, self.model_delay)

    @property
    def held_at_origin(self) -> bool:
        """Whether p_B(0) = N(0) Dm(0) = 0 whatever λ, with the filters of eq. (1)."""
        return bool(self.b[-1] == 0) and not self.divided

    @cached_property
    def roots(self) -> ComplexArray:
        """Poles and zeros of R, before any cancellation, without those at s = 0."""
        return np.concatenate([QuasiPolynomial(p).without_origin.roots for p in self.factors])

    @cached_property
    def excess(self) -> int:
        """By how much the numerator degree of R exceeds the denominator's."""
        return int(self.b.size - self.a.size)

    @cached_property
    def speeds(self) -> FloatArray:
        """Sizes of all roots, those of the family too, and 1/θ, 1/θm, in rad/s; 1 for none."""
        rows = [row for table in (self.E, self.Nf) for row in table if np.count_nonzero(row) > 1]
        own = [QuasiPolynomial(np.trim_zeros(row, "f")).without_origin.roots for row in rows]
        delays = [1 / delay for delay in (self.delay, self.model_delay) if delay]
        sizes = np.concatenate([np.abs(self.roots), delays, *(np.abs(found) for found in own)])
        return sizes if sizes.size else np.ones(1)

    def at_pole(self, omega: FloatArray) -> BoolArray:
        """Tell at which frequencies a pole of R lies within rounding."""
        (_, D, Nm, _), (_, of_D, of_Nm, _) = map(np.abs, self._values(omega)), self._sizes(omega)
        return np.asarray((ERROR * of_D >= D) | (Nm <= ERROR * of_Nm))

    def _values(self, omega: FloatArray, exact: bool = False) -> list[ComplexArray]:
        values = _exactly_on_axis if exact else values_on_axis
        return [values(p, omega) for p in self.factors]

    def _sizes(self, omega: FloatArray) -> list[FloatArray]:
        return [np.polyval(np.abs(p), omega) for p in self.factors]

    # For one filter.

    def p_B(
        self, time_constant: float, gain: float = 1.0, delay: float | None = None, lag: float = 0.0
    ) -> QuasiPolynomial:
        """Characteristic function with one filter, and process: its gain, dead time, more lag."""
        parts: list[FloatArray] = []
        sizes: list[FloatArray] = []
        more = np.array([lag, 1.0]) if lag else np.ones(1)
        with np.errstate(over="ignore"):
            for table, factor, times in (
                (self.E, self.a, more), (self.Nf, self.b, [gain]), (self.Nf, -self.delayed, more),
            ):  # fmt: skip
                for of, found in ((np.asarray, parts), (np.abs, sizes)):
                    row = np.polyval(of(table)[::-1], time_constant)
                    found.append(np.convolve(times, np.convolve(of(factor), row)))
        in_range = abs(self.family.order * log10(time_constant)) <= 300
        if not (in_range and all(np.isfinite(size).all() for size in sizes)):
            raise ArithmeticError(
                f"time constant {time_constant:g} s to the power {self.family.order} leaves the "
                "range of floating-point numbers: choose another unit of time"
            )
        late = self.delay if delay is None else delay
        delayed = (Term(parts[2], self.model_delay),) if self.model_delay else ()
        ahead, behind, scale = parts[0], parts[1], reduce(add, sizes)
        p = QuasiPolynomial(ahead, behind, late, scale, delayed, origin=self.divided)
        return p.over_s(self.divided)

    @cached_property
    def delayed(self) -> FloatArray:
        """Coefficients of D Nm, which stand before the model's dead time; 0 without one."""
        return np.convolve(self.factors[1], self.zeros) if self.model_delay else np.zeros(1)

    @cached_property
    def behind(self) -> list[Term]:
        """What stands before Nf, by dead time; equal ones are added up."""
        if self.model_delay and self.model_delay == self.delay:
            return [Term(add(self.b, -self.delayed), self.delay)]
        return [
            Term(self.b, self.delay),
            *([Term(-self.delayed, self.model_delay)] if self.model_delay else []),
        ]

    # On the imaginary axis: a polynomial in λ at each frequency.

    def coefficients(self, omega: FloatArray, *, exact: bool = False) -> ComplexArray:
        """Coefficients of λ^k in p_B(jω), ascending, frequencies in columns; `exact` takes long."""
        (a, b, delayed), (E, Nf) = self._apart(omega, exact), self._tables(omega)
        return np.asarray(a * E + (b + delayed) * Nf)

    def uncertainty(self, omega: FloatArray) -> FloatArray:
        """Bounds of the rounding errors of the coefficients."""
        (N, D, Nm, Dm), sizes = map(np.abs, self._values(omega)), self._sizes(omega)
        off_a = sizes[1] * Nm + D * sizes[2]
        off_b = sizes[0] * Dm + N * sizes[3] + N * Dm * self.delay * omega / 8
        off_b = off_b / omega**self.divided
        if self.model_delay:
            zeros = np.abs(values_on_axis(self.zeros, omega))
            off_zeros = sizes[1] * zeros + D * np.polyval(np.abs(self.zeros), omega)
            off_b = off_b + D * zeros * self.model_delay * omega / 8 / omega**self.divided
            off_b = off_b + np.abs(self._lag(1j * omega)) * off_zeros
        E, Nf = (_rows(np.abs(table), omega) for table in (self._ahead, self.Nf))
        return np.asarray(ERROR * (off_a * E + off_b * Nf))

    def terms(self, omega: FloatArray, time_constant: FloatArray) -> Parts:
        """Return a E, b Nf exp(-jωθ), and -D Nm Nf exp(-jωθm) or 0, at points (ω, λ), over s^m."""
        (a, b, delayed), (E, Nf) = self._apart(omega), self._tables(omega)
        powers = [np.asarray(time_constant) ** k for k in range(len(E))]
        E, Nf = (
            sum(row * power for row, power in zip(table, powers, strict=True)) for table in (E, Nf)
        )
        return a * E, b * Nf, delayed * Nf

    def off_gain(self, omega: FloatArray, gain: float = 1.0) -> FloatArray:
        """Coefficients in λ, ascending, each frequency a column, of ``|a E|^2 - |b Nf/gain|^2``.

        Its last root bounds the λ with ``|L| = gain``, two dead times taken at their worst.
        """
        (a, b, delayed), (E, Nf) = self._apart(omega), self._tables(omega)
        ahead, behind = a * E, (np.abs(b) / gain + np.abs(delayed)) * Nf
        most = np.maximum(np.abs(ahead).max(axis=0), np.abs(behind).max(axis=0))
        with np.errstate(all="ignore"):
            ahead, behind = (np.nan_to_num(part / most) for part in (ahead, behind))
        return size_squared(ahead) - size_squared(behind)

    def _apart(self, omega: FloatArray, exact: bool = False) -> Parts:
        """Return a, b exp(-jωθ), and -D Nm exp(-jωθm) or 0, divided as p_B is."""
        s = 1j * np.asarray(omega)
        N, D, Nm, Dm = self._values(omega, exact)
        turned = N * Dm * np.exp(-self.delay * s) if self.delay else N * Dm
        turned = turned / s**self.divided if self.divided else turned
        if not self.model_delay:
            return D * Nm, turned, np.zeros(1, dtype=complex)
        return D * Nm, turned, -D * values_on_axis(self.zeros, omega) * self._lag(s)

    def _lag(self, s: ComplexArray) -> ComplexArray:
        """exp(-θm s), or what is left of it without the first terms of its series."""
        m = self.divided
        if not m:
            return np.asarray(np.exp(-self.model_delay * s))
        return np.asarray(
            (-self.model_delay) ** m * exponential_rest(-self.model_delay * s, m, divided=True)
        )

    @cached_property
    def _ahead(self) -> FloatArray:
        """E less Nf times the first terms of the series of exp(-θm s), divided as p_B is."""
        m = self.divided
        if not m:
            return self.E
        lag = exponential(self.model_delay, m) if self.model_delay else np.zeros(1)
        return padded_sum(self.E.T, -convolved(self.Nf.T, lag[:, None])).T[:, :-m]

    def _tables(self, omega: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        s = 1j * np.asarray(omega)
        return _rows(self._ahead, s), _rows(self.Nf, s)

    # At the ends of the axis.

    def lowest(self, time_constant: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Values of the three `terms` at s = 0 for many filters."""
        E, Nf = (
            np.polyval(table[::-1, -1], np.asarray(time_constant))
            for table in (self._ahead, self.Nf)
        )
        lag = (-self.model_delay) ** self.divided / factorial(self.divided)
        return self.a[-1] * E, self.b[-1 - self.divided] * Nf, -self.delayed[-1] * lag * Nf

    def highest(
        self, time_constant: FloatArray, *, lagging: bool = False
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Values of what is `leading` for many filters."""
        ahead, behind, delayed = (
            np.polyval(p[::-1], time_constant) for p in self.leading(lagging=lagging)
        )
        return ahead, behind, delayed

    def leading(self, *, lagging: bool = False) -> list[FloatArray]:
        """Coefficients in λ, ascending, of the highest power of s in p_B of the three `terms`."""
        given = (self.E, self.a, lagging), (self.Nf, self.b, 0), (self.Nf, -self.delayed, lagging)
        parts = [(_wide(table), p, more) for table, p, more in given]
        degrees = [(p.size + table.shape[1] if p.any() else 0) + more for table, p, more in parts]
        return [
            table[:, 0] * p[0] * (degree == max(degrees))
            for (table, p, _), degree in zip(parts, degrees, strict=True)
        ]


# Tables of a family: a row for each power of s, descending, or of λ in `Mismatch`.


def _stable_member(family: FilterFamily) -> Any:
    """Give one filter of the family that is stable, if there is one, as all should be."""
    for time_constant in TRIED:
        filter = family.at(time_constant)
        if family.kind != OWN or count_rhp(QuasiPolynomial(filter.den[0][0])).count == 0:
            break
    return filter


def _common_ramp(family: FilterFamily, model_delay: float) -> int:
    """Count the zeros at s = 0 that Df - Nf exp(-θm s) has for every λ."""
    if not model_delay:
        return family.ramp
    num, den = family.num, family.den
    lag = exponential(model_delay, len(den))[:, None]
    late, sizes = convolved(num, lag)[-len(den) :], convolved(np.abs(num), np.abs(lag))[-len(den) :]
    rest = padded_sum(den.T, -late.T)
    left = np.abs(rest) > ROUNDING * padded_sum(np.abs(den).T, sizes.T)
    return int(np.nonzero(left.T[::-1])[0].min(initial=len(den)))


def _without_shared(table: FloatArray, block: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Divide a family's polynomial and one of the model by what they share for every λ but s."""
    model = QuasiPolynomial(block).without_origin
    held = block.size - model.q.size
    if model.q.size == 1 or np.array_equal(table, np.diag(np.diagonal(table))):
        return table, block
    typical = 1 / float(np.median(np.abs(model.roots)))
    common = model
    for share in GENERIC:
        one = QuasiPolynomial(np.polyval(table.T, share * typical))
        common = shared_factor(common, one).common
        if not common.degree:
            return table, block
    divided = [_divided(column, common.q) for column in table.T]
    longest = max(column.size for column in divided)
    columns = [np.pad(column, (longest - column.size, 0)) for column in divided]
    return np.array(columns).T, np.append(_divided(model.q, common.q), np.zeros(held))


def _divided(p: FloatArray, divisor: FloatArray) -> FloatArray:
    """Divide a polynomial by a factor of it; roots at s = 0 stay exact."""
    if not p.any():
        return np.zeros(1)
    zeros = QuasiPolynomial(p).zeros_at_origin
    return np.append(np.polydiv(p[: p.size - zeros], divisor)[0], np.zeros(zeros))


def _by_powers(*tables: FloatArray) -> list[FloatArray]:
    """Turn tables to ascending powers of λ in rows, as many in all as are used."""
    columns = max(table.shape[1] for table in tables)
    wide = [np.pad(table, ((0, 0), (columns - table.shape[1], 0))).T[::-1] for table in tables]
    used = np.flatnonzero(np.any([table.any(axis=1) for table in wide], axis=0))
    return [table[used[0] : used[-1] + 1] for table in wide]


def _wide(table: FloatArray) -> FloatArray:
    """Leave out the powers of s that no λ needs."""
    used = np.flatnonzero(table.any(axis=0))
    return table[:, used[0] :] if used.size else table[:, -1:]


def _rows(table: FloatArray, s: Any) -> Any:
    """Value of each row's polynomial, descending coefficients, at the same points."""
    return np.polynomial.polynomial.polyval(s, table.T[::-1])


def _exactly_on_axis(p: FloatArray, omega: FloatArray) -> ComplexArray:
    """Values of a polynomial at jω, rounded but once: beside a root Horner's scheme loses them."""
    found = []
    for w in map(Fraction, omega.tolist()):
        real, imag = Fraction(0), Fraction(0)
        for c in p.tolist():
            real, imag = Fraction(c) - imag * w, real * w
        found.append(complex(real, imag))
    return np.array(found)


def summed(products: list[tuple[FloatArray, ...]]) -> FloatArray:
    """Add products of polynomials; what is only rounding is 0."""
    total = padded_sum(*(reduce(convolved, factors) for factors in products))
    size = padded_sum(*(reduce(convolved, map(np.abs, factors)) for factors in products))
    return np.where(np.abs(total) <= ROUNDING * size, 0.0, total)


def multiplied(of_process: FloatArray, of_model: FloatArray) -> FloatArray:
    """Multiply a polynomial of the process by one of the model, within the range of floats."""
    with np.errstate(over="ignore", under="ignore"):
        product = np.convolve(of_process, of_model)
    if not (np.isfinite(product).all() and product[0]):
        raise ValueError(
            "the coefficients of process and model are so large or so small that their product "
            "leaves the range of floating-point numbers: divide numerator and denominator of each "
            "block by its leading coefficient, or change the units"
        )
    return product
