"""Certificates: their counts are the verdict's, and what is not proved is refused."""

from __future__ import annotations

import ast
import copy
import json
import math
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import control as ct
import mpmath
import numpy as np
import pytest

import nrdob
from nrdob import NRDOB, LowPassFilter, paper
from nrdob.certificates import check, checker
from nrdob.certificates.points import half_plane_points
from nrdob.numerics import Term
from nrdob.sampling import random_loop

Content = dict[str, Any]


def example(number: int) -> nrdob.NRDOB:
    given = paper.example(number)
    return nrdob.NRDOB(given.process, given.model, given.controller, given.filter)


def counts(loop: nrdob.NRDOB) -> list[float | None]:
    found = loop.stability()
    return [found.model_loop.closed_loop_rhp, found.observer_loop.closed_loop_rhp]


# What is proved.


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_the_examples_of_the_paper_are_proved_stable(number):
    certificate = example(number).stability().certificate()
    assert certificate.content["claim"] == {"D_F": 0, "p_A": 0, "p_B": 0}
    assert str(certificate).startswith("Proved: the loop is internally stable.")


@pytest.mark.parametrize("power", [-300, 300])
def test_the_unit_of_time_changes_nothing_in_a_proof(power):
    content, unit = (
        copy.deepcopy(example(4).stability().certificate().content),
        Fraction(2) ** power,
    )
    blocks = content["blocks"]
    for block in (*blocks["process"], blocks["model"], blocks["controller"], *blocks["filter"]):
        block["delay"] = str(Fraction(block["delay"]) * unit)
        for part in ("num", "den"):
            by_power = enumerate(reversed(block[part]))
            block[part] = [str(Fraction(c) * unit**k) for k, c in by_power][::-1]
    points = content["points"]
    content["points"] = {name: [str(Fraction(w) / unit) for w in points[name]] for name in points}
    assert check(content).startswith("Proved: the loop is internally stable.")


@pytest.mark.thorough
@pytest.mark.parametrize("delayed", [False, True])
def test_random_loops_stable_or_not_are_counted_as_by_the_verdict(delayed):
    rng = np.random.default_rng(7)
    stable = set()
    for _ in range(60):
        loop = random_loop(rng, delayed=delayed)
        verdict = loop.stability()
        if np.inf in counts(loop):
            with pytest.raises(ArithmeticError, match="at infinite frequency"):
                verdict.certificate()
            continue
        claim = verdict.certificate().content["claim"]
        assert [claim["p_A"], claim["p_B"]] == counts(loop)
        stable.add(verdict.stable)
    assert stable == {True, False}


@pytest.mark.parametrize("den", [[1.1, 1, 0], [1.1, 1, 0.01]])
def test_a_delayed_model_with_an_integrator_cancels_s_inside_its_block(den):
    model = nrdob.delay(0.5) * ct.tf([1], [1, 1, 0])
    process = nrdob.delay(0.6) * ct.tf([1.2], den)
    F = nrdob.interpolating_filter(model, 1.0)
    loop = nrdob.NRDOB(process, model, ct.tf([1, 0.2], [0.1, 1]), F)
    certificate = loop.stability().certificate()
    assert loop.built.poles.degree == 1
    assert certificate.content["claim"]["p_B"] == counts(loop)[1]
    assert "cancel inside its blocks" in str(certificate)


def test_a_predicted_integrator_is_proved_though_its_terms_vanish_at_low_degree():
    plant = nrdob.delay(0.3) * ct.tf([1], [1, 1, 0])
    loop = nrdob.NRDOB(plant, plant, 1.0, LowPassFilter(0.1, 2))
    claim = loop.stability().certificate().content["claim"]
    assert [claim["p_A"], claim["p_B"]] == counts(loop) == [0, 0]


def test_poles_that_cancel_to_rounding_are_told_with_what_is_left_over():
    model = ct.tf([1], [1, 0.3, -1.7])
    F = nrdob.interpolating_filter(model, 0.1)
    loop = nrdob.NRDOB(ct.tf([1.1], [1, 0.3, -1.7]), model, ct.tf([30, 20], [0.02, 1]), F)
    assert "cancel inside its blocks, to " in str(loop.stability().certificate())


