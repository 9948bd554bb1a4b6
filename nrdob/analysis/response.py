r"""Time responses of the NR-DOB loop, exact with dead time.

The loop is kept as the blocks that run it: the process rational part G0, the observer with its two
inputs u and y + η, and, for a reference, the prefilter to which the model loop collapses because
E/R = 1/(1 + Gm C)::

    y = G0 z + d       u = (Nc Dm/p_A) R + F u - (F/Gm)(y + η)       v = u + δ       z(t) = v(t - θ)

One signal v is delayed, everything else is rational. Without dead time y and u are rational, too,
and their factors are taken apart by time scale before anything is simulated
(`nrdob.numerics.timescales`). With dead time z is known on every interval of length θ from the
interval before (`nrdob.analysis.steps`). A model that waits needs u as it was θm ago, a second
delayed signal: u = … + F u(t - θm) - … is known between any two moments at which something comes
around (`nrdob.analysis.lattice`). Where marching loses digits two more ways are at hand. The first
few echoes can be summed up one by one. And where a window spans so many dead times that the
rounding of each adds up, a rational stands in for the dead time once its first echoes are over;
there, and nowhere else, and only where one of another order gives the same ten digits.

Every response is computed twice, in two units of time. Where rounding makes the ninth digit differ
it is refused: there is no such thing here as a response that is only nearly right.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, reduce
from itertools import product
from math import comb, factorial, inf

import control as ct
import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import fftconvolve

from ..diagram import INPUTS, LoopEquations, Quotient
from ..numerics import Block, FloatArray, IntArray, add, impulse_states, split
from .lattice import Driven, delayed_responses
from .steps import MAX_DELAYS, delayed_response
from .window import POINTS, default_response

__all__ = ["forced_response", "step_response"]

OUTPUTS = ("y", "u")

_DIRECT_CONVOLUTION = 10_000

_UNITS = 1.0, 3.0  # of time, in which coefficients are rounded differently
_AGREEMENT = 1e-10  # of the size of a signal: what may hang on rounding
_TRACE = 1e-6  # of the jump at t = 0, against which what has died out is measured
_GRID = 32  # times at which each response is looked at, besides some of those asked for
_SPOT_CHECKS = 9
_FIRST_ECHOES = 2  # delays in which the echoes are summed one by one, which is exact
_ECHOES = 8  # delays at most whose echoes are summed one by one
_FEW_DELAYS = 20_000  # through which rounding does not add up
_ALL_ECHOES = 4  # of the shorter of two delays, whose echoes are summed in every order
_FINER = 1.0, 1.5  # panels of two marches that are compared
_STARTING = 60  # delays, after which a short one is smooth enough to be replaced by a rational
_ORDERS = 9, 7  # of the rational that replaces it, and of the one it is checked against


def step_response(
    loop: LoopEquations, input: str, timepts: ArrayLike | None = None
) -> ct.TimeResponseData:
    r"""Response of y and u to a unit step at t = 0, all signals zero before.

    Parameters
    ----------
    loop : LoopEquations
        The loop, stable or not.
    input : {"R", "d", "delta", "eta"}
        Where the step enters: reference, output disturbance, input disturbance or noise.
    timepts : (N,) array_like or float, optional
        Increasing times from 0 on, in seconds; evenly spaced ones are fastest. A number is the
        last of 1,001 times. By default 1,001 until y and u have settled, or over a few
        e-foldings of an unstable loop; fewer seconds where that cannot be computed.

    Returns
    -------
    control.TimeResponseData
        `time` (N,), `inputs` (1, 1, N) and `outputs` (2, 1, N) as `control.step_response` shapes
        them for one input and two outputs: `outputs[0, 0]` is y, `outputs[1, 0]` is u. As in
        eq. (7), u is the controller output for R, d and eta, and the plant input u + δ for delta.
        Where a signal jumps, its value is the one just after the jump; once an unstable loop
        has left the floating-point range, it is nan.

    Raises
    ------
    ValueError
        If `input` is none of the four, `timepts` is not increasing from 0 or later, or the loop
        is ill-posed.
    ArithmeticError
        If nine digits of the largest value since t = 0 cannot be had, or not within some seconds;
        the message says why.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob.diagram import delay
    >>> from nrdob.diagram import LowPassFilter
    >>> Gm = ct.tf([1], [1, 1])
    >>> loop = LoopEquations(delay(1.0) * Gm, Gm, 1.0, LowPassFilter(2.0, 1))
    >>> y, u = step_response(loop, "d", [0.0, 0.5, 1.0]).outputs[:, 0]
    >>> y.round(6).tolist(), u.round(6).tolist()
    ([1.0, 1.0, 1.0], [-0.5, -0.75, -1.0])
    """
    _check(loop, input)
    if timepts is None:
        times, outputs = default_response(loop, input, lambda last: _prepared(loop, input, last))
    else:
        times = _checked_times(timepts)
        outputs = _prepared(loop, input, float(times[-1]))(times)
    return ct.TimeResponseData(
        times,
        outputs[:, np.newaxis],
        inputs=np.ones((1, 1, times.size)),
        issiso=False,
        output_labels=list(OUTPUTS),
        input_labels=[input],
        title=f"Step response to {input}",
        trace_labels=[f"From {input}"],
        trace_types=["step"],
        plot_inputs=False,
    )


def forced_response(
    loop: LoopEquations, input: str, timepts: ArrayLike, inputs: ArrayLike
) -> ct.TimeResponseData:
    """Response of y and u to a sampled input, piecewise linear between its samples.

    Parameters
    ----------
    loop : LoopEquations
        The loop, stable or not.
    input : {"R", "d", "delta", "eta"}
        Where the signal enters, see `step_response`.
    timepts : (N,) array_like
        Evenly spaced times from 0 on, N >= 2, in seconds.
    inputs : (N,) array_like
        The signal at these times; zero before, so that it may jump at t = 0.

    Returns
    -------
    control.TimeResponseData
        `time` (N,), `inputs` (1, N) and `outputs` (2, N) with rows y and u, as
        `control.forced_response` shapes them.

    Raises
    ------
    ValueError, ArithmeticError
        As `step_response`; or if `timepts` is not evenly spaced from 0, or `inputs` does not
        hold one finite number for each time.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob.diagram import LowPassFilter
    >>> G = ct.tf([1], [1, 1])
    >>> loop = LoopEquations(G, G, 1.0, LowPassFilter(1.0, 1))
    >>> response = forced_response(loop, "R", [0.0, 1.0, 2.0], [0.0, 1.0, 2.0])
    >>> response.outputs[0].round(6).tolist()          # T_R = 1/(s + 2)
    [0.0, 0.283834, 0.754579]
    """
    _check(loop, input)
    times = _checked_times(timepts)
    signal = _real(inputs, "inputs", "give one real number for each time")
    step = _even_step(times)
    if step is None or times[0] != 0:
        raise ValueError("timepts must be evenly spaced from 0, two or more: np.linspace(0, …)")
    if signal.shape != times.shape or not np.isfinite(signal).all():
        raise ValueError(
            f"inputs has shape {signal.shape}; it needs one finite number for each of the "
            f"{times.size} timepts"
        )
    unit, ramp = (_prepared(loop, input, float(times[-1]), order)(times) for order in (1, 2))
    # The input is a sum of hats, one around each sample; the first is cut in half at t = 0.
    # Hat responses die out where ramp responses grow, so that long records lose no digits.
    rise = np.diff(ramp, axis=1, prepend=0.0) / step
    hat = np.diff(rise, axis=1, append=0.0)[:, :-1]
    outputs = signal[0] * (unit - rise)
    for row, pulse in zip(outputs, hat, strict=True):
        row[1:] += _convolve(signal[1:], pulse)
    return ct.TimeResponseData(
        times,
        outputs,
        inputs=signal[np.newaxis],
        issiso=False,
        output_labels=list(OUTPUTS),
        input_labels=[input],
        title=f"Forced response to {input}",
    )


def _check(loop: LoopEquations, input: str) -> None:
    if input not in INPUTS:
        raise ValueError(f"input is {input!r}; it must be one of {', '.join(map(repr, INPUTS))}")
    if loop.ill_posed:
        raise ValueError(f"no time response: {loop.ill_posed}")


def _checked_times(timepts: ArrayLike) -> FloatArray:
    times = _real(timepts, "timepts", "give times in seconds, or the last one, as real numbers")
    if times.ndim == 0:
        times = np.linspace(0.0, float(times), POINTS) if 0 < times < inf else np.full(2, np.nan)
    if times.ndim != 1 or times.size == 0:
        raise ValueError(f"timepts has shape {times.shape}; it must be a non-empty 1-D array")
    if not (np.isfinite(times).all() and times[0] >= 0 and (np.diff(times) > 0).all()):
        raise ValueError("timepts must be finite and increasing from 0 or later, in seconds")
    return times


def _real(values: ArrayLike, name: str, remedy: str) -> FloatArray:
    """Read real numbers, or raise TypeError with the remedy."""
    try:
        array = np.asarray(values)
        if np.iscomplexobj(array) and array.imag.any():
            raise TypeError("complex numbers")
        return array.real.astype(float)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name} is {values!r}; {remedy}") from error


def _even_step(times: FloatArray) -> float | None:
    """Return the spacing of `times`, or None if they are not evenly spaced."""
    if times.size < 2:
        return None
    step = float(times[-1] - times[0]) / (times.size - 1)
    deviation = np.abs(times - times[0] - step * np.arange(times.size)).max()
    return step if deviation <= 1e-8 * step else None


def _convolve(signal: FloatArray, pulse: FloatArray) -> FloatArray:
    # Direct sums are causal to the last digit; the FFT is for records too long for them.
    convolve = np.convolve if signal.size <= _DIRECT_CONVOLUTION else fftconvolve
    return np.asarray(convolve(signal, pulse)[: signal.size])


# A step is one integral of an impulse, a ramp is two.

# Numerators to y and to v, and their common denominator.
Rational = tuple[Sequence[FloatArray], FloatArray]

# Gives y and u, shape (2, N), at N increasing times.
Solver = Callable[[FloatArray], FloatArray]
Way = Callable[..., Solver]


def _prepared(loop: LoopEquations, input: str, horizon: float, integrals: int = 1) -> Solver:
    """Prepare y and u up to a horizon, for as many sets of times as are asked for.

    Everything is computed a second time in another unit of time, in which every coefficient is
    rounded differently. Digits that hang on this are neither in the data nor in the result: where
    nine of them cannot be had, the response is refused.
    """
    jumps = np.array([quotient.at_once for quotient in _maps(loop, input)])
    solver = cache(lambda way, attempt: way(loop, input, horizon, integrals, attempt))

    def solve(times: FloatArray) -> FloatArray:
        asked, grid = _looked_at(times)
        reason = ""

        def both(way: Way, attempt: int, times: FloatArray) -> tuple[FloatArray, FloatArray]:
            found = solver(way, attempt)
            return found(times), found(grid) if grid.size else np.zeros((2, 0))

        for way in _ways(loop, horizon):
            try:
                with np.errstate(all="ignore"):
                    outputs, seen = both(way, 0, times)
                    pair = both(way, 1, times[asked])
            except (ValueError, ArithmeticError) as refusal:
                reason = reason or str(refusal)
                continue
            # At t = 0 the value just after the jump, which the leading coefficients give.
            at_once = jumps[:, np.newaxis] if integrals == 1 else 0.0
            outputs[:, times == 0] = pair[0][:, times[asked] == 0] = at_once
            found, again = np.hstack([outputs[:, asked], seen]), np.hstack(pair)
            size = _largest(np.hstack([outputs, seen]))
            size = np.maximum(size, _TRACE * np.minimum(np.abs(jumps), 1.0))
            if (_largest(found - again) <= _AGREEMENT * size).all():
                outputs[~np.isfinite(outputs)] = np.nan
                return outputs
            reason = reason or _undecided(input, float(times[-1]))
        raise ArithmeticError(reason)

    return solve


def _looked_at(times: FloatArray) -> tuple[IntArray, FloatArray]:
    """Which of the times are compared, and others, evenly up to the last, that show the size."""
    few, grid = _SPOT_CHECKS, times[-1] * np.arange(1, _GRID + 1) / _GRID
    if times.size > _GRID and not times[0] and _even_step(times) is not None:
        few, grid = _SPOT_CHECKS + _GRID, grid[:0]
    return np.unique(np.linspace(0, times.size - 1, few).astype(int)), grid


def _undecided(input: str, horizon: float) -> str:
    return (
        f"the response to {input} over {horizon:g} s cannot be given to nine digits: they hang on "
        "the last digits of the coefficients, as a mode turns or grows too often in this time or "
        "nearly cancels; shorten timepts, or give blocks without what cancels"
    )


def _ways(loop: LoopEquations, horizon: float) -> tuple[Way, ...]:
    """Ways to compute a response, in the order in which they are tried."""
    if loop.model_delay:
        shortest = min(each for each in (loop.delay, loop.model_delay) if each)
        if horizon < _FIRST_ECHOES * shortest:
            return _all_echoes, _waiting
        return (_waiting, _all_echoes) if horizon < _ALL_ECHOES * shortest else (_waiting,)
    if not loop.delay:
        return (_rational,)
    if horizon > MAX_DELAYS * loop.delay:
        return (_short_delay,)
    if horizon > _FEW_DELAYS * loop.delay:
        return _marching, _short_delay
    if horizon < _FIRST_ECHOES * loop.delay:
        return _echoes, _marching
    return (_marching, _echoes) if horizon < _ECHOES * loop.delay else (_marching,)


def _largest(signals: FloatArray) -> FloatArray:
    """Largest size of y and of u; what has left the floating-point range does not count."""
    finite = np.isfinite(signals)
    return np.asarray(np.abs(np.where(finite, signals, 0.0)).max(axis=1))


def _maps(loop: LoopEquations, input: str) -> tuple[Quotient, Quotient]:
    """Return the maps from `input` to y and to u."""
    return {
        "R": lambda: (loop.T_R, loop.U_R),
        "d": lambda: (loop.S_d, loop.U_d),
        "delta": lambda: (loop.S_delta, loop.U_delta),
        "eta": lambda: (loop.S_eta, loop.U_eta),
    }[input]()


def _rational(
    loop: LoopEquations, input: str, horizon: float, integrals: int, attempt: int
) -> Solver:
    """Without dead time both signals are sums of exponentials."""
    maps = _maps(loop, input)
    term = [m.numerator.q for m in maps], maps[0].denominator.q
    return _shifted([(0.0, term)], 0.0, horizon, integrals, attempt)


def _echoes(
    loop: LoopEquations, input: str, horizon: float, integrals: int, attempt: int
) -> Solver:
    r"""Sum up what has come around the loop k times, each a rational transform.

    ``(a + b E)/(q + r E) = a/q + sum of (-r)^(k-1) (b q - a r)/q^(k+1) E^k`` with E = exp(-θs).
    Their degree grows, but nothing has to cancel on the way through a plant after a filter so fast
    that the input of the plant is next to an impulse and all its derivatives.
    """
    maps = _maps(loop, input)
    q, r = loop.p_B.q, loop.p_B.r
    rest = loop.p_A.q if input == "R" else np.ones(1)
    ends = [(m.numerator.q, m.numerator.r) for m in maps]
    terms = [(0.0, ([a for a, _ in ends], np.convolve(rest, q)))]
    nums = [add(np.convolve(b, q), -np.convolve(a, r)) for a, b in ends]
    for k in range(1, int(horizon / loop.delay + 1e-9) + 1):
        terms.append((k * loop.delay, (nums, np.convolve(terms[-1][1][1], q))))
        nums = [-np.convolve(num, r) for num in nums]
    return _shifted(terms, loop.delay, horizon, integrals, attempt)


def _all_echoes(
    loop: LoopEquations, input: str, horizon: float, integrals: int, attempt: int
) -> Solver:
    """Sum up what has come around in every order, with two dead times or one of two signals.

    ``1/(q + sum of r E)`` is the sum over the numbers of times that each r E occurs, as often as
    they can be ordered.
    """
    maps = _maps(loop, input)
    power = max(each.divided for each in (loop.p_B, *(m.numerator for m in maps)))
    p_B = loop.p_B.lifted(power)
    q, echoes = p_B.q, p_B.delayed
    rest = loop.p_A.q if input == "R" else np.ones(1)
    ends = [m.numerator.lifted(power).terms for m in maps]
    counts = [range(int(horizon / echo.delay + 1e-9) + 1) for echo in echoes]
    terms: list[tuple[float, Rational]] = []
    for occurs in product(*counts):
        around = sum(k * echo.delay for k, echo in zip(occurs, echoes, strict=True))
        if around > horizon * (1 + 1e-9):
            continue
        ways = float(comb(sum(occurs), occurs[0])) if occurs else 1.0
        powers = [-echo.q for k, echo in zip(occurs, echoes, strict=True) for _ in range(k)]
        num = reduce(np.convolve, powers, np.array([ways]))
        den = reduce(np.convolve, [q] * sum(occurs), np.convolve(rest, q))
        for row, end in enumerate(ends):
            for a, delay in end:
                if a.any():
                    nums = [np.zeros(1), np.zeros(1)]
                    nums[row] = np.convolve(a, num)
                    terms.append((around + delay, (nums, den)))
    shortest = min((echo.delay for echo in echoes), default=0.0)
    return _shifted(terms, shortest, horizon, integrals, attempt)


def _shifted(
    terms: Sequence[tuple[float, Rational]],
    delay: float,
    horizon: float,
    integrals: int,
    attempt: int,
) -> Solver:
    """Sum up transforms, each delayed, where `delay` is the shortest of the dead times."""
    unit = _UNITS[attempt]
    late = [
        (begin, _impulses(_in_blocks(_forced(*term, integrals), horizon - begin, unit), unit))
        for begin, term in terms
        if begin <= horizon * (1 + 1e-9)
    ]

    def solve(times: FloatArray) -> FloatArray:
        outputs = np.zeros((2, times.size))
        for begin, blocks in late:
            # A time that only rounding puts before a multiple of the delay is meant to be on it.
            since = times - begin
            begun = since >= -1e-9 * delay
            since = np.maximum(since[begun], 0.0)
            if since.size:
                step = _even_step(since)
                for block in blocks:
                    states = impulse_states(block, since * unit, step and step * unit)
                    outputs[:, begun] += block.C @ states
        return outputs

    return solve


def _marching(
    loop: LoopEquations, input: str, horizon: float, integrals: int, attempt: int
) -> Solver:
    """Dead time by dead time, see `nrdob.analysis.steps`."""
    unit = _UNITS[attempt]
    driven = _in_blocks(_around_the_delay(loop), horizon, unit)
    before = _forced(*_before_the_delay(loop, input), integrals)
    free = _impulses(_in_blocks(before, horizon, unit), unit)

    march = delayed_response(driven, free, loop.delay * unit)
    return lambda times: march(times * unit)


def _waiting(
    loop: LoopEquations, input: str, horizon: float, integrals: int, attempt: int
) -> Solver:
    """From moment to moment at which something comes around, see `nrdob.analysis.lattice`."""
    unit = _UNITS[attempt]
    known = np.append([unit ** (1 - integrals)], np.zeros(integrals - 1))  # of δ in this unit
    nothing = np.zeros(0)
    driven = [
        Driven(
            _in_blocks(rational, horizon, unit),
            delay * unit,
            known if input == "delta" and of_v else nothing,
        )
        for rational, delay, of_v in _behind_the_delays(loop)
    ]
    before = _forced(*_beside_the_delays(loop, input), integrals)
    free = _impulses(_in_blocks(before, horizon, unit), unit)
    _, _, _, F = loop.fractions
    ratio = loop.ratio
    around = [F.relative_degree]
    if loop.delay:
        around.append(F.relative_degree + ratio.denominator.degree - ratio.numerator.degree)

    march = delayed_responses(driven, free, horizon * unit, min(around), _FINER[attempt])

    def solve(times: FloatArray) -> FloatArray:
        outputs = march(times * unit)
        if input == "delta":
            outputs[1] += np.polyval(known, times * unit)
        return outputs

    return solve


def _behind_the_delays(loop: LoopEquations) -> list[tuple[Rational, float, bool]]:
    """Return what delayed signals do to y and u, their dead times, and which of them is v.

    That of the process is v = u + δ, what the model waits for is u.
    """
    G, Gm, _, F = loop.fractions
    nothing = np.zeros(1)
    if not loop.delay:
        both = _product(G.num, Gm.num, F.num), _product(G.den, Gm.num, F.num)
        return [((both, _without_waiting(loop)), loop.model_delay, False)]
    inverse = _product(F.den, Gm.num)
    y, u = np.convolve(G.num, inverse), -_product(G.num, F.num, Gm.den)
    process = (y, u), np.convolve(G.den, inverse)
    return [(process, loop.delay, True), (((nothing, F.num), F.den), loop.model_delay, False)]


def _beside_the_delays(loop: LoopEquations, input: str) -> Rational:
    """Return what the input does to y and u before anything has come around.

    u = c - (F/Gm0)(y + η), where c = C e is the prefiltered reference; without dead time in the
    process y = G0 (u + δ) + d at once.
    """
    G, Gm, C, F = loop.fractions
    nothing, one = np.zeros(1), np.ones(1)
    feedback, through = _product(F.num, Gm.den), _product(F.den, Gm.num)
    prefilter = _product(C.num, Gm.den)
    if loop.delay:
        return {
            "R": ((nothing, prefilter), loop.p_A.q),
            "d": ((through, -feedback), through),
            "eta": ((nothing, -feedback), through),
            "delta": ((nothing, nothing), one),
        }[input]
    den = _without_waiting(loop)
    to_y, to_u = _product(G.num, through), _product(G.den, through)
    around, back = _product(G.num, feedback), _product(G.den, feedback)
    return {
        "R": ((_product(to_y, prefilter), _product(to_u, prefilter)), _product(loop.p_A.q, den)),
        "d": ((to_u, -back), den),
        "eta": ((-around, -back), den),
        "delta": ((to_y, -around), den),
    }[input]


def _without_waiting(loop: LoopEquations) -> FloatArray:
    """D Nm Df + N Dm Nf, what a process without dead time does while the model still waits."""
    G, Gm, _, F = loop.fractions
    return add(_product(G.den, Gm.num, F.den), _product(G.num, Gm.den, F.num))


def _product(*factors: FloatArray) -> FloatArray:
    return reduce(np.convolve, factors)


def _short_delay(
    loop: LoopEquations, input: str, horizon: float, integrals: int, attempt: int
) -> Solver:
    """Replace the dead time by a rational once the first few of them are over.

    What is then left of the loop is far slower than its dead time; where it is not, two rationals
    of different order do not agree.
    """
    numbers = _pade(_ORDERS[attempt], loop.delay)
    G = loop.fractions.G
    rational = replace(
        loop, process=(np.convolve(G.num, numbers[0]), np.convolve(G.den, numbers[1]))
    )
    start = _STARTING * loop.delay
    early = _marching(loop, input, start, integrals, attempt)
    late = _rational(rational, input, horizon, integrals, attempt)

    def solve(times: FloatArray) -> FloatArray:
        outputs, first = late(times), times <= start
        if first.any():
            outputs[:, first] = early(times[first])
        return outputs

    return solve


def _pade(order: int, delay: float) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator of the diagonal Padé approximant of exp(-delay·s)."""
    k = np.arange(order, -1, -1)
    den = np.array([
        factorial(2 * order - i) * factorial(order)
        / (factorial(2 * order) * factorial(i) * factorial(order - i))
        * delay**i
        for i in k.tolist()
    ])  # fmt: skip
    return den * (-1.0) ** k, den


