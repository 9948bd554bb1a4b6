r"""Ways to compute a time response of the NR-DOB loop, exact with dead time.

The loop is kept as the blocks that run it: the process rational part G0, the observer with its two
inputs u and y + η, and, for a reference, the prefilter to which the model loop collapses because
E/R = 1/(1 + Gm C)::

    y = G0 z + d       u = (Nc Dm/p_A) R + F u - (F/Gm)(y + η)       v = u + δ       z(t) = v(t - θ)

One signal v is delayed, everything else is rational. Without dead time y and u are rational, too,
and taken apart by time scale (`nrdob.numerics.timescales`). With dead time z is known on every
interval of length θ from the interval before (`nrdob.analysis.steps`). A delayed model needs u as
it was θm ago, a second delayed signal, which is known between any two moments at which something
comes around (`nrdob.analysis.lattice`). Where marching loses digits the first few echoes can be
summed up one by one; and where a window spans so many dead times that the rounding of each adds up,
a rational stands in for the dead time once its first echoes are over, there and nowhere else, and
only where one of another order gives the same ten digits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import reduce
from itertools import product
from math import comb

import numpy as np

from ..diagram import INPUTS, LoopEquations, Quotient
from ..numerics import Block, FloatArray, add, impulse_states, pade, split
from .lattice import Driven, delayed_responses
from .steps import MAX_DELAYS, delayed_response

__all__ = ["Rational", "Solver", "Way", "even_step", "maps", "ways"]

_UNITS = 1.0, 3.0  # of time, in which coefficients are rounded differently
_FIRST_ECHOES = 2  # delays in which the echoes are summed one by one, which is exact
_ECHOES = 8  # delays at most whose echoes are summed one by one
_ECHOES_OF_TWO = 4  # of the shorter of two delays, whose echoes are summed in every order
_FEW_DELAYS = 20_000  # through which rounding does not add up
_FINER = 1.0, 1.5  # panels of two marches that are compared
_STARTING = 60  # delays, after which a short one is smooth enough to be replaced by a rational
_ORDERS = 9, 7  # of the rational that replaces it, and of the one it is checked against

# A step is one integral of an impulse, a ramp is two.

# Numerators to y and to v, and their common denominator.
Rational = tuple[Sequence[FloatArray], FloatArray]

# Gives y and u, shape (2, N), at N increasing times.
Solver = Callable[[FloatArray], FloatArray]
Way = Callable[..., Solver]


def ways(loop: LoopEquations, horizon: float) -> tuple[Way, ...]:
    """Ways to compute a response, in the order in which they are tried."""
    shortest = min((each for each in (loop.delay, loop.model_delay) if each), default=0.0)
    if not shortest:
        return (_echoes,)
    if horizon < _FIRST_ECHOES * shortest:
        return _echoes, _marching
    if horizon < (_ECHOES_OF_TWO if loop.model_delay else _ECHOES) * shortest:
        return _marching, _echoes
    if loop.model_delay or horizon <= _FEW_DELAYS * loop.delay:
        return (_marching,)
    return (_marching, _short_delay) if horizon <= MAX_DELAYS * loop.delay else (_short_delay,)


def maps(loop: LoopEquations, input: str) -> tuple[Quotient, Quotient]:
    """Return the maps from `input` to y and to u; ValueError if there is no such input."""
    if input not in INPUTS:
        raise ValueError(f"input is {input!r}; it must be one of {', '.join(map(repr, INPUTS))}")
    return getattr(loop, INPUTS[input].to_y), getattr(loop, f"U_{input}")


def even_step(times: FloatArray) -> float | None:
    """Return the spacing of `times`, or None if they are not evenly spaced."""
    if times.size < 2:
        return None
    step = float(times[-1] - times[0]) / (times.size - 1)
    deviation = np.abs(times - times[0] - step * np.arange(times.size)).max()
    return step if deviation <= 1e-8 * step else None


def _echoes(
    loop: LoopEquations, input: str, horizon: float, integrals: int, attempt: int
) -> Solver:
    """Sum up what has come around the loop, in every order, each a rational transform.

    ``1/(q + sum of r E)`` is the sum over the numbers of times that each r E occurs, as often as
    they can be ordered. The degrees grow, but nothing has to cancel on the way through a plant
    after a filter so fast that the input of the plant is next to an impulse and all its
    derivatives.
    """
    both = maps(loop, input)
    power = max(each.divided for each in (loop.p_B, *(m.numerator for m in both)))
    p_B = loop.p_B.lifted(power)
    q, echoes = p_B.q, p_B.delayed
    rest = loop.p_A.q if input == "R" else np.ones(1)
    ends = [m.numerator.lifted(power).terms for m in both]
    unit, latest = _UNITS[attempt], horizon * (1 + 1e-9)
    counts = [range(int(horizon / echo.delay + 1e-9) + 1) for echo in echoes]
    late: list[tuple[float, list[Block]]] = []
    for occurs in product(*counts):
        around = sum(k * echo.delay for k, echo in zip(occurs, echoes, strict=True))
        if around > latest:
            continue
        orders = float(comb(sum(occurs), occurs[0])) if occurs else 1.0
        powers = [-echo.q for k, echo in zip(occurs, echoes, strict=True) for _ in range(k)]
        num = reduce(np.convolve, powers, np.array([orders]))
        den = reduce(np.convolve, [q] * sum(occurs), np.convolve(rest, q))
        together: dict[float, list[FloatArray]] = {}  # y and u, where they begin at once
        for row, end in enumerate(ends):
            for a, delay in end:
                if a.any():
                    nums = together.setdefault(around + delay, [np.zeros(1), np.zeros(1)])
                    nums[row] = np.convolve(a, num)
        late += [
            (begin, _free((nums, den), integrals, horizon - begin, unit))
            for begin, nums in together.items()
            if begin <= latest
        ]
    shortest = min((echo.delay for echo in echoes), default=0.0)

    def solve(times: FloatArray) -> FloatArray:
        outputs = np.zeros((2, times.size))
        for begin, blocks in late:
            # A time that only rounding puts before a multiple of the delay is meant to be on it.
            since = times - begin
            begun = since >= -1e-9 * shortest
            since = np.maximum(since[begun], 0.0)
            if since.size:
                step = even_step(since)
                for block in blocks:
                    states = impulse_states(block, since * unit, step and step * unit)
                    outputs[:, begun] += block.C @ states
        return outputs

    return solve


def _marching(
    loop: LoopEquations, input: str, horizon: float, integrals: int, attempt: int
) -> Solver:
    """From moment to moment at which something comes around, see `nrdob.analysis.lattice`.

    With one dead time it comes around evenly, see `nrdob.analysis.steps`.
    """
    unit = _UNITS[attempt]
    behind = [
        (_in_blocks(rational, horizon, unit), delay * unit, of_v)
        for rational, delay, of_v in _behind_the_delays(loop)
    ]
    free = _free(_beside_the_delays(loop, input), integrals, horizon, unit)
    if not loop.model_delay:
        ((blocks, delay, _),) = behind
        march = delayed_response(blocks, free, delay)
        return lambda times: march(times * unit)
    # Where v = u + δ is what comes out, what is delayed in the model is v - δ.
    nothing, delta = np.zeros(0), np.zeros(integrals)
    delta[0] = unit ** (1 - integrals)
    driven = [
        Driven(blocks, delay, nothing if of_v or input != "delta" else -delta)
        for blocks, delay, of_v in behind
    ]
    smoothing, ratio = loop.fractions.F.relative_degree, loop.ratio
    if loop.delay:
        smoothing += min(0, ratio.denominator.degree - ratio.numerator.degree)
    several = delayed_responses(driven, free, horizon * unit, smoothing, _FINER[attempt])
    return lambda times: several(times * unit)


def _behind_the_delays(loop: LoopEquations) -> list[tuple[Rational, float, bool]]:
    """Return what delayed signals do to y and v, their dead times, and which is v itself."""
    G, Gm, _, F = loop.fractions
    num, den = _feedback(loop)
    if not loop.delay:
        both = _product(G.num, Gm.num, F.num), _product(G.den, Gm.num, F.num)
        return [((both, _before_the_delay(loop)), loop.model_delay, False)]
    process = (np.convolve(G.num, den), -np.convolve(G.num, num)), np.convolve(G.den, den)
    found: list[tuple[Rational, float, bool]] = [(process, loop.delay, True)]
    if loop.model_delay:
        found.append((((np.zeros(1), F.num), F.den), loop.model_delay, False))
    return found


def _beside_the_delays(loop: LoopEquations, input: str) -> Rational:
    """Return what the input does to y and v = u, or u + δ, before anything has come around.

    u = c - K (y + η), where c = C e is the prefiltered reference and K all the feedback that does
    not wait; without dead time in the process y = G0 v + d at once.
    """
    G, Gm, C, F = loop.fractions
    nothing, one = np.zeros(1), np.ones(1)
    num, den = _feedback(loop)
    if loop.model_delay:
        prefilter, slowly = _product(C.num, Gm.den), loop.p_A.q
    else:
        prefilter = _product(C.num, loop.built.Dm.q, F.den)
        slowly = _product(loop.p_A.q, loop.built.E.q)
    if loop.delay:
        return {
            "R": ((nothing, prefilter), slowly),
            "d": ((den, -num), den),
            "eta": ((nothing, -num), den),
            "delta": ((nothing, one), one),
        }[input]
    closed = _before_the_delay(loop)
    to_y, to_v = _product(G.num, den), _product(G.den, den)
    around, back = _product(G.num, num), _product(G.den, num)
    return {
        "R": ((_product(to_y, prefilter), _product(to_v, prefilter)), _product(slowly, closed)),
        "d": ((to_v, -back), closed),
        "eta": ((-around, -back), closed),
        "delta": ((to_y, to_v), closed),
    }[input]


def _before_the_delay(loop: LoopEquations) -> FloatArray:
    """D Nm Df + N Dm Nf: a process without dead time, until that of the model is over."""
    G, (num, den) = loop.fractions.G, _feedback(loop)
    return add(_product(G.den, den), _product(G.num, num))


def _feedback(loop: LoopEquations) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator of K, from the blocks as they are built; F/Gm0 of a late model."""
    _, Gm, _, F = loop.fractions
    if loop.model_delay:
        return np.convolve(F.num, Gm.den), np.convolve(F.den, Gm.num)
    built = loop.built
    return np.convolve(built.Nf.q, built.Dm.q), np.convolve(built.E.q, built.Nm.q)