def test_a_neutral_loop_is_proved_where_it_is_strongly_stable():
    process = nrdob.delay(0.3) * ct.tf([0.5, 1], [1, 1])
    F = ct.tf([0.2, 1], [1, 1])
    loop = nrdob.NRDOB(process, ct.tf([0.6, 1], [1, 1]), ct.tf([1], [1, 0]), F)
    assert loop.stability().observer_loop.kind == "neutral"
    certificate = loop.stability().certificate()
    assert certificate.content["claim"]["p_B"] == counts(loop)[1]


@pytest.mark.slow
@pytest.mark.parametrize("spread", [1e2, 1e5, 1e8])
def test_stiff_loops_are_proved_with_few_points(spread):
    lags = np.geomspace(1, spread, 6)
    den = np.poly(-1 / lags) * np.prod(lags)
    loop = nrdob.NRDOB(
        ct.tf([1.1], den), ct.tf([1], den), ct.tf([0.1], [spread, 0]), LowPassFilter(spread, 6)
    )
    certificate = loop.stability().certificate()
    assert certificate.content["claim"]["p_B"] == counts(loop)[1]
    assert max(map(len, certificate.content["points"].values())) < 300


@pytest.mark.slow
def test_a_gain_interval_is_proved_up_to_its_end():
    loop = example(4)
    low, high = 0.01, loop.margins().plant_loop.gm_high
    assert high == pytest.approx(3.7121, abs=1e-4)
    for share in (0.5, 0.9, 0.999):
        certificate = loop.stability().certificate(gains=(low, share * high))
        assert "for all blocks between 2 corners" in str(certificate)
    with pytest.raises(ArithmeticError, match="no certificate for p_B"):
        loop.stability().certificate(gains=(1, 1.001 * high))


def test_a_gain_that_may_change_its_sign_has_no_certificate():
    F = LowPassFilter(1.0, 1)
    loop = nrdob.NRDOB(ct.tf([1], [1, 1]), ct.tf([1], [1, 1]), ct.tf([1], [1, 0]), F)
    with pytest.raises(ArithmeticError, match="no certificate"):
        loop.stability().certificate(gains=(-0.5, 1))


def test_a_root_on_the_axis_has_no_certificate():
    loop = nrdob.NRDOB(ct.tf([1], [1, 1]), ct.tf([1], [1, 0, 0]), 1.0, LowPassFilter(0.1, 2))
    with pytest.raises(ArithmeticError, match=r"no certificate for p_A: .*imaginary axis"):
        loop.stability().certificate()


def test_points_of_a_quadratic_by_hand():
    # |f|² = (2 - ω²)² + 4ω² = 4 + ω⁴; at the last point ω² > 2ω + 2.
    points = half_plane_points([(Term(np.array([1.0, 2.0, 2.0]), 0.0),)])
    assert points[0] == 0 and points[-1] ** 2 > 2 * points[-1] + 2


@pytest.mark.thorough
def test_saved_certificates_are_checked_by_the_file_alone(tmp_path):
    path, alone = tmp_path / "certificate.json", tmp_path / "checker.py"
    example(4).stability().certificate().save(path)
    alone.write_bytes(Path(checker.__file__).read_bytes())

    def run(*program: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, *(program or ("-I", "-S", str(alone))), str(path)]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    for accepted in (run(), run("-m", "nrdob.certificates")):
        assert accepted.returncode == 0 and accepted.stdout.startswith("Proved: the loop is intern")
        assert not accepted.stderr
    content = json.loads(path.read_text(encoding="utf-8"))
    content["claim"]["p_B"] = 2
    path.write_text(json.dumps(content), encoding="utf-8")
    refused = run()
    assert refused.returncode == 1 and refused.stderr.startswith("Not proved: p_B has 0")


