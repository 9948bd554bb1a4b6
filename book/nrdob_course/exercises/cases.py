"""What the problem sets share: plants and models, written in factors, and the verdict on p_B."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import control as ct
import numpy as np

from nrdob import NRDOB, judge_observer
from nrdob.diagram import undelayed
from nrdob.numerics import ComplexArray, FloatArray, number
from nrdob.plants import lags

from .problems import Lack

__all__ = [
    "POINTS", "LoopCase", "UnstablePlant", "alike", "all_pole", "around", "factored",
    "grid_peak", "mirrored", "mirrored_pair", "observer_stable", "on_the_right", "s",
]  # fmt: skip

s = ct.tf("s")


def on_the_right(*roots: Any) -> int:
    """Count roots with a positive real part, of one list or several."""
    return int(sum(np.sum(np.real(each) > 0) for each in roots))


def observer_stable(plant: Any, model: Any, filter: Any) -> bool | None:
    """Judge p_B in two ways; the controller does not occur in it."""
    return judge_observer(plant, model, filter).stable


def grid_peak(F: ComplexArray, R: ComplexArray, of_FH: bool = False) -> float:
    """Ms of L, or of FH, where F and R = G/Gm are known on a grid; true for a stable loop only."""
    return float(np.abs((1 if of_FH else 1 - F) / (1 + F * (R - 1))).max())


def all_pole(*poles: float, gain: float = 1.0) -> ct.TransferFunction:
    """Make lags given by their poles, in rad/s."""
    return lags(*(1 / pole for pole in poles), gain=gain)


def mirrored_pair(
    pole: float, decay: float, gain: float
) -> tuple[ct.TransferFunction, ct.TransferFunction]:
    """Give an unstable plant of gain -k at s = 0, and the model in which its pole is mirrored."""
    return lags(-1 / pole, 1 / decay, gain=-gain), lags(1 / pole, 1 / decay, gain=gain)


POINTS = np.array([0.3 + 0.2j, 0.7j, 1 + 2j, 5j, 3 + 9j, 20j, 40 + 10j, 90j])
"""Where functions of s are compared."""


def alike(first: Callable[[Any], Any], second: Callable[[Any], Any]) -> bool:
    """Tell whether two functions of s are the same."""
    return bool(np.allclose(first(POINTS), second(POINTS), rtol=1e-6, atol=0))


def around(lacks: Callable[[Any, NRDOB], str]) -> Callable[[Any, Any], str]:
    """Judge an answer as a loop around case.process: around that, whatever resembles it."""

    def found(case: Any, got: Any) -> str:
        if not isinstance(got, NRDOB):
            return Lack("type", "it is not an nrdob.NRDOB")
        if got.delay or not alike(got.G, case.process):
            return Lack("plant", "its plant is not case.process")
        # Another plant can have the same values at a few points.
        return lacks(case, replace(got, process=case.process))

    return found


@dataclass(frozen=True, eq=False)
class LoopCase:
    """A loop: its `process`, `model`, `controller` and `filter`."""

    loop: NRDOB


@dataclass(frozen=True, eq=False)
class UnstablePlant:
    """A plant gain/((s - pole)(s + decay))."""

    gain: float  # of either sign
    pole: float  # this and decay positive, in rad/s
    decay: float

    @property
    def process(self) -> ct.TransferFunction:
        """The plant made of these numbers."""
        return self.gain / ((s - self.pole) * (s + self.decay))

    def __repr__(self) -> str:
        return f"the plant {factored(self.process)}"


def mirrored(case: UnstablePlant) -> ct.TransferFunction:
    """Give the model that has the plant's pole in the left half plane."""
    return case.gain / ((s + case.pole) * (s + case.decay))


def factored(block: Any) -> str:
    """Write a transfer function, with or without dead time, in factors.

    Parameters
    ----------
    block : as for `nrdob.NRDOB`
        The transfer function.

    Examples
    --------
    >>> from nrdob import delay
    >>> factored(ct.tf([4], [-1, -1, 2]))
    '−4/((s − 1)(s + 2))'
    >>> factored(delay(0.5) * ct.tf([2, 2], [1, 2, 5, 0]))
    'exp(−0.5s) 2(s + 1)/(s(s² + 2s + 5))'
    """
    tf, dead_time = undelayed(block)
    num, den = tf.num_array[0, 0], tf.den_array[0, 0]
    late = f"exp(−{number(dead_time, 4)}s) " if dead_time else ""
    gain = number(num[0] / den[0], 4)
    above, below = "".join(_factors(num)), _factors(den)
    if above:
        gain = {"1": "", "−1": "−"}.get(gain, gain)
    under = "".join(below) if len(below) < 2 else f"({''.join(below)})"
    return late + gain + above + (f"/{under}" if under else "")


def _factors(polynomial: FloatArray) -> list[str]:
    """Write a factor for each real root and each pair of conjugate ones."""
    found, roots = [], np.roots(polynomial).astype(complex)
    for root in sorted(roots, key=lambda z: (round(abs(z), 9), z.real)):
        if abs(root.imag) <= 1e-6 * abs(root):
            found.append("s" if root == 0 else f"(s{_term(-root.real)})")
        elif root.imag > 0:
            found.append(f"(s²{_term(-2 * root.real, 's')}{_term(abs(root) ** 2)})")
    powers = {2: "²", 3: "³", 4: "⁴"}
    counts = {factor: found.count(factor) for factor in found}
    return [factor + powers.get(count, "") for factor, count in counts.items()]


def _term(value: float, unit: str = "") -> str:
    if abs(value) < 1e-12:
        return ""
    size = number(abs(value), 4)
    return f" {'−' if value < 0 else '+'} {'' if unit and size == '1' else size}{unit}"
