"""A loop for a process that comes alone: which model, filter and controller, and why these."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import control as ct
import numpy as np

from ..design import ModelCandidate, stable_model_exists, suggest_model
from ..diagram import (
    DelayedTransferFunction,
    FilterFamily,
    LowPassFilter,
    as_family,
    as_fraction,
    filter_fraction,
    interpolating_filter,
    undelayed,
)
from ..loop import NRDOB
from ..measured import Identification
from ..numerics import number
from .choices import controller_for, filter_for, slowest_lag
from .resonances import CERTAIN, LIGHT, resonance_warnings
from .trials import Trial, in_words, trials_on

__all__ = ["Proposal", "propose"]

# Time constants of an interpolating filter, against the fastest of the process.
SHORTER = (1.0, 0.3, 0.1, 0.03, 0.01, 3.0, 10.0)
# Why a model differs from the process, by how it does.
REASONS = {
    "matched":
        "the process itself, which is stable, has no zero in the right half plane and no dead time",
    "zeros in the right half plane left out":
        "without the zeros on the imaginary axis or right of it, whose inverse would be unstable",
    "zeros in the right half plane mirrored":
        "with the zeros of the right half plane mirrored, because their inverse would be unstable",
    "unstable poles mirrored": "with the unstable poles mirrored to the left, because the model is "
        "run in parallel and must be stable",
    "poles on the axis moved to the left":
        "with the poles on the axis moved a little to the left, so that the model does not drift",
    "dead time left out": "without the dead time, which cannot be inverted",
    "dead time replaced by a lag":
        "with a lag in place of the dead time, which cannot be inverted",
}  # fmt: skip
# Times the λ for the process found, or the sampling time if that is longer: tried where the loop
# fails on a process that it may be.
SLOWER = tuple(1.2**k for k in range(1, 18))


@dataclass(frozen=True)
class Proposal:
    """What is proposed, or why nothing is.

    Attributes
    ----------
    loop : NRDOB or None
        None where no filter stabilises it under any model tried.
    words, warnings : tuple of str
        The reasons, and what must not be overlooked, the gravest first.
    candidates : tuple of ModelCandidate
        The models compared.
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
        record about as well and at the ends of all intervals, in continuous time and sampled like
        the record, and λ is increased until none fails.
    model, controller : as for `nrdob.NRDOB`, optional
        G̃ and C.
    time_constant, order : float, int, optional
        λ of the filter, in seconds, which is not increased if it is given, and its n.
    max_ms : float
        Largest peak of the sensitivity aimed at.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put.
    """
    if order is not None:
        LowPassFilter(1.0, order)  # refuses what is no order
    found = process if isinstance(process, Identification) else None
    process = found.process if found else process
    if found and found.unsure:
        said = f"No loop is proposed, because {found.unsure}."
        return Proposal(None, (said,), warnings=(said,))
    candidates: tuple[ModelCandidate, ...] = ()
    others, plant = [], process
    if model is None:
        if found:
            process = _as_sampled(process, found.record.sampling_time)
        candidates = tuple(suggest_model(process, max_ms=max_ms))
        best = candidates[0]
        if not best.time_constants:
            return _matched(process, controller, max_ms, candidates)
        how = "; ".join(REASONS.get(part, part) for part in best.how.split(", "))
        why = f"Model: {how}. {_rank(candidates, max_ms)}"
        if process is not plant:
            why += " The samples are slower than anything in the process: the loop is designed for "
            why += "a dead time of one sample."
        family = as_family(order or best.filters)
        base = _Base(process, plant, best.model, why, family, controller, max_ms)
        damped = _without_resonances(process)
        if damped is not None:
            why = "Model: the process without dead time and with its resonances critically damped."
            family = as_family(order or _lowest(damped))
            others = [replace(base, model=damped, why=why, family=family)]
    else:
        family = as_family(order or _lowest(model))
        base = _Base(process, plant, model, "Model: as given.", family, controller, max_ms)
    first = _completed(base, time_constant)
    loop = first.loop
    if loop is not None:
        first = replace(first, trials=tuple(trials_on(loop, found)))
        if time_constant is None:
            first = _improved(base, first, loop, others, found)
    if not first.trials:
        return replace(first, candidates=candidates)
    said = in_words(first.trials, slower=time_constant is None)
    if all(each.holds for each in first.trials):
        return replace(first, words=(*first.words, said), candidates=candidates)
    return replace(first, warnings=(said, *first.warnings), candidates=candidates)


def _improved(
    base: _Base, first: Proposal, loop: NRDOB, others: list[_Base], found: Identification | None
) -> Proposal:
    """Choose another where the first has a fault: one that has none, or else only when sampled."""
    fault = _fault(loop, first.trials)
    if not fault:
        return first
    # Sampled, nothing faster than the samples is of use; if no λ does, continuous time must do.
    rounds = [first.trials[0].dt if first.trials else 0.0]
    if any(not each.continuous.holds for each in first.trials):
        rounds.append(0.0)
    order, suspect = [each.process for each in first.trials], ""
    for dt in rounds:
        for change, other in _others(base, first, loop, others, dt):
            if other.loop is None:
                continue
            seen = _until_one_fails(trials_on(other.loop, found, suspect), sampled=dt > 0)
            if not _fault(other.loop, seen, sampled=dt > 0):
                said = f"{fault}, so {change}, with a controller to match."
                trials = tuple(sorted(seen, key=lambda each: order.index(each.process)))
                return replace(other, words=(*other.words, said), trials=trials)
            # The process on which one fails is where the next one is likeliest to fail.
            suspect = seen[-1].process if seen else ""
    return first


@dataclass(frozen=True)
class _Base:
    """What a loop is completed from: the model, why it is that one, and the kind of filter.

    The loop is that of the plant; the process is what it is designed for.
    """

    process: Any
    plant: Any
    model: Any
    why: str
    family: FilterFamily
    controller: Any
    max_ms: float


def _as_sampled(process: Any, dt: float) -> Any:
    """Give a process that is faster than its samples, or only integrates, a dead time of one."""
    prompt, delay = undelayed(process)
    unstable = np.any(np.roots(as_fraction(prompt, "process").den).real > 0)
    if unstable or max(slowest_lag(process), delay) >= dt:
        return process
    return DelayedTransferFunction(prompt, dt)


def _lowest(model: Any) -> int:
    """Lowest order of a filter with which the inverse of a model is causal."""
    return max(1, as_fraction(undelayed(model)[0], "model").relative_degree)


def _completed(base: _Base, time_constant: float | None, calm: bool = False) -> Proposal:
    """Choose filter and controller; the controller is as slow as the filter if it must be calm."""
    words, warnings = [base.why], []
    if time_constant is None:
        filter, said, warned = filter_for(base.process, base.model, base.family, base.max_ms)
        words.append(said)
        warnings += warned
        if filter is None:
            return Proposal(None, tuple(words), warnings=tuple(warnings))
    else:
        filter = base.family.at(time_constant)
        words.append("Filter: as given.")
    controller = base.controller
    if controller is None:
        controller, said = controller_for(base.model, filter, calm)
        words.append(said)
        if controller is None:
            return Proposal(None, tuple(words), warnings=(*warnings, said))
    else:
        words.append("Controller: as given.")
    loop = NRDOB(base.plant, base.model, controller, filter)
    settles = all(root.real < 0 for root in np.roots(loop.fractions.G.den))
    if settles and loop.delay > slowest_lag(base.process) and not loop.model_delay:
        words.append(
            "The dead time is the longest of all times here. With a model that has it, too, "
            f"nrdob.delay({loop.delay:.4g})*model, the response to the reference has no "
            "oscillation; against disturbances that loop, too, must wait for it."
        )
    return Proposal(loop, tuple(words), warnings=tuple(warnings))


def _until_one_fails(trying: Iterator[Trial], sampled: bool) -> tuple[Trial, ...]:
    seen = []
    for each in trying:
        seen.append(each)
        if not _holds(each, sampled):
            break
    return tuple(seen)


def _holds(trial: Trial, sampled: bool) -> bool:
    return trial.holds if sampled else trial.continuous.holds


def _fault(loop: NRDOB, trials: tuple[Trial, ...], sampled: bool = True) -> str:
    """Say why a loop should not be used as it is; nothing where it may."""
    failed = [each for each in trials if not _holds(each, sampled)]
    if failed:
        like = ", sampled like the record," * all(each.continuous.holds for each in failed)
        return (
            f"With this filter the loop{like} fails on a process that the record does not exclude"
        )
    if loop.stability().stable and any(e <= CERTAIN for e, _ in resonance_warnings(loop)):
        return (
            f"With a model that resonates like the process an error of {100 * CERTAIN:g} % in the "
            "frequency makes the loop unstable"
        )
    return ""


def _others(
    base: _Base, first: Proposal, loop: NRDOB, others: list[_Base], shortest: float
) -> Iterator[tuple[str, Proposal]]:
    """Give loops with other models, then slower ones with the same, λ above a shortest time."""
    for other in others:
        yield "the model does not resonate", _completed(other, None, calm=True)
    den = filter_fraction(loop.filter).den  # (λs + 1)^n
    fastest = float(abs(den[0]) ** (1 / (len(den) - 1)))
    for factor in SLOWER:
        time_constant = factor * max(fastest, shortest)
        slower = _completed(base, time_constant, calm=True)
        words = tuple(
            late if late.startswith("Controller") else early
            for early, late in zip(first.words, slower.words, strict=False)
        )
        change = f"λ is {number(time_constant)} s instead of {number(fastest)} s"
        yield change, replace(slower, words=words)


def _without_resonances(process: Any) -> ct.TransferFunction | None:
    """Give the process without dead time and with critical damping; None if nothing resonates."""
    fraction = as_fraction(undelayed(process)[0], "process", proper=False)
    parts = []
    for part in fraction:
        roots = np.roots(part)
        light = (np.abs(roots.real) < LIGHT * np.abs(roots)) & (roots.imag != 0)
        calm = np.where(light, -np.abs(roots), roots)
        parts.append(part[0] * np.atleast_1d(np.poly(calm).real))
    return None if all(map(np.allclose, parts, fraction)) else ct.tf(*parts)


def _rank(candidates: tuple[ModelCandidate, ...], max_ms: float) -> str:
    if len(candidates) == 1:
        return ""
    among = f"Of the {len(candidates)} models compared it"
    if candidates[0].fastest is None:
        return f"{among} comes closest to a sensitivity peak of {max_ms:g}, which none meets."
    return f"{among} lets the observer reject most at a sensitivity peak of {max_ms:g}."


def _matched(
    process: Any, controller: Any, max_ms: float, candidates: tuple[ModelCandidate, ...]
) -> Proposal:
    """Try the process as its own model, under a filter that is 1 at what must not be inverted."""
    none = (
        f"None of the {len(candidates)} models compared can be stabilised by any low-pass filter "
        "(1/(λs + 1)^n): mirrored poles, smaller gains, the dead time left out or made a lag."
    )
    prompt, delay = undelayed(process)
    words = [none, *_obstacles(prompt, delay)]
    loops = [] if delay else _interpolated(prompt, controller)
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


def _obstacles(prompt: Any, delay: float) -> Iterator[str]:
    """Tell what makes the process hard for every controller."""
    right, unstable = (
        roots[roots.real > 0] for roots in map(np.roots, as_fraction(prompt, "process"))
    )
    if unstable.size and delay:
        fastest = float(unstable.real.max())
        grown = float(np.exp(fastest * delay))
        yield (
            f"The fastest unstable pole is at {number(fastest)} rad/s, and the dead time lasts "
            f"{number(delay)} s: their product is {number(fastest * delay)}. Whatever the "
            f"controller, the sensitivity then peaks at {number(grown - 1)} at least, because "
            f"nothing can act before the dead time is over while the pole grows by {number(grown)}."
        )
    zeros, poles = (np.real(r[r.imag == 0]) for r in (right, unstable))
    if zeros.size and poles.size:
        pairs = [(abs((z + p) / (z - p)), p, z) for z in zeros for p in poles if z != p]
        bound, pole, zero = max(pairs, default=(np.inf, poles[0], zeros[0]))
        yield (
            f"With an unstable pole at {number(pole)} rad/s and a zero at {number(zero)} rad/s the "
            f"sensitivity peaks at {number(bound)} at least, whatever the controller."
        )
    if not delay and not stable_model_exists(prompt).holds:
        yield (
            "Its real poles and zeros in the right half plane do not interlace as they must for a "
            "stable controller (parity interlacing): what stabilises it must itself be unstable."
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
                controller, _ = controller_for(process, filter)
            if controller is None:
                break
            loop = NRDOB(process, process, controller, filter)
            margins = loop.margins()
        except (ValueError, ArithmeticError):
            continue
        if margins.stable:
            loops.append((margins.plant_loop.ms, share * base, loop))
    return loops
