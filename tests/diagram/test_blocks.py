import dataclasses

import control as ct
import numpy as np
import pytest
from scipy import signal

import nrdob
from nrdob.diagram import as_fraction
from nrdob.sampling import random_loop


def test_state_space_gives_the_same_coefficients_as_its_transfer_function():
    G = ct.tf([2.0, 10.0], [1.0, 11.0, 10.0])
    num, den = as_fraction(ct.tf2ss(G), "process")
    assert num == pytest.approx(G.num[0][0]) and den == pytest.approx(G.den[0][0])


def test_state_space_keeps_its_relative_degree():
    G = ct.tf([3.0], np.poly([-1, -20, -300, -4000]))
    assert as_fraction(ct.tf2ss(G), "process").relative_degree == 4


def test_leading_zeros_are_dropped_and_a_number_is_a_gain():
    assert as_fraction(([0, 0, 5], [0, 1, 2]), "block").relative_degree == 1
    assert as_fraction(2, "block").num == [2.0]


@pytest.mark.parametrize(
    ("block", "error", "words"),
    [
        (ct.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]]), ValueError, "2 inputs"),
        (ct.tf([1.0], [1.0, 0.5], 0.1), ValueError, "discrete-time"),
        (ct.tf([1.0, 0.0, 0.0], [1.0, 1.0]), ValueError, "improper"),
        (([1.0], [float("nan"), 1.0]), ValueError, "finite"),
        (([float("inf")], [1.0, 1.0]), ValueError, "finite"),
        (([1.0], [0.0, 0.0]), ValueError, "denominator 0"),
        (([1j], [1.0, 1.0]), TypeError, "complex"),
        (([[1.0, 2.0]], [1.0, 1.0]), ValueError, "shape"),
        ((["a"], [1.0]), TypeError, "real coefficients"),
        ("1/(s+1)", TypeError, "control.TransferFunction"),
        (None, TypeError, "NoneType"),
    ],
)
def test_what_cannot_be_read_is_named_with_the_remedy(block, error, words):
    with pytest.raises(error, match=words) as caught:
        as_fraction(block, "process")
    assert "process" in str(caught.value)


@pytest.mark.parametrize("delayed", [0.0, 0.1])
def test_scipys_systems_are_blocks_like_those_of_python_control(delayed):
    num, den = [2.0, 5.0], [1.0, 4.0, 5.0]
    given = [
        signal.lti(num, den),
        signal.TransferFunction([2, 5], [1, 4, 5]),
        signal.ZerosPolesGain([-2.5], [-2 + 1j, -2 - 1j], 2),
        signal.StateSpace([[0, 1], [-5, -4]], [[0], [1]], [[5, 2]], [[0]]),
    ]
    model, C, F = signal.lti([1], [1, 1]), signal.lti([], [0], 2.0), signal.lti([1], [0.5, 1])
    verdicts = []
    for block in (ct.tf(num, den), *given):
        read = as_fraction(block, "process")
        assert (read.num, read.den) == (pytest.approx(num), pytest.approx(den))
        process = nrdob.delay(delayed) * block if delayed else block
        loop = nrdob.NRDOB(process, model, C, F)
        verdicts.append((loop.stability().stable, loop.margins().plant_loop.ms))
    stable, peaks = zip(*verdicts, strict=True)
    assert all(stable) and peaks == pytest.approx([peaks[0]] * 5)


@pytest.mark.parametrize("seed", range(12))
def test_a_loop_does_not_depend_on_the_coordinates_or_hidden_modes_of_its_states(seed):
    rng = np.random.default_rng(seed)
    loop = random_loop(rng, delayed=bool(seed % 2))
    dead = loop.process.delay if seed % 2 else 0.0
    undelayed = loop.process.tf if seed % 2 else loop.process
    A, B, C, D = signal.tf2ss(*as_fraction(undelayed, "process"))
    n = len(A) + 1
    hidden = np.zeros((n, n))  # one more mode, at -2, that y does not show
    hidden[:-1, :-1], hidden[-1, -1] = A, -2.0
    T = np.linalg.qr(rng.standard_normal((n, n)))[0]
    states = T.T @ hidden @ T, T.T @ np.vstack([B, [[1.0]]]), np.hstack([C, [[0.0]]]) @ T, D
    for kind in (ct.StateSpace, signal.StateSpace):
        found = dataclasses.replace(loop, process=nrdob.delay(dead) * kind(*states))
        assert found.stability().stable == loop.stability().stable
        if loop.stability().stable:
            ms = loop.margins().plant_loop.ms
            assert found.margins().plant_loop.ms == pytest.approx(ms, rel=1e-6)


@pytest.mark.parametrize("gain", [2.0, 1e-20])
def test_zeros_and_poles_keep_their_coefficients_however_small_the_gain(gain):
    read = as_fraction(signal.ZerosPolesGain([-1e9], [-1e12, -3.0], gain), "process")
    assert read.num == pytest.approx(gain * np.array([1.0, 1e9]), rel=1e-12)
