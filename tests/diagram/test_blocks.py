import control as ct
import numpy as np
import pytest

from nrdob.diagram import as_fraction


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
