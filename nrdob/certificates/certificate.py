"""A certificate of a verdict: what a checker needs to prove it again, and nothing else."""

from __future__ import annotations

import json
from dataclasses import dataclass
from fractions import Fraction
from os import PathLike
from pathlib import Path
from typing import Any

from ..diagram import LoopEquations
from ..numerics import FloatArray, QuasiPolynomial
from .checker import check
from .points import half_plane_points

__all__ = ["Certificate", "certify"]


@dataclass(frozen=True)
class Certificate:
    """Proof of how many roots of a loop are in the right half plane, which prints what it proves.

    Attributes
    ----------
    content : dict
        What is written as JSON: `blocks` with numerators, denominators and dead times in exact
        fractions; `cancelled`, what cancels inside the blocks F/Gm (`zeros`) and (1 - F)·Gm
        (`poles`); `claim`, the number of roots of D_F, p_A and p_B in the right half plane;
        `points` of the imaginary axis in rad/s, between which each function keeps to a half plane.
    proved : str
        What the checker says.
    """

    content: dict[str, Any]
    proved: str

    def __str__(self) -> str:
        return self.proved

    def __repr__(self) -> str:
        return f"Certificate({self.proved!r})"

    def save(self, path: str | PathLike[str]) -> None:
        """Write the certificate as JSON, to be checked by ``python checker.py PATH``.

        Parameters
        ----------
        path : str or path
            File to write, such as "certificate.json".
        """
        Path(path).write_text(json.dumps(self.content, indent=1) + "\n", encoding="utf-8")


def certify(loop: LoopEquations, counts: tuple[float | None, float | None]) -> Certificate:
    """Find the points that prove a verdict, and have them checked.

    Parameters
    ----------
    loop : LoopEquations
        The four blocks.
    counts : tuple of two float
        Roots of p_A and p_B in the right half plane.

    Returns
    -------
    Certificate
        Which the checker has accepted.

    Raises
    ------
    ArithmeticError
        If there is none: a root on the imaginary axis or too close to it, infinitely many roots in
        the right half plane, or a loop that is ill-posed.

    Examples
    --------
    >>> import control as ct
    >>> from nrdob import LowPassFilter, delay
    >>> blocks = delay(0.1) * ct.tf([2], [1, 1]), ct.tf([1], [1, 1]), 2, LowPassFilter(0.5, 1)
    >>> certify(LoopEquations(*blocks), (0, 0))
    Certificate('Proved: the loop is internally stable. Roots with Re s >= 0: D_F 0, p_A 0, p_B 0.')
    """
    if reason := loop.ill_posed:
        raise ArithmeticError(f"no certificate: {reason}")
    built, fractions = loop.built, loop.fractions
    power = built.poles.degree if loop.model_delay else 0
    F = QuasiPolynomial(fractions.F.den)
    functions = {"D_F": F, "p_A": loop.p_A, "p_B": loop.p_B.lifted(power)}
    points = {}
    for name, p in functions.items():
        try:
            points[name] = half_plane_points(p.terms, power if name == "p_B" else 0)
        except ArithmeticError as error:
            raise ArithmeticError(f"no certificate for {name}: {error}") from error
    delays = {"process": loop.delay, "model": loop.model_delay}
    content = {
        "format": "nrdob certificate",
        "version": 1,
        "blocks": {
            name: {
                "num": _exact(block.num), "den": _exact(block.den),
                "delay": str(Fraction(delays.get(name, 0.0))),
            }
            for name, block in zip(
                ("process", "model", "controller", "filter"), fractions, strict=True
            )
        },
        "cancelled": {"zeros": _exact(built.zeros.q), "poles": _exact(built.poles.q)},
        "claim": {
            name: None if count is None else int(count)
            for name, count in zip(functions, (0, *counts), strict=True)
        },
        "points": {name: _exact(found) for name, found in points.items()},
    }  # fmt: skip
    try:
        return Certificate(content, check(content))
    except ValueError as error:
        raise ArithmeticError(f"no certificate: {error}") from error


def _exact(values: FloatArray) -> list[str]:
    return [str(Fraction(value)) for value in values.tolist()]
