"""Answers as plain data: how they come out of the process in which a student's code runs.

What arrives is text, read as JSON and built anew by the public constructors. So nothing that the
student's code has made is ever run or trusted where the points are given: a loop comes as its four
blocks, and is judged afresh.
"""

import base64
import json
import pickle
import traceback
import warnings
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import Any

import control as ct
import numpy as np
from numpy.polynomial import Polynomial
from scipy import signal

from nrdob.diagram import DelayedTransferFunction, LowPassFilter, as_fraction
from nrdob.loop import NRDOB

__all__ = [
    "BLOCKS", "BUILD", "HANDOUT", "LONGEST", "LONGEST_TEXT", "MIME", "MOST", "decode", "encode",
    "line_of", "packed", "tell",
]  # fmt: skip

MIME = "application/vnd.nrdob.answer+json"

HANDOUT = "handout.json"  # the file in which a kernel finds what was handed out to it

LONGEST, LONGEST_TEXT = 2_000_000, 1000
"""Letters of an answer, of which a longer one is not taken, and of a text in it."""
MOST, PARTS = 50, 2000
"""Coefficients, states, numbers in a row; numbers and texts of an answer, all together."""

UNORDERED = (str, bytes, set, frozenset, ct.InputOutputSystem)

MADE_INTO: dict[str, Callable[[Any], Any]] = {
    "__float__": float,
    "__complex__": complex,
    "__array__": np.asarray,
    "as_poly": lambda v: np.poly1d([complex(c) for c in v.as_poly(*v.free_symbols).all_coeffs()]),
}
"""By the method which says so. To SymPy a number is also a polynomial, of a root in it."""


def encode(value: Any) -> Any:
    """Write a value in lists, texts and numbers, each under the name of its kind.

    Parameters
    ----------
    value : object

    Examples
    --------
    >>> encode((1, 2j))
    {'tuple': [1, {'complex': [0.0, 2.0]}]}
    >>> decode(encode(LowPassFilter(0.5, 2)))
    LowPassFilter(time_constant=0.5, order=2)
    """
    if value is None or type(value) in (bool, int, float, str):
        return value
    if value is Ellipsis:
        return {"blank": True}
    if isinstance(value, np.generic):
        plain = {"f": float, "c": complex}.get(value.dtype.kind, np.generic.item)
        return encode(plain(value)) if value.dtype.kind in "biufcUS" else _other(value)
    if isinstance(value, np.ndarray):
        # What is left of a matrix is one again; python-control gives a number three axes.
        value = np.asarray(value) if value.ndim <= 2 else np.asarray(value).squeeze()
        if value.dtype.kind not in "biufc":
            return encode(value.tolist())
        return {"array": [encode(each) for each in value.ravel()], "shape": list(value.shape)}
    if isinstance(value, tuple | list | range):
        name = "tuple" if isinstance(value, tuple) else "list"
        return {name: [encode(each) for each in value]}
    if isinstance(value, Mapping):
        return {"dict": [[encode(key), encode(each)] for key, each in value.items()]}
    if isinstance(value, ct.TransferFunction) and (value.ninputs, value.noutputs) != (1, 1):
        return _other(value)
    for kind, (one, parts, _) in KINDS.items():
        if isinstance(value, one):
            return {kind: [encode(each) for each in parts(value)]}
    return _other(value)


def _other(value: Any) -> Any:
    """Write what is none of these: as what it says it can be made into, else as its text."""
    name = type(value).__name__
    for method, kind in MADE_INTO.items():
        if hasattr(type(value), method):
            with suppress(Exception):
                return encode(kind(value))
    if isinstance(value, Iterable) and not isinstance(value, UNORDERED):
        return {"list": [encode(each) for each in value]}  # map, zip, dict.values()
    try:
        text = str(value)[:300]
    except Exception:
        text = f"an object of type {name}"
    return {"other": [name, text]}


def decode(data: Any) -> Any:
    """Build a value from what `encode` has written.

    What was written by something else, or is larger than any answer, is refused by a ValueError
    before anything is computed with it.

    Parameters
    ----------
    data : object
    """
    if (count := _count(data)) > PARTS:
        raise ValueError(f"an answer of {count} parts; at most {PARTS} are read")
    return _built(data)


def _count(data: Any) -> int:
    """Count the parts of an answer, without building any."""
    waiting, count = [data], 0
    while waiting:
        each = waiting.pop()
        count += 1
        if isinstance(each, dict | list):
            waiting += each.values() if isinstance(each, dict) else each
    return count


