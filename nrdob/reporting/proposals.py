"""A loop for a process that comes alone: which model, filter and controller, and why these."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import log10
from typing import Any

import control as ct
import numpy as np
from scipy.optimize import brentq

from ..design import (
    ModelCandidate,
    admissible_time_constants,
    design_controller,
    design_filter,
    stable_model_exists,
    suggest_model,
)
from ..diagram import (
    DelayedTransferFunction,
    FilterFamily,
    LowPassFilter,
    as_fraction,
    interpolating_filter,
)
from ..loop import NRDOB
from ..measured import Identification
from ..numerics import ComplexArray, number
from .trials import Trial, holds_on_all, in_words, trials_on

__all__ = ["Proposal", "propose"]

ORIGIN = 1e-9
"""Size of a root, against the largest, that is taken for 0."""

NOISE_GAIN = 10.0
"""Largest gain from noise to u against that at rest, where only noise limits the filter."""

SPEEDS = (1.0, 0.5, 0.2, 0.1, 0.05, 2.0, 5.0)
"""Crossovers tried for the controller, against the bandwidth 1/(nλ) of the observer."""

MARGINS = (60.0, 30.0, 10.0)
"""Phase margins tried for it, in degrees."""

CALM = 2.0
"""Largest sensitivity peak of the controller with the model that is not called swinging."""

INSIDE = 0.5
"""Of the longest time constant that will do, the longest that is taken."""

RELAXED = (1.2, 1.5, 2.0, 3.0, 5.0)
"""Times the peak aimed at, tried where none meets it."""

SHORTER = (1.0, 0.3, 0.1, 0.03, 0.01, 3.0, 10.0)
"""Time constants of an interpolating filter, against the fastest of the process."""


SLOWER = (1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0)
"""Times the λ for the process found, tried where the loop fails on a process that it may be."""


@dataclass(frozen=True)
class Proposal:
    """What is proposed, or why nothing is.

    Attributes
    ----------
    loop : NRDOB or None
        The loop; None where no filter stabilises it under any model tried.
    words : tuple of str
        The reasons.
    candidates : tuple of ModelCandidate
        The models compared.
    warnings : tuple of str
        What must not be overlooked, the gravest first.
    trials : tuple of Trial
        Of a process found in a record: the loop on all that the process may be.
    """

    loop: NRDOB | None
    words: tuple[str, ...]
    candidates: tuple[ModelCandidate, ...] = ()
    warnings: tuple[str, ...] = ()
    trials: tuple[Trial, ...] = ()


def propose(
    process: Any,
    *,
    model: Any = None,
    controller: Any = None,
    time_constant: float | None = None,
    order: int | None = None,
    max_ms: float = 2.0,
) -> Proposal:
    """Choose what was not given.

    Parameters
    ----------
    process : as for `nrdob.NRDOB`, or Identification
        The process G. If it was identified, the loop is tried on every structure that explains the
        record about as well and at the ends of all intervals, and λ is increased until none fails.
    model, controller : as for `nrdob.NRDOB`, optional
        G̃ and C.
    time_constant : float, optional
        λ of the filter, in seconds; one that is given is not increased.
    order : int, optional
        n of the filter.
    max_ms : float
        Largest peak of the sensitivity aimed at.

    Returns
    -------
    Proposal
        The loop and the reasons, or the reasons why there is none.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put.
    """
    given = {"model": model, "controller": controller, "order": order, "max_ms": max_ms}
    if not isinstance(process, Identification):
        return _proposed(process, time_constant, **given)
    if process.unsure:
        said = f"No loop is proposed, because {process.unsure}."
        return Proposal(None, (said,), warnings=(said,))
    first = _proposed(process.process, time_constant, **given)
    if first.loop is None:
        return first
    proposal, loop, slower = first, first.loop, 1.0
    found = holds_on_all(first.loop, process)
    for factor in () if found or time_constant is not None else SLOWER[1:]:
        late = factor * _time_constant(first.loop.filter)
        tried = _proposed(process.process, late, **given, calm=True)
        if tried.loop is not None and (found := holds_on_all(tried.loop, process)):
            proposal, loop, slower = tried, tried.loop, factor
            break
    trials = trials_on(loop, process)
    said = in_words(trials)
    if not found:
        return replace(first, warnings=(said, *first.warnings), trials=trials)
    words = first.words
    if slower > 1:
        words = tuple(
            late if late.startswith("Controller") else early
            for early, late in zip(first.words, proposal.words, strict=False)
        )
        said = (
            "With this filter the loop fails on a process that the record does not exclude, so λ "
            f"is {slower:g} times as long, with a controller to match. {said}"
        )
    return replace(first, loop=proposal.loop, words=(*words, said), trials=trials)


def _time_constant(filter: Any) -> float:
    """λ of a filter whose denominator is (λs + 1)^n."""
    den = as_fraction(getattr(filter, "tf", filter), "filter").den
    return float(abs(den[0] / den[-1]) ** (1 / (len(den) - 1)))


def _proposed(
    process: Any,
    time_constant: float | None,
    *,
    model: Any,
    controller: Any,
    order: int | None,
    max_ms: float,
    calm: bool = False,
) -> Proposal:
    """Choose what was not given; the controller is as slow as the filter if it must be calm."""
    words: list[str] = []
    warnings: list[str] = []
    candidates: tuple[ModelCandidate, ...] = ()
    if model is None:
        candidates = tuple(suggest_model(process, max_ms=max_ms))
        best = candidates[0]
        if not best.time_constants:
            return _matched(process, controller, max_ms, candidates)
        model, family = best.model, order or best.filters
        words.append(f"Model: {_why(best.how)}. {_rank(candidates, max_ms)}")
    else:
        words.append("Model: as given.")
        lowest = as_fraction(getattr(model, "tf", model), "model").relative_degree
        family = order or max(1, lowest)
    if time_constant is None:
        filter, said, warned = _filter(process, model, family, max_ms)
        words.append(said)
        warnings += warned
        if filter is None:
            return Proposal(None, tuple(words), candidates, tuple(warnings))
    else:
        filter = _at(family, time_constant)
        words.append("Filter: as given.")
    if controller is None:
        controller, said = _controller(model, filter, calm)
        words.append(said)
        if controller is None:
            return Proposal(None, tuple(words), candidates, (*warnings, said))
    else:
        words.append("Controller: as given.")
    loop = NRDOB(process, model, controller, filter)
    settles = all(root.real < 0 for root in np.roots(loop.fractions.G.den))
    if settles and loop.delay > slowest_lag(process) and not loop.model_delay:
        words.append(
            "The dead time is the longest of all times here. With a model that has it, too, "
            f"nrdob.delay({loop.delay:.4g})*model, the response to the reference has no "
            "oscillation; against disturbances that loop, too, must wait for it."
        )
    return Proposal(loop, tuple(words), candidates, tuple(warnings))


def slowest_lag(process: Any) -> float:
    """Largest time constant of poles and zeros, in seconds; 0 where there is none."""
    fraction = as_fraction(getattr(process, "tf", process), "process", proper=False)
    roots = np.concatenate([np.roots(part) for part in fraction])
    sizes = np.abs(roots[np.abs(roots) > ORIGIN * np.abs(roots).max(initial=0.0)])
    return float(max(1 / sizes, default=0.0))


def slowest_time_constant(process: Any) -> float:
    """Largest time constant, dead time included, in seconds; 1 where there is none."""
    return max(slowest_lag(process), getattr(process, "delay", 0.0)) or 1.0


def _rank(candidates: tuple[ModelCandidate, ...], max_ms: float) -> str:
    if len(candidates) == 1:
        return ""
    among = f"Of the {len(candidates)} models compared it"
    if candidates[0].fastest is None:
        return f"{among} comes closest to a sensitivity peak of {max_ms:g}, which none meets."
    return f"{among} lets the observer reject most at a sensitivity peak of {max_ms:g}."


def _why(how: str) -> str:
    reasons = {
        "matched": "the process itself, which is stable, has no zero in the right half plane "
        "and no dead time",
        "zeros in the right half plane left out": "without the zeros in the right half "
        "plane, whose inverse would be unstable",
        "zeros in the right half plane mirrored": "with the zeros of the right half plane "
        "mirrored, because their inverse would be unstable",
        "unstable poles mirrored": "with the unstable poles mirrored to the left, because the "
        "model is run in parallel and must be stable",
        "poles on the axis moved to the left": "with the poles on the axis moved a little to "
        "the left, so that the model does not drift",
        "dead time left out": "without the dead time, which cannot be inverted",
        "dead time replaced by a lag": "with a lag in place of the dead time, which cannot be "
        "inverted",
    }
    return "; ".join(reasons.get(part, part) for part in how.split(", "))


def _filter(
    process: Any, model: Any, family: int | FilterFamily, max_ms: float
) -> tuple[LowPassFilter | ct.TransferFunction | None, str, list[str]]:
    """Choose the fastest filter that keeps the peak; where all do, what the noise allows."""
    of_order = _named(family)
    try:
        found = design_filter(process, model, order=family, max_ms=max_ms)
        return (
            found,
            (
                f"Filter: the fastest {of_order} whose plant loop has a sensitivity peak of "
                f"at most {max_ms:g}."
            ),
            [],
        )
    except ValueError as error:
        reason = str(error)
    if "however fast" in reason:
        return *_by_noise(process, model, family, max_ms), []
    for limit in RELAXED:
        try:
            found = design_filter(process, model, order=family, max_ms=max_ms * limit)
        except ValueError:
            continue
        return (
            found,
            (
                f"Filter: none {of_order} keeps the sensitivity peak below {max_ms:g}; this "
                f"is the fastest below {max_ms * limit:g}."
            ),
            [f"No filter with this model meets a sensitivity peak of {max_ms:g}: it is touchy."],
        )
    return (
        None,
        f"Filter: {reason}.",
        [f"No filter {of_order} gives a loop that could be used with this model: {reason}."],
    )


def _named(family: int | FilterFamily) -> str:
    if isinstance(family, FilterFamily):
        return f"of the {family.kind} filters of order {family.order}"
    return f"of order {family}"


def _at(family: int | FilterFamily, time_constant: float) -> LowPassFilter | ct.TransferFunction:
    if isinstance(family, FilterFamily):
        return family.at(time_constant)
    return LowPassFilter(time_constant, family)


def _by_noise(
    process: Any, model: Any, family: int | FilterFamily, max_ms: float
) -> tuple[LowPassFilter | ct.TransferFunction, str]:
    """Choose among filters that may be as fast as one likes: F/model must not amplify too much."""
    slow = slowest_time_constant(process)
    longest = admissible_time_constants(process, model, family, max_ms=max_ms)[0][1]
    omega = np.geomspace(1e-4, 1e6, 2000) / slow
    Gm = as_fraction(getattr(model, "tf", model), "model")
    inverse = np.abs(np.polyval(Gm.den, 1j * omega) / np.polyval(Gm.num, 1j * omega))
    allowed = NOISE_GAIN * abs(Gm.den[-1] / Gm.num[-1])

    def excess(exponent: float) -> float:
        tried = _at(family, 10**exponent)
        F = as_fraction(getattr(tried, "tf", tried), "filter")
        passed = inverse * np.abs(np.polyval(F.num, 1j * omega) / np.polyval(F.den, 1j * omega))
        return float(log10(passed.max() / allowed))

    fast, late = log10(slow) - 4, log10(slow) + 4
    if allowed > 0 and excess(fast) > 0 > excess(late):
        quiet = 10 ** brentq(excess, fast, late, xtol=1e-3)
        said = (
            f"so the noise must choose: F/G̃ passes noise to u at most {NOISE_GAIN:g} times as "
            "strongly as it passes a constant."
        )
    else:
        quiet = slow / 10
        said = (
            "and noise does not say how fast it must be: this is a tenth of the plant's slowest "
            "time constant (of 1 s where it has none). Choose your own."
        )
    if quiet > INSIDE * longest:
        quiet = INSIDE * longest
        said = "and this is a slow one: a faster one would pass even more noise to u."
    opening = f"every fast one {_named(family)} keeps the sensitivity peak below {max_ms:g}"
    return _at(family, float(f"{quiet:.3g}")), f"Filter: {opening}, {said}"


def _controller(
    model: Any, filter: Any, calm: bool = False
) -> tuple[ct.TransferFunction | None, str]:
    """Design a PI by its phase margin, or by the observer's bandwidth, whose loop is calm.

    Where none of them is, the calmest.
    """
    undelayed = getattr(model, "tf", model)
    tried: list[tuple[float, ct.TransferFunction, str]] = []
    for limit in (CALM, None):
        for bandwidth, margin in _asked_of_controllers(filter, undelayed):
            if calm and bandwidth is None:
                continue
            try:
                found = design_controller(
                    undelayed, bandwidth=bandwidth, phase_margin=margin, max_ms=limit
                )
            except ValueError:
                continue
            how = (
                f"the PI of largest integral gain with a phase margin of {margin:g}° on the model"
                if bandwidth is None
                else f"designed for a crossover at {number(bandwidth)} rad/s, near the bandwidth "
                f"of the observer, with a phase margin of {margin:g}° on the model"
            )
            ms = NRDOB(undelayed, undelayed, found, filter).margins().model_loop.ms
            lowered = limit is not None and bandwidth is None and ms > (1 - 1e-3) * limit
            calmed = f"; its gain is lowered until the sensitivity peaks at {CALM:g}"
            tried.append((ms, found, f"Controller: {how}{calmed if lowered else ''}."))
            if limit is not None:
                return tried[0][1:]
    if tried:
        return min(tried, key=lambda each: each[0])[1:]
    return None, "Controller: none of I, PI and PID was found that stabilises this model."


def _asked_of_controllers(filter: Any, model: Any) -> Iterator[tuple[float | None, float]]:
    yield None, MARGINS[0]
    speed = (
        1 / (filter.order * filter.time_constant)
        if isinstance(filter, LowPassFilter)
        else 1 / slowest_time_constant(model)
    )
    for margin in MARGINS:
        for share in SPEEDS:
            yield share * speed, margin


def _matched(
    process: Any, controller: Any, max_ms: float, candidates: tuple[ModelCandidate, ...]
) -> Proposal:
    """Try the process as its own model, under a filter that is 1 at what must not be inverted."""
    none = (
        f"None of the {len(candidates)} models compared can be stabilised by any low-pass filter "
        "(1/(λs + 1)^n): mirrored poles, smaller gains, the dead time left out or made a lag."
    )
    undelayed = process.tf if isinstance(process, DelayedTransferFunction) else process
    delay = getattr(process, "delay", 0.0)
    words = [none, *_obstacles(undelayed, delay)]
    loops = [] if delay else _interpolated(undelayed, controller)
    if not loops:
        words.append(
            "What to change: "
            + "measure or act with less dead time, " * bool(delay)
            + "add an actuator or a sensor that sees the unstable motion earlier, or give a model "
            "of your own. That nothing tried here works does not prove that nothing does."
        )
        return Proposal(None, tuple(words), candidates, (none,))
    ms, time_constant, loop = min(loops, key=lambda each: each[0])
    words.append(
        "What does work is the process as its own model, under an interpolating filter, "
        "which is 1 at its unstable poles and 0 at its zeros in the right half plane: here "
        f"with λ = {number(time_constant)} s, the best of {len(loops)} tried. It works "
        "only where the model is nearly right."
    )
    warned = (f"The smallest sensitivity peak found is {number(ms)}, above {max_ms:g}.",)
    return Proposal(loop, tuple(words), candidates, warned if ms > max_ms else ())


def _obstacles(undelayed: Any, delay: float) -> Iterator[str]:
    """Tell what makes the process hard for every controller."""
    fraction = as_fraction(undelayed, "process")
    unstable, right = _right(fraction.den), _right(fraction.num)
    if unstable.size and delay:
        fastest = float(unstable.real.max())
        grown = float(np.exp(fastest * delay))
        yield (
            f"The fastest unstable pole is at {number(fastest)} rad/s, and the dead time lasts "
            f"{number(delay)} s: their product is {number(fastest * delay)}. Whatever the "
            f"controller, the sensitivity then peaks at {number(grown - 1)} at least, because "
            "nothing can act before the dead time is over while the pole grows by "
            f"{number(grown)}."
        )
    zeros, poles = (np.real(r[r.imag == 0]) for r in (right, unstable))
    if zeros.size and poles.size:
        pairs = [(abs((z + p) / (z - p)), p, z) for z in zeros for p in poles if z != p]
        bound, pole, zero = max(pairs, default=(np.inf, poles[0], zeros[0]))
        yield (
            f"With an unstable pole at {number(pole)} rad/s and a zero at {number(zero)} rad/s the "
            f"sensitivity peaks at {number(bound)} at least, whatever the controller."
        )
    if not delay and not stable_model_exists(undelayed).holds:
        yield (
            "Its real poles and zeros on the right do not interlace as they must for a stable "
            "controller (parity interlacing): whatever stabilises it must itself be unstable."
        )


def _interpolated(process: Any, controller: Any) -> list[tuple[float, float, NRDOB]]:
    """Find stable loops with the process as its own model: each with its peak and its λ."""
    loops = []
    roots = [abs(r) for part in as_fraction(process, "process") for r in np.roots(part)]
    base = 1 / max((size for size in roots if size > 0), default=1.0)
    for share in SHORTER:
        try:
            filter = interpolating_filter(process, share * base)
            if controller is None:  # the one that is found does not depend on λ
                controller, _ = _controller(process, filter)
            if controller is None:
                break
            loop = NRDOB(process, process, controller, filter)
            margins = loop.margins()
        except (ValueError, ArithmeticError):
            continue
        if margins.stable:
            loops.append((margins.plant_loop.ms, share * base, loop))
    return loops


def _right(den: Any) -> ComplexArray:
    roots = np.roots(den)
    return np.asarray(roots[roots.real > 0])
