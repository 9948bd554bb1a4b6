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


@pytest.mark.slow
def test_one_uncertain_gain_survives_up_to_the_bound_of_a_pure_gain_error():
    G = ct.tf([1], [1, 3, 2])
    loop = nrdob.NRDOB(G, G, ct.tf([1], [1, 0]), LowPassFilter(0.05, 3))
    shares = interval_plants(loop, [(1.0, 17.0)], [(1, 1), (3, 3), (2, 2)])
    assert shares.exact == pytest.approx(0.5)  # half way to 17 is 9
    assert shares.kharitonov < shares.exact


@pytest.mark.thorough
@pytest.mark.parametrize("unit", [1.0, 1e-2, 1e-3, 1e-6, 1e6])
def test_the_unit_of_time_changes_no_share(unit):
    def written(*coefficients):
        return np.array(coefficients) * unit ** np.arange(len(coefficients) - 1, -1, -1.0)

    num, den = written(7.02, 25.2), written(1, 4.89, 27.6)
    model = ct.tf(written(4.94, 17.7), written(1, 5.54, 35.4))
    C = ct.tf(written(0.1, 0.1), written(1, 0))
    loop = nrdob.NRDOB(ct.tf(num, den), model, C, LowPassFilter(4.64 * unit, 1))
    boxes = [
        [(c * low, c * high) for c, (low, high) in zip(p, factors, strict=True)]
        for p, factors in (
            (num, [(0.06, 1.5), (0.15, 1.48)]),
            (den, [(0.0, 2.4), (0.0, 2.13), (0.33, 2.48)]),
        )
    ]
    shares = interval_plants(loop, *boxes)
    assert shares.kharitonov == pytest.approx(0.2823, abs=1e-4)
    assert shares.exact == pytest.approx(0.70618, abs=1e-4)
    rng = np.random.default_rng(1)
    assert sampled(loop, *boxes, 0.999 * shares.exact, rng, 4000) == 1
    assert sampled(loop, *boxes, 1.1 * shares.exact, rng, 4000) < 1


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
