"""Block diagrams that are drawn, and read, from one list of parts and wires.

Each function gives a `Diagram`. Its `plot` is the picture; its `equations` are read off the same
wires: follow each arrow that ends at a sum back to its origin, and write down the block on the way.

This module needs schemdraw and SymPy, which come with the extra "notebooks".
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

from ..diagram import INPUTS
from .figure import COLOURS, INK, SMALLEST, WIDTH, Figure, axes_for, missing, styled

try:
    import sympy as sp
    from schemdraw import Drawing
    from schemdraw.elements import Element
    from schemdraw.segments import Segment, SegmentCircle, SegmentPoly, SegmentText, SegmentType
except ImportError as error:
    raise missing(error, "notebooks") from error

__all__ = [
    "Diagram", "conventional", "delayed_model", "internal_model_control", "limited", "nrdob",
    "six_blocks", "two_degrees_of_freedom",
]  # fmt: skip

Point = tuple[float, float]

UNIT = WIDTH / 14  # inches to a unit of the drawing: a figure is 14 units wide
RADIUS = 0.3
SHADE = INK + "1e"
SIGNS = {1: "+", -1: "−"}

# How each block is written in a picture, and its role, which gives the colour.
BLOCKS = {
    "C": (r"$C$", "controller"),
    "G": (r"$G$", "process"),
    "Gm": (r"$\tilde{G}$", "model"),
    "F": (r"$F$", "filter"),
    "F/Gm": (r"$F\,\tilde{G}^{-1}$", "filter"),
    "(1 - F)*Gm": (r"$(1-F)\,\tilde{G}$", "model"),
    "F*W": (r"$F\,e^{-\theta_ms}$", "filter"),
    "F/Gm0": (r"$F\,\tilde{G}_0^{-1}$", "filter"),
    "(1 - F*W)*Gm0": (r"$(1-F\,e^{-\theta_ms})\,\tilde{G}_0$", "model"),
    "K": (r"$K$", "controller"),
    "sat": ("sat", "process"),
    "C/(1 + C*Gm)": (r"$\dfrac{C}{1+C\,\tilde{G}}$", "controller"),
    "C/((1 - F)*(1 + C*Gm))": (r"$\dfrac{C}{(1-F)\,(1+C\,\tilde{G})}$", "controller"),
}
# How a block or a signal is written in formulas, where not by its own name.
WRITTEN = {
    "Gm": r"\tilde{G}", "Gm0": r"\tilde{G}_0",
    "dhat": r"\hat{\delta}", "ym": "y_m", "yf": "y_f",
}  # fmt: skip


class Term(NamedTuple):
    """An arrow into a sum: sign times block times signal; the block of a plain wire is "1"."""

    sign: int
    block: str
    signal: str

    def __str__(self) -> str:
        return self.signal if self.block == "1" else f"{self.block}*{self.signal}"


@dataclass(frozen=True)
class Input:
    """An external signal, its label centred at (x, y), in units of the drawing."""

    at: Point
    reach: ClassVar[Point] = (RADIUS, RADIUS)


@dataclass(frozen=True)
class Sum:
    """A circle: its output, named as the part, is the signed sum of its inputs."""

    at: Point
    reach: ClassVar[Point] = (RADIUS, RADIUS)


@dataclass(frozen=True)
class Block:
    """A box: its output is its input times the part's name."""

    at: Point
    width: float = 1.1
    height: float = 0.95

    @property
    def reach(self) -> Point:
        """Distance from the centre to the border, sideways and upwards."""
        return self.width / 2, self.height / 2


@dataclass(frozen=True)
class Wire:
    """A line through parts, given by name, and points; all of its pieces are level or upright.

    One that starts at a point is a branch of the wire that passes there; one that ends at a point
    leaves the diagram. It enters the sum at its end with its sign.
    """

    path: tuple[str | Point, ...]
    sign: int = 1


Parts = dict[str, Input | Sum | Block]


