"""Checks that recur: printed maps, margins and functions, step responses, variations."""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.resources import files
from math import isfinite
from typing import Any

import numpy as np
from scipy.optimize import brentq

from nrdob.analysis import LoopStability, Margins, NyquistCount
from nrdob.diagram import INPUTS, DelayedTransferFunction, LowPassFilter, Quotient
from nrdob.loop import NRDOB
from nrdob.numerics import FloatArray, number
from nrdob.paper import PRINTED, PRINTED_FUNCTIONS, Printed, example
from nrdob.plotting import complex_number, frequency, spoken
from nrdob.reporting import formula

from .ledger import EXACT, TOLERANCE, Finding, Section, counted, every, same
from .signals import PRINTED_MAPS, QUADRUPLES, Values, many_loops, random_points

__all__ = [
    "OMEGA", "TO_OUTPUT", "border", "both", "filtered", "inverse_degree", "map_text", "npz",
    "npz_text", "performance", "printed_map", "section", "steps",
]  # fmt: skip

OMEGA = np.geomspace(1e-3, 1e5, 4001)
"""Frequencies on which a statement about all frequencies is tried, rad/s."""

_LOOPS = {"CGm": ("model_loop", r"$C\tilde G$"), "FH": ("observer_loop", "$FH$")}
TO_OUTPUT = tuple(input.to_y for input in INPUTS.values())
"""The maps of eq. (4), to y."""

_FINAL = {"R": 1.0, "d": 0.0, "delta": 0.0, "eta": -1.0}
"""Where y should end after a unit step at each input."""


def filtered(loop: NRDOB, time_constant: float, order: int) -> NRDOB:
    """Give the same loop with another filter of eq. (1)."""
    return replace(loop, filter=LowPassFilter(time_constant, int(order)))


def border(loop: NRDOB, order: int, low: float, high: float) -> float:
    """Time constant between `low` and `high` at which the rightmost root of p_B is on the axis."""

    def rightmost(time_constant: float) -> float:
        return float(filtered(loop, time_constant, order).p_B.roots[0].real)

    return float(brentq(rightmost, low, high, xtol=1e-12))


def inverse_degree(loop: NRDOB) -> int:
    """Measure the relative degree of F/Gm, from 0 on causal, by its size at 10⁷ and 10⁸ rad/s."""
    size = [abs(loop.F(1j * omega) / loop.Gm(1j * omega)) for omega in (1e7, 1e8)]
    return round(float(np.log10(size[0] / size[1])))


def npz(count: NyquistCount | LoopStability) -> tuple[float | None, float, float | None]:
    """Give N, P and Z."""
    return count.encirclements, count.open_loop_rhp, count.closed_loop_rhp


def npz_text(count: NyquistCount | LoopStability) -> str:
    """Write N, P and Z."""
    named = zip("NPZ", npz(count), strict=True)
    return ", ".join(f"{name} = {'?' if each is None else number(each)}" for name, each in named)


def printed_map(name: str) -> Finding:
    """Find whether a map is the printed one, in the diagram and in the package."""
    rng = np.random.default_rng(4)
    v = Values.random(rng)
    printed = PRINTED_MAPS[name](v)
    by_formula = np.isclose(printed, v.map(name), rtol=EXACT, atol=0)
    by_package = []
    for loop in many_loops():
        s = random_points(rng)
        by_package.append(same(getattr(loop, name)(s), Values.of(loop, s).map(name)))
    return Finding(
        every(by_formula) and every(by_package),
        f"the printed formula agrees with the diagram for {by_formula.sum()} of {QUADRUPLES} "
        f"random values of the four blocks, the package's map for {counted(by_package)} loops",
        TOLERANCE,
    )


# Printed margins.


def _margin_texts(id: str) -> dict[str, str]:
    which, loop_name, kind = id.split(".")
    printed, word = PRINTED[id], "phase" if kind == "pm" else "gain"
    value, said = "∞", "tends to infinity"
    if finite := isfinite(printed.value):
        digits = f"{printed.value:.{printed.digits}f}".replace("-", "−")
        value = digits + _unit(printed)
        said = f"is {value}"
    return {
        "place": printed.place,
        "says": f"In Example {which[2:]} the {word} margin of {_LOOPS[loop_name][1]} {said}.",
        "printed": value,
        "method": _METHODS[f"margin, {kind}{'' if finite else ', infinite'}"],
    }


def _margin(id: str) -> Finding:
    which, loop_name, kind = id.split(".")
    loop, printed = example(int(which[2:])), PRINTED[id]
    margins: Margins = getattr(loop.margins(), _LOOPS[loop_name][0])
    gain: Quotient = getattr(loop, loop_name)
    computed = margins.pm if kind == "pm" else margins.gm_db
    confirmed, text = _phase(gain, margins) if kind == "pm" else _gain(gain, margins)
    allowed = f"±{0.5 * 10.0**-printed.digits:g}{_unit(printed)}" if isfinite(computed) else ""
    return Finding(printed.agrees_with(computed) and confirmed, text, allowed)


