"""A delayed model: the diagram solved by SymPy, and every map against it."""

import control as ct
import numpy as np
import pytest
import sympy as sp

import nrdob

s = ct.tf("s")
R, DELTA, D, ETA = INPUTS = sp.symbols("R delta d eta")
G, GM, C, F, E, EM = sp.symbols("G Gm0 C F E Em")  # E and Em are the dead times
S = np.array([0.1 + 0.3j, 2j, 1.5 - 4j, 0.05])


@pytest.fixture(scope="module")
def solved():
    """The signals of the diagram in `nrdob.diagram.equations`, G with its dead time E."""
    u, y, e = sp.symbols("u y e")
    yf = F * (y + ETA) + (1 - F * EM) * GM * u
    found = sp.solve(
        [
            sp.Eq(e, R - yf),
            sp.Eq(u, C * e + F * EM * u - F / GM * (y + ETA)),
            sp.Eq(y, G * E * (u + DELTA) + D),
        ],
        [u, y, e],
    )
    return {"u": found[u], "y": found[y], "e": found[e]}


def of(signal, input):
    return sp.factor(sp.diff(signal, input))


def test_the_error_never_sees_the_plant_nor_a_dead_time(solved):
    assert sp.simplify(of(solved["e"], R) - 1 / (1 + GM * C)) == 0
    assert all(sp.simplify(of(solved["e"], other)) == 0 for other in (DELTA, D, ETA))


@pytest.mark.slow
def test_it_is_the_only_prediction_that_leaves_the_controller_without_dead_time():
    u, y, a, b = sp.symbols("u y a b")
    Ce = u - F * EM * u + F / GM * y  # what the controller gives, by the line for u
    unknown = a * y + b * u - GM * Ce
    found = sp.solve([sp.diff(unknown, y), sp.diff(unknown, u)], [a, b], dict=True)[0]
    assert sp.simplify(found[a] - F) == 0
    assert sp.simplify(found[b] - (1 - F * EM) * GM) == 0
    # The same as Gm0 u + F (y - Gm u): Smith's predictor with a filtered error.
    assert sp.expand((1 - F * EM) * GM * u + F * y - (GM * u + F * (y - GM * EM * u))) == 0


@pytest.mark.slow
@pytest.mark.parametrize(("theta", "wait"), [(0.5, 0.3), (0.5, 0.5), (0.2, 0.9), (0.0, 0.4)])
def test_every_map_is_what_elimination_gives(solved, theta, wait):
    blocks = 2 / ((s + 1) * (s + 3)), 1 / ((s + 1.2) * (s + 2)), (s + 1) / s
    filter = nrdob.LowPassFilter(0.3, 2)
    loop = nrdob.NRDOB(
        nrdob.delay(theta) * blocks[0], nrdob.delay(wait) * blocks[1], blocks[2], filter
    )
    expected = {
        "T_R": of(solved["y"], R), "S_d": of(solved["y"], D), "S_delta": of(solved["y"], DELTA),
        "S_eta": of(solved["y"], ETA), "E_R": of(solved["e"], R), "U_R": of(solved["u"], R),
        "U_d": of(solved["u"], D), "U_eta": of(solved["u"], ETA),
        "U_delta": 1 + of(solved["u"], DELTA),
        "K": F / ((1 - F * EM) * GM), "L": F * G * E / ((1 - F * EM) * GM), "CGm": C * GM,
        "H": G * E / GM - EM, "FH": F * (G * E / GM - EM), "Gm": GM * EM, "ratio": G * E / GM,
    }  # fmt: skip
    values = [block(S) for block in (*blocks, filter)]
    late = np.exp(-theta * S), np.exp(-wait * S)
    for name, formula in expected.items():
        wanted = sp.lambdify((G, GM, C, F, E, EM), formula)(*values, *late)
        assert getattr(loop, name)(S) == pytest.approx(wanted, rel=1e-11), name


@pytest.mark.slow
def test_p_B_is_the_denominator_that_elimination_leaves(solved):
    N, D_, Nm, Dm, Nf, Df = sp.symbols("N D Nm Dm Nf Df")
    ours = D_ * Nm * (Df - Nf * EM) + N * Dm * Nf * E
    S_d = of(solved["y"], D).subs({G: N / D_, GM: Nm / Dm, F: Nf / Df})
    assert sp.simplify(S_d - D_ * Nm * (Df - Nf * EM) / ours) == 0


