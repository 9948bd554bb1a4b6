"""Blocks, intervals and kinds of processes in the words of a report."""

from __future__ import annotations

from collections.abc import Iterable
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from math import inf
from typing import Any

import numpy as np

from ..diagram import LowPassFilter, as_fraction, undelayed
from ..numerics import FloatArray, number, written

__all__ = ["character", "formula", "intervals", "roots_listed"]

MOST_ROOTS = 12
# Imaginary part, against the size, that three digits do not show: a multiple root, split.
FLAT = 5e-4
AXIS = 1e-9  # real part of a zero, against its size, at which it is on the imaginary axis
SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def formula(block: Any) -> str:
    """Write a block as a line: (2 s + 1)/(s² + 3 s + 2) · e^(−0.3 s).

    Parameters
    ----------
    block : as for `nrdob.NRDOB`
        A process, model, controller or filter.

    Examples
    --------
    >>> formula(([2.0], [1.0, 3.0, -2.0]))
    '2/(s² + 3 s − 2)'
    """
    if isinstance(block, LowPassFilter):
        power = str(block.order).translate(SUPERSCRIPTS) if block.order > 1 else ""
        return f"1/({number(block.time_constant, 4)} s + 1){power}"
    prompt, delay = undelayed(block)
    num, den = as_fraction(prompt, "block", proper=False)
    top, bottom = _polynomial(num), _polynomial(den)
    below = f"({bottom})" if "·" in bottom else _bracketed(bottom)
    text = top if den.size == 1 and den[0] == 1 else f"{_bracketed(top)}/{below}"
    return f"{text} · e^(−{number(delay, 4)} s)" if delay else text


def intervals(found: Iterable[tuple[float, float]]) -> str:
    """Write intervals of time constants, such as "λ > 0.375 s", rounded inwards.

    Parameters
    ----------
    found : iterable of (low, high)
        As `nrdob.stabilizing_time_constants` gives them, in seconds.
    """
    said = (
        f"{_inwards(low, ROUND_CEILING)} s < λ < {_inwards(high, ROUND_FLOOR)} s" if high < inf
        else f"λ > {_inwards(low, ROUND_CEILING)} s" if low else "every λ > 0"
        for low, high in found
    )  # fmt: skip
    return " or ".join(said) or "no λ at all"


def _inwards(end: float, rounding: str) -> str:
    """Write the end of an interval with four digits, none of them outside."""
    exact = Context(prec=10).create_decimal(end)  # one off by rounding alone is not moved further
    return number(float(Context(prec=4, rounding=rounding).plus(exact)), 4)


def roots_listed(roots: Any) -> str:
    """Write roots, a pair as one, rightmost first."""
    flat = (complex(r.real) if abs(r.imag) <= FLAT * abs(r) else r for r in map(complex, roots))
    upper = [root for root in sorted(flat, key=lambda root: -root.real) if root.imag >= 0]
    more = len(upper) - MOST_ROOTS
    said = [written(root, number, pair=True) for root in upper[:MOST_ROOTS]]
    return ", ".join(said) + (f", and {more} more further left" if more > 0 else "") or "none"


def character(process: Any) -> list[str]:
    """Say what makes a process easy or hard, in at least one sentence.

    Parameters
    ----------
    process : as for `nrdob.NRDOB`
        The process G.
    """
    prompt, delay = undelayed(process)
    num, den = as_fraction(prompt, "process")
    zeros, poles = np.roots(num), np.roots(den)
    said = []
    origin = int(np.sum(np.abs(poles) == 0))
    if origin:
        kind = {1: "an integrator", 2: "a double integrator"}.get(origin, f"{origin} integrators")
        said.append(f"It holds {kind}: a constant input makes the output run away.")
    unstable = poles[poles.real > 0]
    if unstable.size:
        said.append(f"It is unstable: poles at {roots_listed(unstable)} rad/s.")
    damped = [p for p in poles if p.imag > 0 and p.real <= 0 and -p.real < 0.3 * abs(p)]
    for p in damped[:3]:
        frequency, ratio = number(abs(p)), number(-p.real / abs(p))
        said.append(f"It resonates at {frequency} rad/s with a damping ratio of {ratio}.")
    on_axis = np.abs(zeros.real) <= AXIS * np.abs(zeros)
    wrong, still = zeros[(zeros.real > 0) & ~on_axis], zeros[on_axis & (zeros.imag > 0)]
    if wrong.size:
        said.append(
            f"It has zeros in the right half plane, at {roots_listed(wrong)} rad/s, "
            "which no causal and stable block can undo."
        )
    if still.size:
        said.append(
            f"It has zeros on the imaginary axis, at {roots_listed(still)} rad/s, where the input "
            "does not reach the output: its inverse would not come to rest."
        )
    if num[-1] == 0:
        said.append("It has a zero at s = 0: at rest the input does not reach the output.")
    slow = [1 / abs(p) for p in poles if abs(p) > 0 and p.real < 0]
    if delay:
        beside = f", {number(delay / max(slow))} times its slowest lag" if slow else ""
        said.append(f"It has a dead time of {number(delay)} s{beside}.")
    if den.size == 1 and not delay:
        said.append("It is a pure gain, with no dynamics at all.")
    elif num.size == den.size:
        said.append("It lets the input through at once (as many zeros as poles).")
    if den.size > 5:
        said.append(f"It is of order {den.size - 1}.")
    return said or ["It is stable, without dead time, and its inverse is stable: nothing is hard."]


def _polynomial(coefficients: FloatArray) -> str:
    degree = coefficients.size - 1
    text = ""
    for power, value in zip(range(degree, -1, -1), coefficients.tolist(), strict=True):
        if value == 0:
            continue
        s = {0: "", 1: "s"}.get(power, f"s{str(power).translate(SUPERSCRIPTS)}")
        size = number(abs(value), 4)
        between = "·" if "e" in size else " "
        term = size if not s else s if size == "1" else f"{size}{between}{s}"
        sign = "−" if value < 0 else "+"
        text = f"{text} {sign} {term}" if text else f"{sign}{term}".removeprefix("+")
    return text or "0"


def _bracketed(text: str) -> str:
    return f"({text})" if " " in text else text
