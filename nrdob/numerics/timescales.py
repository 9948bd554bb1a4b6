r"""A rational Laplace transform taken apart by time scale, so that each part is easy to simulate.

A loop with lags of a second and a filter of a nanosecond is stiff: the exponential of its matrix
loses the slow modes under the rounding of the fast ones, whatever the realisation. Here the
*polynomials* are taken apart before anything is simulated. Where the moduli of the roots of p leave
a gap, p = g h with the slow roots in g and the fast ones in h, and

    num/p = a/g + b/h        with        a h + b g = num.

Both are solved by linear equations that are next to the identity once s is measured in the middle
of the gap: each coefficient comes out with the relative accuracy of the data, however far the time
scales are apart. The gaps are read off the Newton polygon of p, the upper hull of the logarithms of
its coefficients, whose slopes are the moduli of the roots up to a small factor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, log2

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm, matrix_balance

from .arrays import ComplexArray, FloatArray
from .coefficients import convolution_matrix
from .rootfinding import polynomial_roots

__all__ = ["Block", "impulse_states", "roots_by_time_scale", "split", "transition"]

# Ratios of moduli, as powers of two:
_GAP = 5.0  # at which a polynomial is always cut
_NARROW_GAP = 1.5  # at which it is cut if its roots are otherwise too far apart for one block
_SPREAD = 12.0  # what one block takes: three or four digits
_REMOTE = 2.0  # roots slower than 1/(4 horizon) are not told apart

_NEWTON_STEPS = 30
_SMALLEST = 1e-290  # coefficients below may have lost digits to underflow
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Block:
    """x' = A x + B z and outputs C x + D z, with modes of one time scale.

    Attributes
    ----------
    A, B, C, D : arrays of shapes (n, n), (n,), (m, n), (m,)
        Time in seconds.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray


def split(nums: Sequence[FloatArray], den: FloatArray, horizon: float) -> list[Block]:
    """Realise proper fractions `nums`/`den` as blocks side by side, one for each time scale.

    They come from slow to fast; only the fastest one has a direct term.

    Parameters
    ----------
    nums : sequence of arrays of float
    den : array of float
        The first coefficient not zero.
    horizon : float
        Longest time of interest, seconds. Roots much slower than that are kept together.

    Raises
    ------
    ArithmeticError
        If the coefficients leave the range of floating-point numbers.

    Examples
    --------
    >>> slow, fast = split([np.array([1.0])], np.array([1e-9, 1.0 + 1e-9, 1.0]), horizon=10.0)
    >>> [f"{float(block.A[0, 0]):.4g}" for block in (slow, fast)]
    ['-1', '-1e+09']
    """
    ascending = np.zeros((len(nums), den.size))
    for row, num in zip(ascending, nums, strict=True):
        row[: num.size] = num[::-1]
    return _blocks(_in_unit(ascending, 0), _in_unit(den[::-1], 0), horizon)


def roots_by_time_scale(den: FloatArray) -> ComplexArray:
    """Find the roots of a polynomial, each group of them to the accuracy of its own time scale.

    Parameters
    ----------
    den : array of float
        The first coefficient not zero.

    Examples
    --------
    >>> roots = roots_by_time_scale(np.array([1e-18, 1e-9 + 1e-15, 1e-6, 0.0]))
    >>> [round(float(root), 3) for root in np.log10(-roots.real[1:])]
    [3.0, 9.0]
    """
    if den.size <= 3 and den[-1]:
        return polynomial_roots(den)
    ascending = den[::-1]
    moduli = _moduli(ascending)
    slowest = min(moduli[np.isfinite(moduli)], default=0.0)
    blocks = _blocks(np.zeros((1, den.size)), ascending, 2.0 ** (-slowest))
    return np.concatenate([np.linalg.eigvals(block.A).astype(complex) for block in blocks])


def _blocks(nums: FloatArray, den: FloatArray, horizon: float) -> list[Block]:
    n = den.size - 1
    if n == 0:
        return [Block(np.zeros((0, 0)), np.zeros(0), np.zeros((len(nums), 0)), nums[:, 0] / den[0])]
    moduli = _moduli(den)
    floor = -np.log2(horizon) - _REMOTE if horizon else moduli[-1]
    for k in _cuts(np.maximum(moduli, floor)):
        unit = round((max(moduli[k], floor) + max(moduli[k - 1], floor)) / 2)
        try:
            parts = _parted(_in_unit(nums, unit), _in_unit(den, unit), k)
        except np.linalg.LinAlgError:  # it cannot be cut here
            continue
        slow, fast = (_blocks(_in_unit(a, -unit), _in_unit(g, -unit), horizon) for a, g in parts)
        return slow + fast
    return [_realised(nums, den, max(float(np.mean(np.maximum(moduli, floor))), floor))]


def _moduli(den: FloatArray) -> FloatArray:
    """Logarithms (base 2) of the moduli of the roots, increasing, by the Newton polygon."""
    corners = [(k, log2(abs(c))) for k, c in enumerate(den.tolist()) if c]
    moduli = [-inf] * corners[0][0]
    while len(corners) > 1:
        (k, height), *rest = corners
        slopes = [(height - each) / (i - k) for i, each in rest]
        slope = min(slopes)
        right = len(slopes) - slopes[::-1].index(slope)  # the last of equal ones
        moduli += [slope] * (corners[right][0] - k)
        corners = corners[right:]
    return np.array(moduli)


