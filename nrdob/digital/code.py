r"""The controller as code: coefficients in JSON, one C file with its header, one Python class.

All three are written from the same numbers (`nrdob.digital.sections`) and the same equations
(`nrdob.digital.equations`); the simulation runs the same sections, too. So what has been simulated
is what runs on the processor, up to rounding.

.. rubric:: What float costs

A `float` has 7 digits. In powers of z they are used up where the sampling is fast: a filter of the
order n whose lag takes N samples needs them to tell :math:`N^{-n}` from 0. Here all coefficients
are in powers of z - 1 and keep their 7 digits; what remains is that a sum does not notice what is
below its last digit. Measured on matched lags of orders 1, 2 and 4 under a reference that jumps and
a wavy disturbance, largest error of u in `float` against its largest value, and that of F alone as
`float` sections in powers of z:

=================  ==================  ======================
samples in a lag   u, orders 1, 2, 4   F in powers of z
=================  ==================  ======================
5                  1e-7, 2e-7, 2e-7    1e-7, 3e-7, 7e-7
50                 3e-7, 4e-7, 7e-7    4e-7, 9e-5, 1e-5
500                7e-7, 2e-6, 2e-6    3e-6, 1e-3, 2e-2
5000               2e-6, 4e-6, 7e-6    3e-5, 1, 0.9
=================  ==================  ======================

"""

from __future__ import annotations

import json
import keyword
import re
from collections.abc import Callable, Mapping
from dataclasses import astuple, dataclass, replace
from functools import cache, cached_property
from math import inf, isfinite, prod
from typing import TYPE_CHECKING, Any

import numpy as np

from ..diagram import Fraction, real_number
from ..numerics import FloatArray
from .controller import SampledBlock, SampledController, Wait, wired
from .equations import BLOCKS, SIGNALS, Row, equations, rendered
from .limits import Limits
from .sections import Section, at_rest, bilinear_sections, second_order_sections, state_space

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["ControllerCode", "controller_code"]

FORMAT = "nrdob controller 1"
"""What the JSON says it is."""

TABLES = {"FILTER": "F", "INVERSE": "F/Gm", "INNER": "", "CONTROLLER": "C"}
"""How the diagram writes the block behind each table of coefficients; INNER is one of two."""

DTYPES = {"double": "DBL_MAX", "float": "FLT_MAX"}
"""Types of C, and the largest number of each."""

LONGEST_WAIT = 1_000_000
"""Samples of dead time at most in what is read: each is a number to be kept."""

Sections = tuple[Section, ...]


