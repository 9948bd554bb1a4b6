"""The ledger: every claim gets its verdict, and would lose it if something were wrong."""

import re
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import nrdob
from nrdob import NRDOB, LowPassFilter, paper
from nrdob.diagram import LoopEquations, Quotient
from nrdob_course import claims
from nrdob_course.claims import (
    LEDGER,
    Finding,
    LedgerError,
    Verdict,
    bands,
    conclusions,
    example3,
    example4,
    examples12,
    ledger,
    lemma1,
    mismatch,
    recurring,
    robustness,
    section2,
    settle,
    signals,
)
from nrdob_course.claims.ledger import Section, in_one_ledger

SECTIONS = (
    section2, bands, lemma1, mismatch, robustness, examples12, example3, example4, conclusions,
)  # fmt: skip
MODULES = (*SECTIONS, ledger, recurring, signals)
TEXT = {"chapter": "11_the_loop", "place": "p. 1", "says": "It is so.", "method": "Look."}
CHAPTERS = {path.stem for path in Path(__file__).parents[2].glob("notebooks/*.ipynb")}


def one(finding, verdict="", id="x"):
    """A claim with a ready finding; with a verdict it is amended."""
    section = Section({id: TEXT | ({"verdict": verdict, "instead": "If."} if verdict else {})})

    @section.check(id)
    def check():
        return finding

    return section.claims[0]


# The core.


def test_a_verdict_follows_from_the_finding():
    otherwise = Finding(False, "1", conditions={"it is otherwise": True})
    assert settle(one(Finding(True, "1"))).verdict is Verdict.REPRODUCED
    assert settle(one(otherwise, "corrected")).verdict is Verdict.CORRECTED


@pytest.mark.parametrize(
    ("finding", "verdict", "words"),
    [
        (Finding(False, "0.3"), "", r"x: does not hold as printed \(0.3\), and .* no amendment"),
        (
            Finding(True, "0.3", conditions={"it is otherwise": True}),
            "refuted",
            r"holds as printed \(0.3\), but the ledger amends it",
        ),
        (
            Finding(False, "0.3", conditions={"1 is odd": True, "2 is odd": False, "4 is": False}),
            "needs a condition",
            r"x: the amended statement fails as well \(0.3\); not met: 2 is odd; 4 is$",
        ),
        (
            Finding(False, "0.3"),
            "needs a condition",
            "not met: any condition, since none was tried",
        ),
    ],
)
def test_a_check_that_finds_something_else_gives_no_verdict(finding, verdict, words):
    with pytest.raises(LedgerError, match=words):
        settle(one(finding, verdict))


def test_an_unknown_id_is_named_with_those_near_it():
    with pytest.raises(KeyError, match=r"no claim 'eq04\.T_X'; near it: eq04\.T_R, eq04\.S_d"):
        claims.check("eq04.T_X")
    with pytest.raises(KeyError, match="no claim 'nonsense'; near it: nothing"):
        claims.check("nonsense")


def test_an_id_stands_in_one_section_only():
    first, second = (Section({"x": TEXT | {"place": place}}) for place in ("p. 0", "p. 1"))
    for section in (first, second):
        section.check("x")(lambda: Finding(True, ""))
    with pytest.raises(ValueError, match=r"two claims have the id 'x': those of p\. 0 and p\. 1"):
        in_one_ledger([first, second])


def test_texts_and_checks_belong_together():
    section = Section({"x": TEXT, "y": TEXT})
    section.check("x")(lambda: Finding(True, ""))
    with pytest.raises(ValueError, match="no text for the claim 'z'"):
        section.check("z")
    with pytest.raises(ValueError, match="two checks have the id 'x'"):
        section.check("x")
    with pytest.raises(ValueError, match=r"no check for y; write one below @SECTION\.check"):
        _ = section.claims
    with pytest.raises(TypeError, match="chaptre"):
        Section({"x": {"chaptre": "11_the_loop"}}).check("x")(lambda: Finding(True, ""))


def test_nothing_is_true_of_nothing():
    with pytest.raises(ValueError, match="nothing was tried"):
        ledger.every([])
    assert not ledger.same([], [])


# The claims. Their verdicts are tested in tests/book/test_site.py, where the ledger is written.