def _cuts(moduli: FloatArray) -> list[int]:
    """Degrees at which to try and cut, the widest gap first."""
    gaps = np.diff(moduli)
    least = _NARROW_GAP if np.ptp(moduli) > _SPREAD else _GAP
    order = np.argsort(-gaps, kind="stable")
    return [int(i) + 1 for i in order if gaps[i] >= least]


def _in_unit(coefficients: FloatArray, unit: int) -> FloatArray:
    """Measure s in units of 2^unit rad/s: exact, unless coefficients leave the range."""
    scaled = np.ldexp(coefficients, unit * np.arange(coefficients.shape[-1]))
    lost = (np.abs(scaled) < _SMALLEST) & (coefficients != 0)
    if lost.any() or not np.isfinite(scaled).all():
        raise ArithmeticError(
            "the time scales of this loop are so far apart that its polynomials leave the range "
            "of floating-point numbers; choose another unit of time, or a filter of lower order"
        )
    return scaled


def _parted(
    nums: FloatArray, p: FloatArray, k: int
) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Part nums/p into a/g with the k roots well inside the unit circle, and b/h."""
    n = p.size - 1
    g, h = p[: k + 1] / p[k], p[k:].copy()
    for _ in range(_NEWTON_STEPS):
        rest = p - np.convolve(g, h)
        if (np.abs(rest) <= 4 * n * _EPS * np.convolve(np.abs(g), np.abs(h))).all():
            break
        correction = np.linalg.solve(_sylvester(g, h), rest)
        g[:k] += correction[:k]
        h += correction[k:]
    else:
        raise np.linalg.LinAlgError("Newton's method does not converge")
    matrix = _sylvester(g, h)
    ab = np.linalg.solve(matrix, nums.T)
    ab += np.linalg.solve(matrix, nums.T - matrix @ ab)
    a = np.zeros((len(nums), k + 1))
    a[:, :k] = ab[:k].T
    return (a, g), (ab[k:].T, h)


def _sylvester(g: FloatArray, h: FloatArray) -> FloatArray:
    """Matrix from the coefficients of a, of lower degree than g, and b to those of a h + b g."""
    k = g.size - 1
    matrix = np.zeros((k + h.size, k + h.size))
    matrix[:-1, :k], matrix[:, k:] = convolution_matrix(h, k), convolution_matrix(g, h.size)
    return matrix


def _realised(nums: FloatArray, den: FloatArray, modulus: float) -> Block:
    """Build the controllable companion form, balanced in a unit of time near that of the roots."""
    unit = round(modulus)
    n = den.size - 1
    nums, den = _in_unit(nums, unit), _in_unit(den, unit)
    D = nums[:, -1] / den[-1]
    A = np.eye(n, k=1)
    A[-1] = -den[:-1] / den[-1]
    B = np.zeros(n)
    B[-1] = 1.0
    C = (nums[:, :-1] - np.outer(D, den[:-1])) / den[-1]
    with np.errstate(invalid="ignore"):  # scales beyond a whole number, of which SciPy makes one
        _, (scale, _) = matrix_balance(A, permute=False, separate=True)
    speed = 2.0**unit
    return Block(A * scale / scale[:, np.newaxis] * speed, B / scale * speed, C * scale, D)


def impulse_states(block: Block, times: FloatArray, step: float | None) -> FloatArray:
    """States x = exp(A t) B at increasing times in seconds, shape (n, N).

    Parameters
    ----------
    block : Block
    times : array of float, shape (N,)
    step : float or None
        Their distance if they are evenly spaced.
    """
    start = expm(block.A * times[0]) @ block.B if times[0] else block.B
    states: FloatArray = start[:, np.newaxis]
    if step is not None:  # Twice as many states with every product.
        power = expm(block.A * step)
        while states.shape[1] < times.size:
            states = np.concatenate([states, power @ states], axis=1)
            power = power @ power
        return states[:, : times.size]
    steps, which = np.unique(np.diff(times), return_inverse=True)
    transitions = expm(np.multiply.outer(steps, block.A))
    columns = [states[:, 0]]
    for i in which:
        columns.append(transitions[i] @ columns[-1])
    return np.stack(columns, axis=1)


def transition(A: FloatArray, B: FloatArray, time: ArrayLike) -> tuple[FloatArray, FloatArray]:
    r"""Compute :math:`\Phi = e^{At}` and :math:`\Gamma = \int_0^te^{A\sigma}B\,d\sigma`.

    So that :math:`\dot x = Ax + Bv` has x(t) = Phi x(0) + Gamma v for a constant v; infinite or nan
    where they overflow. Both are blocks of one matrix exponential (Van Loan, IEEE Trans. Automatic
    Control 23, 1978).

    Parameters
    ----------
    A, B : arrays of float, shapes (n, n) and (n,)
    time : array_like, shape (...)
        One time or several, at least 0.

    Examples
    --------
    >>> Phi, Gamma = transition(np.array([[-1.0]]), np.ones(1), np.log(2))
    >>> Phi.round(6).tolist(), Gamma.round(6).tolist()
    ([[0.5]], [0.5])
    """
    n = B.size
    augmented = np.zeros((n + 1, n + 1))
    augmented[:n, :n], augmented[:n, n] = A, B
    with np.errstate(over="ignore", invalid="ignore"):
        both = expm(np.multiply.outer(np.asarray(time, dtype=float), augmented))
    return both[..., :n, :n], both[..., :n, n]
