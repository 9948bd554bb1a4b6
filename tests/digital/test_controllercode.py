"""The controller as C and Python: compiled, run, and compared with the simulation."""

import re
import subprocess
import sys
from importlib.resources import files

import control as ct
import numpy as np
import pytest
from scipy.signal import bilinear_zpk, sosfilt, zpk2sos

import nrdob
from firmware import (
    COMPILERS,
    compiler,
    python_class,
    relative,
    run_c,
    run_python,
    run_two,
)
from nrdob.alternatives import linear_adrc
from nrdob.digital import ActuatorLimits, Section
from nrdob.sampling import random_loop

LAG = ct.tf([2.0], [1.0, 1.0])
PI = ct.tf([1.0, 1.0], [1.0, 0.0])
LIMITS = ActuatorLimits(-1.0, 1.5, rate=12.0)


def sampled_loop(dt=0.05, wait=0.0, controller=PI, lag=0.5):
    model = nrdob.delay(wait) * LAG if wait else LAG
    process = nrdob.delay(0.13) * ct.tf([2.2], [1.1, 1.0])
    filter = nrdob.LowPassFilter(lag, 1)
    return nrdob.NRDOB(process, model, controller, filter).sampled(dt)


def pulse(sampled, name):
    A, B, C, D = sampled.controller.blocks[name]
    return ct.ss(A, B[:, None], C[None], D, sampled.dt)


def random_sampled(rng):
    """Draw a sampled loop whose blocks are stable, so that rounding does not grow in them."""
    while True:
        loop = random_loop(rng, delayed=bool(rng.integers(2)))
        dt = 10 ** rng.uniform(-3, -0.5)
        sampled = loop.sampled(dt, computation_delay=float(rng.choice([0.0, 0.3, 1.0])) * dt)
        if np.abs(np.linalg.eigvals(sampled.controller.A)).max() <= 1 + 1e-9:
            return sampled


def drawn(seed):
    """Return a sampled loop, how it is run, and what came of it."""
    rng = np.random.default_rng(seed)
    sampled = random_sampled(rng)
    limits = [
        None,
        ActuatorLimits(-1, 1.5),
        ActuatorLimits(-1, 1.5, rate=3 / sampled.dt),
        ActuatorLimits(rate=5),
    ][seed % 4]
    start = [None, 0.7][seed % 2]
    R, d = rng.standard_normal((2, 200))
    found = sampled.simulate(
        {"R": R, "d": d, "delta": 0.3}, noise=0.1, limits=limits, start=start, seed=rng
    )
    return sampled, limits, start, R, found


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_c_and_python_do_what_the_simulation_does(seed):
    sampled, limits, start, R, expected = drawn(seed)
    given = R, expected.measured, expected.applied, start
    in_c = run_c(sampled, "loop", *given, limits=limits)
    in_python = run_python(sampled.code(limits=limits).to_python(), *given)
    for found in (in_c, in_python):
        for signal, name in zip(found, ("u", "applied", "d_hat"), strict=True):
            assert relative(signal, getattr(expected, name)) < 1e-12


@pytest.mark.slow
def test_the_code_of_the_chapter_on_processors_does_what_its_simulation_does():
    motor, s = nrdob.plants.motor_speed(), ct.tf("s")
    C = (0.01 * s + 0.1001) / (0.01 * 0.1 * s)
    loop = nrdob.NRDOB(nrdob.delay(0.002) * motor, motor, C, nrdob.LowPassFilter(0.03, 1))
    sampled = loop.sampled(0.01, computation_delay=0.01)
    expected = sampled.simulate({"R": 5.0, "delta": -2.0}, noise=0.2, timepts=2.0)
    given = np.full(expected.u.size, 5.0), expected.measured, expected.applied
    assert relative(run_python(sampled.code().to_python(), *given)[0], expected.u) < 1e-12
    assert relative(run_c(sampled, "speed", *given)[0], expected.u) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("wait", [0.2, 0.13, 0.03])
