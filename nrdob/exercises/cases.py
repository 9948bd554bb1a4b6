"""What the problem sets share: draw a case that fits, and write a block in factors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from ..alttext import number
from ..blocks import FloatArray
from ..delay import DelayedTransferFunction

T = TypeVar("T")

TRIES = 2000


def first_fitting(draw: Callable[[], T], fits: Callable[[T], bool], tries: int = TRIES) -> T:
    """Draw until a case fits.

    Raises
    ------
    RuntimeError
        If none does, so that a generator that has become too strict says so.

    Examples
    --------
    >>> numbers = iter(range(10))
    >>> first_fitting(lambda: next(numbers), lambda n: n > 3)
    4
    """
    for _ in range(tries):
        case = draw()
        if fits(case):
            return case
    raise RuntimeError(f"none of {tries} cases drawn fits")


def apart(*values: Any, by: float = 0.02) -> bool:
    """Tell whether numbers, or tuples of numbers, differ from one another by more than a share.

    Examples
    --------
    >>> apart(1.0, 1.5, -1.0), apart((1, 2), (1, 3)), apart(1.0, 1.01)
    (True, True, False)
    """
    for k, a in enumerate(values):
        for b in values[:k]:
            first, second = np.atleast_1d(a).astype(float), np.atleast_1d(b).astype(float)
            scale = np.maximum(np.abs(first), np.abs(second))
            if not np.any(np.abs(first - second) > by * scale):
                return False
    return True


def factored(block: Any) -> str:
    """Write a transfer function, with or without dead time, in factors.

    Examples
    --------
    >>> import control as ct
    >>> factored(ct.tf([4], [-1, -1, 2]))
    '−4/((s − 1)(s + 2))'
    >>> factored(DelayedTransferFunction(ct.tf([2, 2], [1, 2, 5, 0]), 0.5))
    'exp(−0.5s) 2(s + 1)/(s(s² + 2s + 5))'
    """
    late = f"exp(−{number(block.delay, 4)}s) " if isinstance(block, DelayedTransferFunction) else ""
    tf = block.tf if isinstance(block, DelayedTransferFunction) else block
    num, den = tf.num_array[0, 0], tf.den_array[0, 0]
    gain = number(num[0] / den[0], 4)
    above, below = (_factors(polynomial) for polynomial in (num, den))
    if above:
        gain = {"1": "", "−1": "−"}.get(gain, gain)
    text = gain + "".join(above)
    if below:
        one = len(below) == 1
        text += f"/{below[0]}" if one else f"/({''.join(below)})"
    return late + text


def _factors(polynomial: FloatArray) -> list[str]:
    """Write a factor for each real root and each pair of conjugate ones."""
    found = []
    for root in sorted(
        np.roots(polynomial).astype(complex), key=lambda z: (round(abs(z), 9), z.real)
    ):
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
