import control as ct
import numpy as np
import pytest

import nrdob
from blockwise import polynomial
from nrdob import interpolating_filter
from nrdob.diagram import ObserverEquations

s = ct.tf("s")


def derivatives(p, at, count):
    """Values of a polynomial and its derivatives, each against the size of its terms."""
    found = []
    for _ in range(count):
        found.append(abs(np.polyval(p, at)) / np.polyval(np.abs(p), abs(at)))
        p = np.polyder(p)
    return np.array(found)


@pytest.mark.parametrize("lag", [1e-3, 0.3, 50.0])
def test_every_condition_is_met_with_its_multiplicity(lag):
    zeros, poles = [2.0, 2.0, 0.5j, -0.5j], [1.0, 1.0, 1.0, 3 + 4j, 3 - 4j]
    model = ct.tf(polynomial(zeros), polynomial([*poles, 0.0, -1.0]))
    F = interpolating_filter(model, lag, ramp=2)
    num, den = F.num[0][0], F.den[0][0]
    difference = np.polysub(den, num)
    assert difference[-2:].tolist() == [0.0, 0.0] and num[-1] == den[-1] == 1.0
    for roots, p in ((zeros, num), (poles, difference)):
        for root in set(roots):
            assert derivatives(p, root, roots.count(root)).max() < 1e-12


@pytest.mark.parametrize(("order", "ramp"), [(None, 1), (4, 1), (None, 3), (6, 3)])
def test_without_anything_on_the_right_the_numerator_is_the_start_of_the_denominator(order, ramp):
    F = interpolating_filter((s + 2) / ((s + 1) * (s + 3)), 0.2, order, ramp)
    num, den = F.num[0][0], F.den[0][0]
    assert num == pytest.approx(den[-ramp:])
    assert den.size - 1 == (order or ramp)


def test_the_lowest_order_is_causal_and_one_less_is_refused():
    model = (2 - s) / ((s - 1) * (s + 1) * (s + 3))
    F = interpolating_filter(model, 0.1)
    assert F.den[0][0].size - F.num[0][0].size == 2  # the model's relative degree
    assert interpolating_filter(model, 0.1, 7).den[0][0].size == 8
    with pytest.raises(ValueError, match=r"1 times F = 0 and 2 times F = 1.*order 4 or more"):
        interpolating_filter(model, 0.1, 3)


def test_the_peak_lies_above_the_price_of_a_pole_beside_a_zero():
    F = interpolating_filter((s - 3) / ((s - 2) * (s + 1)), 0.1)
    assert np.abs(F(1j * np.geomspace(0.01, 1000, 2000))).max() > abs((3 + 2) / (3 - 2))


def random_polynomial(rng, degree, decades):
    roots = []
    while len(roots) < degree:
        size = 10 ** rng.uniform(-decades / 2, decades / 2) * rng.choice([-1, 1])
        kind = rng.choice(["real", "pair", "double", "axis"]) if degree - len(roots) > 1 else "real"
        pair = size * np.exp(1j * (np.pi / 2 if kind == "axis" else rng.uniform(0.1, 1.5)))
        roots += {"real": [size], "double": [size, size]}.get(kind, [pair, pair.conjugate()])
    return polynomial(roots), sum(np.real(r) > -1e-12 * abs(r) for r in roots)


@pytest.mark.thorough
@pytest.mark.parametrize("decades", [1, 3, 5])
def test_what_cancels_is_recognised_in_random_models(decades):
    rng = np.random.default_rng(decades)
    for _ in range(200):
        degree = int(rng.integers(1, 5))
        den, poles = random_polynomial(rng, degree, decades)
        num, zeros = random_polynomial(rng, int(rng.integers(0, degree)), decades)
        F = interpolating_filter((num, den), 10 ** rng.uniform(-decades / 2, decades / 2))
        built = ObserverEquations((num, den), (num, den), F).built
        found = built.zeros.degree, built.poles.degree
        assert found >= (zeros, poles), (num, den, F, found, zeros, poles)


@pytest.mark.parametrize(
    ("model", "given", "reason"),
    [
        ((s - 1) / ((s - 1) * (s + 2)), {}, "a zero and a pole at s = 1, where F would have to be"),
        (s / (s + 1) ** 2, {}, "a zero at s = 0"),
        (1 / (s - 1), {"order": 1}, r"2 times F = 1 to meet.*take order 2 or more"),
        (1 / s**2, {"order": 2}, "take order 3 or more"),
        (1 / (s - 1), {"time_constant": 0.0}, "needs a positive number"),
        (1 / (s - 1), {"ramp": 0}, "ramp >= 1"),
        (nrdob.delay(1.0) / (s - 1), {}, "a pole at s = 1 and a dead time of 1 s"),
        (0 / (s + 1), {}, "identically zero"),
        ((s**2) / (s + 1), {}, "improper"),
    ],
)
def test_conditions_that_cannot_be_met_are_named(model, given, reason):
    with pytest.raises(ValueError, match=reason):
        interpolating_filter(model, **{"time_constant": 0.1} | given)


@pytest.mark.parametrize("given", [{"ramp": 1.5}, {"order": 2.0}, {"time_constant": "1"}])
def test_what_is_no_number_is_refused(given):
    with pytest.raises(TypeError):
        interpolating_filter(1 / (s - 1), **{"time_constant": 0.1} | given)