def test_a_model_that_waits_is_generated_with_its_memory(wait):
    sampled = sampled_loop(wait=wait)
    R = np.sign(np.sin(np.arange(300) * 0.05))
    for start in (None, 0.3):
        expected = sampled.simulate(
            {"R": R}, noise=0.1, limits=LIMITS, tracking_time=0.4, start=start
        )
        given = R, expected.measured, expected.applied, start
        made = {"limits": LIMITS, "tracking_time": 0.4}
        for found in (
            run_c(sampled, "w", *given, **made),
            run_python(sampled.code(**made).to_python(), *given),
        ):
            assert relative(found[0], expected.u) < 1e-12
            assert relative(found[1], expected.applied) < 1e-12
            assert relative(found[2], expected.d_hat) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(("dt", "order"), [(0.1, 1), (1e-3, 4)])
def test_float_keeps_five_digits_at_any_sampling_time(dt, order):
    lags = ct.tf([2.0], np.poly([-1.0] * order))
    sampled = nrdob.NRDOB(lags, lags, PI, nrdob.LowPassFilter(0.5, order)).sampled(dt)
    t = np.arange(round(5 / dt)) * dt
    R = np.sign(np.sin(2 * t))
    expected = sampled.simulate({"R": R, "delta": 0.3 * np.sin(t)})
    assert "double" not in sampled.code().to_c("small", "float")
    u = run_c(sampled, "small", R, expected.measured, expected.applied, dtype="float")[0]
    assert np.abs(u - expected.u).max() < 1e-5 * np.abs(expected.u).max()
    # In powers of z the same digits do not even hold F, where the sampling is fast.
    sos = zpk2sos(*bilinear_zpk([], [-2.0] * order, 2.0**order, 1 / dt))
    exact = sosfilt(sos, expected.measured)
    direct = sosfilt(sos.astype(np.float32), expected.measured.astype(np.float32))
    lost = np.abs(direct - exact).max() / np.abs(exact).max()
    assert (lost > 1e-3) == (dt == 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["double", "float"])
def test_limits_hold_in_the_generated_code_itself(dtype):
    sampled = sampled_loop()
    R = 5 * np.sign(np.sin(np.arange(300) * 0.1))
    expected = sampled.simulate({"R": R}, limits=LIMITS, tracking_time=0.4)
    given = R, expected.measured, expected.applied
    applied = run_c(sampled, "small", *given, dtype=dtype, limits=LIMITS, tracking_time=0.4)[1]
    tolerance = 1e-12 if dtype == "double" else 1e-5
    np.testing.assert_allclose(applied, expected.applied, atol=tolerance)
    assert applied.min() >= -1.0 - tolerance
    assert applied.max() <= 1.5 + tolerance
    steps = np.abs(np.diff(np.append(0.0, expected.applied)))
    assert steps.max() <= 12.0 * 0.05 + 1e-12


