import warnings
from math import inf

import control as ct
import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings

import nrdob
from nrdob import LowPassFilter
from nrdob.diagram import rational_power
from strategies import loops

pytestmark = pytest.mark.usefixtures("no_warning_leaks")

s = ct.tf("s")


@pytest.mark.parametrize(("order", "index"), [(1, 1 / 2), (2, 1 / 4), (3, 3 / 16)])
@pytest.mark.parametrize("time_constant", [1e-6, 0.3, 1e3])
def test_a_perfect_model_passes_noise_in_inverse_proportion_to_lambda(order, index, time_constant):
    G = 1 / (s + 1) ** order
    loop = nrdob.NRDOB(G, G, 1.0, LowPassFilter(time_constant, order))
    assert loop.S_eta.noise_power() == pytest.approx(index / time_constant, rel=1e-12)
    # A dead time alone lets the same noise through.
    assert nrdob.NRDOB(nrdob.delay(2) * G, G, 1.0, LowPassFilter(1, order)).G.noise_power() == (
        pytest.approx(nrdob.NRDOB(G, G, 1.0, LowPassFilter(1, order)).G.noise_power(), rel=1e-12)
    )


@pytest.mark.thorough
@settings(max_examples=25)
@given(loops())
def test_power_without_dead_time_is_the_square_of_controls_norm(loop):
    assume(max(np.roots(loop.p_B.q).real, default=-1.0) < -1e-3)
    num, den = loop.S_eta.numerator.q, loop.S_eta.denominator.q
    assume(num.size < den.size)
    system = ct.ss(ct.tf(num, den))
    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always")
        theirs = ct.norm(system, 2, print_warning=False)
    assume(not doubts)  # of the other side, where time scales are far apart
    assert loop.S_eta.noise_power() == pytest.approx(theirs**2, rel=1e-5)


@pytest.mark.parametrize("roots", [[-1, -2], [-1e-6 + 1j, -1e-6 - 1j], [-1e5, -1.0, -1e-5, -3]])
def test_power_of_a_rational_map_is_the_sum_over_its_poles(roots):
    mp.mp.dps = 40
    roots = [mp.mpc(root) for root in roots]
    den = [1.0]
    for root in roots:
        den = [a - root * b for a, b in zip([*den, 0], [0, *den], strict=True)]  # times (s - root)
    exact = sum(
        1
        / mp.fprod(root - other for other in roots if other is not root)
        / mp.fprod(-root - other for other in roots)
        for root in roots
    )
    found = rational_power(np.ones(1), np.array([float(mp.re(c)) for c in den]))
    assert found == pytest.approx(float(mp.re(exact)), rel=1e-9)


@pytest.mark.thorough
def test_power_with_dead_time_is_the_integral_by_extended_precision():
    G = 1 / (s + 1) ** 2
    loop = nrdob.NRDOB(nrdob.delay(0.5) * 1.1 * G, G, 1.0, LowPassFilter(0.4, 2))
    mp.mp.dps = 18

    def density(omega):
        at, value = mp.mpc(0, omega), mp.mpf(1)
        for factors, sign in ((loop.S_eta.num, 2), (loop.S_eta.den, -2)):
            for p in factors:
                q, r = (mp.polyval([mp.mpf(c) for c in part.tolist()], at) for part in (p.q, p.r))
                value *= abs(q + r * mp.exp(-at * p.delay)) ** sign
        return value

    points = [*range(0, 30, 2), 40, 60, 100, 200, 400]  # beyond it falls with the fourth power
    exact = mp.quad(density, points, maxdegree=6) / mp.pi
    rest = density(400) * 400 / 3 / mp.pi
    assert loop.S_eta.noise_power() == pytest.approx(float(exact + rest), rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dead_time", "time_constant", "order"), [(5.0, 4.0, 2), (0.05, 0.09, 3), (3.0, 6.0, 2)]
)
def test_power_with_dead_time_is_the_integral_over_all_frequencies(dead_time, time_constant, order):
    G = 1 / (s + 1) ** order
    F = LowPassFilter(time_constant, order)
    loop = nrdob.NRDOB(nrdob.delay(dead_time) * 1.1 * G, G, 0.3, F)
    assert loop.stability().stable is True
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half = 0.05 * min(1 / dead_time, 1 / time_constant)
    omega = (half * (2 * np.arange(30000) + 1))[:, None] + half * nodes
    for quotient in (loop.S_eta, loop.T_R):
        body = float(np.sum(np.abs(quotient(1j * omega)) ** 2 * weights) * half / np.pi)
        assert quotient.noise_power() == pytest.approx(body, rel=1e-7)


