r"""The factor that two polynomials share, found as a polynomial and never root by root.

A block that occurs on both sides of a quotient, or in every term of p_A or p_B, leaves a factor d
in numerator and denominator: f = d·u, g = d·v. Roots that are only near give no such d; multiple
roots, which rounding scatters, do. So the roots only suggest d; it is then fitted to the
coefficients of f and g together (Gauss and Newton; Zeng, Contemporary Mathematics 556, 2011,
187-217), each against its own size, and it counts only if d·u and d·v give back every single
coefficient.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components

from .arrays import ROUNDING, BoolArray, ComplexArray, FloatArray, IntArray
from .coefficients import convolution_matrix
from .quasipoly import QuasiPolynomial

__all__ = ["Shared", "factor_near", "shared_factor"]

NEARNESS = (1e-6, 1e-2, 0.3)  # within which roots may be copies of one; multiple ones scatter
EPS = 4 * float(np.finfo(float).eps)  # rounding of a product, against the sizes of what is summed

VANISHING, NO_ROOT = 1e-9, 1e-2
"""Value of a polynomial, against the size of its terms, at a root of it; above which there is none.
A multiple root, however its copies scatter, gives small values, too.
"""

CLOSE = 0.25  # share of the rounding allowed at which a fit is not made any better
FEW = 4  # roots that are known to 1e-4 of themselves even if they are all the same


class Shared(NamedTuple):
    """What two polynomials share, and what is left of them: f = common·u and g = common·v.

    Attributes
    ----------
    common, u, v : QuasiPolynomial
        The factor in both, and the cofactors.
    """

    common: QuasiPolynomial
    u: QuasiPolynomial
    v: QuasiPolynomial


def shared_factor(f: QuasiPolynomial, g: QuasiPolynomial) -> Shared:
    """Find what two polynomials share: powers of s exactly, the rest within rounding.

    Parameters
    ----------
    f, g : QuasiPolynomial
        Without dead time. Their `scale` says how much of each coefficient is rounding.

    Examples
    --------
    >>> f, g = (QuasiPolynomial(np.poly(roots)) for roots in ([0, -1, -3], [0, 0, -1, -2]))
    >>> [p.q.round(6).tolist() for p in shared_factor(f, g)]
    [[1.0, 1.0, 0.0], [1.0, 3.0], [1.0, 2.0, 0.0]]
    """
    # Powers of s are known exactly and stay so: the fit is about the other roots.
    power = min(f.zeros_at_origin, g.zeros_at_origin)
    excess = f.zeros_at_origin - g.zeros_at_origin
    whole, common = (f, g), np.ones(1)
    f, g = f.without_origin, g.without_origin
    while fitted := next(filter(None, (_fitted(f, g, each) for each in _suggested(f, g))), None):
        f, g, common = fitted.u, fitted.v, np.convolve(common, fitted.common.q)
    if not power and common.size == 1:
        return Shared(QuasiPolynomial(common), *whole)
    return Shared(
        QuasiPolynomial(common).lifted(power), f.lifted(max(excess, 0)), g.lifted(max(-excess, 0))
    )


def factor_near(p: QuasiPolynomial, divisor: FloatArray) -> FloatArray:
    """Find the monic factor of a polynomial near a given one.

    Parameters
    ----------
    p : QuasiPolynomial
        Without dead time.
    divisor : array of float
        Monic, what computed roots make of the factor.

    Raises
    ------
    ArithmeticError
        If none divides p within rounding.

    Examples
    --------
    >>> factor_near(QuasiPolynomial([1.0, 3.0, 2.0]), np.array([1.0, 1.01])).round(6).tolist()
    [1.0, 1.0]
    """
    fitted = _fitted(p, p, divisor)
    if fitted is None:
        raise ArithmeticError(
            f"a factor of degree {divisor.size - 1} cannot be told from the rest of the "
            f"polynomial {p.q.tolist()} to rounding: roots inside and outside of it are too close"
        )
    return fitted.common.q


def _suggested(f: QuasiPolynomial, g: QuasiPolynomial) -> Iterator[FloatArray]:
    """Monic polynomials of nearby roots, those of highest degree in each neighbourhood first."""
    few, many = sorted((f, g), key=lambda each: each.degree)
    if not few.degree or (few.degree <= FEW and _sizes_at(many, few.roots).min() > NO_ROOT):
        return
    p, q = f.roots, g.roots
    at_p, at_q = _sizes_at(g, p), _sizes_at(f, q)
    if min(at_p.min(), at_q.min()) > NO_ROOT:
        return
    # A sum of large terms may have roots that are badly known, but it vanishes at the true ones.
    for roots, sizes in ((p, at_p), (q, at_q)):
        if (vanishing := sizes <= VANISHING).any():
            yield np.real(np.poly(_with_conjugates(roots[vanishing])))
    distance = np.abs(p[:, None] - q) / np.maximum(np.abs(p)[:, None], np.abs(q))
    tried: set[tuple[complex, ...]] = set()
    for nearness in NEARNESS:
        for rows, columns in _neighbourhoods(distance <= nearness):
            near = distance[np.ix_(rows, columns)]
            if rows.size <= columns.size:
                fewer, order = p[rows], np.argsort(near.min(axis=1))
            else:
                fewer, order = q[columns], np.argsort(near.min(axis=0))
            for count in range(fewer.size, 0, -1):
                chosen = _with_conjugates(fewer[order[:count]])
                if (key := tuple(np.sort_complex(chosen))) not in tried:
                    tried.add(key)
                    yield np.real(np.poly(chosen))


def _sizes_at(p: QuasiPolynomial, s: ComplexArray) -> FloatArray:
    """Values against the sizes of their terms."""
    return np.asarray(np.abs(p(s)) / p.size(s))


def _neighbourhoods(near: BoolArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Rows and columns that hang together, as connected parts of a graph."""
    edges = np.zeros((sum(near.shape),) * 2)
    edges[: near.shape[0], near.shape[0] :] = near
    part = connected_components(edges, directed=False)[1]
    of_rows, of_columns = np.split(part, near.shape[:1])
    for k in np.intersect1d(of_rows, of_columns):
        yield np.flatnonzero(of_rows == k), np.flatnonzero(of_columns == k)