def test_blocks_held_like_the_process_are_generated_too():
    sampled = nrdob.NRDOB(LAG, LAG, PI, nrdob.LowPassFilter(0.5, 2)).sampled(0.05, "zoh")
    R = np.random.default_rng(0).standard_normal(200)
    expected = sampled.simulate({"R": R}, limits=LIMITS)
    u = run_python(sampled.code(limits=LIMITS).to_python(), R, expected.measured, expected.applied)[
        0
    ]
    assert relative(u, expected.u) < 1e-12
    z = np.exp(1j * np.linspace(0.01, 3, 50))
    held = ct.sample_system(ct.tf([1.0], [0.25, 1.0, 1.0]), 0.05, "zoh")
    np.testing.assert_allclose(pulse(sampled, "F")(z), held(z), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("wait", [0.0, 0.13])
def test_started_at_a_manual_value_the_first_output_is_that_value_if_c_integrates(wait):
    sampled = sampled_loop(wait=wait)
    assert "is this u" in sampled.code().to_c() and "is this u" in sampled.code().to_python()
    controller = python_class(sampled.code().to_python())()
    controller.start(3.0, 0.9, 0.4)
    assert controller.output(3.0, 0.9) == pytest.approx(0.4, rel=1e-12)
    u = run_c(sampled, "nrdob", *(np.array([v]) for v in (3.0, 0.9, 0.4)), 0.4)[0]
    assert u[0] == pytest.approx(0.4, rel=1e-12)


def test_a_c_without_an_integrator_goes_on_with_u_only_from_rest_and_says_so():
    adrc = linear_adrc(nrdob.plants.motor_position(), 2, 10.0, 20.0, 5.0).sampled(0.005)
    p_only = nrdob.NRDOB(LAG, LAG, 1.5, nrdob.LowPassFilter(0.5, 1)).sampled(0.05)
    for sampled in (adrc, p_only):
        for text in (sampled.code().to_c(), sampled.code().to_python()):
            assert "C has no integrator" in text and "is this u" not in text
    controller = python_class(p_only.code().to_python())()
    controller.start(1.0, 0.3, 0.7)
    assert abs(controller.output(1.0, 0.3) - 0.7) > 0.1
    # At rest y = 2 (u + d), and C asks for 1.5 (r - y) = u + d: r = y (1 + 1/3).
    controller.start(0.4, 0.3, 0.7)
    assert controller.output(0.4, 0.3) == pytest.approx(0.7, rel=1e-12)


# Samples that are not finite.

BAD = [np.nan, np.inf, -np.inf]


@pytest.mark.thorough
@pytest.mark.parametrize("dtype", ["double", "float"])
@pytest.mark.parametrize("cc", COMPILERS)
@pytest.mark.parametrize("seed", range(4))
def test_what_is_not_finite_is_left_out_by_each_of_two_instances(cc, dtype, seed):
    rng = np.random.default_rng(seed)
    sampled = [sampled_loop(), sampled_loop(wait=0.13), sampled_loop(controller=1.5),
               sampled_loop(wait=0.1, lag=0.2)][seed]  # fmt: skip
    made = {"limits": [LIMITS, None, ActuatorLimits(0.2, 0.9), ActuatorLimits(rate=5)][seed]}
    inputs = rng.standard_normal((120, 4))
    worse = inputs.copy()
    bad = rng.random(inputs.shape) < 0.05
    worse[bad] = rng.choice(BAD, bad.sum())
    found, skipped = run_two(cc, sampled, "two", dtype, worse, **made)
    whole = [np.isfinite(worse[:, columns]).all(axis=1) for columns in ([0, 1], [2, 3])]
    for i in range(2):
        twin = python_class(sampled.code(**made).to_python())()
        never = python_class(sampled.code(**made).to_python())()  # which does not even meet them
        held = twin.command
        for k, (r, y) in enumerate(worse[:, 2 * i : 2 * i + 2].tolist()):
            u = twin.step(r, y)
            if whole[i][k]:
                held = never.step(r, y)
            assert u == held
            assert found[i, k] == pytest.approx(u, abs=1e-12 if dtype == "double" else 2e-5)
        assert twin.skipped == skipped[i, -1] == (~whole[i]).sum() > 0


@pytest.mark.slow
@pytest.mark.parametrize("bad", BAD)
def test_an_actuator_that_answers_nonsense_is_taken_to_obey(bad):
    told, obeyed = (python_class(sampled_loop().code().to_python())() for _ in "12")
    for k in range(20):
        u = obeyed.step(1.0, 0.1 * k)
        assert told.output(1.0, 0.1 * k) == u
        told.update(bad if k == 7 else u)
    assert (told.skipped, obeyed.skipped) == (1, 0)
    R, ones = np.ones(20), np.full(20, 0.5)
    applied = np.where(np.arange(20) == 7, bad, 0.5)
    in_c = run_c(sampled_loop(), "told", R, ones, applied)
    assert np.isfinite(in_c).all()
    by_class = run_python(sampled_loop().code().to_python(), R, ones, applied)
    assert relative(in_c[0], by_class[0]) < 1e-12


def test_a_start_that_is_not_finite_is_one_from_zero_and_is_counted():
    controller = python_class(sampled_loop().code().to_python())()
    controller.start(np.nan, 0.2, np.inf)
    zero = python_class(sampled_loop().code().to_python())()
    zero.start(0.0, 0.2, 0.0)
    assert (controller.skipped, zero.skipped) == (1, 0)
    assert controller.step(1.0, 0.2) == zero.step(1.0, 0.2)


def test_a_u_beyond_all_numbers_is_never_written():
    controller = python_class(sampled_loop().code().to_python())()
    before = [controller.step(1.0, 0.1) for _ in range(5)][-1]
    assert controller.step(-1.7e308, 1.7e308) == before
    assert controller.skipped == 1
    assert np.isfinite(controller.step(1.0, 0.1))


def test_the_simulation_refuses_what_the_code_leaves_out():
    with pytest.raises(ValueError, match="finite"):
        sampled_loop().simulate({"R": [1.0, np.nan, 1.0]})


def test_an_actuator_that_does_less_than_it_is_told_is_believed():
    made = sampled_loop()
    told, mute = (python_class(made.code().to_python())() for _ in range(2))
    for _ in range(400):
        told.output(5.0, 0.4)
        told.update(0.2)  # stuck
        mute.step(5.0, 0.4)
    # F/Gm of a constant reading 0.4 is 0.2, which is what has been applied.
    assert told.d_hat == pytest.approx(0.0, abs=1e-9)
    assert abs(mute.d_hat) > 10


@pytest.mark.parametrize("wait", [0.0, 0.13])
@pytest.mark.parametrize("dtype", ["double", "float"])
def test_a_processor_without_division_can_run_it(wait, dtype):
    sampled = sampled_loop(wait=wait, lag=0.3)
    assert abs(sampled.controller.factor - 1) > 1e-3  # there is something to divide by
    text = sampled.code(limits=LIMITS, tracking_time=0.4).to_c("plain", dtype)
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    assert "/" not in code and "%" not in code and "fmod" not in code


# Blocks.


def test_blocks_are_tustins():
    z = np.exp(1j * np.linspace(0.01, 3, 50))
    s = 2 / 0.05 * (z - 1) / (z + 1)
    for name, expected in (
        ("F", 1 / (0.5 * s + 1)),
        ("F/Gm", (s + 1) / (2 * (0.5 * s + 1))),
        ("(1-F)Gm", 0.5 * s / (0.5 * s + 1) * 2 / (s + 1)),
        ("C", (s + 1) / s),
    ):
        np.testing.assert_allclose(pulse(sampled_loop(), name)(z), expected, rtol=1e-10)


# Names, types, ranges.


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("heater", "heater"),
        ("2nd heater", "nd_heater"),
        ("a;b*/ int x", "a_b___int_x"),
        ("__secret", "secret"),
        ("class", "class_"),
        ("größe", "gr__e"),
    ],
)
def test_names_become_what_the_languages_allow(name, written):
    sampled = sampled_loop()
    text = sampled.code().to_c(name)
    assert f"{written}_real {written}_step({written}_state *s" in text
    assert f"class {written}:" in sampled.code().to_python(name)
    assert sampled.code().to_c(written) == text
    u = run_c(sampled, written, np.ones(1), np.zeros(1), np.zeros(1))[0]
    assert u[0] > 0


