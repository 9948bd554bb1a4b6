"""Linear ADRC is an NR-DOB: checked against its own observer, and its sets against poles."""

from functools import cache
from math import inf, pi

import control as ct
import numpy as np
import pytest
import sympy as sp

from campaigns.charts import region_at
from nrdob import delay
from nrdob.alternatives import (
    adrc_chart,
    adrc_stabilizing_bandwidths,
    adrc_stabilizing_gains,
    linear_adrc,
)
from nrdob.alternatives.adrc import adrc_filters

s = ct.tf("s")


@cache
def eliminated(order):
    """F from the equations of observer and state feedback, by SymPy."""
    S, b0, wo, wc, y, r = sp.symbols("S b0 wo wc y r")
    n = order + 1
    z = sp.symbols(f"z1:{n + 1}")
    gains = [sp.binomial(order, i) * wc ** (order - i) for i in range(order)]
    u = (gains[0] * r - sum(k * each for k, each in zip(gains, z, strict=False)) - z[-1]) / b0
    equations = []
    for i in range(n):
        right = sp.binomial(n, i + 1) * wo ** (i + 1) * (y - z[0])
        right += z[i + 1] if i + 1 < n else 0
        right += b0 * u if i == order - 1 else 0
        equations.append(S * z[i] - right)
    solved = u.subs(sp.solve(equations, z, dict=True)[0])
    K, prefilter = -sp.diff(solved, y), sp.diff(solved, r)
    loop = K * b0 / S**order
    return sp.cancel(loop / (1 + loop)), sp.cancel(prefilter), (S, b0, wo, wc)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_the_filter_keeps_the_lowest_terms_of_its_denominator(order):
    F, _, (S, _, wo, wc) = eliminated(order)
    den = sp.expand((S / wc + 1) ** order * (S / wo + 1) ** (order + 1))
    num = sum(den.coeff(S, k) * S**k for k in range(order + 1))
    assert sp.simplify(F - num / den) == 0
    filter = adrc_filters(order, 1.7).at(1 / 23.0)
    exact = [sp.Poly(p.subs({wo: 23, wc: sp.Rational(17, 10)}), S).all_coeffs() for p in (num, den)]
    for found, expected in zip((filter.num[0][0], filter.den[0][0]), exact, strict=True):
        np.testing.assert_allclose(found, np.array(expected, dtype=float), rtol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_the_reference_arrives_as_by_adrc_behind_a_prefilter(order):
    _, prefilter, symbols = eliminated(order)
    loop = linear_adrc(1 / (s + 1) ** order, order, 1.3, 11.0, 2.5)
    at = np.array([0.3j, 2 + 5j, -0.4 + 40j])
    by_hand = [
        complex(prefilter.subs(dict(zip(symbols, (x, 1.3, 11, 2.5), strict=True)))) for x in at
    ]
    before = 1.0 if order == 1 else (at + 2.5) / (3 * at + 2.5)
    np.testing.assert_allclose(loop.U_R(at) / loop.S_d(at) * before, by_hand, rtol=1e-10)


def in_state_space(G, order, b0, wo, wc):
    """Process, extended observer and state feedback, wired by hand: (R, d, δ) to (y, u)."""
    plant = ct.ss(G)
    n, m = plant.nstates, order + 1
    gains = [ct.tf([1], [1, wc]) ** order, ct.tf([1], [1, wo]) ** m]
    kc = gains[0].den[0][0][:0:-1]
    lo = gains[1].den[0][0][1:]
    feedback = -np.append(kc, 1.0) / b0
    observer = np.diag(np.ones(m - 1), 1)
    observer[:, 0] -= lo
    into = np.zeros(m)
    into[order - 1] = b0
    A = np.zeros((n + m, n + m))
    A[:n, :n] = plant.A
    A[:n, n:] = plant.B @ feedback[None]
    A[n:, n:] = observer + np.outer(into, feedback)
    A[n:, :n] = np.outer(lo, plant.C[0])
    reference = kc[0] / b0
    B = np.zeros((n + m, 3))
    B[:n, 0], B[n:, 0] = plant.B[:, 0] * reference, into * reference
    B[n:, 1] = lo
    B[:n, 2] = plant.B[:, 0]
    C = np.zeros((2, n + m))
    C[0, :n], C[1, n:] = plant.C[0], feedback
    return ct.ss(A, B, C, [[0, 1, 0], [reference, 0, 0]])


@pytest.mark.parametrize(("order", "G"), [(1, 2 / (s + 1)), (2, 3 / (s**2 + 0.4 * s + 1))])
def test_steps_are_those_of_observer_and_state_feedback(order, G):
    b0, wo, wc = 2.2, 15.0, 3.0
    loop = linear_adrc(G, order, b0, wo, wc)
    times = np.linspace(0, 4, 81)
    found = ct.step_response(in_state_space(G, order, b0, wo, wc), times).outputs
    for k, name in ((1, "d"), (2, "delta")):
        y, u = loop.step_response(name, times).outputs[:, 0]
        np.testing.assert_allclose(y, found[0, k], atol=1e-7)
        np.testing.assert_allclose(u - (name == "delta"), found[1, k], atol=1e-6)
    if order == 1:
        y, _ = loop.step_response("R", times).outputs[:, 0]
        np.testing.assert_allclose(y, found[0, 0], atol=1e-7)


def rightmost(G, order, b0, wo, wc):
    return max(ct.poles(in_state_space(G, order, b0, wo, wc)).real)


PLANTS = {
    "lag behind": 1 / (s * (0.3 * s + 1)),
    "unstable": 2 / ((s - 1) * (0.1 * s + 1)),
    "resonant": 4 / (s**2 + 0.2 * s + 4),
    "inverse response": (1 - 0.2 * s) / ((s + 1) * (0.5 * s + 1)),
    "three lags": 1 / ((s + 1) * (0.2 * s + 1) * (0.05 * s + 1)),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("order", [1, 2])
def test_bandwidths_are_those_with_all_poles_on_the_left(name, order):
    G = PLANTS[name]
    found = adrc_stabilizing_bandwidths(G, order, 3.0, 1.5)
    ends = [end for interval in found for end in interval]
    for wo in np.geomspace(0.02, 2000, 60):
        if all(abs(wo / end - 1) > 1e-3 for end in ends if end):
            inside = any(low < wo < high for low, high in found)
            assert inside == (rightmost(G, order, 3.0, wo, 1.5) < 0)
    for end in ends:
        if 0 < end < inf:
            assert abs(rightmost(G, order, 3.0, end, 1.5)) < 1e-6 * end


@pytest.mark.parametrize("tau", [0.01, 0.3, 5.0])
def test_b0_of_an_integrator_with_a_lag_begins_where_routh_says(tau):
    wo, wc = 8.0, 2.0
    a, beta, gamma = wc + 2 * wo, wo**2 + 2 * wc * wo, wc * wo**2
    third = 1 + tau * a  # of τ s⁴ + (1 + τa) s³ + a s² + k (β s + γ)
    largest = third * (a - third * gamma / beta) / (tau * beta)
    found = adrc_stabilizing_gains(1 / (s * (tau * s + 1)), 1, wo, wc)
    if largest <= 0:
        assert found == []
    else:
        ((low, high),) = found
        assert low == pytest.approx(1 / largest, rel=1e-9) and high == inf


def test_b0_has_the_sign_of_the_process():
    G = delay(0.1) / (s + 1)
    forward = adrc_stabilizing_gains(G, 1, 7.0, 2.0)
    mirrored = adrc_stabilizing_gains(-1 * G, 1, 7.0, 2.0)
    assert forward and all(low > 0 for low, _ in forward)
    for (low, high), (least, most) in zip(forward, reversed(mirrored), strict=True):
        assert (least, most) == pytest.approx((-high, -low), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_with_dead_time_every_end_is_where_a_count_changes(order):
    G = delay(0.07) * 5 / ((s + 0.5) * (0.1 * s + 1))

    def stable(wo, b0):
        return linear_adrc(G, order, b0, wo, 2.0).stability().stable

    bandwidths = adrc_stabilizing_bandwidths(G, order, 9.0, 2.0, highest=300.0)
    gains = adrc_stabilizing_gains(G, order, 20.0, 2.0)
    assert bandwidths and gains
    for found, judge in (
        (bandwidths, lambda x: stable(x, 9.0)),
        (gains, lambda x: stable(20.0, x)),
    ):
        for low, high in found:
            assert judge(low * (1 + 1e-6) if low else 1e-3)
            assert high in (inf, 300.0) or judge(high * (1 - 1e-6))
            assert not low or not judge(low * (1 - 1e-6))
            assert high in (inf, 300.0) or not judge(high * (1 + 1e-6))


def test_the_phase_of_an_integrator_with_dead_time_gives_the_largest_bandwidth():
    theta, wc = 0.1, 2.0
    ((low, high),) = adrc_stabilizing_bandwidths(delay(theta) / s, 1, 1.0, wc)
    assert low == 0.0
    # K(jω) e^(-jωθ)/(jω) = -1 there: the angle first, the size then.
    a, beta, gamma = wc + 2 * high, high**2 + 2 * wc * high, wc * high**2
    omega = np.roots([1.0, 0, a**2, 0, -(beta**2), 0, -(gamma**2)])
    omega = omega[(abs(omega.imag) < 1e-9) & (omega.real > 0)].real[0]
    angle = np.arctan(omega * beta / gamma) - np.arctan(omega / a)
    assert angle == pytest.approx(omega * theta, rel=1e-8)


@pytest.mark.slow
def test_the_chart_counts_what_single_loops_have():
    G = delay(0.1) / s
    chart = adrc_chart(G, 1, 2.0, observer_bandwidth=(1, 100), b0=(0.2, 20), ms=(2.0,))
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(25):
        wo, b0 = 100 ** rng.uniform(), 0.2 * 100 ** rng.uniform()
        region = region_at(chart, wo, b0)
        stable = linear_adrc(G, 1, b0, wo, 2.0).stability().stable
        if region is not None:
            seen.add(stable)
            assert stable == (region.count == 0) == (chart.count(wo, b0) == 0)
    assert seen == {True, False}
    level = np.concatenate(chart.ms_levels[2.0])
    wo, b0 = level[len(level) // 2]
    ms = linear_adrc(G, 1, float(b0), float(wo), 2.0).margins().plant_loop.ms
    assert ms == pytest.approx(2.0, rel=0.05)
    assert "bandwidth of the observer" in chart.plot().alt


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"order": 3}, ValueError, "order is 3; linear ADRC is here of order 1 or 2: take"),
        ({"order": 1.5}, TypeError, "whole number"),
        ({"b0": 0}, ValueError, "b0 is 0; it must be finite and not 0: take the leading"),
        ({"b0": "much"}, TypeError, "b0 is 'much', a str; give what is known of the process"),
        ({"observer_bandwidth": -3.0}, ValueError, "observer_bandwidth is -3.0; it is a frequency"),
        ({"controller_bandwidth": 0.0}, ValueError, "controller_bandwidth is 0.0; it is a freq"),
        ({"controller_bandwidth": inf}, ValueError, "positive and finite"),
    ],
)
def test_what_adrc_cannot_be_is_refused(change, error, message):
    given = {"order": 1, "b0": 1.0, "observer_bandwidth": 10.0, "controller_bandwidth": 2.0}
    with pytest.raises(error, match=message):
        linear_adrc(1 / s, **(given | change))


