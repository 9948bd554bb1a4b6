r"""The equations of the controller, once: what is generated in any language comes from here.

They are those of `nrdob.digital.controller`, written over the blocks of the diagram. A block knows
three verbs, `output(block, v)`, what comes out at an input v; `advance(block, v)`, which renews its
states; and `rest(block, v, w)`, which puts it at rest at v (giving w if it integrates). The dead
time of a model knows `late(v)`, `remember(v)` and `fill(v)`. First comes what must be
ready before u can be written, then what can be done while the actuator works.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

__all__ = ["BLOCKS", "SIGNALS", "Row", "equations", "rendered"]

BLOCKS = {
    "filter_y": "FILTER",
    "filter_u": "FILTER",
    "inverse": "INVERSE",
    "inner": "INNER",
    "controller": "CONTROLLER",
}
"""What has states, and whose coefficients it works with: F has two copies."""

SIGNALS = {
    "r": "reference",
    "y": "measurement",
    "y_filtered": "measurement, its noise reduced",
    "from_y": "input that would explain the measurement, filtered",
    "u": "command, before any limit",
    "applied": "what the actuator did",
    "d_hat": "estimate of the disturbance at the input",
}
"""What is kept from one call to the next."""


class Row(NamedTuple):
    """One equation: an expression that C and Python share, and its target.

    That is the signal on the left; empty where only states are renewed.
    """

    target: str
    expression: str


def equations(*, delayed: bool) -> dict[str, tuple[Row, ...]]:
    """Lay out "output" from r and y, "update" from applied, and "start" from r, y and u.

    Examples
    --------
    >>> for row in equations(delayed=False)["output"]:
    ...     print(row.target, "=", row.expression)
    y_filtered = output(filter_y, y)
    from_y = output(inverse, y)
    filtered = output(filter_u, 0)
    e = r - y_filtered - output(inner, 0)
    u = (output(controller, e) + filtered - from_y) * RECIPROCAL
    """
    if delayed:
        late, inner = "late({})", "{} - filtered"
        remember, fill = [Row("", "remember(applied)")], [Row("", "fill(u)")]
    else:
        late = inner = "{}"
        remember, fill = [], []
    nothing = inner.format(0) if delayed else "0"
    return {
        "output": (
            Row("y_filtered", "output(filter_y, y)"),
            Row("from_y", "output(inverse, y)"),
            Row("filtered", f"output(filter_u, {late.format(0)})"),
            Row("e", f"r - y_filtered - output(inner, {nothing})"),
            Row("u", "(output(controller, e) + filtered - from_y) * RECIPROCAL"),
        ),
        "update": (
            Row("late_u", late.format("applied")),
            Row("filtered", "output(filter_u, late_u)"),
            Row("inner_u", inner.format("applied")),
            Row("e", "r - y_filtered - output(inner, inner_u)"),
            Row("d_hat", "from_y - filtered"),
            Row("", "advance(filter_y, y)"),
            Row("", "advance(inverse, y)"),
            Row("", "advance(filter_u, late_u)"),
            Row("", "advance(inner, inner_u)"),
            Row("", "advance(controller, e + TRACKING * (applied - u))"),
            *remember,
        ),
        "start": (
            *fill,
            Row("", "rest(filter_y, y, y)"),
            Row("", "rest(inverse, y, 0)"),
            Row("", "rest(filter_u, u, u)"),
            Row("y_filtered", "output(filter_y, y)"),
            Row("from_y", "output(inverse, y)"),
            Row("filtered", "output(filter_u, u)"),
            Row("d_hat", "from_y - filtered"),
            Row("inner_u", inner.format("u")),
            Row("", "rest(inner, inner_u, 0)"),
            Row("e", "r - y_filtered - output(inner, inner_u)"),
            Row("", "rest(controller, e, u + d_hat)"),
        ),
    }


def rendered(
    row: Row, signal: Callable[[str], str], verb: Callable[[str, str], str]
) -> tuple[str, str]:
    """Write both sides of one equation in a language.

    `signal` writes a signal that is kept, `verb` the beginning of a call, from the verb and the
    block; from the verb and "" for the dead time.
    """
    text = re.sub(rf"\b({'|'.join(SIGNALS)})\b", lambda f: signal(f[1]), row.expression)
    text = re.sub(r"\b(output|advance|rest)\((\w+), ", lambda f: verb(f[1], f[2]), text)
    text = re.sub(r"\b(late|remember|fill)\(", lambda f: verb(f[1], ""), text)
    return signal(row.target) if row.target in SIGNALS else row.target, text