@dataclass(frozen=True)
class Diagram:
    """A block diagram: parts by name, the wires between them, and labels.

    Attributes
    ----------
    title : str
        Begins the alt text.
    parts : dict
        Inputs and sums under the name of their signal, blocks under their gain; a gain that occurs
        twice has an apostrophe the second time.
    wires : tuple of Wire
        Between the parts.
    bottom, top : float
        Edges of the picture.
    labels, shades : dict, tuple
        Places of the texts that name signals and groups, and corners of each shaded group.

    Examples
    --------
    >>> from nrdob.plotting import diagrams
    >>> print(diagrams.two_degrees_of_freedom())
    u  = C/((1 - F)*(1 + C*Gm))*R - K*ym
    v  = u + delta
    y  = G*v + d
    ym = y + eta
    """

    title: str
    parts: Parts
    wires: tuple[Wire, ...]
    bottom: float
    top: float
    labels: dict[str, Point]
    shades: tuple[tuple[Point, ...], ...] = ()

    @property
    def equations(self) -> dict[str, tuple[Term, ...]]:
        """The terms of each sum, read off the wires."""
        return {
            name: tuple(Term(w.sign, *self.origin(w)) for w in self.wires if w.path[-1] == name)
            for name, part in self.parts.items()
            if isinstance(part, Sum)
        }

    @property
    def symbolic(self) -> dict[sp.Symbol, sp.Expr]:
        r"""The same equations in SymPy, with symbols named as in the book: ``\tilde{G}``, ``y_m``.

        Examples
        --------
        >>> from nrdob.plotting import diagrams
        >>> diagrams.two_degrees_of_freedom().symbolic[sp.Symbol("u")]
        C*R/((1 - F)*(C*\tilde{G} + 1)) - K*y_m
        """
        names = set(re.findall(r"[A-Za-z]\w*", str(self)))
        symbols = {name: sp.Symbol(WRITTEN.get(name, name)) for name in names}
        return {
            symbols[name]: sp.Add(
                *(t.sign * sp.sympify(t.block, symbols) * symbols[t.signal] for t in terms)
            )
            for name, terms in self.equations.items()
        }

    def __str__(self) -> str:
        width = max(map(len, self.equations))
        return "\n".join(
            f"{name:<{width}} = {_sum(terms)}" for name, terms in self.equations.items()
        )

    def polyline(self, wire: Wire) -> list[Point]:
        """Give the corners of a wire, from border to border.

        Parameters
        ----------
        wire : Wire
            One of the diagram's.
        """
        centres = [self.parts[p].at if isinstance(p, str) else p for p in wire.path]
        first = self._border(wire.path[0], centres[0], centres[1])
        last = self._border(wire.path[-1], centres[-1], centres[-2])
        return [first, *centres[1:-1], last]

    def plot(self, ax: Any = None) -> Figure:
        """Draw the diagram.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; by default a figure of its own.
        """
        (ax,) = axes_for(ax, 1, UNIT * (self.top - self.bottom))
        with styled():
            drawing = Drawing(
                canvas=ax, show=False, color=INK, lw=1.2, ls="-", fill=None, fontsize=10,
                font="DejaVu Sans", mathfont="dejavusans",
            )  # fmt: skip
            whole = Element().at((0, 0)).theta(0)
            whole.segments += self._segments()
            drawing.add(whole)
            drawing.draw(show=False)
        ax.set(xlim=(0, WIDTH / UNIT), ylim=(self.bottom, self.top), aspect="equal")
        ax.set_axis_off()
        equations = "; ".join(f"{name} = {_sum(terms)}" for name, terms in self.equations.items())
        return Figure(ax.lines, ax, alt=f"Block diagram of {self.title}: {equations}")

    def _segments(self) -> list[SegmentType]:
        segments: list[SegmentType] = [
            SegmentPoly(list(corners), color="none", fill=SHADE, zorder=0)
            for corners in self.shades
        ]
        segments += [_text(label, place) for label, place in self.labels.items()]
        segments += [each for wire in self.wires for each in self._drawn_wire(wire)]
        return segments + [each for item in self.parts.items() for each in _drawn_part(*item)]

    def _drawn_wire(self, wire: Wire) -> list[SegmentType]:
        points, start, end = self.polyline(wire), wire.path[0], wire.path[-1]
        colour = COLOURS[INPUTS[start].role] if isinstance(start, str) and start in INPUTS else INK
        drawn: list[SegmentType] = [Segment(points, arrow="->", color=colour)]
        if not isinstance(start, str):
            drawn.append(SegmentCircle(start, 0.075, color=colour, fill=colour))
        if isinstance(end, str) and isinstance(self.parts[end], Sum):
            drawn.append(_text(SIGNS[wire.sign], _beside(*points[-2:]), colour))
        return drawn

    def _border(self, end: str | Point, centre: Point, other: Point) -> Point:
        if not isinstance(end, str):
            return centre
        reach = self.parts[end].reach
        x, y = (c + r * ((o > c) - (o < c)) for c, r, o in zip(centre, reach, other, strict=True))
        return x, y

    def origin(self, wire: Wire) -> tuple[str, str]:
        """Follow a wire back: the block on the way, "1" for none, and the signal at its origin.

        Parameters
        ----------
        wire : Wire
            One of the diagram's.
        """
        start = wire.path[0]
        if not isinstance(start, str):
            return self.origin(next(w for w in self.wires if w != wire and self._on(w, start)))
        if not isinstance(self.parts[start], Block):
            return "1", start
        before = next(w for w in self.wires if w.path[-1] == start)
        block, signal = self.origin(before)
        gain = start.rstrip("'")
        return (gain if block == "1" else f"{block}*{gain}"), signal

    def _on(self, wire: Wire, point: Point) -> bool:
        return wire.path[0] != point and any(
            all(min(ends) <= at <= max(ends) for at, *ends in zip(point, a, b, strict=True))
            for a, b in pairwise(self.polyline(wire))
        )