def test_the_checker_is_short_and_needs_the_standard_library_only():
    source = Path(checker.__file__).read_text(encoding="utf-8").splitlines()
    imports = [line.split()[1] for line in source if line.startswith(("import ", "from "))]
    tree = ast.parse("\n".join(source))
    documented = [tree, *(node for node in tree.body if isinstance(node, ast.FunctionDef))]
    docstrings = [ast.get_docstring(node, clean=False) for node in documented]
    told = sum(bool(line.strip()) for text in docstrings if text for line in text.splitlines())
    assert sum(bool(line.strip()) for line in source) - told <= 200
    assert set(imports) <= sys.stdlib_module_names


@pytest.mark.thorough
def test_an_interval_of_dead_time_is_proved_up_to_its_end():
    loop = example(4)
    own = loop.process.delay
    end = loop.margins().plant_loop.delay_margin + own
    for low, high in ((0, own), (0.9 * own, 1.1 * own), (0, 0.99 * end)):
        certificate = loop.stability().certificate(delays=(low, high))
        said = str(certificate).split("for every dead time from ")[1].split(". ")[0]
        assert [float(end) for end in said.split(" to ")] == pytest.approx([low, high], rel=1e-5)
    with pytest.raises(ArithmeticError, match="no certificate for p_B"):
        loop.stability().certificate(delays=(own, 1.001 * end))


@pytest.mark.slow
def test_a_set_of_time_constants_is_proved_up_to_its_end():
    given = paper.example(3)
    loop = example(3)
    [(low, high)] = nrdob.stabilizing_time_constants(given.process, given.model, given.filter.order)
    span = high - low
    for share in (0.1, 0.01, 0.001):
        part = low + share * span, high - share * span
        proved = loop.stability().certificate(time_constants=part)
        assert "internally stable for all blocks between 3 corners" in str(proved)
    with pytest.raises(ArithmeticError, match="no certificate for p_B"):
        loop.stability().certificate(time_constants=(high - 0.1 * span, high + 0.001 * span))


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2, 5])
def test_every_filter_of_an_interval_lies_between_the_ones_of_its_certificate(order):
    # (λs + 1)^n is the Bernstein sum of the denominators, exactly.
    lam = Fraction(7, 5)
    loop = nrdob.NRDOB(ct.tf([1], [1, 1]), ct.tf([1], [1, 1]), 1.0, LowPassFilter(1.0, order))
    content = loop.stability().certificate(time_constants=(0.75, 1.5)).content
    share = (lam - Fraction(3, 4)) / Fraction(3, 4)
    found = [
        sum(
            math.comb(order, k) * share**k * (1 - share) ** (order - k) * Fraction(F["den"][i])
            for k, F in enumerate(content["blocks"]["filter"])
        )
        for i in range(order + 1)
    ]
    assert found == [math.comb(order, k) * lam ** (order - k) for k in range(order + 1)]


@pytest.mark.slow
def test_intervals_at_once():
    loop = example(4)
    certificate = loop.stability().certificate(
        gains=(0.5, 1.5), delays=(0.03, 0.08), time_constants=(0.07, 0.11)
    )
    rng = np.random.default_rng(5)
    for k, delay, lam in zip(
        *rng.uniform([[0.5], [0.03], [0.07]], [[1.5], [0.08], [0.11]], (3, 20)), strict=True
    ):
        process = k * nrdob.delay(delay) * loop.process.tf
        assert replace(loop, process=process, filter=LowPassFilter(lam, 3)).stability().stable
    said = "for all blocks between 8 corners for every dead time from 0.03 to 0.08"
    assert said in str(certificate)


@pytest.mark.parametrize(
    "interval",
    [
        {"delays": (-0.1, 0.1)},
        {"delays": (0.2, 0.1)},
        {"gains": (2, 1)},
        {"gains": (0.5, np.inf)},
        {"time_constants": (0, 1)},
        {"time_constants": (2, 1)},
    ],
)
def test_what_is_no_interval_is_refused(interval):
    with pytest.raises(ValueError, match=f"{next(iter(interval))} are "):
        example(4).stability().certificate(**interval)


def test_time_constants_of_another_filter_are_refused():
    loop = replace(example(4), filter=ct.tf([1], [0.1, 0.5, 1.1, 1]))
    with pytest.raises(ValueError, match="those of a LowPassFilter"):
        loop.stability().certificate(time_constants=(0.1, 0.2))


