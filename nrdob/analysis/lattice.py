r"""The method of steps with several dead times.

    x' = A x + sum of B z        (y, v) = C x + sum of D z        z(t) = v(t - T) + w(t - T)

for every dead time T, where w is known, and all is zero before t = 0. What happens at t = 0 comes
around at every sum of multiples of the dead times, a lattice of moments at which signals jump or
bend. Panels are laid between them, on which signals are polynomials, as in `nrdob.analysis.steps`:

- fine after each moment of the lattice and coarser until the next, for as long as there are not too
  many moments; the lengths between neighbours are only a few different ones;
- or, since every way around the loop makes a bend smoother, between the first few echoes only, and
  then evenly, short enough for the fastest mode.

Where each delayed signal is known: a panel is no longer than the shortest dead time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, inf

import numpy as np

from ..numerics import Block, ComplexArray, FloatArray, IntArray
from .steps import (
    NODES,
    across,
    panel_basis,
    panel_lengths,
    panel_matrices,
    radau,
    resolved_to,
    side_by_side,
)

__all__ = ["Driven", "delayed_responses"]

MAX_PANELS = 60_000  # panels that one march may take: a second or two
MAX_LENGTHS = 5_000  # lengths of panels that may differ: each has a matrix of its own
SMOOTH = NODES + 3  # derivatives of a bend through which a polynomial on a short panel passes
_CHUNK = 500  # panels, whose delayed signals are looked up together
_SAME = 1e-12  # of the last time: two moments of the lattice that are one


@dataclass(frozen=True)
class Driven:
    """What one delayed signal does: blocks to two outputs, side by side, at rest at first.

    `known` holds coefficients, in descending powers of t, of what is added to the second output
    before its delay.
    """

    blocks: Sequence[Block]
    delay: float
    known: FloatArray


def delayed_responses(
    driven: Sequence[Driven], free: Sequence[Block], last: float, smoothing: int, finer: float = 1.0
) -> Callable[[FloatArray], FloatArray]:
    """March from moment to moment until the last time of interest, in seconds.

    The input makes both outputs the impulse responses of the blocks in `free`; a bend gains at
    least `smoothing` derivatives on every way around the loop. What is returned takes increasing
    times (N,) and gives both outputs there, (2, N). A ValueError if too many panels would be
    needed, an ArithmeticError if signals are too fast for them.
    """
    blocks, start, poles = side_by_side([each.blocks for each in driven], free)
    delays = np.array([each.delay for each in driven])
    for refined in (finer, 2 * finer, 4 * finer, 8 * finer):
        edges = _mesh(poles, delays, last, smoothing, refined)
        values = _march(blocks, driven, start, edges)
        if resolved_to(1e-11, values):
            break
    else:
        raise ArithmeticError(
            "the signals between two echoes of the dead times are too fast to be resolved; shorten "
            "timepts or slow the fastest block"
        )

    def at(times: FloatArray) -> FloatArray:
        # A time that only rounding puts before a moment is meant to be on it.
        panel = np.searchsorted(edges, times + 1e-9 * delays.min(), side="right") - 1
        panel = np.clip(panel, 0, edges.size - 2)
        basis = panel_basis((times - edges[panel]) / np.diff(edges)[panel])
        return np.asarray((values[panel] @ basis[..., np.newaxis])[..., 0].T)

    return at


def _mesh(
    poles: ComplexArray, delays: FloatArray, last: float, smoothing: int, finer: float
) -> FloatArray:
    """Borders of panels until the last time: those of the cheaper of the two ways."""
    span = max(last, 1e-3 * float(delays.min()))
    echoes = ceil(SMOOTH / smoothing) if smoothing else inf
    fastest = float(np.abs(poles).max(initial=0.0)) * finer
    even = min(float(delays.min()), 2 / fastest if fastest else inf)
    meshes = [_graded(poles, _lattice(delays, span, inf), inf, finer)]
    if echoes < inf and span / even < MAX_PANELS:
        meshes.append(_graded(poles, _lattice(delays, span, echoes), even, finer))
    found = min((each for each in meshes if each is not None), key=len, default=None)
    if found is None:
        raise ValueError(
            f"timepts spans so many echoes of the dead times {', '.join(f'{T:g}' for T in delays)} "
            f"s that more than {MAX_PANELS:,} panels would be needed; shorten timepts or slow the "
            "fastest block"
        )
    return found


def _lattice(delays: FloatArray, span: float, echoes: float) -> FloatArray | None:
    """Add up multiples of the dead times, from 0 to `span`; None if there are too many."""
    moments = np.zeros(1)
    for delay in delays:
        begins = moments if echoes < inf else _apart(moments, delay, _SAME * span)
        count = min(int(span / delay), echoes) + 1
        if count * begins.size > 4 * MAX_PANELS:
            return None
        moments = (begins[:, None] + delay * np.arange(count)).ravel()
        moments = moments[moments < span * (1 - _SAME)]
    moments = np.append(np.sort(moments), span)
    return np.asarray(moments[np.append(True, np.diff(moments) > _SAME * span)])


def _apart(moments: FloatArray, delay: float, same: float) -> FloatArray:
    """Keep of moments that are a multiple of the dead time apart only the first."""
    phase = moments % delay
    order = np.argsort(phase, kind="stable")
    groups = np.cumsum(np.diff(phase[order], prepend=-inf) > same)
    kept = np.full(groups[-1] + 1, inf)
    np.minimum.at(kept, groups, moments[order])
    return kept[1:]


def _graded(
    poles: ComplexArray, moments: FloatArray | None, longest: float, finer: float
) -> FloatArray | None:
    """Borders of panels between neighbouring moments, none of them longer than `longest`."""
    if moments is None or moments.size > MAX_PANELS:
        return None
    gaps = np.diff(moments)
    first, which = _different(gaps, moments[-1])
    inner = []
    for gap in gaps[first].tolist():
        lengths = panel_lengths(poles, gap, finer)
        pieces = np.maximum(np.ceil(lengths / longest), 1.0).astype(int)
        inner.append(np.append(0.0, np.cumsum(np.repeat(lengths / pieces, pieces))[:-1]))
    sizes = np.array([each.size for each in inner])[which]
    if sizes.sum() > MAX_PANELS:
        return None
    within = np.concatenate([inner[k] for k in which])
    return np.append(np.repeat(moments[:-1], sizes) + within, moments[-1])


def _different(lengths: FloatArray, last: float) -> tuple[IntArray, IntArray]:
    """Where each different length stands first, but for rounding, and which of them each is."""
    rounded = np.round(lengths / (1e-13 * last))
    _, first, which = np.unique(rounded, return_index=True, return_inverse=True)
    return first, which


def _march(
    blocks: Sequence[tuple[Block, int]], driven: Sequence[Driven], x: FloatArray, edges: FloatArray
) -> FloatArray:
    """Values (P, 2, m) of y and v at the nodes of all panels."""
    lengths = np.diff(edges)
    first, which = _different(lengths, edges[-1])
    if first.size > MAX_LENGTHS:
        raise ValueError(
            f"panels of {first.size:,} different lengths would be needed, more than "
            f"{MAX_LENGTHS:,}; shorten timepts or slow the fastest block"
        )
    matrices = panel_matrices(blocks, len(driven), lengths[first])
    n, m, panels = x.size, NODES, lengths.size
    values = np.zeros((panels, 2, m))
    for begin in range(0, panels, _CHUNK):
        end = min(begin + _CHUNK, panels)
        sources = zip(*(_source(each, edges, slice(begin, end)) for each in driven), strict=True)
        index, weights, known = (np.concatenate(parts, axis=1) for parts in sources)
        newest = index.max(axis=1)
        j = begin
        while j < end:
            # As many panels at once as need nothing from one another but the state.
            stop = begin + max(int(newest.searchsorted(j)), j + 1 - begin)
            some = slice(j - begin, stop - begin)
            late = (weights[some] * values[index[some], 1]).sum(axis=-1) + known[some]
            if stop == j + 1:
                found = matrices[which[j]] @ np.concatenate([x, late[0]])
                x, values[j] = found[:n], found[n:].reshape(2, m)
            else:
                end_state, found = across(matrices[which[j:stop]], x[:, None], late[..., None])
                x, values[j:stop] = end_state[:, 0], found[..., 0]
            j = stop
    return values


def _source(
    each: Driven, edges: FloatArray, some: slice
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Where panels find their delayed signal: panels, weights of their nodes, what is added."""
    left, right = edges[:-1][some, None], edges[1:][some, None]
    then = left + (right - left) * radau()[0] - each.delay
    middle = (left + right) / 2 - each.delay
    inside = middle + (then - middle) * (1 - 1e-9)  # rounding must not choose the side of a jump
    begun = inside > 0
    index = np.clip(np.searchsorted(edges, inside, side="right") - 1, 0, None)
    place = (then - edges[index]) / np.diff(edges)[index]
    weights = panel_basis(np.where(begun, place, 0.0).ravel()).reshape(*place.shape, NODES)
    known = np.polyval(each.known, then) if each.known.size else np.zeros_like(then)
    return index, weights * begun[..., None], known * begun
