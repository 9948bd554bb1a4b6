import numpy as np
import pytest

from nrdob import paper


def test_process_and_model_of_example_1_are_equal_and_the_others_are_not():
    s = np.array([1j, 2.0 + 1j])
    for number in paper.EXAMPLES:
        loop = paper.example(number)
        assert np.allclose(loop.G(s), loop.Gm(s)) == (number == 1)


@pytest.mark.parametrize("number", [2, 3, 4])
def test_a_modified_example_changes_the_plant_only(number):
    nominal, modified = paper.example(number), paper.example(number, modified=True)
    s = 1 + 2j
    assert nominal.Gm(s) == modified.Gm(s)
    assert nominal.C(s) == modified.C(s)
    assert nominal.filter == modified.filter
    assert nominal.G(s) != modified.G(s)


@pytest.mark.parametrize("claim", paper.PRINTED_FUNCTIONS)
def test_printed_transfer_functions_reproduce_except_eq_14(claim):
    computed = getattr(paper.example(int(claim[2])), claim.split(".")[1])
    assert paper.PRINTED_FUNCTIONS[claim].agrees_with(computed) == (claim != "ex3.H")


def test_eq_14_is_right_with_the_opposite_sign():
    H = paper.example(3).H
    printed = paper.PRINTED_FUNCTIONS["ex3.H"]
    s = 2 + 1j
    assert H(s) == pytest.approx(-np.polyval(printed.num, s) / np.polyval(printed.den, s))


def test_examples_that_the_paper_lacks_are_refused():
    with pytest.raises(ValueError, match="no Example 5"):
        paper.example(5)
    with pytest.raises(ValueError, match="no modified plant"):
        paper.example(1, modified=True)
