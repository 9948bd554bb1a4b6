"""Families: reproducible, whoever draws them; members that are what was asked for."""

from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

import nrdob
from nrdob.uncertain.plantfamily import BLOCK

LAG = ct.tf([1], [1, 1])


def test_members_are_the_same_however_many_there_are_and_whoever_asks():
    few = nrdob.plant_family(LAG, gain=(0.5, 2), delay=(0, 0.1), samples=50, seed=7)
    many = nrdob.plant_family(LAG, gain=(0.5, 2), delay=(0, 0.1), samples=BLOCK + 50, seed=7)
    assert np.array_equal(few["gain"], many["gain"][:50])
    assert np.array_equal(many.drawn.block(1)["delay"], many["delay"][BLOCK:])
    assert not np.array_equal(many["gain"][:50], many["gain"][BLOCK:])
    other = nrdob.plant_family(LAG, gain=(0.5, 2), delay=(0, 0.1), samples=50, seed=8)
    assert not np.array_equal(few["gain"], other["gain"])


def test_a_member_is_gain_lag_and_dead_time_on_top_of_the_process():
    process = nrdob.delay(0.2) * LAG
    plants = nrdob.plant_family(process, gain=(0.5, 2), delay=(-0.1, 0.1), lag=(0, 0.3), samples=9)
    for k in (0, -1, 4):
        gain, delay, lag = (plants[name][k] for name in ("gain", "delay", "lag"))
        s = 0.3 + 0.7j
        expected = gain / ((s + 1) * (lag * s + 1)) * np.exp(-(0.2 + delay) * s)
        assert plants[k](s) == pytest.approx(expected)
    assert len(plants) == 9 and plants.names == ("gain", "delay", "lag")
    with pytest.raises(IndexError):
        plants[9]


def test_a_grid_has_every_combination():
    plants = nrdob.plant_family(LAG, gain=(1, 3), lag=(0, 1), grid=3)
    assert plants["gain"].tolist() == [1, 1, 1, 2, 2, 2, 3, 3, 3]
    assert plants["lag"].tolist() == [0, 0.5, 1] * 3


def test_fits_are_drawn_with_their_moments():
    covariance = np.array([[0.04, 0.01], [0.01, 0.09]])
    fitted = nrdob.plant_family(LAG, fit=({"gain": 2.0, "lag": 1.0}, covariance), samples=BLOCK)
    drawn = np.array([fitted["gain"], fitted["lag"]])
    assert drawn.mean(axis=1) == pytest.approx([2, 1], abs=0.02)
    assert np.cov(drawn) == pytest.approx(covariance, abs=0.005)
    estimates = {name: SimpleNamespace(value=value) for name, value in (("J", 2.0), ("b", 1.0))}
    named = nrdob.plant_family(LAG, parameters=motor, fit=(estimates, covariance), samples=7)
    assert named[3](1.0) == pytest.approx(1 / (named["J"][3] + named["b"][3]))


def motor(J, b):
    return [1.0], [J, b]


def test_a_function_makes_plants_of_parameters():
    plants = nrdob.plant_family(LAG, parameters=motor, J=(1, 2), b=(3, 4), gain=(5, 6), samples=5)
    J, b, gain = (plants[name][3] for name in ("J", "b", "gain"))
    assert plants[3](1.0) == pytest.approx(gain / (J + b))


@pytest.mark.parametrize(
    ("given", "kind", "said"),
    [
        ({"gain": (2.0, 0.3)}, ValueError, r"from high to low; write \(0.3, 2\)"),
        ({"gain": (2.0, 2.0)}, ValueError, "nothing is uncertain"),
        ({"gain": (0.0, np.inf)}, ValueError, "finite"),
        ({"gain": 2.0}, TypeError, "give an interval"),
        ({"gain": ("a", "b")}, TypeError, "no real numbers"),
        ({}, ValueError, "nothing is uncertain"),
        ({"J": (1, 2)}, TypeError, "nothing takes J"),
        ({"gain": (1, 2), "samples": 0}, ValueError, "samples is 0"),
        ({"gain": (1, 2), "samples": 2.5}, TypeError, "whole number"),
        ({"gain": (1, 2), "seed": -1}, ValueError, "seed is -1"),
        ({"gain": (1, 2), "grid": 1}, ValueError, "2 or more"),
        ({"gain": (1, 2), "grid": 2.5}, TypeError, "whole number"),
        ({"fit": ({"gain": 1.0}, [[1.0]]), "grid": 3}, ValueError, "a fit has no grid"),
        ({"fit": ({"gain": 1.0}, [[-1.0]])}, ValueError, "negative variance"),
        ({"fit": ({"gain": 1.0}, [1.0, 2.0])}, ValueError, "shape"),
        ({"fit": ({"gain": np.nan}, [[1.0]])}, ValueError, "finite"),
        ({"fit": [1.0]}, TypeError, "means by name"),
        ({"fit": ({"gain": "1"}, [[1.0]])}, TypeError, "real numbers by name"),
        ({"fit": ({"J": 1.0}, [[1.0]])}, ValueError, "only a function"),
        ({"gain": (1, 2), "fit": ({"gain": 1.0}, [[1.0]])}, ValueError, "drawn twice"),
    ],
)
def test_what_is_no_family_is_refused_with_a_remedy(given, kind, said):
    with pytest.raises(kind, match=said):
        nrdob.plant_family(LAG, **given)


def test_a_column_that_is_not_there_is_refused_with_those_that_are():
    with pytest.raises(KeyError, match="the columns are gain"):
        nrdob.plant_family(LAG, gain=(1, 2))["lag"]
