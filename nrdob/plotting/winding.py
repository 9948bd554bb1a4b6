"""The argument principle to look at: a walk around the unit circle, and how far f(s) has turned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..numerics import ComplexArray, FloatArray
from .figure import COLOURS, INK, PIXELS, SHORT, TALL, WIDTH, Figure, new_axes, styled

__all__ = ["winding_animation", "winding_plot"]

CIRCLE: ComplexArray = np.exp(-2j * np.pi * np.linspace(0, 1, 401))
"""The walk: clockwise, from +1 to +1."""

# Where the SVG has the walk, the value of f, and the bars; y downwards, as in every SVG.
WALK, VALUE, BARS = 120 + 130j, 395 + 115j, 305 + 270j
# Width of the SVG, radius of its circle, and length of the bar of one turn.
ACROSS, RADIUS, TURN = 480, 75, 120
STEP = 22  # from one bar to the next


def winding_plot(zeros: Sequence[complex], poles: Sequence[complex]) -> Figure:
    """Draw a walk around the unit circle in four moments, and f(s) below it.

    Parameters
    ----------
    zeros, poles : sequence of complex
        Of f, none of them on the circle: each is joined to the walker by a vector.
    """
    f = _rational(zeros, poles)
    turned = _swept(f)
    axes, moments = _panels((2, 4), TALL), (100, 200, 300, 400)
    with styled():
        for (above, below), k in zip(axes.T, moments, strict=True):
            _draw_walk(above, zeros, poles, k)
            _draw_value(below, f, k)
            above.set_title(f"{k // 100} quarter{'s' * (k > 100)}")
            below.set_title(f"{turned[k]:+.2f} turns")
        axes[0, 0].set(xlabel="Re s", ylabel="Im s")
        axes[1, 0].set(xlabel="Re f", ylabel="Im f")
    said = ", ".join(f"{turned[k]:.2f}" for k in moments)
    return Figure([], axes, f"f(s) after each quarter of the way: {said} clockwise turns around 0")


def winding_animation(zeros: Sequence[complex], poles: Sequence[complex]) -> Figure:
    """Animate the walk of `winding_plot`, with a bar for the angle that each vector has swept.

    It moves where SVG is shown, and rests for those who ask for less motion; as PNG it is its end.

    Parameters
    ----------
    zeros, poles : sequence of complex
        Of f, none of them on the circle.
    """
    f = _rational(zeros, poles)
    axes = _panels((1, 2), SHORT)
    with styled():
        _draw_walk(axes[0, 0], zeros, poles, CIRCLE.size - 1)
        _draw_value(axes[0, 1], f, CIRCLE.size - 1)
    whole = round(float(_swept(f)[-1]))
    many = f"{whole} clockwise encirclement{'s' * (whole != 1)}"
    alt = f"The walk as an animation; in all f makes {many} of 0"
    return Figure([], axes, alt, _svg(zeros, poles))


def _rational(zeros: Sequence[complex], poles: Sequence[complex]) -> ComplexArray:
    """Give f on the circle."""
    one = np.ones_like(CIRCLE)
    num, den = (np.prod([one, *(CIRCLE - a for a in roots)], axis=0) for roots in (zeros, poles))
    return np.asarray(num / den)


def _swept(values: ComplexArray) -> FloatArray:
    """Angle turned so far, in clockwise turns."""
    steps = np.angle(values[1:] / values[:-1])
    return np.append(0.0, -np.cumsum(steps) / (2 * np.pi))


def _panels(shape: tuple[int, int], height: float) -> Any:
    axes = new_axes(shape, height)
    for ax in axes.flat:
        ax.set_aspect("equal", adjustable="datalim")
    return axes


def _draw_walk(ax: Axes, zeros: Sequence[complex], poles: Sequence[complex], k: int) -> None:
    walker = CIRCLE[k]
    for points, marker, role in ((zeros, "o", "process"), (poles, "x", "model")):
        for a in points:
            colour = COLOURS[role]
            ax.plot([a.real, walker.real], [a.imag, walker.imag], color=colour, lw=1.1)
            ax.plot(a.real, a.imag, marker, color=colour, ms=5.5)
    ax.plot(CIRCLE.real, CIRCLE.imag, color=INK, lw=0.7)
    ax.plot(CIRCLE[: k + 1].real, CIRCLE[: k + 1].imag, color=COLOURS["reference"])
    ax.plot(walker.real, walker.imag, ".", color=COLOURS["reference"], ms=9)


def _draw_value(ax: Axes, image: ComplexArray, k: int) -> None:
    ax.plot(image.real, image.imag, color=INK, lw=0.7)
    ax.plot(image[: k + 1].real, image[: k + 1].imag, color=COLOURS["loop"])
    ax.plot([0, image[k].real], [0, image[k].imag], color=INK, lw=1.1)
    ax.plot(image[k].real, image[k].imag, ".", color=COLOURS["loop"], ms=9)
    ax.plot(0, 0, "+", color=COLOURS["critical"], ms=9, mew=2.2, zorder=6)


# --- the same, moving -----------------------------------------------------------------------------


def _svg(zeros: Sequence[complex], poles: Sequence[complex]) -> str:
    image = _rational(zeros, poles)
    scale = 170 / max(np.ptp(image.real), np.ptp(image.imag))
    walk, value = WALK + RADIUS * CIRCLE.conj(), VALUE + scale * image.conj()
    vectors = [(f"zero at {_short(a)}", a, CIRCLE - a, COLOURS["process"]) for a in zeros]
    vectors += [(f"pole at {_short(a)}", a, 1 / (CIRCLE - a), COLOURS["model"]) for a in poles]
    labels = [label for label, *_ in vectors] + ["their sum: turns of f"]
    x, y = BARS.real, BARS.imag
    foot = y + STEP * len(labels)

    def moment(frames: Any) -> str:
        parts = []
        for k, (_, a, factor, colour) in enumerate(vectors):
            place, bar = WALK + RADIUS * np.conj(a), BARS + 1j * STEP * k
            parts += [
                _stroke(frames, place, walk, colour, 1.5),
                _dot([0], place + 0 * walk, colour),
                _stroke(frames, bar, bar + TURN * _swept(factor), colour, 10),
            ]
        bar = BARS + 1j * STEP * len(vectors)
        parts.append(_stroke(frames, bar, bar + TURN * _swept(image), COLOURS["loop"], 10))
        parts.append(_stroke(frames, VALUE, value, INK, 1.5))
        parts += [_dot(frames, walk, COLOURS["reference"]), _dot(frames, value, COLOURS["loop"])]
        return "".join(parts)

    scene = _still(walk) + _still(value)
    cross = f"M{VALUE.real - 8:.0f} {VALUE.imag:.0f}h16M{VALUE.real:.0f} {VALUE.imag - 8:.0f}v16"
    scene += f'<path d="{cross}" stroke="{COLOURS["critical"]}" stroke-width="2.5"/>'
    scene += _text(20, 24, "s walks around the circle") + _text(290, 24, "f(s) turns around 0")
    scene += "".join(_text(160, y + 4 + STEP * k, label, "end") for k, label in enumerate(labels))
    for n in (-1, 0, 1):
        at = x + TURN * n
        scene += f'<path d="M{at:g} {y - 10:g}V{foot:g}" stroke="{INK}" stroke-width="0.6"/>'
        scene += _text(at, foot + 16, ("−1", "0", "+1")[n + 1], "middle")
    frames = np.append(np.arange(0, CIRCLE.size, 5), np.full(16, CIRCLE.size - 1))
    tall, wide = foot + 26, PIXELS * WIDTH
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {ACROSS} {tall:.0f}" '
        f'width="{wide:.0f}" height="{wide * tall / ACROSS:.0f}" '
        'font-family="DejaVu Sans, sans-serif" font-size="13">'
        "<style>.rest{display:none}@media (prefers-reduced-motion: reduce)"
        "{.moving{display:none}.rest{display:inline}}</style>"
        f'{scene}<g class="moving">{moment(frames)}</g>'
        f'<g class="rest">{moment([CIRCLE.size - 1])}</g></svg>'
    )


def _short(a: complex) -> str:
    """Write a complex number for a label: −0.5, 0.5j, 1.5+1j."""
    real, imag = complex(a).real, complex(a).imag
    text = f"{real:g}" if not imag else f"{imag:g}j" if not real else f"{real:g}{imag:+g}j"
    return text.replace("-", "−")


def _moving(tag: str, fixed: str, frames: Any, **numbers: FloatArray) -> str:
    """Write an SVG element whose attributes run through numbers, one for each frame."""
    runs = {key: np.asarray(values)[frames] for key, values in numbers.items()}
    rest = "".join(f' {key}="{values[-1]:.1f}"' for key, values in runs.items())
    inside = "".join(
        f'<animate attributeName="{key}" dur="12s" repeatCount="indefinite" values="'
        + ";".join(f"{each:.1f}" for each in values)
        + '"/>'
        for key, values in runs.items()
        if values.size > 1
    )
    return f"<{tag} {fixed}{rest}>{inside}</{tag}>"


def _stroke(frames: Any, start: complex, end: ComplexArray, colour: str, width: float) -> str:
    fixed = f'x1="{start.real:.1f}" y1="{start.imag:.1f}" stroke="{colour}" stroke-width="{width}"'
    return _moving("line", fixed, frames, x2=end.real, y2=end.imag)


def _dot(frames: Any, at: ComplexArray, colour: str) -> str:
    return _moving("circle", f'r="4.5" fill="{colour}"', frames, cx=at.real, cy=at.imag)


def _still(points: ComplexArray) -> str:
    joined = " ".join(f"{p.real:.1f},{p.imag:.1f}" for p in points[::4])
    return f'<polyline points="{joined}" fill="none" stroke="{INK}" stroke-width="0.8"/>'


def _text(x: float, y: float, words: str, anchor: str = "start") -> str:
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" fill="{INK}">{words}</text>'
