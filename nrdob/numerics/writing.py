"""Numbers as text: how a real and a complex one are written in a message, a table or alt text."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, isnan

import numpy as np

__all__ = ["number", "written"]


def number(value: float, digits: int = 3) -> str:
    """Write a number with so many significant digits, a true minus sign and no needless zeros.

    Parameters
    ----------
    value : float
    digits : int

    Examples
    --------
    >>> number(-0.73284), number(1234.5), number(46.82, 2), number(float("inf"))
    ('−0.733', '1230', '47', '∞')
    """
    if not isfinite(value):
        return "undefined" if isnan(value) else "∞" if value > 0 else "−∞"
    # A value such as 0.7325 must not fall to either side by the last bit: settle nine digits first.
    settled = float(f"{value:.8e}")
    if settled == 0:
        return "0"
    if 1e-4 <= abs(settled) < 1e6:
        text = np.format_float_positional(
            settled, precision=digits, unique=False, fractional=False, trim="-"
        )
    else:
        text = f"{settled:.{digits - 1}e}"
    return text.replace("-", "−")


def written(
    value: complex, write: Callable[[float], str] = "{:.4g}".format, *, pair: bool = False
) -> str:
    """Write a complex number; a real one without its imaginary part.

    Parameters
    ----------
    value : complex
    write : callable
        How its parts are written.
    pair : bool
        Write the number and its conjugate as one.

    Examples
    --------
    >>> written(-0.5 + 2j), written(10 + 0j), written(-0.5 + 2j, number, pair=True)
    ('-0.5 + 2j', '10', '−0.5 ± 2j')
    """
    if value.imag == 0:
        return write(value.real)
    size = write(abs(value.imag))
    if pair:
        return f"± {size}j" if value.real == 0 else f"{write(value.real)} ± {size}j"
    sign = write(value.imag).removesuffix(size) or "+"
    return f"{write(value.real)} {sign} {size}j"
