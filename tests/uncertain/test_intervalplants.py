"""Interval plants: two theorems, one exact, one that refuses too much, and what is sampled."""

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob import LowPassFilter, paper
from nrdob.numerics import ROUNDING, hurwitz
from nrdob.uncertain import interval_plants


def around(coefficients, part):
    return [tuple(sorted((c * (1 - part), c * (1 + part)))) for c in coefficients]


def sampled(loop, num, den, share, rng, count=20_000):
    """Share of stable plants among corners and random ones of a share of the box."""
    G, columns = loop.fractions.G, []
    for nominal, given in ((G.num, num), (G.den, den)):
        t = rng.uniform(size=(nominal.size, count))
        t[:, : count // 2] = np.round(t[:, : count // 2])
        low, high = np.array(given).T[:, :, None]
        columns.append(nominal[:, None] + share * (low + t * (high - low) - nominal[:, None]))
    A = np.convolve(loop.built.E.q, loop.built.Nm.q)
    B = np.convolve(loop.built.Nf.q, loop.built.Dm.q)
    p = np.array([np.polyadd(np.convolve(d, A), np.convolve(n, B)) for n, d in
                  zip(columns[0].T, columns[1].T, strict=True)]).T  # fmt: skip
    return hurwitz(p, ROUNDING * np.abs(p))[0].mean()


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_box_of_coefficients_survives_up_to_its_exact_share(number):
    loop = paper.example(number)
    G = loop.fractions.G
    num, den = around(G.num, 0.9), around(G.den, 0.9)
    shares = interval_plants(loop, num, den)
    assert 0 < shares.kharitonov <= shares.exact
    rng = np.random.default_rng(number)
    assert sampled(loop, num, den, shares.exact * (1 - 1e-6), rng, 4000) == 1
    if shares.exact < 1:
        assert sampled(loop, num, den, min(1.2 * shares.exact, 1.0), rng, 4000) < 1


def test_one_uncertain_gain_survives_up_to_the_bound_of_a_pure_gain_error():
    G = ct.tf([1], [1, 3, 2])
    loop = nrdob.NRDOB(G, G, ct.tf([1], [1, 0]), LowPassFilter(0.05, 3))
    shares = interval_plants(loop, [(1.0, 17.0)], [(1, 1), (3, 3), (2, 2)])
    assert shares.exact == pytest.approx(0.5)  # half way to 17 is 9
    assert shares.kharitonov < shares.exact


def test_what_the_theorems_do_not_hold_for_is_refused():
    loop = paper.example(3)
    for given, said in (
        (([(3, 5)], [(-1, -1), (-1, -1)]), "3 coefficients"),
        (([(5, 6)], [(-1, -1), (-1, -1), (2, 2)]), "without the nominal 4"),
    ):
        with pytest.raises(ValueError, match=said):
            interval_plants(loop, *given)
    with pytest.raises(ValueError, match="leave out the dead time"):
        interval_plants(paper.example(4), [(1, 1)], [(1, 1), (4, 4), (4, 4)])