def test_equal_dead_times_are_one():
    G0 = 1 / (s + 1)
    F2 = nrdob.LowPassFilter(0.3, 1)
    matched = nrdob.NRDOB(nrdob.delay(0.7) * G0, nrdob.delay(0.7) * G0, 2, F2)
    assert matched.p_B.delay == 0 and matched.p_B.roots.real == pytest.approx([-1, -1 / 0.3])
    assert matched.stability().observer_loop.kind == "rational"
    detuned = nrdob.NRDOB(nrdob.delay(0.7) * 1.2 * G0, nrdob.delay(0.7) * G0, 2, F2)
    assert [term.delay for term in detuned.p_B.terms] == [0.0, 0.7]
    # 0.1 + 0.2 is not 0.3, but meant to be.
    rounded = nrdob.NRDOB(nrdob.delay(0.1) * nrdob.delay(0.2) * G0, nrdob.delay(0.3) * G0, 2, F2)
    assert rounded.process.delay != rounded.model.delay
    assert rounded.p_B.delay == 0


def test_a_model_with_no_dead_time_is_what_it_was():
    ex = nrdob.paper.example(4)
    loop = nrdob.NRDOB(ex.process, nrdob.delay(0.0) * ex.model, ex.controller, ex.filter)
    assert loop.p_B.q.tolist() == ex.p_B.q.tolist() and loop.p_B.r.tolist() == ex.p_B.r.tolist()
    assert repr(loop.stability()) == repr(ex.stability())


def test_the_integral_action_of_the_observer_is_kept_exactly():
    ex = nrdob.paper.example(4)
    loop = nrdob.NRDOB(ex.process, nrdob.delay(0.04) * ex.model, ex.controller, ex.filter)
    assert loop.S_d.dc_gain == 0 and np.isinf(loop.L.dc_gain) and loop.T_R.dc_gain == 1
    # 1 - F exp(-θm s) = (nλ + θm) s + …: no digit is lost beside s = 0.
    small = np.array([1e-12, 1e-9j, 1e-15j])
    assert loop.S_d(small) == pytest.approx(
        small * (3 * 0.09 + 0.04) * 4 * 1 / (1.5 * 2.5), rel=1e-8
    )


def test_an_integrating_model_leaves_a_zero_of_p_B_at_the_origin_unless_its_block_is_built_as_one():
    blocks = (
        nrdob.delay(1.0) / ((s + 0.1) * (0.1 * s + 1)), nrdob.delay(0.9) / s, 0.3,
        nrdob.LowPassFilter(0.5, 2),
    )  # fmt: skip
    kept = nrdob.NRDOB(*blocks, keep_factors=True)
    assert kept.p_B.zeros_at_origin == 1 and "integrator" in kept.stability().reason
    # With (1 - F exp(-θm s))/s built as one block of finite memory the rest is what counts.
    loop = nrdob.NRDOB(*blocks)
    assert loop.p_B.zeros_at_origin == 0 and loop.stability().stable
    assert loop.p_B(0.0) == pytest.approx(0.1 * (2 * 0.5 + 0.9) + 1)
    at = np.array([1e-9j, 1e-3, 0.3 + 2j, 40j])
    assert loop.p_B(at) * at == pytest.approx(kept.p_B(at), rel=1e-9)
    assert loop.K(at) == pytest.approx(kept.K(at), rel=1e-9)
    assert loop.S_delta(at) == pytest.approx(kept.S_delta(at), rel=1e-9)
    assert kept.p_B.without_origin.degree == loop.p_B.degree == 4 - 1


def test_a_filter_of_degree_1_can_match_its_dead_time_to_first_order():
    # (s + 1) - (2s + 1) exp(-s) = 3s²/2 - …
    model = nrdob.delay(1.0) * ((s + 2) / (s + 1))
    loop = nrdob.NRDOB(model, model, 0.1, ct.tf([2, 1], [1, 1]))
    assert loop.one_minus_F.zeros_at_origin == 2