def test_power_near_the_limit_of_stability_is_that_of_the_nearly_undamped_pair():
    # R = exp(-sT) and n = 1: the pair comes onto the axis at λ = 2T/π.
    G, T = 1 / (s + 1), 1.0
    powers = []
    for excess in (1e-3, 1e-4, 1e-5):
        F = LowPassFilter(2 * T / np.pi * (1 + excess), 1)
        powers.append(nrdob.NRDOB(nrdob.delay(T) * G, G, 1.0, F).S_eta.noise_power() * excess)
    assert powers[1] == pytest.approx(powers[2], rel=1e-3)
    # s λ + exp(-sT) = 0 moves by -s/(1 + sT)·dλ/λ from s = jπ/(2T); power |residue|²/|Re s|.
    root = 0.5j * np.pi / T
    residue = abs(1 / (2 * T / np.pi * (1 + root * T)))
    damping = (root / (1 + root * T)).real
    assert powers[2] == pytest.approx(residue**2 / damping, rel=1e-3)


def test_short_and_long_dead_times_tend_to_their_limits():
    G, F = 1 / (s + 1), LowPassFilter(1.0, 2)
    plain = nrdob.NRDOB(1.1 * G, G, 1.0, F).S_eta.noise_power()
    short = nrdob.NRDOB(nrdob.delay(1e-9) * 1.1 * G, G, 1.0, F).S_eta.noise_power()
    assert short == pytest.approx(plain, rel=1e-8)
    # R = exp(-sT), n = 1, λ = aT: the power is that of T = 1, divided by T.
    unit, long = (
        nrdob.NRDOB(nrdob.delay(T) * G, G, 1.0, LowPassFilter(2 * T, 1)).S_eta.noise_power() * T
        for T in (1.0, 1e4)
    )
    assert long == pytest.approx(unit, rel=1e-9)


def test_first_order_with_pure_delay_is_the_known_integral():
    # Küchler and Mensch, Langevin's stochastic differential equation extended by a time-delayed
    # term, Stochastics and Stochastics Reports 40 (1992).
    G = 1 / (s + 1)
    for T, lam in ((1.0, 1.0), (0.1, 2.0), (1.0, 0.7)):
        loop = nrdob.NRDOB(nrdob.delay(T) * G, G, 1.0, LowPassFilter(lam, 1))
        b = 1 / lam  # x' = -b x(t - T) + noise has the variance (1 + sin bT)/(2b cos bT)
        exact = b**2 * (1 + np.sin(b * T)) / (2 * b * np.cos(b * T))
        assert loop.S_eta.noise_power() == pytest.approx(exact, rel=1e-10)


def test_a_model_that_waits_exactly_passes_what_the_filter_passes():
    G = nrdob.delay(1.3) / (s + 1)
    loop = nrdob.NRDOB(G, G, 1.0, LowPassFilter(0.5, 2))
    assert loop.S_eta.noise_power() == pytest.approx(1 / (4 * 0.5), rel=1e-12)