def _unit(printed: Printed) -> str:
    return "°" if printed.unit == "deg" else f" {printed.unit}"


def _phase(gain: Quotient, margins: Margins) -> tuple[bool, str]:
    """Confirm a phase margin and say it."""
    if not isfinite(margins.pm):
        largest = float(np.abs(gain(1j * OMEGA)).max())
        return largest < 1, f"∞: the largest |{spoken(gain.name)}| is {number(largest, 4)}"
    turn = np.exp(1j * np.radians(margins.pm))
    at = complex(gain(1j * margins.wgc))
    meets = min(abs(at * turn + 1), abs(at / turn + 1)) < 1e-9
    return meets, f"{number(margins.pm, 5)}° {frequency(margins.wgc)}"


def _gain(gain: Quotient, margins: Margins) -> tuple[bool, str]:
    """Confirm a gain margin and say it."""
    if not isfinite(margins.gm_db):
        values = gain(1j * OMEGA)
        crosses = (np.diff(np.sign(values.imag)) != 0) & (values.real[1:] < 0)
        where = "no frequency" if not crosses.any() else f"{crosses.sum()} frequencies"
        return not crosses.any(), f"∞: {spoken(gain.name)} is real and negative at {where}"
    meets = abs(complex(gain(1j * margins.wpc)) * margins.gm + 1) < 1e-9
    return meets, f"{number(margins.gm_db, 5)} dB {frequency(margins.wpc)}"


# Printed transfer functions.


def printed_text(id: str) -> str:
    """Write a printed transfer function in one line."""
    printed = PRINTED_FUNCTIONS[id]
    return formula(DelayedTransferFunction((printed.num, printed.den), printed.delay))


def map_text(quotient: Quotient) -> str:
    """Write a map in one line, common factors divided out where there is no dead time."""
    if quotient.delay:
        num, den = quotient.numerator.r, quotient.denominator.q
    else:
        tf = quotient.to_tf()
        num, den = tf.num_array[0, 0], tf.den_array[0, 0]
    return formula(DelayedTransferFunction((num / den[0], den / den[0]), quotient.delay))


def _function(id: str, printed_as: str) -> Finding:
    example_name, _, name = printed_as.partition(".")
    computed: Quotient = getattr(example(int(example_name[2:])), name)
    right = PRINTED_FUNCTIONS[printed_as].agrees_with(computed)
    return Finding(right, map_text(computed), "relative difference below 1e−10")


# Encirclements and step responses.


def no_turn(loop: NRDOB) -> Finding:
    """Find whether FH stays inside the unit circle, and does not encircle −1."""
    part, size = loop.stability().observer_loop, float(np.abs(loop.FH(1j * OMEGA)).max())
    words = f"{npz_text(part)}; the largest |F·H| is {number(size, 4)}"
    return Finding(npz(part) == (0, 0, 0) and size < 1, words)


def response(loop: NRDOB, input: str) -> tuple[float, float]:
    """Give the least and the greatest value of y after a unit step, each looked at closely."""
    found = loop.step_response(input)
    times, y = found.time, found.outputs[0, 0]

    def closely(k: int) -> FloatArray:
        near = np.linspace(times[max(k - 1, 0)], times[min(k + 1, times.size - 1)], 201)
        return np.asarray(loop.step_response(input, near).outputs[0, 0])

    return float(closely(int(y.argmin())).min()), float(closely(int(y.argmax())).max())


def comes_to_rest(loop: NRDOB) -> bool:
    """Whether the four responses end at 1, 0, 0 and −1, by the maps at s = 0 and by simulation."""

    def at_the_end(input: str) -> float:
        late = 5 * loop.step_response(input).time[-1]
        return float(loop.step_response(input, [0.0, late]).outputs[0, 0, -1])

    return all(
        abs(getattr(loop, INPUTS[input].to_y).dc_gain - final) < 1e-9
        and abs(at_the_end(input) - final) < 1e-3
        for input, final in _FINAL.items()
    )


def steps(loop: NRDOB) -> Finding:
    """Find whether a loop is stable and its step responses end where they should."""
    peaks = ", ".join(
        f"{name.to_y.replace('delta', 'δ').replace('eta', 'η')} "
        f"{number(max(response(loop, input), key=abs), 4)}"
        for input, name in INPUTS.items()
    )
    finals = ", ".join(number(getattr(loop, name).dc_gain, 4) for name in TO_OUTPUT)
    verdict = loop.stability()
    stable = "stable" if verdict.stable else f"not known to be stable: {verdict.reason}"
    words = f"{stable}; final values {finals}; largest excursions {peaks}"
    return Finding(verdict.stable is True and comes_to_rest(loop), words)