def nrdob() -> Diagram:
    """Draw the loop with a noise-reduction disturbance observer, Fig. 1 of the paper."""
    parts, wires = _observer()
    low = -2.75
    return Diagram(
        "the NR-DOB loop",
        parts | {"(1 - F)*Gm": Block((5.2, -1.3), 2.2), "yf": Sum((5.2, low)),
                 "F'": Block((8, low))},
        (*wires,
         Wire(((5.2, 0), "(1 - F)*Gm")), Wire(("(1 - F)*Gm", "yf")),
         Wire(((13.2, 0), (13.2, low), "F'")), Wire(("F'", "yf")),
         Wire(("yf", (1.4, low), "e"), -1)),
        -3.5, 3.9,
        _LABELS | {"$e$": (1.95, 0.35), r"$\hat{\delta}$": (4.35, 3.1), "$y_f$": (3.3, low + 0.35),
                   "disturbance estimate": _SAID, "noise reduction": (10.42, low + 0.3)},
        (_ESTIMATE, ((3.9, -0.6), (6.5, -0.6), (6.5, -2.1), (12.0, -2.1), (12.0, -3.4),
                     (3.9, -3.4))),
    )  # fmt: skip


def six_blocks() -> Diagram:
    """Draw Fig. 1 with a name for the output of each block but the process, whose output is y."""
    drawn = nrdob()
    outputs = {"$c$": (3.52, -0.35), "$w$": (6.4, 3.1), "$g$": (5.55, 2.1),
               "$b$": (5.6, -2.0), "$a$": (6.9, -2.4)}  # fmt: skip
    kept = {text: place for text, place in drawn.labels.items() if text != "noise reduction"}
    return replace(drawn, title="the NR-DOB loop, its six blocks", labels=kept | outputs)


def delayed_model() -> Diagram:
    """Draw the loop with a delayed model: W is its dead time, Gm0 the part that is inverted."""
    drawn = nrdob()
    parts = {_DELAYED.get(name, name): part for name, part in drawn.parts.items()}
    parts |= {"F*W": Block((5.2, 1.3), 1.7), "(1 - F*W)*Gm0": Block((5.2, -1.3), 3.6)}
    wires = tuple(
        Wire(tuple(_DELAYED.get(p, p) if isinstance(p, str) else p for p in wire.path), wire.sign)
        for wire in drawn.wires
    )
    title = "the loop with a delayed model, W = exp(-θm s)"
    return replace(drawn, title=title, parts=parts, wires=wires)


