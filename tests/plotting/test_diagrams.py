"""The block diagrams say what the equations say, and are drawn like every figure of the house."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations, pairwise

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
import schemdraw
import sympy as sp

from lettering import LEAST, collisions, drawn_texts, shown
from nrdob.diagram import INPUTS
from nrdob.plotting import WIDTH, Figure, diagrams
from nrdob.plotting.diagrams import BLOCKS, Block, Diagram, Input, Point, Sum
from nrdob.sampling import random_loop

mpl.use("Agg")
DRAW: dict[str, Callable[[], Diagram]] = {
    "nrdob": diagrams.nrdob,
    "conventional": diagrams.conventional,
    "two_degrees_of_freedom": diagrams.two_degrees_of_freedom,
    "internal_model_control": diagrams.internal_model_control,
    "six_blocks": diagrams.six_blocks,
    "delayed_model": diagrams.delayed_model,
    "limited": diagrams.limited,
}
each_diagram = pytest.mark.parametrize("draw", DRAW.values(), ids=DRAW)
C, F, G, Gm = (sp.Symbol(name) for name in ("C", "F", "G", "Gm"))
GAINS = {"C": C, "F": F, "G": G, "Gm": Gm, "K": F / ((1 - F) * Gm)}


@pytest.fixture(autouse=True)
def _no_figures() -> Iterator[None]:
    plt.close("all")
    yield
    plt.close("all")


def maps(diagram: Diagram) -> dict[str, dict[str, sp.Expr]]:
    """Solve what is read off the picture: from every input to every signal."""
    signals = {name: sp.Symbol(name) for name, part in diagram.parts.items() if name not in GAINS}
    equations = [
        sum(t.sign * sp.sympify(t.block, locals=GAINS) * signals[t.signal] for t in terms)
        - signals[name]
        for name, terms in diagram.equations.items()
    ]
    solved = sp.solve(equations, [signals[name] for name in diagram.equations], dict=True)[0]
    return {
        name: {i: sp.diff(solved[signals[name]], signals[i]) for i in INPUTS}
        for name in diagram.equations
    }


# What the picture says.


def test_figure_1_reads_as_the_equations_of_the_loop() -> None:
    assert str(diagrams.nrdob()).splitlines() == [
        "e    = R - yf",
        "u    = C*e - dhat",
        "dhat = F/Gm*ym - F*u",
        "v    = u + delta",
        "y    = G*v + d",
        "ym   = y + eta",
        "yf   = (1 - F)*Gm*u + F*ym",
    ]


def test_the_conventional_observer_feeds_the_measurement_itself_to_the_controller() -> None:
    ours, theirs = diagrams.nrdob().equations, diagrams.conventional().equations
    assert [(t.sign, t.signal) for t in theirs["e"]] == [(1, "R"), (-1, "ym")]
    assert {name for name in theirs if theirs[name] != ours[name]} == {"e"}
    assert set(ours) - set(theirs) == {"yf"}


def test_a_limited_loop_feeds_its_observer_with_what_is_applied() -> None:
    limited = str(diagrams.limited()).replace("sat*", "").splitlines()
    for ours, theirs in zip(str(diagrams.nrdob()).splitlines(), limited, strict=True):
        name, _, terms = theirs.partition(" = ")
        assert ours.startswith(name) and sorted(ours.partition(" = ")[2].split()) == sorted(
            terms.replace("delta + u", "u + delta").split()
        )
    assert [name for name, terms in diagrams.limited().equations.items()
            if any("sat" in term.block for term in terms)] == ["dhat", "v", "yf"]  # fmt: skip


@pytest.mark.slow
def test_a_model_that_waits_leaves_the_error_what_it_is_without_dead_time() -> None:
    W, Gm0 = sp.symbols("W Gm0")
    solved = maps(diagrams.delayed_model())
    assert sp.simplify(solved["e"]["R"] - 1 / (1 + Gm0 * C)) == 0
    assert sp.simplify(solved["y"]["d"] - (1 - F * W) / (1 - F * W + F * G / Gm0)) == 0


@pytest.mark.thorough
@each_diagram
def test_the_equations_in_sympy_are_those_read_off_the_picture(draw: Callable[[], Diagram]) -> None:
    diagram = draw()
    printed = {"ym": "y_m", "yf": "y_f", "dhat": r"\hat{\delta}"}
    model = {sp.Symbol("Gm"): sp.Symbol(r"\tilde{G}"), sp.Symbol("Gm0"): sp.Symbol(r"\tilde{G}_0")}
    symbolic = diagram.symbolic
    solved = sp.solve([sp.Eq(*line) for line in symbolic.items()], list(symbolic), dict=True)[0]
    feedback = {sp.Symbol("K"): GAINS["K"].subs(model)}
    for name, by in maps(diagram).items():
        answer = solved[sp.Symbol(printed.get(name, name))].subs(feedback)
        for given, wanted in by.items():
            assert sp.simplify(sp.diff(answer, sp.Symbol(given)) - wanted.subs(model)) == 0


@pytest.mark.slow
@pytest.mark.parametrize("delayed", [False, True])
def test_figure_1_solved_gives_the_maps_of_the_package(delayed: bool) -> None:
    solved = maps(diagrams.nrdob())
    wanted = {
        "T_R": ("y", "R"), "S_d": ("y", "d"), "S_delta": ("y", "delta"), "S_eta": ("y", "eta"),
        "E_R": ("e", "R"), "U_R": ("u", "R"), "U_d": ("u", "d"), "U_eta": ("u", "eta"),
        "U_delta": ("v", "delta"),
    }  # fmt: skip
    functions = {n: sp.lambdify((C, F, G, Gm), solved[y][i]) for n, (y, i) in wanted.items()}
    rng = np.random.default_rng(1)
    for _ in range(20):
        loop = random_loop(rng, delayed=delayed)
        s = complex(rng.uniform(0.1, 2), rng.uniform(-5, 5))
        for name, function in functions.items():
            value = function(loop.C(s), loop.F(s), loop.G(s), loop.Gm(s))
            assert value == pytest.approx(getattr(loop, name)(s), rel=1e-9), name


@pytest.mark.slow
@pytest.mark.parametrize(
    "other", [diagrams.two_degrees_of_freedom, diagrams.internal_model_control]
)
def test_the_equivalent_loops_are_the_same_from_every_input(other: Callable[[], Diagram]) -> None:
    ours, theirs = maps(diagrams.nrdob()), maps(other())
    for signal in ("u", "y"):
        for name in INPUTS:
            assert sp.simplify(ours[signal][name] - theirs[signal][name]) == 0, (signal, name)


# Whether the lines can be read in one way only.


def touch(a: tuple[Point, Point], b: tuple[Point, Point]) -> bool:
    """Tell whether two level or upright pieces have a point in common."""
    return all(
        max(min(a[0][i], a[1][i]), min(b[0][i], b[1][i]))
        <= min(max(a[0][i], a[1][i]), max(b[0][i], b[1][i]))
        for i in (0, 1)
    )


@each_diagram
def test_lines_are_level_or_upright_and_lines_of_two_signals_never_touch(
    draw: Callable[[], Diagram],
) -> None:
    diagram = draw()
    lines = [(diagram.origin(wire), diagram.polyline(wire)) for wire in diagram.wires]
    for _, line in lines:
        assert all((a[0] == b[0]) != (a[1] == b[1]) for a, b in pairwise(line))
    for (one, first), (other, second) in combinations(lines, 2):
        if one != other:
            pieces = ((a, b) for a in pairwise(first) for b in pairwise(second))
            assert not any(touch(a, b) for a, b in pieces), (one, other)


@each_diagram
def test_every_input_and_block_is_used_and_every_line_leads_somewhere(
    draw: Callable[[], Diagram],
) -> None:
    diagram = draw()
    starts = [wire.path[0] for wire in diagram.wires]
    ends = [wire.path[-1] for wire in diagram.wires]
    for name, part in diagram.parts.items():
        assert starts.count(name) == 1, f"{name} must have one output; others branch off"
        arrows = {Input: 0, Block: 1}.get(type(part))
        assert ends.count(name) == arrows if arrows is not None else ends.count(name) >= 2
    assert [end for end in ends if not isinstance(end, str)] == [(10.6, -0.65)]  # y leaves


@each_diagram
def test_lines_pass_through_no_part(draw: Callable[[], Diagram]) -> None:
    diagram = draw()
    for wire in diagram.wires:
        for name, part in diagram.parts.items():
            if isinstance(part, Input) or name in wire.path:
                continue
            (x, y), (dx, dy) = part.at, part.reach
            inside = ((x - dx, y - dy), (x + dx, y + dy))
            assert not any(touch(piece, inside) for piece in pairwise(diagram.polyline(wire)))


# The drawing itself.


@pytest.mark.slow
@each_diagram
def test_what_is_drawn_is_what_is_read(draw: Callable[[], Diagram]) -> None:
    diagram = draw()
    (ax,) = diagram.plot().axes.flat
    drawn = [line.get_xydata() for line in ax.lines]
    assert len(drawn) == len(diagram.wires)
    for wire, line in zip(diagram.wires, drawn, strict=True):
        np.testing.assert_allclose(line[:-1], diagram.polyline(wire)[:-1])
        # The arrowhead goes on to the border of the part.
        assert np.linalg.norm(line[-1] - diagram.polyline(wire)[-1]) == pytest.approx(0.25)


@pytest.mark.thorough
@each_diagram
def test_every_block_and_signal_is_labelled_once(draw: Callable[[], Diagram]) -> None:
    diagram = draw()
    (ax,) = diagram.plot().axes.flat
    shown = [text.get_text() for text in ax.texts]
    for name, part in diagram.parts.items():
        if isinstance(part, Sum):
            continue
        label = INPUTS[name].label if isinstance(part, Input) else BLOCKS[name.rstrip("'")][0]
        copies = sum(other.rstrip("'") == name.rstrip("'") for other in diagram.parts)
        assert shown.count(label) == copies, label
    terms = [term for terms in diagram.equations.values() for term in terms]
    assert shown.count("−") == sum(term.sign < 0 for term in terms)
    assert shown.count("+") == sum(term.sign > 0 for term in terms)


@pytest.mark.thorough
@each_diagram
def test_texts_overlap_neither_each_other_nor_a_line_and_none_is_cut(
    draw: Callable[[], Diagram],
) -> None:
    figure = draw().plot()
    (ax,) = figure.axes.flat
    texts = drawn_texts(figure.figure)
    assert set(texts) == set(ax.texts)
    assert collisions(texts, figure.figure.bbox) == []
    assert min(shown(text.get_fontsize()) for text in texts) >= LEAST
    lines = [line.get_transform().transform(line.get_xydata()) for line in ax.lines]
    pieces = [piece for line in lines for piece in pairwise(line)]
    assert not any(touch(piece, box.get_points()) for piece in pieces for box in texts.values())


@pytest.mark.thorough
@each_diagram
def test_a_diagram_is_a_figure_of_the_house(draw: Callable[[], Diagram]) -> None:
    diagram = draw()
    figure = diagram.plot()
    assert isinstance(figure, Figure)
    assert figure.figure.get_figwidth() == WIDTH
    assert figure.png() == diagram.plot().png()
    assert figure.alt.startswith(f"Block diagram of {diagram.title}: ")
    for line in str(diagram).splitlines():
        assert " ".join(line.split()) in figure.alt


@pytest.mark.slow
def test_the_users_axes_are_used() -> None:
    user, ax = plt.subplots()
    figure = diagrams.nrdob().plot(ax)
    assert figure.figure is user
    assert plt.get_fignums() == [user.number]


@pytest.mark.slow
def test_the_users_settings_neither_change_nor_matter() -> None:
    expected = diagrams.nrdob().plot().png()
    before_schemdraw = dict(schemdraw.schemdraw.schemdrawstyle)
    try:
        schemdraw.config(color="red", lw=5, fontsize=30, font="serif", fill="blue")
        chosen = dict(schemdraw.schemdraw.schemdrawstyle)
        with mpl.rc_context({"lines.linewidth": 7, "text.color": "red", "font.size": 30}):
            before = dict(mpl.rcParams)
            assert diagrams.nrdob().plot().png() == expected
            assert dict(mpl.rcParams) == before
        assert schemdraw.schemdraw.schemdrawstyle == chosen
    finally:
        schemdraw.schemdraw.schemdrawstyle.clear()
        schemdraw.schemdraw.schemdrawstyle.update(before_schemdraw)
