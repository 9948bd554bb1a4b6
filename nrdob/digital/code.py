r"""The controller as code: one C file with its header, one Python class.

Both are written from the numbers that the simulation runs (`nrdob.digital.sections`), and from the
equations of `nrdob.digital.controller`.

A block knows three verbs, `output(block, v)`, what comes out at an input v; `advance(block, v)`,
which renews its states; and `rest(block, v, w)`, which puts it at rest at v (giving w if it
integrates). The dead time of a model knows `late(v)`, `remember(v)` and `fill(v)`. First comes what
must be ready before u can be written, then what can be done while the actuator works.

In powers of z - 1 all coefficients keep the 7 digits of a `float`, however fast the sampling is.
Measured at 5000 samples in a lag, orders 1, 2 and 4: largest error of u 2e-6, 4e-6 and 7e-6 of its
largest value; that of F alone, as `float` sections in powers of z, is 3e-5, 1 and 0.9.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import isfinite, prod
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..diagram import real_number
from .actuatorlimits import ActuatorLimits, Rule, limited
from .controller import SampledController
from .sections import Section

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["ControllerCode", "equations", "tracking"]

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

TABLES = {"FILTER": "F", "INVERSE": "F/Gm", "INNER": "", "CONTROLLER": "C"}
"""How the diagram writes the block behind each table of coefficients; INNER is one of two."""


class Calls(NamedTuple):
    """How a language writes a signal, and the call of a verb of a block or of the dead time."""

    signal: str
    block: str
    delay: str


C_CALLS = Calls("s->", "{name}_{verb}({name}_{table}, s->{block}, {count}, ", "{name}_{verb}(s, ")
PYTHON_CALLS = Calls("self.", "self._{verb}({table}, self.{block}, ", "self._{verb}(")

DTYPES = {"double": "DBL_MAX", "float": "FLT_MAX"}  # types of C, and the largest number of each


@dataclass(frozen=True, eq=False)
class ControllerCode:
    """A sampled controller, ready to be written in any language.

    Attributes
    ----------
    controller : SampledController
    limits : ActuatorLimits
    tracking : float
        Share of u's limitation that is added to the error of C: back-calculation.
    """

    controller: SampledController
    limits: ActuatorLimits
    tracking: float = 0.0

    @property
    def rule(self) -> Rule:
        """How the actuator makes of a command what it applies."""
        return limited(self.limits, self.controller.dt)

    def to_c(self, name: str = "nrdob", dtype: str = "double") -> str:
        """Write one small C99 file: no allocation, limits and anti-windup inside.

        A sample that is not finite is left out: the last command is held, no state changes, and
        the state counts it as `skipped`.

        Parameters
        ----------
        name : str
            What the names in it begin with; what C does not allow in a name becomes "_".
        dtype : {"double", "float"}
            Type of all numbers.

        Returns
        -------
        str
            The file, with `name_init`, `name_start`, `name_output`, `name_update`, `name_step`. It
            begins with what `to_header` returns, so that it stands alone.

        Raises
        ------
        OverflowError
            If a coefficient is out of the range of `dtype`.

        Examples
        --------
        >>> from nrdob import paper
        >>> text = paper.example(1).sampled(0.01).code().to_c("heater")
        >>> "heater_real heater_output(heater_state *s, heater_real r, heater_real y);" in text
        True
        """
        return self._in_c("controller.c.j2", name, dtype)

    def to_header(self, name: str = "nrdob", dtype: str = "double") -> str:
        """Write the header of the C file, for those that call the controller.

        Parameters
        ----------
        name, dtype : as for `to_c`
        """
        return self._in_c("controller.h.j2", name, dtype)

    def _in_c(self, template: str, name: str, dtype: str) -> str:
        if dtype not in DTYPES:
            raise ValueError(f"dtype is {dtype!r}; choose one of {', '.join(DTYPES)}")
        number = repr if dtype == "double" else _float
        return self._written(template, name, number, C_CALLS, dtype=dtype, largest=DTYPES[dtype])

    def to_python(self, name: str = "Controller") -> str:
        """Write one Python class, with `start`, `output`, `update` and `step`, that stands alone.

        Parameters
        ----------
        name : str
            Of the class; what Python does not allow in a name becomes "_".
        """
        return self._written("controller.py.j2", name, repr, PYTHON_CALLS)

    def _cascade(self, table: str) -> tuple[Section, ...]:
        return self.controller.sections[TABLES[table] or self.controller.inner]

    def _written(
        self, template: str, name: str, number: Callable[[float], str], calls: Calls, **more: str
    ) -> str:
        name = _identifier(name)
        # The factor of u[k] is divided out here: the processor has nothing left to divide by.
        constants = {"RECIPROCAL": 1 / self.controller.factor, "TRACKING": self.tracking}

        def call(verb: str, block: str) -> str:
            if not block:
                return calls.delay.format(name=name, verb=verb)
            table, verb = BLOCKS[block], "through" if verb == "output" else verb
            count = len(self._cascade(table))
            return calls.block.format(name=name, verb=verb, table=table, block=block, count=count)

        def line(row: str) -> tuple[str, str]:
            target, _, text = row.rpartition(" = ")
            text = re.sub(rf"\b({'|'.join(SIGNALS)})\b", lambda f: calls.signal + f[1], text)
            text = re.sub(r"\b(output|advance|rest)\((\w+), ", lambda f: call(f[1], f[2]), text)
            text = re.sub(r"\b(late|remember|fill)\(", lambda f: call(f[1], ""), text)
            text = re.sub("|".join(constants), lambda f: number(constants[f[0]]), text)
            return calls.signal + target if target in SIGNALS else target, text

        dt, delay, limits = self.controller.dt, self.controller.delay, self.limits
        bounds = {"low": limits.low, "high": limits.high, "change": limits.rate * dt}
        tables = {
            table: {"rows": self._cascade(table), "meaning": block or self.controller.inner}
            for table, block in TABLES.items()
        }
        parts = equations(delayed=bool(delay)).items()
        return _environment().get_template(template).render(
            name=name, dt=repr(dt), number=number, blocks=BLOCKS, signals=SIGNALS, tables=tables,
            equations={part: [line(row) for row in rows] for part, rows in parts}, delay=delay,
            integrates=any(section.integrates for section in self._cascade("CONTROLLER")),
            **{key: float(value) if isfinite(value) else None for key, value in bounds.items()},
            **more,
        )  # fmt: skip


def tracking(controller: SampledController, time: float) -> float:
    """Share of u's limitation that C needs as an error, for its integrator to follow in time."""
    time = real_number(time, "tracking_time", "give seconds as a number")
    *others, last = controller.sections["C"]
    if not last.integrates or any(section.integrates for section in others):
        raise ValueError(
            "tracking_time is for a controller with one integrator, and this one has "
            f"{'two' if last.integrates else 'none'}: leave it out"
        )
    shortest = controller.dt / abs(controller.factor)
    if not (isfinite(time) and time >= shortest):
        raise ValueError(
            f"tracking_time is {time:g} s; it must be finite and at least {shortest:.6g} s here, "
            "or the integrator would overshoot at every sample"
        )
    slope = last.b2 / last.a1 if last.order == 2 else last.b1
    share = controller.dt / time / (slope * prod(section.rest for section in others))
    A, B, C, _ = controller.blocks["C"]
    # While the actuator stays at its limit; with z - 1 for eigenvalues: beside 1 digits are lost.
    moved = A - np.eye(B.size) - share / controller.factor * np.outer(B, C)
    if (size := float(np.abs(1 + np.linalg.eigvals(moved)).max())) >= 1:
        raise ValueError(
            f"tracking_time is {time:g} s; with it C would become unstable while u is limited "
            f"(a root z of modulus {size:.4g}), since it has more than an integrator: choose a "
            "longer one, or leave it out"
        )
    return share