def limited() -> Diagram:
    """Draw the loop with a limited actuator, sat: the observer receives what has been applied."""
    drawn = nrdob()
    moved: Parts = {
        "e": Sum((1.2, 0)), "C": Block((2.3, 0), 1.0), "u": Sum((3.45, 0)),
        "sat": Block((4.6, 0), 1.0), "dhat": Sum((5.55, 2.75)), "F": Block((5.55, 1.3)),
        "(1 - F)*Gm": Block((5.55, -1.3), 2.2), "yf": Sum((5.55, -2.75)),
    }  # fmt: skip
    places = {4.1: 3.45, 5.2: 5.55, 1.4: 1.2}
    wires = tuple(
        Wire(tuple(p if isinstance(p, str) else (places.get(p[0], p[0]), p[1]) for p in wire.path),
             wire.sign)
        for wire in drawn.wires if wire.path != ("u", "v")
    )  # fmt: skip
    return replace(
        drawn, title="the NR-DOB loop with a limited actuator", parts=drawn.parts | moved,
        wires=(*wires, Wire(("u", "sat")), Wire(("sat", "v"))),
        labels=_LABELS | {"$u$": (3.92, 0.35), "$u_a$": (5.87, -0.35), "$e$": (1.64, 0.35),
                          r"$\hat{\delta}$": (4.5, 3.1), "$y_f$": (3.3, -2.4)},
        shades=(),
    )  # fmt: skip


def conventional() -> Diagram:
    """Draw the loop with a conventional disturbance observer: the measurement itself goes to C."""
    parts, wires = _observer()
    return Diagram(
        "the loop with a conventional disturbance observer",
        parts,
        (*wires, Wire(((13.2, 0), (13.2, -1.4), (1.4, -1.4), "e"), -1)),
        -1.6, 3.9,
        _LABELS | {"$e$": (1.95, 0.35), r"$\hat{\delta}$": (4.35, 3.1),
                   "disturbance estimate": _SAID},
        (_ESTIMATE,),
    )  # fmt: skip


def two_degrees_of_freedom() -> Diagram:
    """Draw the equivalent loop: a prefilter, and one feedback K = F/((1 - F) Gm)."""
    prefilter = "C/((1 - F)*(1 + C*Gm))"
    parts: Parts = {
        "R": Input((0.35, 0)),
        prefilter: Block((2.75, 0), 3.4, 1.6),
        "u": Sum((5.2, 0)),
    }
    return Diagram(
        "the equivalent loop with two degrees of freedom",
        parts | _PLANT | {"K": Block((8, -1.4))},
        (Wire(("R", prefilter)), Wire((prefilter, "u")), Wire(("u", "v")), *_PLANT_WIRES,
         Wire(("ym", (13.2, 0), (13.2, -1.4), "K")), Wire(("K", (5.2, -1.4), "u"), -1)),
        -2.0, 1.6,
        _LABELS | {"$u$": (5.7, 0.35)},
    )  # fmt: skip


def internal_model_control() -> Diagram:
    """Draw the same loop as internal model control: the error of the model is fed back."""
    prefilter = "C/(1 + C*Gm)"
    parts: Parts = {"R": Input((0.35, 0)), prefilter: Block((2.2, 0), 2.1, 1.6), "u": Sum((4.1, 0))}
    return Diagram(
        "the same loop as internal model control",
        parts | _PLANT
        | {"Gm": Block((8, -1.4)), "r": Sum((11.8, -1.4)), "F/Gm": Block((8, -2.7), 1.7)},
        (Wire(("R", prefilter)), Wire((prefilter, "u")), Wire(("u", "v")), *_PLANT_WIRES,
         Wire(("ym", (13.2, 0), (13.2, -1.4), "r")),
         Wire(((5.2, 0), (5.2, -1.4), "Gm")), Wire(("Gm", "r"), -1),
         Wire(("r", (11.8, -2.7), "F/Gm")), Wire(("F/Gm", (4.1, -2.7), "u"), -1)),
        -3.3, 1.6,
        _LABELS,
    )  # fmt: skip