@pytest.mark.thorough
@pytest.mark.parametrize(("theta", "wait", "order"), [(1.0, 0.8, 2), (0.0, 0.7, 2), (0.5, 1.1, 3)])
def test_two_dead_times_pass_the_integral_of_the_squared_size(theta, wait, order):
    loop = nrdob.NRDOB(
        nrdob.delay(theta) / (s + 1), nrdob.delay(wait) / (s + 1.2), 1.0, LowPassFilter(0.4, order)
    )
    for quotient in (loop.S_eta, loop.U_eta, loop.S_delta):
        power, last = 0.0, 2000.0
        nodes, weights = np.polynomial.legendre.leggauss(20)
        for low in np.arange(0.0, last, 2.0):
            omega = low + 1 + nodes
            power += weights @ np.abs(quotient(1j * omega)) ** 2
        omega = np.linspace(last - 500, last, 20_001)
        decay = 2 * (quotient.denominator.degree - quotient.numerator.degree)
        height = (np.abs(quotient(1j * omega)) ** 2 * omega**decay).mean()  # of what turns
        power += height * last ** (1 - decay) / (decay - 1)
        assert quotient.noise_power() == pytest.approx(power / np.pi, rel=2e-7)


@pytest.mark.parametrize("dead_time", [0.0, 0.1])
def test_infinite_power_is_refused_with_the_reason(dead_time):
    G, Gm = nrdob.delay(dead_time) / (s + 1), 1 / (s + 1)
    loop = nrdob.NRDOB(G, Gm, 1 / s, LowPassFilter(0.5, 1))
    with pytest.raises(ValueError, match="S_d is infinite: it is not strictly proper"):
        loop.S_d.noise_power()
    with pytest.raises(ValueError, match="root at s = 0; make the loop stable"):
        loop.L.noise_power()
    unstable = nrdob.NRDOB(nrdob.delay(dead_time) / (s - 1), 1 / (s + 1), 1, LowPassFilter(9, 1))
    with pytest.raises(ValueError, match="right half plane; make the loop stable"):
        unstable.S_eta.noise_power()
    border = nrdob.NRDOB(nrdob.delay(dead_time) / (s + 1), 1 / (s**2 + 4), 1, LowPassFilter(1, 2))
    with pytest.raises(ValueError, match="undecided"):
        border.Gm.noise_power()


@pytest.mark.slow
def test_a_numerator_with_and_without_dead_time_passes_what_its_turns_leave():
    # |F|² |exp(-jω) - 1|², of which 2/(2λ) is left without the cosine and exp(-1/λ) of it with it.
    loop = nrdob.NRDOB(nrdob.delay(1) / (s + 1), 1 / (s + 1), 1, LowPassFilter(2, 1))
    assert loop.FH.noise_power() == pytest.approx((1 - np.exp(-0.5)) / 2, rel=1e-9)
    assert nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), 1, LowPassFilter(2, 1)).FH.noise_power() == 0.0


def test_coloured_noise_is_white_noise_in_a_larger_state_space():
    G = 4 / (s**2 + 0.5 * s + 1)
    loop = nrdob.NRDOB(G, 1 / (s + 1) ** 2, 1 / s, LowPassFilter(0.4, 2))
    W = (0.3 * s + 1) / (s**2 + 0.2 * s + 4)
    assert loop.stability().stable
    for quotient in (loop.S_eta, loop.U_eta, loop.S_d):  # of which the last two pass white noise
        both = ct.ss(ct.tf(quotient.numerator.q, quotient.denominator.q)) * ct.ss(W)
        P = ct.lyap(both.A, both.B @ both.B.T)
        assert quotient.noise_power(W) == pytest.approx((both.C @ P @ both.C.T).item(), rel=1e-8)


@pytest.mark.parametrize("dead_time", [0.05, 1.0])
def test_coloured_noise_with_dead_time_is_the_integral_of_its_spectrum(dead_time):
    G = 1 / (s + 1) ** 2
    loop = nrdob.NRDOB(nrdob.delay(dead_time) * G, G, 1.0, LowPassFilter(1.3 * dead_time, 2))
    W = 3 / (0.5 * s + 1)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    width = 0.5 / dead_time
    omega = width * (np.arange(4000)[:, None] + 0.5 + nodes / 2)
    for quotient in (loop.S_eta, loop.U_eta):
        body = float(np.sum(quotient.spectrum(omega, W) * weights) * width / 2 / np.pi)
        rest = float(quotient.spectrum(omega[-1, -1], W)) * omega[-1, -1] / np.pi  # 1/ω² at least
        assert quotient.noise_power(W) == pytest.approx(body, rel=1e-6, abs=rest)