def test_the_ledger_holds_every_claim_of_every_section_once():
    ids = [claim.id for module in SECTIONS for claim in module.SECTION.claims]
    assert sorted(ids) == sorted(LEDGER)
    assert [id for id, claim in LEDGER.items() if id != claim.id] == []


def test_every_module_of_the_ledger_is_tried_here():
    files = {path.stem for path in Path(claims.__file__).parent.glob("*.py")} - {"__init__"}
    assert files == {module.__name__.rpartition(".")[2] for module in MODULES}
    assert [module for module in MODULES if hasattr(module, "SECTION")] == list(SECTIONS)


def test_every_equation_figure_and_lemma_of_the_paper_is_there():
    places = " ; ".join(claim.place for claim in LEDGER.values())
    names = [rf"eq\. \({number}\)" for number in range(1, 18)]
    names += [rf"Fig\. {number}(?!\d)" for number in range(1, 20)]
    names += ["Lemma 1", "Lemma 2", "Corollary 1"]
    assert [name for name in names if not re.search(name, places)] == []


@pytest.mark.parametrize("id", LEDGER)
def test_every_claim_says_what_where_and_how(id):
    claim = LEDGER[id]
    assert len(claim.method.split()) >= 6, "the text tells how it is checked"
    assert claim.says.endswith(".")
    assert claim.amendment is None or claim.amendment.text.endswith(".")
    assert claim.place.strip()
    assert claim.chapter in CHAPTERS
    for text in (claim.says, claim.amendment.text if claim.amendment else ""):
        assert text.count("$") % 2 == 0


def test_every_printed_margin_and_function_has_its_claim():
    assert set(paper.PRINTED) <= set(LEDGER)
    places = {claim.place for claim in LEDGER.values()}
    assert {printed.place for printed in paper.PRINTED_FUNCTIONS.values()} <= places


# Mutations: something is made wrong on purpose, and the claims that rest on it must fall.


def everywhere(monkeypatch, name, value):
    """Replace a name in every module of the ledger that knows it."""
    for module in MODULES:
        if name in vars(module):
            monkeypatch.setattr(module, name, value)


def replace_map(monkeypatch, name, factors):
    """Give a loop another quotient for one of its maps, made of the factors of the right one."""
    right = getattr(LoopEquations, name).func
    changed = cached_property(lambda loop: Quotient(*factors(right(loop), loop), name))
    changed.__set_name__(LoopEquations, name)
    monkeypatch.setattr(LoopEquations, name, changed)


def change_examples(monkeypatch, change):
    """Change every loop of the paper."""
    example = paper.example
    everywhere(monkeypatch, "example", lambda *which, **how: change(example(*which, **how)))


def loop_with(loop, process=1.0, model=1.0):
    return replace(loop, process=process * loop.process, model=model * loop.model)


def wrong_sign_of_p_b(monkeypatch):
    right = LoopEquations.p_B.func
    changed = cached_property(lambda loop: right(loop_with(loop, process=-1.0)))
    changed.__set_name__(LoopEquations, "p_B")
    monkeypatch.setattr(LoopEquations, "p_B", changed)


def miswired_diagram(monkeypatch):
    equations = signals.Values.equations

    def changed(blocks, **kind):
        matrix = equations(blocks, **kind)
        matrix[..., 1, 2] *= -1
        return matrix

    monkeypatch.setattr(signals.Values, "equations", changed)


def wrong_formulas(monkeypatch):
    for name, formula in signals.PRINTED_MAPS.items():
        monkeypatch.setitem(signals.PRINTED_MAPS, name, lambda v, f=formula: 1.001 * f(v))


def first_order_filters(monkeypatch):
    monkeypatch.setattr(
        LowPassFilter, "__call__", lambda F, s: 1 / (F.time_constant * np.asarray(s) + 1)
    )


def misplaced_bandwidth(monkeypatch):
    everywhere(monkeypatch, "brentq", lambda *args, **how: 1.1 * brentq(*args, **how))


def h_without_minus_one(monkeypatch):
    replace_map(monkeypatch, "H", lambda H, loop: (loop.ratio.num, loop.ratio.den))


def h_without_zeros_of_the_model(monkeypatch):
    replace_map(monkeypatch, "H", lambda H, loop: (H.num, H.den[:1]))


def ratio_upside_down(monkeypatch):
    replace_map(monkeypatch, "ratio", lambda ratio, loop: (ratio.den, ratio.num))


def filter_left_out(monkeypatch):
    replace_map(monkeypatch, "F", lambda F, loop: (F.den, F.den))


