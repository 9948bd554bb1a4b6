r"""The plane w = (z - 1)/(α (z + 1)), α = dt/2, in which a sampled loop is one in continuous time.

Tustin's rule puts w for s. In the plane of w every block that is sampled so is unchanged, the unit
circle is the imaginary axis, and of the whole sampled loop only the process is different::

    z = (1 + αw)/(1 - αw)                        w = jΩ  <=>  z = exp(jω dt),  αΩ = tan(ω dt/2)

    G_w(w) = G_z(z)                              p_B = D_w Nm (Df - Nf) + N_w Dm Nf

G_w is rational, whatever the dead time: each whole sample is a factor (1 - αw)/(1 + αw). So all
that is known about loops in continuous time holds for sampled ones, with the process G_w.

As dt gets short, all poles and zeros of G_z move together to z = 1 and the coefficients of its
polynomials lose the digits that tell them apart. So all is computed with whole numbers of as many
digits as it takes for two precisions to give the same floating-point coefficients of w.

Model, controller and filter can be sampled behind a hold, too, but not every model soundly. One
that falls off by two powers of s or more gets zeros from the sampling, with short sampling times
near z = -1 for two powers, -3.73 for three (Åström, Hagander, Sternby, Automatica 20, 1984, 31-38).
F/Gm, which inverts them, then rings or diverges from sample to sample. Tustin's rule puts these
zeros at z = -1 in F/Gm as *zeros* of F.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction as Exact
from functools import cached_property, lru_cache
from itertools import accumulate
from math import comb, log2
from operator import mul
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..diagram import Fraction, LoopEquations, as_fraction, nonzero, undelayed
from ..numerics import FloatArray, QuasiPolynomial, Shared, shared_factor, written
from .hold import checked_times, in_samples

__all__ = [
    "MULTIPLIED_OUT",
    "after_samples",
    "delay_in_w",
    "held_blocks",
    "held_in_w",
    "process_in_w",
]

Whole = NDArray[np.object_]

DIGITS = tuple(128 * 3**k >> k for k in range(13))  # binary, behind the point: 128, 192 … 16607
MULTIPLIED_OUT = 40  # samples of dead time up to which powers of 1 + v and 1 - v are multiplied out
STEPS = 2  # halvings of a time near 1, after which powers of A times it fall
AT_NYQUIST = 1e-12  # distance of a pole from z = -1 at which it lies there
ON_CIRCLE = 1e-9  # distance from the unit circle at which a sampling zero lies on it

AGREEMENT = 4 * float(np.finfo(float).eps)


def held_in_w(
    process: Fraction,
    dt: float,
    *,
    fraction: float = 0.0,
    at_once: bool = False,
    late: bool = False,
) -> Fraction:
    """Take a process behind its hold to the plane of w; the denominator is monic.

    Parameters
    ----------
    process : Fraction
        The rational part, proper, in powers of s.
    dt : float
        Sampling time in seconds.
    fraction : float
        Dead time in samples, below 1.
    at_once : bool
        Whether a direct term acts at once, as it does inside the processor, and not only after
        the next sample, as it does behind it.
    late : bool
        Whether to leave out the factor 1 - αw that every strictly proper process has.

    Raises
    ------
    ValueError, ArithmeticError
        If an undamped mode of the process is sampled exactly twice in each of its periods; if the
        process is too stiff for this sampling time.

    Examples
    --------
    >>> import numpy as np
    >>> num, den = held_in_w(Fraction(np.array([1.0]), np.array([1.0, 1.0])), 0.1)
    >>> np.roots(num).round(6).tolist(), np.roots(den).round(6).tolist()
    ([20.0], [-0.999167])
    """
    if not process.num.any():  # no controller
        return Fraction(np.zeros(1), np.ones(1))
    a, h, direct, unit = _in_unit(tuple(process.num.tolist()), tuple(process.den.tolist()))
    given = _Given(a, h, direct, Exact(dt) / unit, Exact(fraction), at_once)
    last = None
    for bits in DIGITS:
        found = _in_v(given, bits, late)
        if (
            found
            and last
            and all(
                (np.abs(p - q) <= AGREEMENT * np.abs(q)).all()
                for p, q in zip(found, last, strict=True)
            )
        ):
            return _scaled(found, dt)
        last = found
    raise ArithmeticError(
        f"the process has modes so much faster than dt = {dt:g} s that its samples cannot be "
        "computed: leave out what is much faster than the sampling"
    )


def process_in_w(
    process: Any, dt: float, computation_delay: float = 0.0, model: Any = None
) -> Fraction:
    r"""Take a whole process, dead time and all, behind its hold to the plane of w, α = dt/2.

    A processor delays its model by m samples and a fraction φ of one, :math:`E=v^m(1-\varphi+
    \varphi v)` with :math:`v=(1-\alpha w)/(1+\alpha w)`. In
    :math:`1+F(G/\tilde G_0-E)` the bracket is :math:`G'/\tilde G_0-1` with :math:`G'=G+
    (1-E)\tilde G_0`: that process has the same p_B with the model without its dead time, but for
    the poles of :math:`\tilde G_0`.

    Parameters
    ----------
    process : control.TransferFunction, StateSpace, DelayedTransferFunction or (num, den)
        G, proper, with or without dead time.
    dt, computation_delay : float
        Sampling time, and time from reading y to writing u, in seconds.
    model : DelayedTransferFunction, optional
        A model with a dead time, stable without it: then it is the process G' that is returned.

    Raises
    ------
    TypeError, ValueError
        If both dead times together hold more samples than can be multiplied out, or a pole of the
        model is not in the open left half plane.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import delay
    >>> num, den = process_in_w(delay(0.25) / ct.tf([1, 1], [1]), 0.1)
    >>> den.size - 1                              # the lag, two samples and half of one
    4
    """
    dt, computation_delay = checked_times(dt, computation_delay)
    process, delay = undelayed(process)
    G = nonzero(as_fraction(process, "process"), "process")
    samples, fraction = in_samples(delay + computation_delay, dt)
    held = held_in_w(G, dt, fraction=fraction)
    own, model_delay = undelayed(model)
    if model_delay:
        model = as_fraction(own, "model")
        return _with_delayed_model(held, _few(samples, dt), model, delay_in_w(model_delay, dt), dt)
    return after_samples(held, samples, dt)


def after_samples(held: Fraction, samples: int, dt: float) -> Fraction:
    """Give a process behind its hold its samples of dead time, multiplied out."""
    down, up = _powers(_few(samples, dt), dt)
    return Fraction(np.convolve(held.num, down), np.convolve(held.den, up))


def delay_in_w(delay: float, dt: float) -> Fraction:
    """Give the samples by which a processor delays its model, and a fraction of one."""
    samples, fraction = in_samples(delay, dt)
    down, up = _powers(_few(samples, dt), dt)
    if not fraction:
        return Fraction(down, up)
    return Fraction(
        np.trim_zeros(np.convolve(down, [(1 - 2 * fraction) * dt / 2, 1.0]), "f"),
        np.convolve(up, [dt / 2, 1.0]),
    )


def _few(samples: int, dt: float) -> int:
    """Refuse more samples of dead time than can be multiplied out."""
    if samples > MULTIPLIED_OUT:
        raise ValueError(
            f"the dead time of {samples * dt:g} s holds {samples} samples of dt = {dt:g} s; sets "
            f"are computed for up to {MULTIPLIED_OUT}: choose a longer dt, or ask without dt, as "
            "in continuous time"
        )
    return samples


def _powers(samples: int, dt: float) -> tuple[FloatArray, FloatArray]:
    """Multiply (1 - αw)^k and (1 + αw)^k out."""
    up: FloatArray = np.array([comb(samples, k) * (dt / 2) ** k for k in range(samples, -1, -1)])
    return up * (-1.0) ** np.arange(samples, -1, -1), up


def _with_delayed_model(
    held: Fraction, samples: int, model: Fraction, late: Fraction, dt: float
) -> Fraction:
    """Give G' of a process behind its hold, with whole samples, and a delayed model."""
    if np.any(QuasiPolynomial(model.den).roots.real >= 0):
        raise ValueError(
            "the model has a dead time, and a pole that is not in the open left half plane; with "
            "dt sets of delayed models are computed for stable ones: leave the dead time out, or "
            "ask NRDOB(…).sampled(dt).stability() for one λ"
        )
    extra = max(samples - (late.den.size - 1), 0)  # powers of (1 + αw): those of the longer one
    common = late.den.size - 1 + extra
    own = np.convolve(_powers(samples, dt)[0], _powers(common - samples, dt)[1])
    E, both = np.convolve(late.num, _powers(extra, dt)[1]), _powers(common, dt)[1]
    num = np.polyadd(
        np.convolve(np.convolve(held.num, own), model.den),
        np.convolve(held.den, np.convolve(model.num, np.polysub(both, E))),
    )
    return Fraction(num, np.convolve(held.den, np.convolve(model.den, both)))