def test_a_density_is_a_shaping_filter_of_its_square_root():
    G = 1 / (s + 1)
    loop = nrdob.NRDOB(G, G, 1.0, LowPassFilter(0.5, 2))
    assert loop.noise_variance(0.09**0.5).y == pytest.approx(0.09 * 0.5, rel=1e-12)
    assert loop.noise_variance().u == loop.U_d.noise_power()


@pytest.mark.parametrize(
    ("shaping", "message"),
    [
        (1 / s, "shaping has a pole at 0: behind it noise has no finite power"),
        (1 / (s - 1), "shaping has a pole at 1: behind it"),
        (s, "shaping is improper"),
        (nrdob.delay(1.0) / (s + 1), "shaping has a dead time of 1 s"),
    ],
)
def test_a_shaping_filter_must_be_stable(shaping, message):
    loop = nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), 1.0, LowPassFilter(0.5, 2))
    with pytest.raises(ValueError, match=message):
        loop.noise_variance(shaping)
    with pytest.raises(ValueError, match=message):
        loop.S_eta.spectrum([1.0], shaping)


def test_variances_of_an_unstable_loop_are_refused_also_where_noise_passes_directly():
    loop = nrdob.NRDOB(1 / (s - 1), 1 / (s + 1), 1, LowPassFilter(9, 1))
    with pytest.raises(ValueError, match="has roots in the right half plane; make the loop stable"):
        loop.noise_variance()
    with pytest.raises(ValueError, match="make the loop stable"):
        loop.U_eta.check_stable()


def test_at_a_motor_noise_and_rejection_obey_a_bound_that_butterworths_filter_reaches() -> None:
    # ‖U_η‖² ‖S_d/s‖⁶ ≥ 27/64 J² for a plant 1/(Js + b): complete the square of ë + √2 k ė + k² e.
    s, inertia = ct.tf("s"), 0.3
    rng = np.random.default_rng(27)

    def price(friction: float, num: list[float], den: list[float]) -> float:
        motor = 1 / (inertia * s + friction)
        loop = nrdob.NRDOB(motor, motor, 2.0, ct.tf(num, den))
        return loop.U_eta.noise_power() * loop.S_d.step_energy() ** 3 / inertia**2

    assert price(0.0, [1], [0.04, 0.2 * np.sqrt(2), 1]) == pytest.approx(27 / 64, rel=1e-9)
    assert price(0.5, [1], [0.04, 0.2 * np.sqrt(2), 1]) > 27 / 64
    for _ in range(20):
        den = np.poly(-rng.uniform(0.3, 3, 3))
        assert price(rng.uniform(0, 1), [rng.uniform(-1, 3) * den[-2], den[-1]], den) > 27 / 64


def test_noise_with_a_white_part_reaches_u_with_infinite_variance():
    # W S_eta = -2/(s + 1), and U_eta = -2 (s + 1)/(s + 2).
    G = 1 / (s + 1)
    loop = nrdob.NRDOB(G, G, 1.0, LowPassFilter(0.5, 1))
    found = loop.noise_variance((s + 2) / (s + 1))
    assert found.y == pytest.approx(2.0, rel=1e-12) and found.u == inf


def test_no_noise_is_no_variance_of_a_stable_loop():
    G = 1 / (s + 1)
    assert nrdob.NRDOB(G, G, 1.0, LowPassFilter(0.5, 1)).noise_variance(0) == (0.0, 0.0)
    with pytest.raises(ValueError, match="make the loop stable"):
        nrdob.NRDOB(1 / (s - 1), G, 1.0, LowPassFilter(9, 1)).noise_variance(0)