# What is not proved.


def tampered(content: Content) -> Iterator[tuple[str, Content]]:
    """Change one thing after another, each so that nothing, or something false, is claimed."""

    def changed(place: str, value: Any) -> Content:
        other = copy.deepcopy(content)
        target = other
        *path, last = place.split(".")
        for key in path:
            target = target[int(key) if isinstance(target, list) else key]
        target[last] = value
        return other

    for name, points in content["points"].items():
        place = f"points.{name}"
        for claim in (-1, 1, 2, 3, "0", None, True, 0.0, [0]):
            yield f"{name} claims {claim!r}", changed(f"claim.{name}", claim)
        for k in range(1, len(points)):
            # The last but one may be far enough out, too.
            yield f"{name} without the points from {k - 1}", changed(place, points[: k - 1])
            yield f"{name} without the points before {k}", changed(place, points[k:])
        for wrong in (
            points[::-1], [*points, points[-1]], [], "0", None,
            ["0", "1/0"], ["0", "nan"], ["0", "1e9"], ["0", 1.5], ["0", "9" * 2000],
            ["-1", *points], [*points[:1], *points], dict.fromkeys(points),
        ):  # fmt: skip
            yield f"{name}, points {str(wrong)[:30]}", changed(place, wrong)
    process = content["blocks"]["process"][0]
    F = content["blocks"]["filter"][0]
    single = {**content["blocks"], "process.0": process, "filter.0": F}
    del single["process"], single["filter"]
    for block, parts in single.items():
        for part in ("num", "den"):
            place = f"blocks.{block}.{part}"
            turned = [str(-Fraction(c)) for c in parts[part]]
            yield f"{block} with the other sign of {part}", changed(place, turned)
            for wrong in ([], ["0"], ["0", "1"], ["x"], [1], None, ["1"] * 70, ["1/0"]):
                yield f"{block}.{part} is {str(wrong)[:20]}", changed(place, wrong)
        longer = [*parts["num"], *["0"] * len(parts["den"])]
        yield f"{block} improper", changed(f"blocks.{block}.num", longer)
        for delay in ("-1", "x", None, "5000"):
            if block in ("process.0", "model_delay") or delay != "0":
                yield f"delay of {block} {delay}", changed(f"blocks.{block}.delay", delay)
    for block in content["blocks"]:
        others = {name: given for name, given in content["blocks"].items() if name != block}
        yield f"without {block}", changed("blocks", others)
    for wrong in ([], [process] * 100, process, [process, {**process, "delay": "1/10"}]):
        yield f"{len(wrong)} processes, {str(wrong)[:9]}", changed("blocks.process", wrong)
    slow = {**F, "den": ["1000000", "3000", "3000", "1"]}
    for wrong in ([], [F] * 100, F, [F, slow]):
        yield f"{len(wrong)} filters, {str(wrong)[:9]}", changed("blocks.filter", wrong)
    for wrong in ("1", "1/10", "-1/100", "x", 0, None, ["0"]):
        yield f"within {wrong}", changed("within", wrong)
    for wrong in ("z", "w", "Re s", "", 1):
        yield f"variable {wrong!r}", changed("variable", wrong)
    for part in ("zeros", "poles"):
        for wrong in (["1", "1"], ["1", "-1"], ["1", "0", "1"], ["0"], [], None, ["1"] * 9):
            yield f"cancelled {part} {wrong}", changed(f"cancelled.{part}", wrong)
    for key in content:
        yield f"without {key}", {k: v for k, v in content.items() if k != key}
        yield f"{key} is None", changed(key, None)
    yield "more keys", content | {"trust": True}
    yield "another version", changed("version", 2)
    for gain in (4, 8, 100):  # the gain may rise by 3.7121 in Example 4
        num = [str(gain * Fraction(c)) for c in process["num"]]
        yield f"gain times {gain}", changed("blocks.process.0.num", num)
        yield (
            f"up to gain times {gain}",
            changed("blocks.process", [process, {**process, "num": num}]),
        )


TAMPERED = list(tampered(json.loads(json.dumps(example(4).stability().certificate().content))))