def held_blocks(loop: LoopEquations, dt: float) -> LoopEquations:
    """Sample model, controller and filter, each behind a hold, as blocks of w, if sound."""
    _, Gm, C, F = loop.fractions
    if loop.keep_factors:
        raise ValueError(
            "method='zoh' builds F/model as one block; for keep_factors=True use method='tustin'"
        )
    if loop.model_delay:
        raise ValueError(
            f"method='zoh' is not for a model with a dead time ({loop.model_delay:g} s); use "
            "method='tustin', whose model is delayed by whole samples and fractions of them"
        )
    late = Gm.relative_degree > 0
    model, filter = (held_in_w(block, dt, at_once=True, late=late) for block in (Gm, F))
    _check_sound(model, Gm, dt)
    filter = Fraction(filter.num / filter.num[-1], filter.den / filter.den[-1])  # F(0) = 1
    sample, _ = _powers(int(late), dt)
    Gw, Fw = (Fraction(np.convolve(num, sample), den) for num, den in (model, filter))
    controller = held_in_w(C, dt, at_once=True)
    return _HeldBlocks(loop.process, Gw, controller, Fw, rest=(model, filter), sample=sample)


@dataclass(frozen=True, eq=False)
class _HeldBlocks(LoopEquations):
    """Blocks behind holds: with a strictly proper model, both it and F begin with `sample`, 1 - αw.

    It cancels in F/Gm, and nothing but its numerators tells so: `rest` is what they are without it.
    Only the process may be replaced.
    """

    rest: tuple[Fraction, Fraction] = field(kw_only=True)
    sample: FloatArray = field(kw_only=True)

    @cached_property
    def shared_zeros(self) -> Shared:
        found = shared_factor(*(QuasiPolynomial(block.num) for block in self.rest))
        return found._replace(common=QuasiPolynomial(np.convolve(found.common.q, self.sample)))


