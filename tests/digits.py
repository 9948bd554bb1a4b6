"""Numbers that say more than floating-point arithmetic knows, in whatever is printed."""

from __future__ import annotations

import re

DECIMAL = re.compile(r"(?<![\w.])[-+\N{MINUS SIGN}]?(\d+\.\d*)(?:e([-+]?\d+))?")
MOST_DIGITS = 8
SMALLEST = 1e-13
"""What is smaller, and not 0, is what rounding left over."""


def hanging_on_rounding(text: str) -> list[str]:
    """Find the numbers whose printed form another processor may change.

    Those are numbers of nine and more significant digits, residues of rounding, and zeros with
    the sign of one. Integers are counts, and exact.
    """
    found = []
    for match in DECIMAL.finditer(text):
        mantissa, exponent = match.group(1), int(match.group(2) or 0)
        digits = mantissa.replace(".", "").lstrip("0")
        value = float(mantissa) * 10.0**exponent
        negative_zero = value == 0 and match.group()[0] in "-\N{MINUS SIGN}"
        if len(digits) > MOST_DIGITS or 0 < value < SMALLEST or negative_zero:
            found.append(match.group())
    return found
