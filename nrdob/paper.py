"""The paper's four examples, their modified plants, and every number it prints about them.

Liceaga-Castro, J. U., I. I. Siller-Alcalá, E. Liceaga-Castro, Noise reduction disturbance observer
global stability and robustness conditions based on the Nyquist stability criteria, 2020.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import control as ct
import numpy as np

from .diagram import LowPassFilter, Quotient, delay
from .loop import NRDOB

__all__ = ["EXAMPLES", "PRINTED", "PRINTED_FUNCTIONS", "Printed", "PrintedFunction", "example"]

EXAMPLES = (1, 2, 3, 4)
"""Matched, non-minimum phase, unstable, time delay."""


@dataclass(frozen=True)
class Printed:
    """A value as the paper prints it.

    Attributes
    ----------
    value, unit : float, str
        The number, inf where the paper writes a margin "tends to infinity", in "deg" or "dB".
    digits, place : int, str
        Decimals printed, half of the last of which is the tolerance, and where it stands.

    Examples
    --------
    >>> PRINTED["ex3.FH.pm"].agrees_with(65.13)
    True
    """

    value: float
    unit: str
    digits: int
    place: str

    def agrees_with(self, computed: float) -> bool:
        """Tell whether a computed value rounds to the printed one.

        Parameters
        ----------
        computed : float
            A value in the same unit.

        Returns
        -------
        bool
            True within half a unit of the last printed digit.
        """
        if self.value == inf:
            return computed == inf
        # A computed 50.65 may be printed 50.6 or 50.7: allow the rounding of the last digit.
        return abs(computed - self.value) <= 0.5 * 10.0**-self.digits * (1 + 1e-9)


PRINTED: dict[str, Printed] = {
    "ex1.CGm.pm": Printed(50.6, "deg", 1, "Example 1, text"),
    "ex1.CGm.gm": Printed(inf, "dB", 0, "Example 1, text"),
    "ex2.CGm.pm": Printed(90.0, "deg", 0, "Example 2, text and Fig. 4"),
    "ex2.CGm.gm": Printed(inf, "dB", 0, "Example 2, text and Fig. 4"),
    "ex2.FH.pm": Printed(inf, "deg", 0, "Example 2, text and Fig. 6"),
    "ex2.FH.gm": Printed(14.0, "dB", 0, "Example 2, text and Fig. 6"),
    "ex3.CGm.pm": Printed(54.0, "deg", 0, "Example 3, text and Fig. 9"),
    "ex3.CGm.gm": Printed(inf, "dB", 0, "Example 3, text and Fig. 9"),
    "ex3.FH.pm": Printed(65.1, "deg", 1, "Example 3, text and Fig. 12"),
    "ex3.FH.gm": Printed(-14.0, "dB", 0, "Example 3, text and Fig. 12"),
    "ex4.FH.pm": Printed(inf, "deg", 0, "Example 4, text and Fig. 16"),
    "ex4.FH.gm": Printed(14.01, "dB", 2, "Example 4, text and Fig. 16"),
    "ex4.CGm.pm": Printed(68.2, "deg", 1, "Example 4, text and Fig. 17"),
    "ex4.CGm.gm": Printed(inf, "dB", 0, "Example 4, text and Fig. 17"),
}
"""Printed margins by claim id: example, loop, margin.

:meta hide-value:
"""


@dataclass(frozen=True)
class PrintedFunction:
    """A transfer function as the paper prints it.

    Attributes
    ----------
    num, den, delay : tuple of float, tuple of float, float
        Coefficients in descending powers of s, and dead time in seconds.
    place : str
        Where in the paper it stands.

    Examples
    --------
    >>> PRINTED_FUNCTIONS["ex3.ratio"].agrees_with(example(3).ratio)
    True
    """

    num: tuple[float, ...]
    den: tuple[float, ...]
    delay: float
    place: str

    def agrees_with(self, computed: Quotient) -> bool:
        """Tell whether a computed map has the printed values on a grid of the right half plane.

        Parameters
        ----------
        computed : Quotient
            A map of the loop.

        Returns
        -------
        bool
            True if all values agree to ten digits.
        """
        s = np.add.outer(np.linspace(0.3, 30, 7), 1j * np.linspace(0, 200, 9)).ravel()
        printed = np.polyval(self.num, s) / np.polyval(self.den, s) * np.exp(-self.delay * s)
        return bool(np.allclose(computed(s), printed, rtol=1e-10, atol=0))


PRINTED_FUNCTIONS: dict[str, PrintedFunction] = {
    "ex2.ratio": PrintedFunction((-0.01, 1.0), (1.0,), 0.0, "eq. (9)"),
    "ex2.H": PrintedFunction((-0.01, 0.0), (1.0,), 0.0, "Example 2, below eq. (9)"),
    "ex3.ratio": PrintedFunction((4.0, 4.0), (1.0, -1.0), 0.0, "eq. (13)"),
    "ex3.H": PrintedFunction((-3.0, -5.0), (1.0, -1.0), 0.0, "eq. (14)"),
    "ex4.ratio": PrintedFunction(
        (1.0, 4.0, 3.75), (1.0, 4.0, 4.0), 0.05, "Example 4, above Fig. 15"
    ),
}
"""Printed transfer functions by claim id: example, map.

:meta hide-value:
"""


def example(number: int, modified: bool = False) -> NRDOB:
    """Build one of the paper's loops.

    Parameters
    ----------
    number, modified : int, bool
        1 matched, 2 non-minimum phase, 3 unstable, 4 time delay; with the modified plant of the
        robustness test or not.

    Returns
    -------
    NRDOB
        The loop, with the blocks that the paper prints.

    Raises
    ------
    ValueError
        For an example that the paper does not contain; Example 1 has no modified plant.

    Examples
    --------
    >>> example(3).filter
    LowPassFilter(time_constant=0.05, order=2)
    >>> example(4, modified=True).delay
    0.1
    """
    if number not in EXAMPLES:
        raise ValueError(f"there is no Example {number}; the paper has 1, 2, 3 and 4")
    if number == 1 and modified:
        raise ValueError("Example 1 has no modified plant; choose 2, 3 or 4")
    s = ct.tf("s")
    G: Any
    # Only the blocks that are asked for: operations on transfer functions are slow.
    if number == 1:
        G = (2 * s + 10) / (s**2 + 11 * s + 10)
        Gm, C, F = G, 1.39 / s, LowPassFilter(0.01, 2)
    elif number == 2:
        G = 0.1 * (-s + 100) / (s + 2)
        if modified:
            G = 0.125 * (-s + 80) / ((s + 2) * (0.1 * s + 1))
        Gm, C, F = 10 / (s + 2), (0.5 * s + 1) / s, LowPassFilter(0.025, 2)
    elif number == 3:
        G = 4 / (-(s**2) - s + 2)
        if modified:
            G = 2 / ((-(s**2) - s + 2) * (0.1 * s + 1))
        Gm, C, F = -1 / (s**2 + 3 * s + 2), -1.8 * (0.5 * s + 1) / s, LowPassFilter(0.05, 2)
    else:
        G = delay(0.05) / (s + 2) ** 2
        if modified:
            G = delay(0.1) / ((s + 2) ** 2 * (0.1 * s + 1))
        Gm, C, F = 1 / ((s + 1.5) * (s + 2.5)), 2.7 * (s + 1.5) / s, LowPassFilter(0.09, 3)
    return NRDOB(process=G, model=Gm, controller=C, filter=F)