def _check_sound(held: Fraction, model: Fraction, dt: float) -> None:
    """Refuse a model, without its sample of dead time, with a zero that only sampling has made."""
    roots = QuasiPolynomial(held.num).roots * dt / 2
    at_infinity = held.den.size - held.num.size - (model.relative_degree > 0)
    z = np.append((1 + roots) / (1 - roots), np.full(at_infinity, -1.0))
    outside = z[np.abs(z) > 1 - ON_CIRCLE]
    own = QuasiPolynomial(model.num).roots
    made = outside.size - int(np.sum(own.real >= 0))
    if made > 0:
        worst = outside[outside.real.argmin()]
        raise ValueError(
            f"method='zoh' is unsound here: behind its hold the model, of relative degree "
            f"{model.relative_degree}, has a zero at z = {written(complex(worst))} that only the "
            f"sampling has made, and F/model, which inverts it, would diverge as its powers; use "
            "method='tustin'"
        )


class _Given(NamedTuple):
    """A block direct + h1/s + h2/s² + … and the time, exactly, in a unit of time of its own.

    `a` holds the ascending coefficients of its denominator, without the leading 1; `h` h1, h2, …
    """

    a: list[Exact]
    h: list[Exact]
    direct: Exact
    time: Exact
    fraction: Exact
    at_once: bool

    @property
    def remembers(self) -> bool:
        """Whether the input before the last is felt, too."""
        return bool(self.fraction or (self.direct and not self.at_once))


