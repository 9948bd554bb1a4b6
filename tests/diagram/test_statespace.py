import control as ct
import numpy as np
import pytest

import nrdob
from nrdob.diagram.statespace import MAX_STATES, polynomials

s = ct.tf("s")


def chain(poles, gain=1.0):
    """Lags in a row, each driving the next: no entry of A is lost against another."""
    poles = np.asarray(poles, dtype=float)
    n = poles.size
    A = np.diag(poles) + np.diag(-poles[:-1], 1)
    B = np.zeros((n, 1))
    B[-1] = -poles[-1] * gain
    return ct.ss(A, B, np.eye(n)[:1], 0)


def turned(system, rng, orthogonal=True):
    """The same system in coordinates that hide its structure."""
    T = rng.standard_normal((system.nstates,) * 2)
    T = np.linalg.qr(T)[0] if orthogonal else T
    return ct.ss(np.linalg.solve(T, system.A @ T), np.linalg.solve(T, system.B), system.C @ T, 0)


def integrators(den):
    return den.size - 1 - np.flatnonzero(den)[-1]


def test_a_chain_of_lags_six_decades_apart_has_unit_gain_and_no_integrator():
    A = np.diag([-1e4, -10, -0.1, -0.01]) + np.diag([1e4, 10, 0.1], 1)
    P = ct.ss(A, [[0], [0], [0], [0.01]], [[1, 0, 0, 0]], 0)
    num, den = polynomials(P, "process")
    assert num[-1] / den[-1] == pytest.approx(1, rel=1e-14)
    assert den == pytest.approx(np.poly([-1e4, -10, -0.1, -0.01]), rel=1e-13)
    sets = [nrdob.stabilizing_time_constants(G, 1 / (s + 1), 1) for G in (P, ct.tf(P))]
    assert np.array(sets[0]) == pytest.approx(np.array(sets[1]), rel=1e-6)


@pytest.mark.parametrize("decades", [5, 6, 8, 12])
@pytest.mark.parametrize("seed", range(8))
def test_no_integrator_is_invented_however_far_the_poles_are_apart(decades, seed):
    rng = np.random.default_rng(seed)
    poles = -(10.0 ** np.append(rng.uniform(-decades / 2, decades / 2, 3), [decades / 2]))
    poles = np.append(poles, -(10.0 ** (-decades / 2)))
    companion = ct.ss(*map(np.array, _companion(np.poly(poles))))
    for system, zeros in ((chain(poles), 0), (companion, 0), (_parallel(poles, rng), None)):
        num, den = polynomials(system, "process")
        assert integrators(den) == 0
        assert den == pytest.approx(np.poly(poles), rel=1e-12)
        if zeros is not None:
            assert num.size == 1


def _companion(den):
    n = den.size - 1
    A = np.eye(n, k=-1)
    A[0] = -den[1:]
    return A, np.eye(n)[:, :1], np.eye(n)[-1:], [[0.0]]


def _parallel(poles, rng):
    n = poles.size
    return ct.ss(np.diag(poles), np.ones((n, 1)), rng.uniform(0.5, 2, (1, n)) * -poles, 0)


@pytest.mark.parametrize("orthogonal", [True, False])
@pytest.mark.parametrize("count", [0, 1, 2, 3])
@pytest.mark.parametrize("seed", range(6))
def test_integrators_and_relative_degree_are_found_in_any_coordinates(seed, count, orthogonal):
    rng = np.random.default_rng(seed)
    poles = np.append(-(10.0 ** rng.uniform(-1, 1, int(rng.integers(1, 4)))), np.zeros(count))
    zeros = -(10.0 ** rng.uniform(-1, 1, int(rng.integers(0, poles.size))))
    plain = ct.tf2ss(ct.zpk(zeros, poles, 3.0))
    num, den = polynomials(turned(plain, rng, orthogonal), "process")
    assert integrators(den) == count
    assert (num.size, den.size) == (zeros.size + 1, poles.size + 1)
    at = 1j * np.geomspace(0.01, 100, 9)
    exact = 3 * np.prod(at[:, None] - zeros, axis=1) / np.prod(at[:, None] - poles, axis=1)
    assert np.polyval(num, at) / np.polyval(den, at) == pytest.approx(exact, rel=1e-8)


def test_a_zero_at_the_origin_is_found_in_any_coordinates():
    for seed in range(10):
        rng = np.random.default_rng(seed)
        plain = ct.tf2ss(s / ((s + 1) * (s + 2) * (s + 3)))
        num, _ = polynomials(turned(plain, rng), "process")
        assert num.size == 2 and num[-1] == 0


def test_coarse_coordinates_are_refused_rather_than_misread():
    poles, read, refused = -np.array([1e5, 30.0, 0.1, 1e-5]), [], []
    for seed in range(20):
        system = turned(chain(poles), np.random.default_rng(seed))
        try:
            read.append(polynomials(system, "process"))
        except ValueError as error:
            refused.append(str(error))
    assert refused and all("pass the transfer function" in words for words in refused)
    assert all(integrators(den) == 0 and num.size == 1 for num, den in read)


def test_a_pole_within_rounding_of_the_origin_is_refused():
    # The two states differ by 1e-11 of what is subtracted: an integrator, or a pole there?
    A = np.array([[-1.0, 1.0], [1.0, -1.0 + 1e-11]])
    with pytest.raises(ValueError, match=r"a pole of process at s = 0 cannot be told.*transfer"):
        polynomials(ct.ss(A, [[1.0], [0.0]], [[0.0, 1.0]], 0), "process")


def test_hidden_modes_stay_in_both_polynomials():
    hidden = ct.ss(np.diag([-1.0, 2.0]), [[1.0], [0.0]], [[1.0, 1.0]], 0)  # 2 is not reached
    num, den = polynomials(hidden, "process")
    assert num == pytest.approx([1, -2]) and den == pytest.approx([1, -1, -2])


def test_a_connection_of_states_is_that_of_transfer_functions():
    G = ct.series(ct.tf2ss(1 / (s * (s + 1))), ct.tf2ss((s + 3) / (s + 5)))
    num, den = polynomials(G, "process")
    assert num == pytest.approx([1, 3]) and den == pytest.approx([1, 6, 5, 0])


def test_what_cannot_be_read_exactly_is_refused_with_the_remedy():
    n = MAX_STATES + 1
    with pytest.raises(ValueError, match="reduced model"):
        polynomials(ct.ss(-np.eye(n), np.ones((n, 1)), np.ones((1, n)), 0), "process")
    with pytest.raises(ValueError, match=r"process has an entry.*not finite"):
        polynomials(ct.ss([[np.nan]], [[1.0]], [[1.0]], 0), "process")
    with pytest.raises(ValueError, match="another unit of time"):
        polynomials(ct.ss(-1e200 * np.eye(2), np.ones((2, 1)), np.ones((1, 2)), 0), "process")


def test_a_gain_without_states_is_a_gain():
    num, den = polynomials(ct.ss([], [], [], [[2.0]]), "process")
    assert num.tolist() == [2.0] and den.tolist() == [1.0]