@pytest.mark.parametrize("name", ["", "123", "___", 7, None])
def test_a_name_of_nothing_is_refused(name):
    with pytest.raises(ValueError, match="give a word"):
        sampled_loop().code().to_c(name)


def test_another_type_is_refused():
    with pytest.raises(ValueError, match="dtype is 'half'; choose one of double, float"):
        sampled_loop().code().to_c(dtype="half")


def test_a_coefficient_beyond_float_is_refused():
    loop = nrdob.NRDOB(1e-45 * LAG, 1e-45 * LAG, 1e45 * PI, nrdob.LowPassFilter(0.5, 1))
    sampled = loop.sampled(0.05)
    assert "nrdob_real" in sampled.code().to_c()
    with pytest.raises(OverflowError, match="out of the range of float: use dtype='double'"):
        sampled.code().to_c(dtype="float")


def test_the_python_class_stands_alone(tmp_path):
    (tmp_path / "alone.py").write_text(sampled_loop().code().to_python("Alone"), encoding="utf-8")
    asked = "import sys, alone; print(alone.Alone().step(1.0, 0.0), 'nrdob' in sys.modules)"
    done = subprocess.run([sys.executable, "-I", "-c", "import sys; sys.path[:0] = ['.'];" + asked],
                          cwd=tmp_path, capture_output=True, text=True, check=True)  # fmt: skip
    value, there = done.stdout.split()
    assert float(value) == pytest.approx(sampled_loop().simulate({"R": [1.0]}).u[0], rel=1e-12)
    assert there == "False"