def one_turn_more(monkeypatch):
    for name in ("turns", "encirclements"):
        for module in MODULES:
            if name in vars(module) and module is not signals:
                function = vars(module)[name]
                monkeypatch.setattr(module, name, _one_more(function))
    monkeypatch.setattr(signals, "turns", _one_more(signals.turns))


def _one_more(function):
    if function.__module__.startswith("nrdob.plotting.alttext"):  # turns in words
        return function

    def changed(*args, **how):
        count = function(*args, **how)
        if isinstance(count, int):
            return count + 1
        known = count.encirclements is not None
        return replace(count, encirclements=count.encirclements + 1) if known else count

    return changed


def one_root_more(monkeypatch):
    count_rhp = nrdob.numerics.count_rhp

    def changed(p):
        found = count_rhp(p)
        return found if found.count is None else replace(found, count=found.count + 1)

    monkeypatch.setattr(nrdob.analysis.nyquist, "count_rhp", changed)
    everywhere(monkeypatch, "count_rhp", changed)


def modes_all_stable(monkeypatch):
    modes = signals.modes
    everywhere(monkeypatch, "modes", lambda *blocks: -np.abs(modes(*blocks).real) - 1)


def margins_ten_percent_off(monkeypatch):
    loop_margins = nrdob.loop.loop_margins

    def off(found):
        return replace(
            found, gm=1.1 * found.gm, pm=1.1 * found.pm, sm=1.1 * found.sm,
            gm_low=1.1 * found.gm_low, gm_high=1.1 * found.gm_high,
        )  # fmt: skip

    def changed(*args):
        found = loop_margins(*args)
        loops = ("model_loop", "observer_loop", "plant_loop")
        return replace(found, **{name: off(getattr(found, name)) for name in loops})

    monkeypatch.setattr(nrdob.loop, "loop_margins", changed)


def responses_too_large(monkeypatch):
    step_response = NRDOB.step_response

    def changed(*args, **how):
        found = step_response(*args, **how)
        found.y *= 1.5
        return found

    monkeypatch.setattr(NRDOB, "step_response", changed)


def larger_plants(monkeypatch):
    change_examples(monkeypatch, lambda loop: loop_with(loop, process=1.3))


def larger_modified_plants(monkeypatch):
    example = paper.example
    changed = lambda which, modified=False: loop_with(  # noqa: E731
        example(which, modified), process=1.3 if modified else 1.0
    )
    everywhere(monkeypatch, "example", changed)


def negative_models(monkeypatch):
    change_examples(monkeypatch, lambda loop: loop_with(loop, model=-1.0))


def inverse_that_predicts(monkeypatch):
    replace_map(
        monkeypatch,
        "K",
        lambda K, loop: ((*loop.F.num, *loop.Gm.den), (*loop.F.den, *loop.Gm.num)),
    )


def another_year(monkeypatch):
    text = conclusions.REFERENCE_2.removesuffix("2006") + "2004"
    monkeypatch.setattr(conclusions, "REFERENCE_2", text)


