"""Sampled loops: the verdict against python-control's sampled blocks and poles, and the rest."""

import control as ct
import pytest

import nrdob
from nrdob import paper
from nrdob.digital import largest_sampling_time

DT = 0.01


@pytest.mark.parametrize("side", ["nrdob", "control"])
def test_sampled_verdict(race, side):
    loop = paper.example(3)

    def ours():
        return loop.sampled(DT, computation_delay=DT).stability().stable

    def theirs():
        # Poles of 1 + K G z^-1; what cancels between the blocks is not seen, nor is it counted.
        K = ct.sample_system(ct.ss(loop.K.to_tf()), DT, "tustin")
        G = ct.sample_system(ct.ss(loop.process), DT, "zoh")
        closed = ct.feedback(K * G * ct.ss(ct.tf([1], [1, 0], DT)))
        return bool((abs(closed.poles()) < 1).all())

    race("sampled: verdict, Example 3", side, ours, theirs)


@pytest.mark.parametrize("side", ["nrdob", "control"])
def test_sampled_margins(race, side):
    loop = paper.example(3)
    sampled = loop.sampled(DT)
    sampled.stability()
    K = ct.sample_system(loop.K.to_tf(), DT, "tustin")
    L = K * ct.sample_system(ct.ss(loop.process), DT, "zoh")

    def ours():
        fresh = loop.sampled(DT)
        return fresh.margins()

    race("sampled: verdict and margins, Example 3", side, ours, lambda: ct.stability_margins(L))


@pytest.mark.parametrize(
    ("name", "run"),
    [
        ("largest sampling time, Example 3", lambda: largest_sampling_time(paper.example(3))),
        (
            "set of time constants, Example 4",
            lambda: nrdob.stabilizing_time_constants(
                paper.example(4).process, paper.example(4).model, 3, dt=DT
            ),
        ),
        ("step response, Example 4", lambda: paper.example(4).sampled(DT).step_response("R", 6.0)),
    ],
)
def test_sampled_answers_that_nobody_else_gives(race, name, run):
    race(f"sampled: {name}", "nrdob", run, run)