def test_a_bandwidth_that_is_real_may_be_of_any_kind():
    given = 1 / s, 1, 1.0
    loops = linear_adrc(*given, 10.0, 2 + 0j), linear_adrc(*given, 10 + 0j, 2)
    assert loops[0].controller == loops[1].controller == 2.0


def test_axes_of_the_chart_must_span_a_factor_of_twenty():
    with pytest.raises(ValueError, match=r"b0 reaches from 1.0 to 2.0; .* a factor of 20 or more"):
        adrc_chart(1 / s, 1, 2.0, observer_bandwidth=(1, 100), b0=(1, 2))
    with pytest.raises(TypeError, match=r"give \(low, high\)"):
        adrc_chart(1 / s, 1, 2.0, observer_bandwidth=5, b0=(1, 20 * pi))


@pytest.mark.parametrize("pole", [1.0, 3.0])
def test_an_unstable_process_needs_a_fast_enough_observer(pole):
    # y' = a y + u, u = -ωc ŷ - d̂: s^3 + p s^2 + q s + ωc ωo^2, stable for p q > ωc ωo^2.
    wc = 2.0
    p, q = np.array([2.0, wc - pole]), np.array([1.0, 2 * wc - 2 * pole, -pole * wc])
    least = np.roots(np.polysub(np.polymul(p, q), [wc, 0, 0])).real.max()
    ((low, high),) = adrc_stabilizing_bandwidths(1 / (s - pole), 1, 1.0, wc)
    assert low == pytest.approx(least, rel=1e-9) and high == inf


def test_the_fastest_observer_of_a_late_integrator_is_on_the_border_at_its_dead_time():
    # u = -(((2ωc ωo + ωo²) s + ωc ωo²)/(s (s + ωc + 2ωo))) y, and s y = u, late.
    wc, theta = 2.0, 0.1
    ((_, high),) = adrc_stabilizing_bandwidths(delay(theta) / s, 1, 1.0, wc)
    num, den = [2 * wc * high + high**2, wc * high**2], [1.0, wc + 2 * high, 0.0, 0.0]
    x = np.roots([1.0, den[1] ** 2, -(num[0] ** 2), -(num[1] ** 2)])
    omega = np.sqrt(x[np.abs(x.imag) < 1e-9].real.max())
    turned = np.angle(-np.polyval(num, 1j * omega) / np.polyval(den, 1j * omega))
    assert turned / omega == pytest.approx(theta, rel=1e-8)
