import control as ct
import numpy as np
import pytest
from hypothesis import assume, given

import nrdob
from densegrid import turned
from nrdob import paper
from nrdob.analysis import encirclements, resolved_frequencies
from strategies import loops

s = ct.tf("s")


def turns_counted_on_a_dense_grid(quotient, point, near):
    """Clockwise turns of L(jω) around a point for ω from -∞ to ∞, poles off the axis.

    The grid is densest at the poles and the roots of 1 + L, which are `near`, and reaches far
    beyond them all.
    """
    sizes = np.abs(near)
    wide = np.geomspace(1e-4 * sizes.min(), 1e4 * sizes.max(), 20_001)
    omega = np.unique(np.append(wide, sizes[:, None] * (1 + 0.02 * np.linspace(-1, 1, 1001))))
    return -turned(quotient(1j * omega) - point) / np.pi


@pytest.mark.parametrize(
    ("number", "name", "point", "n", "p"),
    [
        (2, "H", -1, 1, 0),  # Fig. 5: the arc at infinity of an improper H included
        (3, "ratio", 1, -1, 1),  # Fig. 10
        (3, "H", -1, -1, 1),  # Fig. 11
        (3, "FH", -1, -1, 1),  # Fig. 12
        (2, "FH", -1, 0, 0),  # Fig. 6
        (4, "FH", -1, 0, 0),  # Fig. 16
        (1, "CGm", -1, 0, 0),
    ],
)
def test_turns_of_the_papers_nyquist_plots(number, name, point, n, p):
    count = encirclements(getattr(paper.example(number), name), point)
    assert (count.encirclements, count.open_loop_rhp, count.closed_loop_rhp) == (n, p, n + p)


@pytest.mark.thorough
@given(loops())
def test_turns_agree_with_a_dense_grid(loop):
    count = encirclements(loop.FH)
    poles = np.concatenate([f.roots for f in loop.FH.den])
    zeros = loop.p_B.roots
    near = np.append(poles, zeros)
    damping = np.abs(near.real) / np.abs(near)
    assume(count.encirclements is not None and damping.min() >= 3e-4)
    turns = turns_counted_on_a_dense_grid(loop.FH, -1, near)
    assert turns == pytest.approx(count.encirclements, abs=0.1)


@pytest.mark.thorough
@given(loops(delayed=True))
def test_turns_with_delay_agree_with_a_dense_grid(loop):
    count = encirclements(loop.FH)
    poles = np.concatenate([f.roots for f in loop.FH.den])
    damping = np.abs(poles.real) / np.abs(poles)
    omega = np.union1d(np.geomspace(1e-6, 300, 30_001), np.linspace(0, 300, 30_001)[1:])
    values = loop.FH(1j * omega) + 1
    assume(count.encirclements is not None)
    assume(damping.min() >= 3e-4 and np.abs(values).min() >= 1e-3)
    assume(abs(values[-1] - 1) <= 0.5)  # the plot has come to rest within the grid
    assert round(-turned(values) / np.pi) == pytest.approx(count.encirclements, abs=0.3)


@pytest.mark.parametrize("multiplicity", [1, 2, 3])
def test_poles_on_the_axis_of_any_multiplicity_are_passed_on_the_right(multiplicity):
    # 1 + k/(s^2+1)^m = 0: the closed-loop roots are known in closed form.
    model = 1 / (s**2 + 1) ** multiplicity
    loop = nrdob.NRDOB(model, model, 0.5, nrdob.LowPassFilter(1, 2 * multiplicity))
    count = encirclements(loop.CGm)
    roots = np.roots(np.polyadd(np.poly([1j, -1j] * multiplicity).real, [0.5]))
    assert count.open_loop_rhp == 0
    if np.abs(roots.real).min() > 1e-6:
        assert count.encirclements == count.closed_loop_rhp == np.sum(roots.real > 0)
    else:
        assert count.encirclements is None


def test_a_plot_through_the_point_is_said_to_be_one():
    loop = nrdob.NRDOB(1 / (s + 1), 1 / (s + 2) * 2, 1, nrdob.LowPassFilter(1, 1))
    count = encirclements(loop.ratio, 1.0)  # equal DC gains: the plot starts at +1
    assert count.encirclements is None
    assert "passes through the point" in count.reason


def test_sampled_frequencies_hold_a_resonance_between_any_grid_points():
    G = 1 / (s**2 + 2e-7 * s + 1)
    loop = nrdob.NRDOB(G, 1 / (s + 1) ** 2, 1, nrdob.LowPassFilter(0.1, 2))
    peak = np.abs(loop.G(1j * resolved_frequencies(loop.FH))).max()
    assert peak > 0.9 * np.abs(loop.G(1j))


@pytest.mark.parametrize(("name", "point"), [("H", -1.0), ("ratio", 0.0)])
def test_a_plot_that_turns_for_ever_has_infinitely_many_turns_but_finitely_many_zeros(name, point):
    count = encirclements(getattr(paper.example(4), name), point)
    # 1 + H = G/Gm has the two zeros of the rational part, both on the left.
    assert (count.encirclements, count.closed_loop_rhp) == (np.inf, 0)
    assert "infinitely many" in count.reason


def test_a_curve_that_ends_at_the_point_has_no_turns_to_count():
    s = ct.tf("s")
    loop = nrdob.NRDOB((s + 3) / (s + 1) ** 2, (s + 2) / (s + 1) ** 2, 1, nrdob.LowPassFilter(1, 1))
    found = encirclements(loop.ratio, point=1.0)
    assert found.encirclements is None and found.closed_loop_rhp == 0
    assert "infinite frequency" in found.reason


def test_a_curve_that_stays_at_the_point_has_no_turns_to_count():
    found = encirclements(nrdob.paper.example(1).ratio, point=1.0)
    assert found.encirclements is None and found.closed_loop_rhp is None
    assert "stays at the point" in found.reason