def _around_the_delay(loop: LoopEquations) -> Rational:
    """Return what z does: y = G0 z and v = -K G0 z with K = F/((1 - F) Gm)."""
    G, (num, den) = loop.fractions.G, _feedback(loop)
    return (np.convolve(G.num, den), -np.convolve(G.num, num)), np.convolve(G.den, den)


def _before_the_delay(loop: LoopEquations, input: str) -> Rational:
    """Return what the input does to y and v before anything has come around."""
    nothing, one = np.zeros(1), np.ones(1)
    if input == "delta":
        return (nothing, one), one
    if input == "R":
        prefilter = reduce(
            np.convolve, (loop.fractions.C.num, loop.built.Dm.q, loop.fractions.F.den)
        )
        return (nothing, prefilter), np.convolve(loop.p_A.q, loop.built.E.q)
    num, den = _feedback(loop)
    return (den if input == "d" else nothing, -num), den


def _feedback(loop: LoopEquations) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator of K, from the blocks as they are built."""
    built = loop.built
    return np.convolve(built.Nf.q, built.Dm.q), np.convolve(built.E.q, built.Nm.q)


def _forced(nums: Sequence[FloatArray], den: FloatArray, integrals: int) -> Rational:
    return nums, np.append(den, np.zeros(integrals))


def _in_blocks(rational: Rational, horizon: float, unit: float) -> list[Block]:
    """Split by time scale, with time in units of 1/unit seconds."""
    nums, den = rational
    return split([_in_unit(num, unit) for num in nums], _in_unit(den, unit), horizon * unit)


def _impulses(blocks: Sequence[Block], unit: float) -> list[Block]:
    """Scale what an impulse sets off: one of a second is shorter or longer in another unit."""
    return [replace(block, B=unit * block.B) for block in blocks]


def _in_unit(coefficients: FloatArray, unit: float) -> FloatArray:
    return coefficients * unit ** np.arange(coefficients.size - 1, -1, -1.0)