def test_there_are_many_ways_to_tamper():
    assert len(TAMPERED) >= 200
    assert len({name for name, _ in TAMPERED}) == len(TAMPERED)


@pytest.mark.slow
@pytest.mark.parametrize("content", [each for _, each in TAMPERED], ids=[n for n, _ in TAMPERED])
def test_a_tampered_certificate_is_refused(content):
    with pytest.raises(ValueError, match=r".{8}"):
        check(content)


@pytest.mark.parametrize("other", [None, [], "certificate", 1, {}])
def test_something_else_is_refused(other):
    with pytest.raises(ValueError, match=r"an object needs format|there are no parts"):
        check(other)


def test_cosine_and_sine_are_within_their_bound():
    rng = np.random.default_rng(3)
    with mpmath.workdps(90):
        for exponent in rng.uniform(-20, 12, 200):
            x = Fraction(float(10**exponent))
            cosine, sine, bound = checker.cosine_sine(x)
            angle = mpmath.mpf(x.numerator) / x.denominator
            for found, true in ((cosine, mpmath.cos(angle)), (sine, mpmath.sin(angle))):
                error = abs(mpmath.mpf(found.numerator) / found.denominator - true)
                assert error <= mpmath.mpf(bound.numerator) / bound.denominator
            assert bound < Fraction(1, 2**100)


# Parts that do not join.


def parts_of(**interval: tuple[float, float]) -> list[Content]:
    content = example(4).stability().certificate(**interval).content
    assert isinstance(content, list) and len(content) > 2
    check(content)
    return content


@pytest.mark.thorough
@pytest.mark.parametrize("interval", [{"delays": (0.0, 0.28)}, {"time_constants": (0.1, 9.0)}])
def test_parts_that_leave_a_gap_are_refused(interval):
    content = parts_of(**interval)
    for wrong in ([content[0], content[2]], [*content[:1], *content[2:]], content[::-1][:2]):
        if wrong[0]["within"] == "0" or wrong != content[::-1][:2]:
            with pytest.raises(ValueError, match="do not join"):
                check(wrong)


@pytest.mark.thorough
def test_parts_of_different_loops_do_not_join():
    delays, lags = parts_of(delays=(0.0, 0.28)), parts_of(time_constants=(0.1, 9.0))
    other = example(1).stability().certificate().content
    for wrong in ([*delays, *lags], [*lags, *delays], [delays[0], other], [other, other, lags[0]]):
        with pytest.raises(ValueError, match="do not join"):
            check(wrong)


# Sampled loops.


@pytest.mark.parametrize("number", [1, 2, 3, 4])
@pytest.mark.parametrize("ratio", [0.1, 2.0, 20.0])
def test_sampled_loops_are_counted_as_by_the_verdict(number, ratio):
    loop = example(number)
    verdict = loop.sampled(ratio * loop.filter.time_constant).stability()
    certificate = verdict.certificate()
    claim = certificate.content["claim"]
    parts = verdict.model_loop, verdict.observer_loop
    assert [claim["p_A"], claim["p_B"]] == [part.closed_loop_rhp for part in parts]
    assert "Re w = c (z - 1)/(z + 1) >= 0" in str(certificate)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("late", "wait", "stable"),
    [(0.05, 0.1, 1), (0.6, 0.26, 1), (1.0, 1.0, 1), (2.0, 0.1, 0), (2.0, 0.26, 0)],
)
def test_sampled_loops_with_a_delayed_model_are_counted_as_by_the_verdict(late, wait, stable):
    model = nrdob.delay(wait) * ct.tf([1], [1, 1])
    process = nrdob.delay(late) * ct.tf([1.2], [1, 1])
    loop = nrdob.NRDOB(process, model, ct.tf([1, 1], [1, 0]), LowPassFilter(0.4, 2))
    verdict = loop.sampled(0.1, computation_delay=0.03).stability()
    claim = verdict.certificate().content["claim"]
    parts = verdict.model_loop, verdict.observer_loop
    assert [claim["p_A"], claim["p_B"]] == [part.closed_loop_rhp for part in parts]
    assert verdict.stable is bool(stable)
    with pytest.raises(ArithmeticError, match="no certificate for p_B"):
        verdict.certificate(gains=(1, 100))