@lru_cache  # of one block at many sampling times it is the same
def _in_unit(
    num: tuple[float, ...], den: tuple[float, ...]
) -> tuple[list[Exact], list[Exact], Exact, Exact]:
    """Expand a block in powers of 1/s, in the unit of time in which its roots are near 1."""
    den_, num_ = [Exact(x) for x in den], [Exact(x) for x in num]
    num_ = [Exact(0)] * (len(den_) - len(num_)) + num_
    a, b = [x / den_[0] for x in den_], [x / den_[0] for x in num_]
    rates = [log2(abs(x)) / k for k, x in enumerate(a[1:], 1) if x]
    unit = Exact(2) ** -round(max(rates, default=0.0))
    a, b = ([x * unit**k for k, x in enumerate(p)] for p in (a, b))
    h: list[Exact] = []
    for k, x in enumerate(b):
        h.append(x - sum(a[k - i] * h[i] for i in range(k)))
    return a[:0:-1], h[1:], b[0], unit


def _in_v(given: _Given, bits: int, late: bool) -> Fraction | None:
    """Give the held process in powers of v = αw; None if a mode has grown beyond the digits."""
    num, den = _in_z(given, bits)
    columns = [p @ _bilinear(p.size - 1) for p in (num[1:] if late else num, den)]
    largest = max(abs(x) for x in columns[1])
    if largest >> bits + bits // 4:  # det(zI - A) begins with 1: what is small beside it is lost
        return None

    def kept(column: Whole) -> FloatArray:
        floor = max(map(abs, column)) >> bits // 2
        return np.array([x / largest if abs(x) > floor else 0.0 for x in column[::-1]])

    return Fraction(*map(kept, columns))


def _scaled(found: Fraction, dt: float) -> Fraction:
    """Go from powers of v to those of w, and to a monic denominator."""
    num, den = found.num[np.argmax(found.num != 0) :], found.den
    if abs(den[0]) <= AT_NYQUIST * np.abs(den).max():
        raise ValueError(
            f"an undamped mode of the process turns by half a revolution in dt = {dt:g} s, at the "
            "Nyquist frequency: choose another dt"
        )
    powers = (2 / dt) ** np.arange(den.size) / den[0]  # of 1/α, from the leading coefficient on
    return Fraction(num * powers[den.size - num.size :], den * powers)


def _in_z(given: _Given, bits: int) -> tuple[Whole, Whole]:
    """Numerator and denominator of the held process, descending powers of z, in 2^-bits."""
    n, a = len(given.a), [_fixed(x, bits) for x in given.a]
    growth, B0 = _held(a, given.time * (1 - given.fraction), bits)
    B1 = [0] * n
    if given.fraction:
        # Behind e^(A (1-φ) dt) what is felt in the first φ of a sample goes on.
        early, held = _held(a, given.time * given.fraction, bits)
        growth, B1 = _times(growth, early, a, bits), _times(growth, held, a, bits)
    columns = accumulate(range(1, n), lambda p, _: _by_x(p, a, bits), initial=growth)
    Ad = np.array(list(columns), dtype=object).T[:n, :n]
    order = n + given.remembers
    A = np.zeros((order, order), dtype=object)
    A[:n, :n], B, C = Ad, np.zeros(order, dtype=object), np.zeros(order, dtype=object)
    B[:n], C[:n] = B0, [_fixed(x, bits) for x in given.h]
    direct = _fixed(given.direct, bits)
    if given.remembers:
        A[:n, n], B[n], C[n] = B1, 1 << bits, 0 if given.at_once else direct
    num, den = _transfer(A, B, C, bits)
    return (num + (direct * den >> bits), den) if given.at_once else (num, den)