def _with_conjugates(roots: ComplexArray) -> ComplexArray:
    upper = roots[roots.imag > 0]
    lower = roots[roots.imag < 0].conj()
    extra = [root for root in lower if not np.any(np.isclose(upper, root, rtol=1e-12, atol=0))]
    pairs = np.concatenate([upper, np.array(extra, dtype=complex)])
    return np.concatenate([roots[roots.imag == 0], pairs, pairs.conj()])


def _fitted(f: QuasiPolynomial, g: QuasiPolynomial, divisor: FloatArray) -> Shared | None:
    """Fit the nearest common factor with its cofactors, which must give back all coefficients."""
    m = divisor.size - 1
    if m >= f.q.size or m >= g.q.size:
        return None
    weights = tuple(1 / _sizes(p) for p in (f, g))
    with np.errstate(all="ignore"):
        u, v = (
            _least_squares(convolution_matrix(divisor, p.q.size - m) * w[:, None], p.q * w)
            for p, w in zip((f, g), weights, strict=True)
        )
        for _ in range(5):
            if all(_gives_back(p, divisor, c, CLOSE) for p, c in ((f, u), (g, v))):
                break
            errors = [
                (p.q - np.convolve(divisor, c)) * w
                for p, c, w in zip((f, g), (u, v), weights, strict=True)
            ]
            rows = f.q.size
            jacobian = np.zeros((rows + g.q.size, m + u.size + v.size))
            jacobian[:, :m] = np.vstack([convolution_matrix(c, m + 1)[:, 1:] for c in (u, v)])
            jacobian[:rows, m : m + u.size] = convolution_matrix(divisor, u.size)
            jacobian[rows:, m + u.size :] = convolution_matrix(divisor, v.size)
            jacobian *= np.concatenate(weights)[:, None]
            step = _least_squares(jacobian, np.concatenate(errors))
            divisor = divisor + np.concatenate([[0.0], step[:m]])
            u, v = u + step[m : m + u.size], v + step[m + u.size :]
        else:
            if not all(_gives_back(p, divisor, c) for p, c in ((f, u), (g, v))):
                return None
    return Shared(QuasiPolynomial(divisor), QuasiPolynomial(u), QuasiPolynomial(v))


def _gives_back(
    p: QuasiPolynomial, divisor: FloatArray, cofactor: FloatArray, share: float = 1.0
) -> bool:
    """Whether a product is p, within a share of the rounding of its coefficients and factors."""
    error = np.abs(p.q - np.convolve(divisor, cofactor))
    rounding = EPS * np.convolve(np.abs(divisor), np.abs(cofactor))
    return bool(np.all(error <= share * (ROUNDING * _sizes(p) + rounding)))


def _sizes(p: QuasiPolynomial) -> FloatArray:
    """Size of each coefficient; of one that is zero, what its neighbours let expect."""
    if p.scale.all():
        return p.scale
    there = np.flatnonzero(p.scale)
    expected = np.exp(np.interp(np.arange(p.q.size), there, np.log(p.scale[there])))
    return np.where(p.scale == 0, expected, p.scale)


def _least_squares(matrix: FloatArray, target: FloatArray) -> FloatArray:
    """Solve with columns of equal length, so that no unit of time is preferred."""
    length = np.linalg.norm(matrix, axis=0)
    return np.asarray(np.linalg.lstsq(matrix / length, target, rcond=None)[0] / length)