MUTATIONS = {
    wrong_formulas: "fig01 eq03 eq04.T_R eq04.S_d eq04.S_delta eq04.S_eta eq07.E_R eq07.U_R "
    "eq07.U_d eq07.U_delta",
    miswired_diagram: "sec1.dob_noise fig01 eq03 eq04.T_R eq04.S_d eq04.S_delta eq04.S_eta "
    "eq05.T_R eq05.S_d eq05.S_eta eq06.T_R eq06.S_d eq06.S_eta eq06.S_delta sec2.noise "
    "sec2.high_disturbance eq07.E_R eq07.E_zero eq07.U_R eq07.U_d eq07.U_delta "
    "lemma1.polynomials sec3.three_dof",
    wrong_sign_of_p_b: "eq05.S_delta lemma1.forms lemma1.sufficient lemma1.N_p sec3.rhp_zeros "
    "sec3.slow_filter_always sec3.no_turns_no_filter cor1.stable cor1.robust ex1.F ex2.slow "
    "ex3.critical_point",
    first_order_filters: "eq01.causal eq01.bandwidth eq02.low eq02.high",
    misplaced_bandwidth: "sec1.dob_noise eq01.bandwidth eq02.high sec3.speculation "
    "sec3.any_bandwidth ex3.fast eq16",
    h_without_minus_one: "lemma1.H_forms sec3.H_zero sec3.M sec3.Z_H fig03 ex2.H eq14 fig15b "
    "ex4.infinite_turns",
    h_without_zeros_of_the_model: "lemma1.H_poles",
    ratio_upside_down: "eq09 eq13 ex4.relative_degree ex4.order_causal ex4.radius",
    filter_left_out: "ex1.causal",
    one_turn_more: "lemma1.N_p sec3.Z_H sec3.slow_filter_always sec3.no_turns_no_filter fig05 "
    "ex3.rotation fig10 fig10.caption fig11",
    modes_all_stable: "lemma1.polynomials lemma1.sufficient cor1.necessary",
    margins_ten_percent_off: "lemma2.ii cor1.robust ex4.gain_margin",
    responses_too_large: "fig02 fig07 fig08 fig13 fig14 fig18 fig19 ex2.performance "
    "ex3.performance ex4.performance",
    one_root_more: "lemma2.i ex1.responses_prove eq08 eq10 fig06 ex2.nmp ex3.matched_fails "
    "ex3.negative_gain ex3.smaller ex4.noncausal_order eq12 eq15 fig12 ex3.overparametrise eq17 "
    "fig16 concl.unstable_nmp_delay concl.not_matching "
    "ex2.family ex4.family",
    larger_plants: "eq09 eq13 eq14 ex3.family ex4.ratio ex4.radius",
    larger_modified_plants: "ex2.variation ex3.variation ex4.variation",
    negative_models: "eq11 fig15a",
    inverse_that_predicts: "ex4.model_delay",
    another_year: "ref02.year",
}  # fmt: skip
"""What is made wrong, and claims that must not survive it."""


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("mutation", "id"),
    [(mutation, id) for mutation, ids in MUTATIONS.items() for id in ids.split()],
    ids=lambda value: value if isinstance(value, str) else value.__name__,
)
def test_a_claim_does_not_survive_what_contradicts_it(monkeypatch, mutation, id):
    mutation(monkeypatch)
    with pytest.raises(LedgerError, match=re.escape(id)):
        claims.check(id)


@pytest.mark.parametrize("id", paper.PRINTED)
def test_another_printed_margin_would_not_be_confirmed(monkeypatch, id):
    printed = paper.PRINTED[id]
    other = 20.0 if np.isinf(printed.value) else printed.value + 1.0
    monkeypatch.setitem(paper.PRINTED, id, replace(printed, value=other))
    with pytest.raises(LedgerError, match=re.escape(id)):
        claims.check(id)


@pytest.mark.parametrize(
    ("id", "printed"),
    [("eq09", "ex2.ratio"), ("eq13", "ex3.ratio"), ("ex4.ratio", "ex4.ratio")],
)
def test_another_printed_function_would_not_be_confirmed(monkeypatch, id, printed):
    function = paper.PRINTED_FUNCTIONS[printed]
    changed = replace(function, num=tuple(1.01 * c for c in function.num))
    monkeypatch.setitem(paper.PRINTED_FUNCTIONS, printed, changed)
    with pytest.raises(LedgerError, match=re.escape(id)):
        claims.check(id)


def test_eq_14_with_the_right_sign_would_need_no_correction(monkeypatch):
    function = paper.PRINTED_FUNCTIONS["ex3.H"]
    monkeypatch.setitem(
        paper.PRINTED_FUNCTIONS, "ex3.H", replace(function, num=tuple(-c for c in function.num))
    )
    with pytest.raises(LedgerError, match="holds as printed"):
        claims.check("eq14")


def test_a_check_that_fails_tells_which_condition(monkeypatch):
    first_order_filters(monkeypatch)
    with pytest.raises(LedgerError, match=r"^eq02\.low: .*; not met: \|F\| ≥ 1 − ε exactly"):
        claims.check("eq02.low")


def test_a_response_that_does_not_ring_would_contradict_what_is_said_of_example_2(monkeypatch):
    monkeypatch.setattr(examples12, "swings", lambda *which: 0)
    with pytest.raises(LedgerError, match=r"not met: S_d rings, as it did not before$"):
        claims.check("ex2.performance")


def test_every_claim_can_be_broken():
    broken = {id for ids in MUTATIONS.values() for id in ids.split()} | set(paper.PRINTED)
    assert set(LEDGER) - broken == set()
