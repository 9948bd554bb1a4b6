import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import lambertw

from nrdob.numerics import QuasiPolynomial, Term, count_rhp
from nrdob.numerics.longdelay import rightmost_roots


@pytest.mark.parametrize("delay", 10.0 ** np.arange(-2, 8))
@pytest.mark.parametrize("gain", [-2.0, -0.3, 0.01, 0.36, 1.0, 30.0])
def test_the_rightmost_root_of_an_integrator_is_the_lambert_w_function(delay, gain):
    # (sT) exp(sT) = -KT, and the principal branch is the rightmost.
    expected = lambertw(-gain * delay) / delay
    root = rightmost_roots(np.array([1.0, 0.0]), [(np.array([gain]), delay)])[0]
    assert root.real == pytest.approx(expected.real, rel=1e-9)
    assert abs(root.imag) == pytest.approx(abs(expected.imag), rel=1e-9)


@pytest.mark.parametrize("delay", [60.0, 150.0, 400.0])
def test_hundreds_of_roots_on_the_right_are_all_found(delay):
    q, r = np.polymul([1.0, 0.02, 1.0], [1.0, 1.0]), np.array([1.0, 3.0])
    found = rightmost_roots(q, [(r, delay)])
    count = count_rhp(QuasiPolynomial(q, r, delay)).count
    assert 20 < count == np.sum(found.real > 0)


@pytest.mark.parametrize("ratio", [0.2, -0.7])
def test_the_chain_of_a_neutral_equation_is_seen_from_its_top(ratio):
    # (s + 1)(1 + c exp(-sT)): roots on one vertical line, and -1.
    delay = 50.0
    root = rightmost_roots(np.array([1.0, 1.0]), [(ratio * np.array([1.0, 1.0]), delay)])[0]
    assert root.real == pytest.approx(np.log(abs(ratio)) / delay, rel=1e-6)


@pytest.mark.parametrize("delay", [20.0, 60.0, 150.0])
@pytest.mark.parametrize("gains", [(1.5, -0.3), (-0.5, 0.8), (3.0, -2.0)])
def test_of_a_product_of_two_delayed_lags_the_rightmost_root_is_that_of_one(gains, delay):
    # (s + 1 + a exp(-sT)) (s + 1 + b exp(-sT)), each with the roots of the Lambert W function.
    a, b = gains
    terms = [(np.array([a * b]), 2 * delay), ((a + b) * np.array([1.0, 1.0]), delay)]
    found = rightmost_roots(np.array([1.0, 2.0, 1.0]), terms)
    alone = [lambertw(-each * delay * np.exp(delay)) / delay - 1 for each in gains]
    assert found[0].real == pytest.approx(max(each.real for each in alone), rel=1e-6)


def test_terms_that_are_small_everywhere_leave_the_root_near_that_without_them():
    q, delayed = np.array([1.0, 1.0]), [(np.array([0.01]), 2.0), (np.array([0.02]), 1.0)]
    # On the real axis left of 0 the sum rises from -∞ to its largest root.
    expected = brentq(lambda x: x + 1 + 0.01 * np.exp(-2 * x) + 0.02 * np.exp(-x), -1.5, 0.0)
    assert rightmost_roots(q, delayed)[0] == pytest.approx(expected, rel=1e-9)


def test_where_no_guess_leads_to_a_root_there_are_none():
    weak = QuasiPolynomial([1.0, 2.0, 2.0], [0.1], 200.0, more=(Term(np.array([0.05]), 70.0),))
    assert not weak.roots.size and not weak.roots_resolved and count_rhp(weak).count == 0


def test_roots_agree_with_another_program():
    tdscontrol = pytest.importorskip("tdscontrol")
    rng = np.random.default_rng(5)
    for _ in range(5):
        n = int(rng.integers(1, 5))
        q = np.real(np.poly(-rng.uniform(0.2, 3, n)))
        r, delay = q[-1] * rng.uniform(-2, 2, 1), rng.uniform(1, 5)
        A0, A1 = np.eye(n, k=1), np.zeros((n, n))
        A0[-1], A1[-1, 0] = -q[:0:-1], -r[0]
        system = tdscontrol.tds([np.asfortranarray(A0), np.asfortranarray(A1)], [0.0, delay])
        theirs = np.array(tdscontrol.roots(system, -1.5 / delay))
        ours = rightmost_roots(q, [(r, delay)])[0]
        assert abs(theirs - ours).min() < 1e-6 * abs(ours)
        assert theirs.real.max() == pytest.approx(ours.real, rel=1e-6)


def test_a_chain_that_rises_to_its_line_has_no_rightmost_root():
    # |r/q| rises to 1/2 at infinity: the real parts rise to -ln(2)/T, which no root has.
    assert not rightmost_roots(np.ones(2), [(np.array([0.5, 0.1]), 50.0)]).size


def test_where_the_argument_cannot_be_followed_no_root_is_called_the_rightmost():
    terms = [(np.array([0.5]), 1e5), (np.array([0.4]), 1e5 / np.pi)]
    assert not rightmost_roots(np.array([1.0, 0.001]), terms).size


@pytest.mark.slow
@pytest.mark.parametrize(
    ("poles", "gain", "delay"),
    [([0.0, -0.0815, -1.0147], 0.0248, 4.35), ([0.0, -0.0088, -0.5085], 0.0056, 24.7)],
)
def test_a_slow_root_beside_an_integrator_is_found(poles, gain, delay):
    # Neither a pole nor a turn of the dead time is near it.
    q, r = np.poly(poles), np.array([gain])
    first = rightmost_roots(q, ((r, delay),))[0]

    def p(s):
        return np.polyval(q, s) + gain * np.exp(-s * delay)

    assert abs(p(first)) < 1e-12 * np.polyval(np.abs(q), abs(first))
    line = first.real + 1e-3 * abs(first)
    turned = np.unwrap(np.angle(p(line + 1j * np.linspace(0, 1e4, 2_000_001))))
    assert (turned[-1] - turned[0]) / np.pi == pytest.approx(len(poles) / 2, abs=1e-3)