# The checks that recur, by their kind.


def _controller(id: str, which: int) -> Finding:
    part = example(which).stability().model_loop
    rightmost = complex_number(part.rightmost)
    return Finding(part.stable is True, f"{npz_text(part)}; p_A rightmost {rightmost}")


KINDS: dict[str, Callable[..., Finding]] = {
    "margin": _margin,
    "controller": _controller,
    "map": lambda id, input, signal: printed_map(id.partition(".")[2]),
    "function": _function,
    "steps": lambda id, which, modified: steps(example(which, modified)),
    "no_turn": lambda id, which: no_turn(example(which)),
    "performance": lambda id, **known: performance(**known),
    "variation": lambda id, **known: variation(**known),
}


def _texts(name: str) -> dict[str, Any]:
    return tomllib.loads(files(__package__).joinpath(f"{name}.toml").read_text("utf-8"))


_METHODS = _texts("recurring")


def section(name: str) -> Section:
    """Read the texts of a part of the paper, name.toml, and enter the checks that recur in it."""
    texts = _texts(name)
    chapter = {"chapter": texts.pop("chapter")}  # of those that name none
    recurring = {id: text.pop("recurs") for id, text in texts.items() if "recurs" in text}
    for id, text in texts.items():
        if printed_as := text.pop("printed_as", recurring.get(id, {}).get("printed_as")):
            text.setdefault("place", PRINTED_FUNCTIONS[printed_as].place)
            text["printed"] = printed_text(printed_as)
    found = Section({id: chapter | text for id, text in texts.items()})
    for id, known in recurring.items():
        kind = known.pop("kind")
        said = _margin_texts(id) if kind == "margin" else {}
        if kind in _METHODS:
            said["method"] = _METHODS[kind].format(**known)
        found.check(id, **said)(partial(KINDS[kind], id, **known))
    return found


# The modified plant: how it differs, and what it costs.


def both(which: int) -> list[NRDOB]:
    """Give the loop of an example, and that with the modified plant."""
    return [example(which, modified) for modified in (False, True)]


MEASURES: dict[str, Callable[[NRDOB], float]] = {
    "zero": lambda loop: float(loop.G.numerator.roots[0].real),
    "DC gain": lambda loop: float(loop.G.dc_gain),
    "dead time": lambda loop: float(loop.delay),
}
"""What of the plant is modified."""


def variation(which: int, what: str, factor: float, unit: str = "", also: str = "") -> Finding:
    """Find whether the plant is modified by a factor on what is measured, and a pole at −10.

    What is `also` named of the measures stays as it is.
    """
    loops = both(which)
    before, after = map(MEASURES[what], loops)
    poles = [np.sort(np.roots(loop.G.denominator.q).real) for loop in loops]
    one_more = np.allclose(poles[1], [-10, *poles[0]], atol=1e-6)
    stays = [MEASURES[also](loop) for loop in loops] if also else [1.0, 1.0]
    return Finding(
        bool(np.isclose(after, factor * before)) and one_more and same(*stays),
        f"{what} {number(before, 4)} → {number(after, 4)}{unit}; poles "
        f"{', '.join(number(p, 4) for p in poles[1])}"
        + (f"; {also} still {number(stays[1], 4)}" if also else ""),
    )


def performance(which: int, times: float) -> Finding:
    """Find what the modified plant changes in the responses, and whether Ms grows so many times."""
    loops = both(which)
    tracking = [response(loop, "R")[1] for loop in loops]
    rejection = [response(loop, "d")[0] for loop in loops]
    peak = [loop.margins().plant_loop.ms for loop in loops]
    stable = all(loop.stability().stable and comes_to_rest(loop) for loop in loops)
    tracks = abs(tracking[1] / tracking[0] - 1) < 0.1
    rejects = abs(rejection[1] - rejection[0]) < 0.1 and peak[1] < 1.1 * peak[0]
    names = "Ms", "lowest value of the response to d", "peak of the response to R"
    compared = zip(names, (peak, rejection, tracking), strict=True)
    return Finding(
        stable and tracks and rejects,
        "; ".join(f"{name} {number(a, 4)} → {number(b, 4)}" for name, (a, b) in compared),
        "kept: within 10 %",
        conditions={
            "both loops are stable, and their responses end where they should": stable,
            "the response to the reference is maintained": tracks,
            f"Ms grows to more than {number(times)} times what it was": peak[1] > times * peak[0],
            "the response to d falls below −0.4": rejection[1] < -0.4,
        },
    )