@pytest.mark.slow
def test_gains_of_a_sampled_loop_are_proved_up_to_the_margin():
    sampled = example(4).sampled(0.01)
    high = sampled.margins().gm_high
    assert sampled.stability().certificate(gains=(0.1, 0.999 * high))
    with pytest.raises(ArithmeticError, match="no certificate for p_B"):
        sampled.stability().certificate(gains=(0.1, 1.001 * high))


@pytest.mark.slow
def test_what_a_sampled_loop_has_no_certificate_for_is_said():
    loop = example(4)
    with pytest.raises(ArithmeticError, match="holds 50 samples"):
        loop.sampled(0.001).stability().certificate()
    model = nrdob.delay(3e6) * ct.tf([1], [1e6, 1])
    late = nrdob.NRDOB(model, model, ct.tf([2e5, 0.2], [1e6, 0]), LowPassFilter(5e5, 6))
    with pytest.raises(ArithmeticError, match=r"p_B: its coefficients .* another unit of time"):
        late.sampled(1e5).stability().certificate()
    with pytest.raises(ValueError, match="only gains and time constants"):
        loop.sampled(0.01).stability().certificate(delays=(0, 0.1))


# What mutants of the checker have shown to be asked by no test.


def with_a_root_at_zero() -> Content:
    model = nrdob.delay(0.5) * ct.tf([1], [1, 1, 0])
    process = nrdob.delay(0.6) * ct.tf([1.2], [1.1, 1, 0])
    F = nrdob.interpolating_filter(model, 1.0)
    loop = nrdob.NRDOB(process, model, ct.tf([1, 0.2], [0.1, 1]), F)
    return json.loads(json.dumps(loop.stability().certificate().content))


def test_the_first_piece_beside_a_root_at_zero_must_be_short():
    content = with_a_root_at_zero()
    points = content["points"]["p_B"]
    refusals = set()
    for k in range(2, len(points) - 1):
        content["points"]["p_B"] = [points[0], *points[k:]]
        with pytest.raises(ValueError, match="p_B is not proved to keep") as refused:
            check(content)
        refusals.add(str(refused.value))
    assert "p_B is not proved to keep its first direction" in refusals


def test_a_piece_that_is_too_long_is_named_wherever_it_is():
    content = json.loads(json.dumps(example(4).stability().certificate().content))
    points = content["points"]["p_B"]
    for k in range(4, len(points) - 4, 5):
        content["points"]["p_B"] = points[: k - 3] + points[k + 3 :]
        with pytest.raises(ValueError, match=r"p_B is not proved to keep to a half plane at \d"):
            check(content)


@pytest.mark.slow
def test_parts_of_an_interval_are_said_to_join():
    loop = example(4)
    end = loop.process.delay + 0.99 * loop.margins().plant_loop.delay_margin
    certificate = loop.stability().certificate(delays=(0, end))
    assert len(certificate.content) > 1
    assert str(certificate).startswith(f"Proved in {len(certificate.content)} parts that join: ")


# Lies that have been believed: of each it is told what is wrong.


def block(num: list[Any], den: list[Any], delay: Any = 0) -> Content:
    texts = [[str(Fraction(c)) for c in part] for part in (num, den)]
    return {"num": texts[0], "den": texts[1], "delay": str(delay)}


LAG, INTEGRATOR = block([1], [1, 1]), block([1], [1, 0])


def written(
    processes: list[Content],
    model: Content,
    controller: Content,
    filters: list[Content],
    ends: tuple[float, float] = (0.02, 1e3),
) -> Content:
    """Claim that all is stable, with points close to each other."""
    points = [str(Fraction(w)) for w in [0.0, *np.geomspace(*ends, 1200)]]
    names = ("D_F", "p_A", "p_B")
    return {
        "format": "nrdob certificate",
        "version": 1,
        "variable": "s",
        "blocks": {
            "process": processes,
            "model": model | {"delay": "0"},
            "model_delay": block([1], [1], model["delay"]),
            "controller": controller,
            "filter": filters,
        },
        "within": "0",
        "cancelled": {"zeros": ["1"], "poles": ["1"]},
        "claim": dict.fromkeys(names, 0),
        "points": dict.fromkeys(names, points),
    }