def test_c_allocates_nothing_and_includes_only_what_needs_no_library():
    text = sampled_loop(wait=0.13).code().to_c()
    for word in ("malloc", "free(", "printf"):
        assert word not in text
    freestanding = ["stdbool", "stddef", "stdint", "float"]
    assert re.findall(r"#include <(\w+)\.h>", text) == freestanding
    assert text.startswith(sampled_loop(wait=0.13).code().to_header())


def test_the_header_can_be_read_by_cpp_too(tmp_path):
    (tmp_path / "a.h").write_text(
        sampled_loop(wait=0.13).code().to_header("a", "float"), encoding="utf-8"
    )
    call = [compiler("g++"), "-std=c++11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only"]
    subprocess.run([*call, "-x", "c++", tmp_path / "a.h"], check=True)


@pytest.mark.parametrize("limits", [None, LIMITS])
def test_every_branch_and_loop_of_the_c_has_braces(limits):
    text = sampled_loop(wait=0.13).code(limits).to_c()
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    heads = re.findall(r"^ *(?:\} )?(?:if|for|while|else)\b.*$", code, flags=re.MULTILINE)
    assert len(heads) > 8 and all(head.endswith("{") for head in heads)
    assert not re.search(r"\bint\b|\bunsigned\b|\blong\b|else if", code)


# Sections.


def test_a_small_sampling_time_costs_no_digits():
    dt, lag = 1e-6, 1.0
    filter = nrdob.LowPassFilter(lag, 4)
    model = ct.tf([1.0], np.poly([-1.0, -2.0]))
    sampled = nrdob.NRDOB(model, model, PI, filter).sampled(dt)
    cascade = sampled.controller.sections["F"]
    rest = np.prod([section.rest for section in cascade])
    assert rest == pytest.approx(1.0, rel=1e-12)
    # α2 is the product of two poles in δ, whose closed form is p dt/(1 - p dt/2).
    pole = -dt / lag / (1 + dt / lag / 2)
    product = np.prod([section.a2 for section in cascade])
    assert product == pytest.approx(pole**4, rel=1e-11)


def test_integrators_come_last_and_say_so():
    cascade = sampled_loop(controller=ct.tf([1.0, 1.0], [0.01, 1.0, 0.0])).controller.sections["C"]
    assert [section.integrates for section in cascade][-1]
    assert not Section(2.0).integrates
    assert Section(2.0).rest == 2.0


def test_the_templates_are_data_of_the_package():
    found = sorted(path.name for path in files("nrdob.digital").joinpath("templates").iterdir())
    assert found == ["controller.c.j2", "controller.h.j2", "controller.py.j2"]