def _product(*factors: FloatArray) -> FloatArray:
    return reduce(np.convolve, factors)


def _short_delay(
    loop: LoopEquations, input: str, horizon: float, integrals: int, attempt: int
) -> Solver:
    """Replace the dead time by a rational once the first few of them are over."""
    num, den = pade(_ORDERS[attempt], loop.delay)
    G = loop.fractions.G
    rational = replace(loop, process=(np.convolve(G.num, num), np.convolve(G.den, den)))
    start = _STARTING * loop.delay
    early = _marching(loop, input, start, integrals, attempt)
    late = _echoes(rational, input, horizon, integrals, attempt)

    def solve(times: FloatArray) -> FloatArray:
        outputs, first = late(times), times <= start
        if first.any():
            outputs[:, first] = early(times[first])
        return outputs

    return solve


def _free(rational: Rational, integrals: int, horizon: float, unit: float) -> list[Block]:
    """Blocks whose impulse responses are a transform over s^integrals, in units of 1/unit s."""
    nums, den = rational
    blocks = _in_blocks((nums, np.append(den, np.zeros(integrals))), horizon, unit)
    # An impulse of a second is shorter or longer in another unit.
    return [replace(block, B=unit * block.B) for block in blocks]


def _in_blocks(rational: Rational, horizon: float, unit: float) -> list[Block]:
    """Split by time scale, with time in units of 1/unit seconds."""
    nums, den = rational
    *nums, den = (p * unit ** np.arange(p.size - 1, -1, -1.0) for p in (*nums, den))
    return split(nums, den, horizon * unit)