def with_equal_dead_times() -> Content:
    # The terms with Nf are added up, and cancel; with a dead time of 1.5 s two roots are at
    # 0.41 ± 5.86j.
    late = block([1], [1, 1], 1)
    return written([late], late, INTEGRATOR, [block([1], ["1/10", 1])]) | {"within": "1/2"}


def with_two_dead_times() -> Content:
    processes = [block(["1/2"], [1, 1]), block(["1/2"], [1, 1], 1)]
    return written(processes, block([1], [1, 1], 1), INTEGRATOR, [block([1], [2, 1])])


def with_the_integrators_of_the_process() -> Content:
    # Of the two integrators of the model one cancels inside its block: F'(0) is not θm.
    late = block([1], [1, 0, 0], 1)
    content = written([late], late, block([3, 1], [1, 3]), [block([1], [4, 4, 1])])
    return content | {"cancelled": {"zeros": ["1"], "poles": ["1", "0", "0"]}}


def with_more_integrators_than_the_model() -> Content:
    process = block([1, 0, 0], [1, 1, 0, 0], 1)
    content = written([process], block([1], [1, 0], 1), block([1], [1]), [LAG])
    return content | {"cancelled": {"zeros": ["1"], "poles": ["1", "0", "0", "0"]}}


def with_an_improper_process_between() -> Content:
    processes = [block([3, 1], [1, 1]), block([3, 1], [-1, 1])]
    return written(processes, block([1, 1], [1, 2]), INTEGRATOR, [block([1, 2], [2, 2])])


def with_a_zero_that_is_far_from_cancelling() -> Content:
    # Nf(1e-4) = 1/2, which is little against 1e10 s^4, but not there: a root is at 1.0032e-4.
    num = ["10000000000", "-1000000", "0", "-5000", "1"]
    den = [10**16, 4 * 10**12, 6 * 10**8, 4 * 10**4, 1]
    model, controller = block([-(10**4), 1], [1, 1]), block(["-1/1000000"], [1])
    content = written([block(["1/10"], [1, 1])], model, controller, [block(num, den)], (1e-8, 1e5))
    return content | {"cancelled": {"zeros": ["1", "-1/10000"], "poles": ["1"]}}


def with_filters_of_which_not_all_cancel() -> Content:
    # Half way between the filters the numerator is (s - 1)(s - 2)/2 + s.
    M, den = 2 * 10**9, [10**44, 4 * 10**33, 6 * 10**22, 4 * 10**11, 1]
    half, one = Fraction(1, 2), Fraction(1)
    nums = [[k, half - 3 * k, 2 * k - 3 * half + one, one] for k in (M, -M)]
    process, model = block(["1/100"], [1, 1]), block([1, -3, 2], [1, 6, 9])
    filters = [block(num, den) for num in nums]
    content = written([process], model, block(["1/10"], [1]), filters, (1e-14, 1e5))
    return content | {"cancelled": {"zeros": ["1", "-3", "2"], "poles": ["1"]}}


def with_a_model_delay_that_amplifies() -> Content:
    content = written([LAG], LAG, INTEGRATOR, [LAG])
    content["blocks"]["model_delay"] = block([2], [1, 1])
    return content


def with_a_model_delay_that_grows() -> Content:
    content = written([LAG], LAG, INTEGRATOR, [LAG])
    content["blocks"]["model_delay"] = block([-1], [1, -1])
    return content


def with_a_dead_time_of_samples() -> Content:
    content = written([block([1], [1, 1], 1)], LAG, INTEGRATOR, [LAG])
    return content | {"variable": "w = c (z - 1)/(z + 1)"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lie", "refusal"),
    [
        (with_equal_dead_times, "where the dead time is the model's"),
        (with_two_dead_times, "dead times or signs of D differ"),
        (with_the_integrators_of_the_process, "no common factor"),
        (with_more_integrators_than_the_model, "too many roots"),
        (with_an_improper_process_between, "dead times or signs of D differ"),
        (with_a_zero_that_is_far_from_cancelling, "no common factor"),
        (with_filters_of_which_not_all_cancel, "only what is exact cancels"),
        (with_a_model_delay_that_amplifies, "another gain than 1"),
        (with_a_model_delay_that_grows, "D_F has 1 such roots"),
        (with_a_dead_time_of_samples, "no dead times"),
    ],
)
def test_a_lie_that_has_been_believed_is_refused(lie, refusal):
    with pytest.raises(ValueError, match=refusal):
        check(lie())


