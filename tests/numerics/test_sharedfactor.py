import numpy as np
import pytest

from nrdob.numerics import QuasiPolynomial, shared_factor


def polynomial(roots):
    return QuasiPolynomial(np.atleast_1d(np.real(np.poly(roots))))


def product(a, b):
    return QuasiPolynomial(np.convolve(a.q, b.q), scale=np.convolve(a.scale, b.scale))


@pytest.mark.parametrize("decades", [1, 4, 8])
@pytest.mark.parametrize("seed", range(12))
def test_what_was_multiplied_in_is_divided_out_and_nothing_else(seed, decades):
    rng = np.random.default_rng(seed)
    shared, left, right = (
        -(10 ** rng.uniform(-decades / 2, decades / 2, int(rng.integers(low, high))))
        for low, high in ((1, 4), (0, 4), (1, 6))
    )
    if seed % 2:
        shared[:] = shared[0]  # a multiple root
    right[0] = shared[0] * (1 + 10.0 ** -(seed % 7 + 2))  # near, and not shared
    d = polynomial(shared)
    f, g = product(d, polynomial(left)), product(d, polynomial(right))
    _, u, v = shared_factor(f, g)
    assert (u.degree, v.degree) == (left.size, right.size)
    at = 1j * np.geomspace(1e-5, 1e5, 41)
    assert u(at) / v(at) == pytest.approx(f(at) / g(at), rel=1e-9)


@pytest.mark.parametrize("damping", [0.0, 1e-9, 1e-6, 0.1])
def test_an_undamped_pair_is_shared_with_its_damping(damping):
    pair = QuasiPolynomial([1.0, 2 * damping, 1.0])
    _, u, v = shared_factor(product(pair, polynomial([-1])), product(pair, polynomial([-2, -3])))
    assert (u.degree, v.degree) == (1, 2)
    other = QuasiPolynomial([1.0, 2 * damping + 1e-9, 1.0])
    _, u, v = shared_factor(product(pair, polynomial([-1])), product(other, polynomial([-2])))
    assert (u.degree, v.degree) == (3, 3)


def test_roots_at_the_origin_are_shared_exactly():
    _, u, v = shared_factor(polynomial([0, 0, -1]), polynomial([0, 0, 0, -2]))
    assert u.q.tolist() == [1.0, 1.0] and v.q.tolist() == [1.0, 2.0, 0.0]


def test_a_tenfold_root_is_shared_as_often_as_both_have_it():
    _, u, v = shared_factor(polynomial([-1.0] * 10), polynomial([-1.0] * 4 + [-3.0]))
    assert (u.degree, v.degree) == (6, 1)