def _transfer(A: Whole, B: Whole, C: Whole, bits: int) -> tuple[Whole, Whole]:
    """Give C adj(zI - A) B and det(zI - A), descending, by Faddeev and LeVerrier."""
    unit = np.eye(len(A), dtype=int).astype(object)
    M, num, den = unit * (1 << bits), [0], [1 << bits]
    for k in range(1, len(A) + 1):
        num.append(C @ (M @ B >> bits) >> bits)
        AM = A @ M >> bits
        den.append(-np.trace(AM) // k)
        M = AM + unit * den[-1]
    return np.array(num, dtype=object), np.array(den, dtype=object)


def _held(a: list[int], time: Exact, bits: int) -> tuple[list[int], list[int]]:
    """Exp of xt and its integral h from 0 to t, modulo a(x): powers of A applied to the input.

    Over a short step by Taylor's series; then h(2t) = 2h + x h², as exp(xt) = 1 + x h.
    """
    halvings = (time.numerator // time.denominator).bit_length() + STEPS
    # Of the short step 2^STEPS times as much here, and of x as much less in the powers.
    step = _fixed(time / 2 ** (halvings - STEPS), bits)
    powers = _falling_powers(tuple(a), bits)
    terms = [step]
    for k in range(2, len(powers) + 1):
        terms.append(terms[-1] * step // (k << bits))
    held = [sum(map(mul, terms, column)) >> bits + STEPS for column in zip(*powers, strict=True)]
    for _ in range(halvings):
        square = _by_x(_times(held, held, a, bits), a, bits)
        held = [2 * x + y for x, y in zip(held, square, strict=True)]
    one = ([1 << bits] + [0] * len(a))[: len(a)]
    return [x + y for x, y in zip(one, _by_x(held, a, bits), strict=True)], held


@lru_cache(maxsize=12)  # of one block at many sampling times they are the same
def _falling_powers(a: tuple[int, ...], bits: int) -> list[list[int]]:
    """Powers of x/2^STEPS modulo a(x), as many as Taylor's series needs."""
    powers, factorial = [([1 << bits] + [0] * len(a))[: len(a)]], 1
    while not factorial >> bits:
        powers.append([x >> STEPS for x in _by_x(powers[-1], list(a), bits)])
        factorial *= len(powers)
    return powers


def _by_x(p: list[int], a: list[int], bits: int) -> list[int]:
    """Multiply by x, modulo a(x); of a number, whose a is empty, nothing is left."""
    return [x - (p[-1] * y >> bits) for x, y in zip([0, *p[:-1]], a, strict=False)]


def _times(p: list[int], q: list[int], a: list[int], bits: int) -> list[int]:
    """Multiply modulo a(x)."""
    n = len(a)
    product = [0] * (2 * n)
    for i, x in enumerate(p):
        for j, y in enumerate(q, i):
            product[j] += x * y
    product = [x >> bits for x in product]
    while len(product) > n:
        top, k = product.pop(), len(product) - n
        for j, y in enumerate(a, k):
            product[j] -= top * y >> bits
    return product


@lru_cache
def _bilinear(order: int) -> Whole:
    """Coefficients of (1+v)^(n-k) (1-v)^k, a row for each k, ascending powers of v."""
    rows = []
    for k in range(order + 1):
        plus = [comb(order - k, i) for i in range(order - k + 1)]
        minus = [comb(k, i) * (-1) ** i for i in range(k + 1)]
        rows.append(np.convolve(np.array(plus, dtype=object), np.array(minus, dtype=object)))
    return np.array(rows, dtype=object)


def _fixed(x: Exact, bits: int) -> int:
    return (x.numerator << bits) // x.denominator