@dataclass(frozen=True, eq=False)
class ControllerCode:
    """A sampled controller, ready to be written in any language.

    Attributes
    ----------
    dt : float
        Sampling time in seconds.
    blocks : dict of str: tuple of Section
        "C", "F", "F/Gm" and "(1-F)Gm", or "Gm" for a model that waits.
    wait : Wait
        Dead time of the model.
    tracking : float
        What the error of C gets of each unit by which u was limited: back-calculation.
    limits : Limits
        Of the actuator.
    """

    dt: float
    blocks: Mapping[str, Sections]
    wait: Wait
    tracking: float
    limits: Limits

    @cached_property
    def wired(self) -> SampledController:
        """The same as one state space, in the states that the code has."""
        blocks = {
            name: SampledBlock(name, *state_space(cascade)) for name, cascade in self.blocks.items()
        }
        return wired(blocks, self.wait, self.dt)

    @property
    def inner(self) -> str:
        """Name of the block between u and yf."""
        return next(name for name in self.blocks if name not in TABLES.values())

    @property
    def waited(self) -> list[tuple[float, int]]:
        """The dead time of the model as weights of u and their ages in samples; empty if none."""
        terms = [(1 - self.wait.fraction, self.wait.samples)]
        if self.wait.fraction:
            terms.append((self.wait.fraction, self.wait.samples + 1))
        return terms if self.wait else []

    def start(self, r: float, y: float, u: float) -> FloatArray:
        """States of `wired` that take over from a constant u, y being at rest.

        Parameters
        ----------
        r, y, u : float
            Reference, measurement, and the constant u.

        Returns
        -------
        (n,) array of float
            The states. If C integrates, the first output is u. Otherwise it is u only where r, y
            and u are a state of rest of the loop; elsewhere C answers to the error at once.
        """
        F, inverse, C = (self.blocks[name] for name in ("F", "F/Gm", "C"))
        states = {name: at_rest(F, v, v) for name, v in (("F u", u), ("F y", y))}
        states["F/Gm"] = at_rest(inverse, y, 0.0)
        filtered = _output(F, states["F u"], u)
        d_hat = _output(inverse, states["F/Gm"], y) - filtered
        inner_u = u - filtered if self.wait else u
        inner = self.blocks[self.inner]
        states[self.inner] = at_rest(inner, inner_u, 0.0)
        e = r - _output(F, states["F y"], y) - _output(inner, states[self.inner], inner_u)
        states["C"] = at_rest(C, e, u + d_hat)
        states["wait"] = np.full(self.wait.memory, u)
        found = np.zeros(self.wired.states)
        for name, rows in self.wired.rows.items():
            found[rows] = states[name]
        return found

    def to_c(self, name: str = "nrdob", dtype: str = "double") -> str:
        """Write one small C99 file: no allocation, limits and anti-windup inside.

        A sample that is not finite is left out: the last command is held, no state changes, and
        the state counts it as `skipped`. So it is in the class that `to_python` writes.

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
        ValueError
            If nothing is left of the name, or the type is another one.
        OverflowError
            If a coefficient is out of the range of `dtype`.

        Examples
        --------
        >>> from nrdob import paper
        >>> from nrdob.digital import Limits
        >>> text = paper.example(1).sampled(0.01).to_c("heater", limits=Limits(0, 10))
        >>> "heater_real heater_output(heater_state *s, heater_real r, heater_real y);" in text
        True
        """
        return self._in_c("controller.c.j2", name, dtype)

    def to_header(self, name: str = "nrdob", dtype: str = "double") -> str:
        """Write the header of the C file, for those that call the controller.

        Parameters
        ----------
        name, dtype : as for `to_c`
            The same as there.
        """
        return self._in_c("controller.h.j2", name, dtype)

    def _in_c(self, template: str, name: str, dtype: str) -> str:
        if dtype not in DTYPES:
            raise ValueError(f"dtype is {dtype!r}; choose one of {', '.join(DTYPES)}")
        prefix = _identifier(name)

        def call(verb: str, block: str) -> str:
            if not block:
                return f"{prefix}_{verb}(s, "
            table, verb = BLOCKS[block], "through" if verb == "output" else verb
            return f"{prefix}_{verb}({prefix}_{table}, s->{block}, {len(self._cascade(table))}, "

        return self._written(template, prefix, _c_number(dtype), "s->{}".format, call,
                             dtype=dtype, largest=DTYPES[dtype])  # fmt: skip

    def to_python(self, name: str = "Controller") -> str:
        """Write one Python class that needs nothing else, not even this package.

        Parameters
        ----------
        name : str
            Name of the class; what Python does not allow in a name becomes "_".

        Returns
        -------
        str
            The module, with methods `start`, `output`, `update` and `step`.

        Examples
        --------
        >>> from nrdob import paper
        >>> "class Heater:" in paper.example(1).sampled(0.01).to_python("Heater")
        True
        """

        def call(verb: str, block: str) -> str:
            if not block:
                return f"self._{verb}("
            verb = "through" if verb == "output" else verb
            return f"self._{verb}({BLOCKS[block]}, self.{block}, "

        return self._written("controller.py.j2", _identifier(name), repr, "self.{}".format, call)

    def to_json(self) -> str:
        """Write the coefficients, in powers of z - 1 and as second-order sections.

        Returns
        -------
        str
            JSON: for each block "delta", with b0, b1, b2, a1, a2 of each section, which is what
            `from_json` reads, and "sos" for `scipy.signal.sosfilt`.

        Examples
        --------
        >>> from nrdob import paper
        >>> text = paper.example(1).sampled(0.01).to_json()
        >>> ControllerCode.from_json(text).to_json() == text
        True
        """
        written = {
            "format": FORMAT,
            "dt": self.dt,
            "blocks": {
                name: {
                    "delta": [list(astuple(section)) for section in cascade],
                    "sos": second_order_sections(cascade).tolist(),
                }
                for name, cascade in self.blocks.items()
            },
            "wait": {"samples": self.wait.samples, "fraction": self.wait.fraction},
            "tracking": self.tracking,
            "limits": {
                name: value if isfinite(value) else None
                for name, value in zip(("low", "high", "rate"), self._bounds, strict=True)
            },
        }
        return json.dumps(written, indent=1, allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> ControllerCode:
        """Read what `to_json` has written. Nothing in it is ever executed.

        Parameters
        ----------
        text : str
            The JSON.

        Raises
        ------
        ValueError
            If it is no such text; the message says what is missing or wrong.
        """
        try:
            read = json.loads(text)
        except RecursionError:
            raise ValueError("this is not a controller: it is nested too deeply") from None
        if not isinstance(read, dict) or read.get("format") != FORMAT:
            raise ValueError(
                f"this is not a controller written by to_json: it has no format {FORMAT!r}"
            )
        blocks = {
            name: tuple(Section(*row) for row in _rows(block, name))
            for name, block in _part(read, "blocks").items()
        }
        if [*blocks] not in (["C", "F", "F/Gm", inner] for inner in ("(1-F)Gm", "Gm")):
            raise ValueError(
                f"the blocks are {', '.join(blocks) or 'missing'}; a controller has C, F, F/Gm and "
                "(1-F)Gm (or Gm), in this order"
            )
        wait, limits = _part(read, "wait"), _part(read, "limits")
        dt, samples, fraction = (
            _number(part, name)
            for part, name in ((read, "dt"), (wait, "samples"), (wait, "fraction"))
        )
        if not dt > 0:
            raise ValueError(f"dt is {dt:g}; the sampling time is a positive number of seconds")
        if not (0 <= samples <= LONGEST_WAIT and samples == int(samples)):
            raise ValueError(
                f"samples is {samples:g}; the dead time of a model is 0, 1, 2, … {LONGEST_WAIT} "
                "whole samples"
            )
        if not 0 <= fraction < 1:
            raise ValueError(f"fraction is {fraction:g}; it is what is left of a sample, below 1")
        infinite = {"low": -inf, "high": inf, "rate": inf}
        bounds = {
            name: default if limits.get(name) is None else _number(limits, name)
            for name, default in infinite.items()
        }
        return cls(
            dt,
            blocks,
            Wait(int(samples), fraction),
            _number(read, "tracking"),
            Limits(**bounds),
        )

    @property
    def _bounds(self) -> tuple[float, float, float]:
        return float(self.limits.low), float(self.limits.high), float(self.limits.rate)

    def _cascade(self, table: str) -> Sections:
        return self.blocks[TABLES[table] or self.inner]

    def _written(
        self,
        template: str,
        name: str,
        number: Callable[[float], str],
        signal: Callable[[str], str],
        call: Callable[[str, str], str],
        **more: Any,
    ) -> str:
        constants = {"FACTOR": number(self.wired.factor), "TRACKING": number(self.tracking)}

        def line(row: Row) -> tuple[str, str]:
            target, text = rendered(row, signal, call)
            for constant, value in constants.items():
                text = text.replace(constant, value)
            return target, text

        low, high, rate = self._bounds
        bounds = {"low": low, "high": high, "change": rate * self.dt}
        return (
            _environment()
            .get_template(template)
            .render(
                name=name,
                dt=repr(self.dt),
                number=number,
                blocks=BLOCKS,
                signals=SIGNALS,
                tables={
                    table: {"rows": self._cascade(table), "meaning": block or self.inner}
                    for table, block in TABLES.items()
                },
                equations={
                    part: [line(row) for row in rows]
                    for part, rows in equations(waits=bool(self.wait)).items()
                },
                waited=self.waited,
                memory=self.wait.memory,
                integrates=any(section.integrates for section in self.blocks["C"]),
                **{key: value if isfinite(value) else None for key, value in bounds.items()},
                **more,
            )
        )


def controller_code(
    fractions: Mapping[str, Fraction],
    alpha: float,
    wait: Wait,
    dt: float,
    *,
    limits: Limits | None = None,
    tracking_time: float | None = None,
) -> ControllerCode:
    """Put the blocks of a sampled controller into sections.

    Parameters
    ----------
    fractions : dict of str: Fraction
        The blocks, in powers of w = (z - 1)/(α (z + 1)).
    alpha : float
        α in seconds.
    wait : Wait
        Dead time of the model.
    dt : float
        Sampling time in seconds.
    limits : Limits, optional
        Of the actuator.
    tracking_time : float, optional
        Time in seconds in which the integrator of C follows a u that is limited.

    Raises
    ------
    TypeError
        If the limits are given as something else.
    ValueError
        If there is a tracking time but no integrator to track with, or it is too short.
    """
    if not isinstance(limits, Limits | None):
        raise TypeError(
            f"limits is a {type(limits).__name__}; give nrdob.digital.Limits(low, high, rate)"
        )
    blocks = {name: bilinear_sections(block, alpha) for name, block in fractions.items()}
    code = ControllerCode(dt, blocks, wait, 0.0, Limits() if limits is None else limits)
    if tracking_time is None:
        return code
    return replace(code, tracking=_tracking(code, tracking_time))


def _tracking(code: ControllerCode, time: float) -> float:
    """Part of u's limitation that C must get as an error, for its integrator to follow in time."""
    time = real_number(time, "tracking_time", "give seconds as a number")
    *others, last = code.blocks["C"]
    if not last.integrates or any(section.integrates for section in others):
        raise ValueError(
            "tracking_time is for a controller with one integrator, and this one has "
            f"{'two' if last.integrates else 'none'}: leave it out"
        )
    shortest = code.dt / abs(code.wired.factor)
    if not (isfinite(time) and time >= shortest):
        raise ValueError(
            f"tracking_time is {time:g} s; it must be finite and at least {shortest:.6g} s here, "
            "or what is tracked would be overshot at every sample"
        )
    slope = last.b2 / last.a1 if last.order == 2 else last.b1
    return code.dt / time / (slope * prod(section.rest for section in others))


def _output(cascade: Sections, states: FloatArray, input: float) -> float:
    _, _, C, D = state_space(cascade)
    return float(C @ states + D * input)


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


def _c_number(dtype: str) -> Callable[[float], str]:
    """How C writes a number so that nothing of it is lost."""

    def written(value: float) -> str:
        if dtype == "double":
            return repr(float(value))
        with np.errstate(over="ignore"):
            short = np.float32(value)
        if not np.isfinite(short) or (short == 0 and value != 0):
            raise OverflowError(
                f"the coefficient {value:.3g} is out of the range of float: use dtype='double'"
            )
        return f"{float(short)!r}f"

    return written


def _identifier(name: str) -> str:
    """Make a name that C and Python allow."""
    if not isinstance(name, str) or not re.search(r"[A-Za-z]", name):
        raise ValueError(f"name is {name!r}; give a word that what is written can be called by")
    allowed = re.sub(r"\W", "_", name, flags=re.ASCII).lstrip("_0123456789")
    return f"{allowed}_" if keyword.iskeyword(allowed) else allowed


def _part(read: dict[str, Any], name: str) -> dict[str, Any]:
    part = read.get(name)
    if not isinstance(part, dict):
        raise ValueError(f"{name} is missing, or is no object: write the text with to_json")
    return part


def _number(part: dict[str, Any], name: str) -> float:
    value = part.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f"{name} is {value!r}; a finite number is needed")
    return float(value)


def _rows(block: Any, name: str) -> list[list[float]]:
    rows = block.get("delta") if isinstance(block, dict) else None
    numbers = isinstance(rows, list) and all(
        isinstance(row, list) and len(row) == 5 for row in rows
    )
    if not (rows and numbers):
        raise ValueError(f"{name} needs delta, a list of sections [b0, b1, b2, a1, a2]")
    return [[_number({name: value}, name) for value in row] for row in rows]