def test_cosine_and_sine_of_large_angles_are_within_their_bound():
    # Squared two hundred times, a rounding error of the first turn grows without bound.
    for exponent in range(55, 80):
        x = 10**exponent
        cosine, sine, bound = checker.cosine_sine(Fraction(x))
        assert bound < Fraction(1, 2**100)
        with mpmath.workdps(90):
            for found, true in ((cosine, mpmath.cos(x)), (sine, mpmath.sin(x))):
                assert abs(mpmath.mpf(found.numerator) / found.denominator - true) < 1e-30


def test_what_is_said_of_an_interval_is_not_rounded_to_more():
    high = 0.24999996
    said = str(example(4).stability().certificate(delays=(0, high)))
    assert "from 0 to 0.24999996. " in said


@pytest.mark.slow
def test_parts_in_another_order_do_not_join():
    content = parts_of(delays=(0.0, 0.28))
    with pytest.raises(ValueError, match="do not join"):
        check(content[1::-1])


def test_a_name_that_is_given_twice_is_refused(tmp_path):
    path = tmp_path / "certificate.json"
    example(4).stability().certificate().save(path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('"within"', '"within": "1", "within"'), encoding="utf-8")
    command = [sys.executable, checker.__file__, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "given twice" in done.stderr


def test_an_interval_around_the_dead_time_of_the_model_is_cut_there() -> None:
    s = ct.tf("s")
    loop = NRDOB(nrdob.delay(1.0) / (s + 1), nrdob.delay(1.0) / (s + 1), 0.5, LowPassFilter(1.0, 1))
    certificate = loop.stability().certificate(delays=(0.5, 1.5))
    assert "for every dead time from 0.5 to 1.5" in certificate.proved
    assert len(certificate.content) == 2
    for theta in (0.5, 0.8, 1.2, 1.5):
        late = NRDOB(nrdob.delay(theta) / (s + 1), loop.model, 0.5, loop.filter)
        assert late.stability().stable is True


@pytest.mark.parametrize("given", [[], ["-h"], ["one.json", "two.json"]])
def test_the_checker_wants_one_file(given):
    said = subprocess.run(
        [sys.executable, checker.__file__, *given], capture_output=True, text=True, check=False
    )
    assert said.returncode == 1 and not said.stdout and "usage: python checker.py" in said.stderr


def test_an_interval_that_is_one_number_is_refused_by_name():
    with pytest.raises(TypeError, match=r"gains is 1\.3; give the lowest and the highest"):
        paper.example(1).stability().certificate(gains=1.3)


def test_what_holds_for_each_end_of_an_interval_is_proved_for_both_together():
    loop = NRDOB(([1], [1, 3, 2]), ([4], [0.25, 1]), 1, LowPassFilter(0.5, 3))
    assert "stable" in loop.stability().certificate(gains=(4, 10)).proved
    loop = NRDOB(([1], [1]), ([1], [1, 2]), 1, LowPassFilter(1.0, 3))
    assert "stable" in loop.stability().certificate(time_constants=(1, 8)).proved


@pytest.mark.parametrize("integrates", [False, True])
@pytest.mark.parametrize("lam", [1.0, 2.0, 1.9])  # -2/λ is a pole of the model for the first two
def test_what_cancels_at_one_time_constant_is_not_claimed_of_all(lam, integrates):
    G = ct.tf([2], [1, 3, 2, 0] if integrates else [1, 3, 2])
    loop = NRDOB(G, G, 1, LowPassFilter(lam, 2 + integrates))
    assert "stable" in loop.stability().certificate(time_constants=(0.5, 5)).proved
