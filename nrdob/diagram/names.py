"""Every map and every input of the diagram by name: how it is written and said, and whose it is."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CLOSED_LOOP", "INPUTS", "MAPS", "Name"]


@dataclass(frozen=True)
class Name:
    """How a map or an input is written, in LaTeX, and said; the role gives the colour.

    `to_y` is the map of eq. (4) by which an input comes to the output y.
    """

    label: str
    spoken: str
    role: str
    to_y: str = ""


CLOSED_LOOP = {
    "T_R": Name("$T_R$", "T_R", "reference"),
    "S_d": Name("$S_d$", "S_d", "disturbance"),
    "S_delta": Name(r"$S_\delta$", "S_delta", "disturbance"),
    "S_eta": Name(r"$S_\eta$", "S_eta", "noise"),
    "E_R": Name("$E_R$", "E_R", "reference"),
    "U_R": Name("$U_R$", "U_R", "reference"),
    "U_d": Name("$U_d$", "U_d", "disturbance"),
    "U_delta": Name(r"$U_\delta$", "U_delta", "disturbance"),
    "U_eta": Name(r"$U_\eta$", "U_eta", "noise"),
}
"""The maps of eqs. (4) and (7)."""

MAPS = {
    "FH": Name(r"$F\,H$", "F·H", "loop"),
    "H": Name("$H$", "H", "loop"),
    "CGm": Name(r"$C\,\tilde{G}$", "C·Gm", "model"),
    "L": Name("$L$", "L", "process"),
    "ratio": Name(r"$\tilde{G}^{-1}G$", "G/Gm", "loop"),
    "K": Name("$K$", "K", "controller"),
    "G": Name("$G$", "G", "process"),
    "Gm": Name(r"$\tilde{G}$", "Gm", "model"),
    "C": Name("$C$", "C", "controller"),
    "F": Name("$F$", "F", "filter"),
    **CLOSED_LOOP,
}
"""Attributes of a loop that can be drawn by name."""

INPUTS = {
    "R": Name("$R$", "reference", "reference", "T_R"),
    "d": Name("$d$", "output disturbance", "disturbance", "S_d"),
    "delta": Name(r"$\delta$", "input disturbance", "disturbance", "S_delta"),
    "eta": Name(r"$\eta$", "noise", "noise", "S_eta"),
}
"""Where a signal can enter from outside."""