_PLANT: Parts = {
    "delta": Input((6.5, 1.25)), "v": Sum((6.5, 0)), "G": Block((8, 0)),
    "d": Input((9.5, 1.25)), "y": Sum((9.5, 0)),
    "eta": Input((11.8, 1.25)), "ym": Sum((11.8, 0)),
}  # fmt: skip
_PLANT_WIRES = (
    Wire(("delta", "v")), Wire(("v", "G")), Wire(("G", "y")), Wire(("d", "y")),
    Wire(("y", "ym")), Wire(((10.6, 0), (10.6, -0.65))), Wire(("eta", "ym")),
)  # fmt: skip
"""The plant with its disturbances and its sensor, the same in every diagram."""

# Blocks that a delayed model changes; F' of the noise reduction stays.
_DELAYED = {"F": "F*W", "F/Gm": "F/Gm0", "(1 - F)*Gm": "(1 - F*W)*Gm0"}
_LABELS = {"$u$": (4.8, 0.35), "$y$": (10.6, -0.95), r"$y+\eta$": (12.65, 0.35)}
_ESTIMATE = ((4.3, 0.6), (6.2, 0.6), (6.2, 2.1), (12.0, 2.1), (12.0, 3.8), (4.3, 3.8))
_SAID = (9.85, 3.5)  # where the disturbance estimate is named


def _observer() -> tuple[Parts, tuple[Wire, ...]]:
    """Give what both observers share: forward path, plant, disturbance estimate."""
    high = 2.75
    parts: Parts = {
        "R": Input((0.35, 0)), "e": Sum((1.4, 0)), "C": Block((2.75, 0)), "u": Sum((4.1, 0)),
        "dhat": Sum((5.2, high)), "F": Block((5.2, 1.3)), "F/Gm": Block((8, high), 1.7),
    }  # fmt: skip
    wires = (
        Wire(("R", "e")), Wire(("e", "C")), Wire(("C", "u")), Wire(("u", "v")), *_PLANT_WIRES,
        Wire(("ym", (13.2, 0), (13.2, high), "F/Gm")), Wire(("F/Gm", "dhat")),
        Wire(((5.2, 0), "F")), Wire(("F", "dhat"), -1), Wire(("dhat", (4.1, high), "u"), -1),
    )  # fmt: skip
    return parts | _PLANT, wires


def _sum(terms: tuple[Term, ...]) -> str:
    text = " ".join(f"{'-' if term.sign < 0 else '+'} {term}" for term in terms)
    return text.removeprefix("+ ")


def _drawn_part(name: str, part: Input | Sum | Block) -> list[SegmentType]:
    if isinstance(part, Input):
        label, role = INPUTS[name].label, INPUTS[name].role
        return [_text(label, part.at, COLOURS[role])]
    if isinstance(part, Sum):
        return [SegmentCircle(part.at, RADIUS)]
    label, role = BLOCKS[name.rstrip("'")]
    (x, y), (dx, dy) = part.at, part.reach
    corners = [(x - dx, y - dy), (x - dx, y + dy), (x + dx, y + dy), (x + dx, y - dy)]
    box = SegmentPoly(corners, color=COLOURS[role])
    return [box, _text(label, part.at, COLOURS[role], size=9.5)]


def _beside(before: Point, end: Point) -> Point:
    """Give the place of a sign: left of an upright arrowhead, above a level one."""
    along = [(b > e) - (b < e) for b, e in zip(before, end, strict=True)]
    if along[0]:
        return end[0] + 0.22 * along[0], end[1] + 0.3
    return end[0] - 0.25, end[1] + 0.45 * along[1]


def _text(text: str, at: Point, colour: str = INK, size: float = SMALLEST) -> SegmentText:
    return SegmentText(at, text, align=("center", "center"), color=colour, fontsize=size)