def _built(data: Any) -> Any:
    if not isinstance(data, dict):
        if data is None or isinstance(data, bool | int | float):
            return data
        if isinstance(data, str):
            return data[:LONGEST_TEXT]
        raise ValueError(f"an answer cannot be read from {type(data).__name__}")
    kind, parts = next(iter(data.items()), ("", None))
    if kind == "blank":
        return Ellipsis
    if not isinstance(parts, list):
        raise ValueError(f"an answer cannot be read from {kind!r}")
    if len(parts) > (MOST**2 if kind == "array" else MOST):
        raise ValueError(f"an answer with {len(parts)} numbers in a row; at most {MOST} are read")
    if kind == "dict":
        return {_built(key): _built(each) for key, each in parts}
    if kind == "other":
        name, text = (str(part)[:300] for part in parts)
        return type(name, (), {"__repr__": lambda self: text})()
    if kind == "array":
        shape = [int(size) for size in data["shape"]]
        if len(shape) > 2 or max(shape, default=0) > MOST:
            raise ValueError(f"an answer of {shape} numbers; at most {MOST} in a row are read")
        return np.array([_built(each) for each in parts]).reshape(shape)
    if kind not in BUILD:
        raise ValueError(f"an answer cannot be read from {kind!r}")
    return BUILD[kind](*map(_built, parts))


def _filter(time_constant: Any, order: Any) -> LowPassFilter:
    if not order <= MOST:
        raise ValueError(f"a filter of order {order}; at most {MOST} is read")
    return LowPassFilter(time_constant, order)


KINDS: dict[str, tuple[type, Callable[[Any], tuple[Any, ...]], Callable[..., Any]]] = {
    "complex": (complex, lambda v: (v.real, v.imag), complex),
    "loop": (NRDOB, lambda v: (v.process, v.model, v.controller, v.filter), NRDOB),
    "filter": (LowPassFilter, lambda v: (float(v.time_constant), int(v.order)), _filter),
    "delayed": (
        DelayedTransferFunction, lambda v: (v.tf, float(v.delay)), DelayedTransferFunction
    ),
    "tf": (
        ct.TransferFunction, lambda v: (v.num_array[0, 0], v.den_array[0, 0], v.dt),
        ct.TransferFunction,
    ),
    "ss": (ct.StateSpace, lambda v: (v.A, v.B, v.C, v.D, v.dt), ct.StateSpace),
    "polynomial": (Polynomial, lambda v: (v.coef, v.domain, v.window), Polynomial),
    "poly1d": (np.poly1d, lambda v: (v.coeffs,), np.poly1d),
    "lti": (signal.lti, lambda v: as_fraction(v, "it", proper=False), ct.TransferFunction),
}  # fmt: skip
"""What has parts of its own: its type, the parts, and what is built of them."""

BUILD: dict[str, Callable[..., Any]] = {kind: build for kind, (_, _, build) in KINDS.items()}
BUILD |= {"list": lambda *parts: [*parts], "tuple": lambda *parts: parts}


# --- in the process of the student's code -------------------------------------------------------


def packed(case: Any) -> str:
    """Pack a case for the way to the student's code; it is ours, so a pickle is safe there.

    Parameters
    ----------
    case : object
    """
    return base64.b64encode(pickle.dumps(case)).decode("ascii")


def tell(answer: Any, case: str = "") -> None:
    """Call the answer on a packed case, and publish what it returns; a value without a case.

    Parameters
    ----------
    answer : object
    case : str
    """
    from IPython.display import publish_display_data

    publish_display_data({MIME: _told(answer, case)})  # type: ignore[no-untyped-call]


def _told(answer: Any, case: str) -> str:
    try:
        told = _called(answer, pickle.loads(base64.b64decode(case))) if case else _value(answer)
        text = json.dumps(told)
    except (RecursionError, TypeError, ValueError) as error:  # a list that holds itself
        text = json.dumps({"value": {"other": [type(error).__name__, str(error)[:300]]}})
    if len(text) > LONGEST:
        return json.dumps({"value": {"other": ["answer", f"an answer of {len(text)} letters"]}})
    return text


BLOCKS = (ct.InputOutputSystem, *(one for one, _, _ in KINDS.values()))
"""What can be called, at a complex s, and is an answer all the same."""


def _value(answer: Any) -> Any:
    is_function = callable(answer) and not isinstance(answer, BLOCKS)
    return {"function": True} if is_function else {"value": encode(answer)}


def _called(answer: Any, case: Any) -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            got = answer(case)
    except (Exception, SystemExit) as error:
        where = f". {line}" if (line := line_of(error, answer)) else ""
        return {"error": [type(error).__name__, f"{error!s:.500}{where:.300}"]}
    return {"value": encode(got)}


def line_of(error: BaseException, answer: Any) -> str:
    """Say which line of a function has raised an error; empty if that was none of its file.

    Parameters
    ----------
    error, answer : exception, callable
    """
    file = getattr(getattr(answer, "__code__", None), "co_filename", None)
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.line for frame in frames if frame.filename == file and frame.line]
    return f"In the line: {lines[-1]}" if lines else ""
