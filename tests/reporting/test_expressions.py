"""Formulas as one writes them: what they mean, and what is refused."""

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob.reporting import read_block
from nrdob.reporting.formulas import formula

AT = 0.3 + 0.7j


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("4/(s^2+3s+2)", 4 / (AT**2 + 3 * AT + 2)),
        ("2(s+1)(s+2)", 2 * (AT + 1) * (AT + 2)),
        ("-s^2", -(AT**2)),
        ("(-s)**2", AT**2),
        ("s^-2", AT**-2),
        ("1/(0.5 s + 1)/(.1s+1.)", 1 / (0.5 * AT + 1) / (0.1 * AT + 1)),
        ("1e-3 s + 2E+1", 1e-3 * AT + 20),
        ("1/(s+1) exp(-0.3s)", np.exp(-0.3 * AT) / (AT + 1)),
        ("exp(-s/2)*exp(-0.25 s)", np.exp(-0.75 * AT)),
        ("exp(-s)/(s+1) - exp(-s)", np.exp(-AT) * (1 / (AT + 1) - 1)),
        ("(exp(-0.1s)/s)^3", np.exp(-0.3 * AT) / AT**3),
        ("exp(-0 s)", 1),
        ("(" * 39 + "s" + ")" * 39, AT),
        ("s^(-(2))", AT**-2),
    ],
)
def test_a_formula_has_the_value_it_reads(text, value):
    assert read_block(text)(AT) == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize(
    "block",
    [
        ct.tf([2, 1], [1, 3, -2]),
        ct.tf([-1], [1e-7, 0]),
        ct.tf(1, np.poly(-np.ones(12))),
        nrdob.delay(0.3) * ct.tf([1, 0, 4], [1e-9, 2e-5, 1]),
        nrdob.LowPassFilter(0.05, 3),
        ct.tf(0.5, 1),
    ],
)
def test_what_a_report_prints_can_be_typed_in_again(block):
    read = read_block(formula(block), "--process")
    s = 1j * np.geomspace(0.01, 100, 30)
    dead = np.exp(-s * getattr(block, "delay", 0.0))
    rational = block.tf if hasattr(block, "tf") else block
    assert read.tf(s) * np.exp(-s * read.delay) == pytest.approx(rational(s) * dead, rel=1e-3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("1/(s+1)(s+2)", "after a quotient"),
        ("1/2s", "after a quotient"),
        ("exp(0.3s)", "predict the future"),
        ("1/exp(-s)", "predict the future"),
        ("exp(2)", "no dead time"),
        ("exp(-s^2)", "nothing but -T s"),
        ("exp s", "needs a bracket"),
        ("s + exp(-s)", "only one dead time"),
        ("s^0.5", "whole number"),
        ("s^^2", "no power"),
        ("s^99", "degree above 40"),
        ("(s+1)^40 (s+1)", "degree is above 40"),
        ("(s+1", "not closed"),
        ("s+", "breaks off"),
        ("s)", "nothing may follow"),
        ("1/(s-s)", "divided by zero"),
        ("1e400", "overflow"),
        ("(" * 5000, "characters"),
        ("(" * 500, "within each other"),
        ("-" * 500 + "s", "within each other"),
        ("s^" + "(" * 500, "within each other"),
        ("9^9^9", "nothing may follow"),
        ("__import__('os')", "what is '__import__'"),
        ("s.real", "what is '.real'"),
        ("1/(s2+3s+2)", "'2' stands right behind 's': write a power with ^"),
        ("1.5.2", "'.2' stands right behind '1.5'"),
    ],
)
def test_what_is_no_transfer_function_is_refused_in_a_sentence(text, said):
    with pytest.raises(ValueError, match=r"^--process, ") as caught:
        read_block(text, "--process")
    assert said in str(caught.value)


def test_terms_over_the_same_denominator_have_no_common_factor():
    block = read_block("1/(s-1) + 2/(s-1) - s/(s-1)")
    assert block.tf.den[0][0].tolist() == [1, -1] and block.tf.num[0][0].tolist() == [-1, 3]


@pytest.mark.parametrize("text", ["*2", "1/(s+*3)", "/s", "s+)", "(s+1)^2-/3)"])
def test_what_stands_where_a_number_must_is_named(text):
    with pytest.raises(ValueError, match="stands where a number, s or a bracket must"):
        read_block(text)