@cache
def _environment() -> Environment:
    # Loaded only where code is written.
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader("nrdob.digital"),
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,
    )


def _float(value: float) -> str:
    """Write a number of seven digits in C."""
    with np.errstate(over="ignore"):
        short = np.float32(value)
    if not np.isfinite(short) or (short == 0 and value != 0):
        raise OverflowError(
            f"the coefficient {value:.3g} is out of the range of float: use dtype='double'"
        )
    return f"{float(short)!r}f"


def _identifier(name: str) -> str:
    if not isinstance(name, str) or not re.search(r"[A-Za-z]", name):
        raise ValueError(f"name is {name!r}; give a word to name the code by")
    allowed = re.sub(r"\W", "_", name, flags=re.ASCII).lstrip("_0123456789")
    return f"{allowed}_" if keyword.iskeyword(allowed) else allowed


def equations(*, delayed: bool) -> dict[str, tuple[str, ...]]:
    """Lay out "output" from r and y, "update" from applied, and "start" from r, y and u.

    In expressions that C and Python share; where there is no target only states are renewed.
    """
    late, inner = ("late({})", "{} - filtered") if delayed else ("{}", "{}")
    remember, fill = (["remember(applied)"], ["fill(u)"]) if delayed else ([], [])
    return {
        "output": (
            "y_filtered = output(filter_y, y)",
            "from_y = output(inverse, y)",
            f"filtered = output(filter_u, {late.format(0)})",
            f"e = r - y_filtered - output(inner, {inner.format(0)})",
            "u = (output(controller, e) + filtered - from_y) * RECIPROCAL",
        ),
        "update": (
            f"late_u = {late.format('applied')}",
            "filtered = output(filter_u, late_u)",
            f"inner_u = {inner.format('applied')}",
            "e = r - y_filtered - output(inner, inner_u)",
            "d_hat = from_y - filtered",
            "advance(filter_y, y)",
            "advance(inverse, y)",
            "advance(filter_u, late_u)",
            "advance(inner, inner_u)",
            "advance(controller, e + TRACKING * (applied - u))",
            *remember,
        ),
        "start": (
            *fill,
            "rest(filter_y, y, y)",
            "rest(inverse, y, 0)",
            "rest(filter_u, u, u)",
            "y_filtered = output(filter_y, y)",
            "from_y = output(inverse, y)",
            "filtered = output(filter_u, u)",
            "d_hat = from_y - filtered",
            f"inner_u = {inner.format('u')}",
            "rest(inner, inner_u, 0)",
            "e = r - y_filtered - output(inner, inner_u)",
            "rest(controller, e, u + d_hat)",
        ),
    }
