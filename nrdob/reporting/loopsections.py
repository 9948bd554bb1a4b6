"""What can be said of a loop: one function for each section of a report."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial
from math import inf, isfinite, isnan, log10

import numpy as np

from ..analysis import Margins, Stability
from ..design import admissible_time_constants, stability_chart, stabilizing_time_constants
from ..diagram import LowPassFilter, as_fraction
from ..digital import largest_sampling_time
from ..loop import NRDOB
from ..numerics import number, written
from ..plotting import COLOURS, chart_plot, nyquist_plot
from .formulas import character, formula, intervals, roots_listed
from .html import Attachment, Section, Table, picture
from .resonances import CERTAIN, resonance_warnings

__all__ = ["UNDECIDED", "sections_of"]

# Margins below, and sensitivity above, which a loop is called near its limit.
SMALL_GAIN_DB, SMALL_PHASE, LARGE_MS = 6.0, 30.0, 2.0
UNDECIDED = "Whether the loop is stable could not be decided."
LONGEST_PROOF = 500_000  # letters that a certificate in a page may have
# How far a chart reaches below and above λ; less far where a dead time asks for too much.
SPANS = (30.0, 10.0, 3.0)
# Times at which peaks after a step are looked for; the first, against the shortest time of the
# loop; and how near the end y must be in the last.
EVENLY, EARLIEST, ARRIVED = 1001, 0.01, 0.05
FINE = 10.0  # by how much a loop is sampled faster than it must be, where no sampling time is given


def sections_of(
    loop: NRDOB, step: float | None = None
) -> Iterator[tuple[str, Callable[[], Section]]]:
    """Give each section by its title, written one by one; step is the sampling time, if known."""
    parts: tuple[tuple[str, Callable[[NRDOB, float | None, str], Section]], ...] = (
        ("The loop", _blocks),
        ("Is it stable?", _verdict),
        ("How nearly not?", _margins),
        ("Which filters would do?", _filters),
        ("Stability around this filter", _chart),
        ("What it does", _responses),
        ("On a processor", _sampled),
    )
    for title, write in parts:
        yield title, partial(write, loop, step, title)


def _blocks(loop: NRDOB, step: float | None, title: str) -> Section:
    rows = []
    for name in ("process G", "model G̃", "controller C", "filter F"):
        block = getattr(loop, name.split()[0])
        num, den = as_fraction(getattr(block, "tf", block), name, proper=False)
        poles, zeros = (roots_listed(np.roots(part)) for part in (den, num))
        rows.append((name, formula(block), poles, zeros))
    head = ("block", "formula", "poles", "zeros")
    table = Table("The blocks, with poles and zeros in rad/s", head, tuple(rows))
    words = (
        "The model and its inverse tell from u and y what disturbs the plant; the filter takes "
        "that off the input. All the feedback from y to u is K = F/((1 − F) G̃), and the "
        "controller C acts on the reference through the model.",
        "What kind of process is it? " + " ".join(character(loop.process)),
    )
    return Section(title, words, (table,))


def _verdict(loop: NRDOB, step: float | None, title: str) -> Section:
    found = loop.stability()
    rows = []
    for part in (found.model_loop, found.observer_loop):
        counts = part.encirclements, part.open_loop_rhp, part.closed_loop_rhp
        n, p, z = ("?" if count is None else number(count) for count in counts)
        rightmost = part.rightmost
        last = "none" if isnan(rightmost.real) else written(rightmost, number, pair=True)
        rows.append((part.name, n, p, z, last, roots_listed(part.roots)))
    table = Table(
        "Z = N + P: encirclements of −1, poles in the right half plane before, roots there after "
        "closing the loop, in rad/s; (i) is the controller with the model, with the roots of p_A, "
        "(ii) the observer with the plant, with those of p_B",
        ("condition", "N", "P", "Z", "rightmost root", "roots, rightmost first"),
        tuple(rows),
    )
    says = {
        True: "The loop is stable: both conditions hold, each found in two independent ways.",
        False: "The loop is NOT stable.",
        None: UNDECIDED,
    }[found.stable]
    alarms = () if found.stable else (f"{says} {found.reason}.",)
    caption = "All the feedback around the plant, L = K·G; the red cross is −1."
    drawn = picture(nyquist_plot(loop.L), caption)
    words, files = _proof(found)
    words = (says, f"{found.reason}.", *words)
    return Section(title, words, (table,), (drawn,), (), alarms, files)


def _proof(found: Stability) -> tuple[tuple[str, ...], tuple[Attachment, ...]]:
    """Give a certificate of the verdict, or say why there is none."""
    try:
        certificate = found.certificate()
    except ArithmeticError as error:
        return (f"There is {error}.",), ()
    text = json.dumps(certificate.content)
    if len(text) > LONGEST_PROOF:
        return ("Its certificate is too long for a page: let the package save it.",), ()
    says = (
        f"{certificate.proved} The certificate holds the blocks in exact fractions; "
        "python -m nrdob.certificates certificate.json proves it again."
    )
    return (), (Attachment("certificate.json", text, says),)


def _margins(loop: NRDOB, step: float | None, title: str) -> Section:
    found = loop.margins()
    if not found.stable:
        return Section(title, ("A loop that is not stable has no margins.",))
    rows = tuple(
        {
            each.name: (what, *_tolerated(each), _or_any(each.delay_margin, " s"))
            for what, each in (
                ("C·G̃, the reference's loop", found.model_loop),
                ("F·H, the observer's condition", found.observer_loop),
                ("L, what the plant feels", found.plant_loop),
            )
        }.values()
    )
    table = Table(
        "How much gain, phase and dead time the loops tolerate",
        ("loop", "gain may rise by", "gain may fall by", "phase", "peak Ms", "delay margin"),
        rows,
    )
    warnings = tuple(_warnings(found.plant_loop, loop, step))
    if found.model_loop.ms > 1.0005 * LARGE_MS:
        warnings += (
            "The controller leaves its own loop with the model a sensitivity peak of "
            f"{number(found.model_loop.ms)}: the reference will make it swing.",
        )
    moved = tuple(resonance_warnings(loop))
    alarms = tuple(said for error, said in moved if error <= CERTAIN)
    warnings += tuple(said for error, said in moved if error > CERTAIN)
    worst = (*alarms, *warnings, "None of them is small.")[0]
    words = ("What a change of the plant uses up are the margins of L.", worst)
    return Section(title, words, (table,), (), warnings, alarms)


def _warnings(found: Margins, loop: NRDOB, step: float | None) -> Iterator[str]:
    """Say what brings the loop near its limit, in plain words."""
    for factor, way in ((found.gm_high, "rises"), (found.gm_low, "falls")):
        decibels = abs(20 * log10(factor)) if 0 < factor < inf else inf
        if decibels < SMALL_GAIN_DB:
            digits = 3 - int(log10(max(abs(factor - 1), 1e-6)))  # so that 0.9998 is not "times 1"
            yield (
                f"Only {number(decibels, 2)} dB from instability if the gain of the plant {way}: "
                f"times {number(factor, digits)} is too {'much' if way == 'rises' else 'little'}."
            )
    if found.pm < SMALL_PHASE:
        yield f"Only {number(found.pm, 2)}° of phase margin at {number(found.wgc)} rad/s."
    if found.ms > 1.0005 * LARGE_MS:
        yield (
            f"Disturbances near {number(found.wms)} rad/s are made {number(found.ms, 2)} times as "
            "large as without control."
        )
    least = max(step or 0.0, 0.1 * loop.delay)
    if found.delay_margin < least:
        yield (
            f"With another {number(found.delay_margin, 2)} s of dead time the loop is unstable, "
            "less than " + ("one sample." if step else "a tenth of the dead time.")
        )


def _filters(loop: NRDOB, step: float | None, title: str) -> Section:
    filter = loop.filter
    if not isinstance(filter, LowPassFilter):
        said = "The filter is not of the form 1/(λs + 1)^n, so there is no set of λ to look for."
        return Section(title, (said,))
    rows = []
    warnings: list[str] = []
    for order in (filter.order, filter.order + 1):
        blocks = loop.process, loop.model, order
        found = calm = stabilizing_time_constants(*blocks)
        if found:
            calm = admissible_time_constants(*blocks, max_ms=LARGE_MS)
        rows.append((f"n = {order}", intervals(found), intervals(calm)))
        if order == filter.order and not found:
            warnings.append(f"No λ stabilises the observer with this model and n = {order}.")
    table = Table(
        "All time constants λ of the filter 1/(λs + 1)^n",
        ("order", "stable", f"peak of the sensitivity at most {LARGE_MS:g}"),
        tuple(rows),
    )
    said = f"The filter here has λ = {number(filter.time_constant, 4)} s and n = {filter.order}."
    return Section(title, (said,), (table,), (), tuple(warnings))


def _chart(loop: NRDOB, step: float | None, title: str) -> Section:
    filter = loop.filter
    if not isinstance(filter, LowPassFilter):
        return Section(title, ("A chart over λ needs a filter of the form 1/(λs + 1)^n.",))
    here = filter.time_constant
    for span in SPANS:
        try:
            chart = stability_chart(
                loop.process, loop.model, filter.order, x=("gain", 0.2, 5.0),
                y=("time_constant", here / span, here * span),
            )  # fmt: skip
            break
        except ValueError:
            if span == SPANS[-1]:
                raise
    figure = chart_plot(chart)
    figure.axes[0, 0].plot(1.0, here, "+", color=COLOURS["critical"], ms=11, mew=2.2, zorder=6)
    caption = (
        "Number of unstable roots when the gain of the plant is not what it was, and for other "
        "filters; the red cross is this loop."
    )
    return Section(title, (), (), (picture(figure, caption),))


def _responses(loop: NRDOB, step: float | None, title: str) -> Section:
    if not loop.stability().stable:
        return Section(title, ("Responses are drawn of stable loops only.",))
    drawn = tuple(
        picture(loop.plot_step(signal), f"{name} {signal} after unit steps.")
        for signal, name in (("y", "Output"), ("u", "Control signal"))
    )
    last, end = float(loop.step_response("R").time[-1]), loop.T_R.dc_gain
    # A slow end must not hide a fast beginning.
    fastest = max(np.abs(p.roots).max(initial=1 / last) for p in (loop.p_A, loop.p_B))
    early = np.geomspace(min(EARLIEST / fastest, 0.1 * last), last, EVENLY)
    times = np.union1d(np.linspace(0, last, EVENLY), early)
    y, u = loop.step_response("R", times).outputs[:, 0]
    reached = (
        f"Within {number(last)} s after a step of the reference y rises to "
        f"{number(float(y.max()))}, and u reaches {number(float(np.abs(u).max()))} per unit."
    )
    if abs(y[-1] - end) > ARRIVED * max(abs(end), float(np.abs(y).max())):
        reached += f" Later values cannot be computed to nine digits; y goes to {number(end)}."
    try:
        noisy = (
            "White noise of unit density on the sensor makes u wander with a standard deviation of "
            f"{number(float(np.sqrt(loop.U_eta.noise_power())))}."
        )
    except (ValueError, ArithmeticError) as error:
        noisy = f"What noise does to u: {error}."
    return Section(title, (reached, noisy), (), drawn)


def _sampled(loop: NRDOB, step: float | None, title: str) -> Section:
    if not loop.stability().stable:
        return Section(title, ("A loop that is not stable is not worth sampling.",))
    words, warnings, alarms = [], [], []
    longest = inf
    try:
        longest = largest_sampling_time(loop)
        words.append(
            f"Sampled by Tustin's rule, the loop becomes unstable at dt = {number(longest, 4)} s; "
            "it is stable at all shorter ones that were tried, 4 % apart."
            if longest < inf
            else "Sampled by Tustin's rule, the loop is stable at every sampling time looked at."
        )
    except (ValueError, ArithmeticError, NotImplementedError) as error:
        warnings.append(f"The largest sampling time is not known: {error}.")
    dt = step or _sampling_time(loop, longest)
    sampled = loop.sampled(dt)
    verdict = sampled.stability()
    says = {True: "stable", False: "NOT stable", None: "not decided"}[verdict.stable]
    of = "at which the plant was measured" if step else "chosen here"
    words.append(f"At dt = {number(dt, 4)} s, {of}, the sampled loop is {says}: {verdict.reason}.")
    if not verdict.stable:
        alarms.append(f"At dt = {number(dt, 4)} s the sampled loop is {says}.")
    tables = []
    if verdict.stable:
        try:
            table, after = _compared(loop.margins().plant_loop, sampled.margins(), dt)
        except (ValueError, ArithmeticError) as error:
            warnings.append(f"What sampling takes from the margins is not known: {error}.")
        else:
            tables.append(table)
            warnings += after
    return Section(title, tuple(words), tuple(tables), (), tuple(warnings), tuple(alarms))


def _compared(before: Margins, after: Margins, dt: float) -> tuple[Table, list[str]]:
    """Set margins before and after sampling side by side."""
    named = ("continuous", before), (f"dt = {number(dt, 4)} s", after)
    rows = tuple((what, *_tolerated(each)) for what, each in named)
    head = ("loop L", "gain may rise by", "gain may fall by", "phase", "peak Ms")
    warnings = []
    if after.ms > 1.2 * max(before.ms, LARGE_MS):
        warnings.append(
            f"Sampled at {number(dt, 4)} s the peak of the sensitivity is {number(after.ms)} "
            f"instead of {number(before.ms)}: sample faster, or take a larger λ."
        )
    return Table("What sampling takes from the margins", head, rows), warnings


def _sampling_time(loop: NRDOB, longest: float) -> float:
    """Choose a sampling time that is fast enough, in seconds."""
    times = [longest / FINE]
    if isinstance(loop.filter, LowPassFilter):
        times.append(2 * loop.filter.time_constant / FINE)
    shortest = min(times)
    return float(f"{shortest:.2g}") if isfinite(shortest) else 0.1


def _tolerated(margins: Margins) -> tuple[str, ...]:
    """Write the gains up and down, the phase and the peak of a loop."""
    gains = (abs(20 * log10(g)) if 0 < g < inf else inf for g in (margins.gm_high, margins.gm_low))
    return (
        *(_or_any(gain, " dB") for gain in gains), _or_any(margins.pm, "°"), number(margins.ms),
    )  # fmt: skip


def _or_any(value: float, unit: str) -> str:
    return f"{number(value)}{unit}" if isfinite(value) else "any"
