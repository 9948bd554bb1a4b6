"""Reports are always written, stand alone, and say what is true."""

import base64
import json
import re
from dataclasses import replace
from functools import cache

import control as ct
import numpy as np
import pytest
from bs4 import BeautifulSoup

import nrdob
from nrdob.certificates import check
from nrdob.diagram import as_family
from nrdob.digital import largest_sampling_time
from nrdob.measured import checked_record, heated_air, identify
from nrdob.reporting import datasections, main, propose
from nrdob.reporting.choices import controller_for, filter_for
from nrdob.reporting.datasections import data_sections
from nrdob.reporting.loopsections import sections_of
from tests.campaigns import proposals

s = ct.tf("s")
UNKIND = "<script>alert(1)</script>"


@cache
def of_loop():
    loop = nrdob.NRDOB(
        process=4 / (-(s**2) - s + 2),
        model=-1 / (s**2 + 3 * s + 2),
        controller=-1.8 * (0.5 * s + 1) / s,
        filter=nrdob.LowPassFilter(0.65, 2),
    )
    return loop, nrdob.report(loop, title=UNKIND).html


@cache
def of_record():
    return nrdob.report(heated_air())


def words(page):
    page = getattr(page, "html", page)
    return " ".join(BeautifulSoup(page, "html.parser").get_text().replace("\xa0", " ").split())


@pytest.mark.thorough
@pytest.mark.parametrize(
    "page", [lambda: of_loop()[1], lambda: of_record().html], ids=["loop", "record"]
)
def test_a_page_stands_alone_and_names_its_pictures(page):
    tree = BeautifulSoup(page(), "html.parser")
    assert not tree.find_all(["script", "link", "iframe", "object", "embed"])
    for tag in tree.find_all(True):
        for name, value in tag.attrs.items():
            assert not name.startswith("on")
            if name in ("href", "src", "xlink:href"):
                held = "data:image/png;base64,", "data:application/json;base64,"
                assert value.startswith(("#", *held))
    assert not re.search(r"url\((?!#)", page())
    drawn = tree.find_all(attrs={"role": "img"})
    assert len(drawn) >= 4 and all(len(each["aria-label"]) > 40 for each in drawn)
    named = [tag["id"] for tag in tree.find_all(id=True)]
    assert len(named) == len(set(named))
    assert {a["href"][1:] for a in tree.find_all("a", download=False)} <= set(named)


@pytest.mark.thorough
def test_a_report_holds_the_proof_of_its_verdict():
    for process, stable in ((1 / (s + 1), True), (-1 / (s + 1), False)):
        loop = nrdob.NRDOB(nrdob.delay(0.2) * process, 1 / (s + 1), 2, nrdob.LowPassFilter(0.5, 1))
        tree = BeautifulSoup(nrdob.report(loop).html, "html.parser")
        (link,) = tree.find_all("a", download=True)
        _, _, held = link["href"].partition("base64,")
        proved = check(json.loads(base64.b64decode(held)))
        assert link["download"] == "certificate.json" and proved in link.parent.get_text()
        assert ("internally stable" in proved) is stable is loop.stability().stable


@pytest.mark.thorough
def test_a_report_says_why_there_is_no_proof():
    # λ = 2θ/π: a root on the imaginary axis
    edge = nrdob.LowPassFilter(0.4 / np.pi, 1)
    loop = nrdob.NRDOB(nrdob.delay(0.2) / (s + 1), 1 / (s + 1), 2, edge)
    page = nrdob.report(loop).html
    assert "There is no certificate" in page and "download=" not in page


@pytest.mark.thorough
def test_what_is_handed_in_is_escaped():
    assert UNKIND not in of_loop()[1] and "&lt;script&gt;alert(1)" in of_loop()[1]


@pytest.mark.slow
def test_the_report_of_a_loop_tells_its_numbers():
    loop, page = of_loop()
    text = words(page)
    margins = loop.margins().plant_loop
    assert "The loop is stable" in text
    low = -20 * np.log10(margins.gm_low)
    assert f"Only {low:.2g} dB from instability if the gain of the plant falls" in text
    assert "0 s < λ < 0.7639 s" in text  # 3 - √5
    longest = largest_sampling_time(loop)
    assert f"the loop becomes unstable at dt = {longest:.4g} s" in text
    assert "cannot be written" not in text


@pytest.mark.slow
def test_the_report_of_a_record_tells_what_was_found():
    text = words(of_record())
    assert "two lags with dead time" in text and "89.1 %" in text and "85.5 %" in text
    assert "Tried on the process found" in text and "corners of the intervals" in text
    assert "The loop is stable" in text and "dt = 0.08 s, at which the plant was measured" in text
    assert "cannot be written" not in text


@pytest.mark.slow
def test_where_nothing_was_held_out_the_report_does_not_tell_of_it():
    told = of_record().identification
    found = replace(told, validation_percent=np.nan, fitted=told.record.u.size)
    *_, (_, trust) = data_sections(found)
    assert "Nothing was held out" in trust().words[0]
    assert "part held out" not in trust().tables[0].head
    *_, (_, trust) = data_sections(told)
    assert "part held out" in trust().tables[0].head


@pytest.mark.slow
@pytest.mark.parametrize(
    ("process", "said"),
    [
        (nrdob.delay(2.5) / (s - 1), "their product is 2.5"),
        (s / (s + 1) ** 2, "zero at s = 0"),
        (s + 1, "improper"),
        (ct.tf([1], [1, 0.5], 0.1), "discrete-time"),
    ],
    ids=["too late", "no gain at rest", "improper", "discrete"],
)
def test_where_nothing_works_the_report_says_why(process, said):
    text = words(nrdob.report(process))
    assert "No loop that works was found" in text and said in text


@pytest.mark.slow
def test_where_only_the_process_itself_is_a_model_that_works_it_is_proposed():
    found = propose((s - 4) / ((s - 1) * (s + 1)))
    peak = found.loop.margins().plant_loop.ms
    assert found.loop.stability().stable and peak >= 5 / 3  # |(z + p)/(z - p)|
    assert found.loop.process is found.loop.model
    assert "at least" in found.words[1] and "an interpolating filter" in found.words[2]


@pytest.mark.thorough
def test_a_record_without_a_process_is_still_shown():
    rng = np.random.default_rng(0)
    u = np.zeros(60)
    u[58:] = 1.0
    text = words(nrdob.report(checked_record(np.arange(60.0), u, rng.standard_normal(60))))
    assert "60 samples every 1 s" in text


@pytest.mark.slow
def test_what_a_sensor_writes_where_it_fails_does_not_hide_the_record(monkeypatch):
    monkeypatch.setattr(datasections, "picture", lambda figure, caption: figure)
    t = np.arange(200.0)
    y = 20 + np.where(t < 50, 0.0, 1 - np.exp((50 - t) / 15))
    y += 0.01 * np.random.default_rng(0).standard_normal(200)
    y[100:103] = -999
    with pytest.warns(UserWarning, match="left out"):
        found = identify(t, np.where(t < 50, 0.0, 1.0), y, structure="one lag with dead time")
    for told in (None, found):
        shown = datasections.record_section(found.record, told)
        assert "y between 20 and 21 in the samples that count." in shown.words[0]
        low, high = shown.pictures[0].axes[0, 0].get_ylim()
        assert 19.8 < low < 20 and 21 < high < 21.2


@pytest.mark.slow
def test_a_loop_that_is_not_stable_is_called_so():
    page = nrdob.report(nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), -5, (1, [1, 1])))
    text = words(page)
    assert "The loop is NOT stable" in text and "no margins" in text


@pytest.mark.slow
def test_a_loop_has_its_blocks_already():
    with pytest.raises(ValueError, match="give the process alone"):
        nrdob.report(of_loop()[0], order=2)


@pytest.mark.parametrize("subject", [None, "nonsense", 3.5j, object()])
def test_what_is_nothing_to_report_on_is_refused(subject):
    with pytest.raises(TypeError, match="a report is on a process"):
        nrdob.report(subject)


@cache
def slow_record():
    """A lag of 1 s with a gain of 2, every 0.1 s, and the process without the estimate's errors."""
    rng = np.random.default_rng(1)
    u = np.sign(np.sin(0.01 * np.arange(400) ** 1.3))
    y = np.zeros(400)
    for k in range(399):
        y[k + 1] = np.exp(-0.1) * y[k] + 2 * (1 - np.exp(-0.1)) * u[k]
    y += 0.01 * rng.standard_normal(400)
    found = identify(0.1 * np.arange(400), u, y, structure="one lag with dead time")
    return replace(found, process=2 / (s + 1))


MATCHED = {"model": 2 / (s + 1), "controller": 0.3 / s, "order": 1}


@pytest.mark.thorough
def test_an_instability_of_the_sampled_loop_is_the_headline():
    found = nrdob.report(slow_record(), **MATCHED, time_constant=0.01)
    assert found.loop.stability().stable and not found.loop.sampled(0.1).stability().stable
    assert found.verdict.startswith("Sampled like the record, at dt = 0.1 s, the loop fails.")
    assert "slower filters" not in found.verdict  # none was tried, since λ is given
    assert found.mood == "bad" and found.warnings[0] == found.verdict
    assert "At dt = 0.1 s the sampled loop is NOT stable." in found.warnings
    assert words(found).index(found.verdict) < words(found).index("The loop is stable")


@pytest.mark.thorough
def test_a_peak_that_sampling_makes_is_in_the_headline():
    found = nrdob.report(slow_record(), **MATCHED, time_constant=0.07)
    after = found.loop.sampled(0.1).margins().ms
    assert found.loop.margins().plant_loop.ms < 1.01 and after > 2.4
    assert found.mood == "open"
    elsewhere = max(each.ms for each in found.proposal.trials)
    assert found.verdict.startswith(
        f"The loop is stable; its sensitivity peaks at 1, and at {elsewhere:.3g} at most on all "
        "that the record allows. But: Sampled"
    )
    peaks = [each.sampled.ms for each in found.proposal.trials]
    above = sum(each > 2.5 for each in peaks)
    assert above and after == pytest.approx(peaks[0])
    assert f"unstable on 0, and on {above} more the sensitivity peaks above 2.5" in found.verdict
    said = f"the peak of the sensitivity is {after:.3g} instead of 1"
    assert any(said in warning for warning in found.warnings)


@pytest.mark.thorough
def test_a_resonance_that_may_be_nowhere_else_is_the_headline():
    process = ct.tf([100], [1, 0.04, 100])
    found = nrdob.report(process, model=process, time_constant=0.0316, order=2)
    other = nrdob.NRDOB(ct.tf([96.04], [1, 0.0392, 96.04]), *blocks(found.loop))
    assert found.loop.stability().stable and not other.stability().stable
    assert found.verdict.startswith("With the process' resonance at 10 rad/s 2 % lower")


@pytest.mark.thorough
@pytest.mark.parametrize("delay", [0.0, 0.5])
def test_a_proposal_does_not_rest_on_the_frequency_of_a_resonance(delay):
    proposal = propose(nrdob.delay(delay) * ct.tf([1], [1, 0.02, 1]))
    assert "the model does not resonate" in proposal.words[-1] and not proposal.warnings
    for factor in (0.9, 0.98, 1.02, 1.1):
        process = nrdob.delay(delay) * ct.tf([factor**2], [1, 0.02 * factor, factor**2])
        assert nrdob.NRDOB(process, *blocks(proposal.loop)).stability().stable


@pytest.mark.slow
def test_a_proposal_is_tried_once_on_each_process(monkeypatch):
    found, judged = slow_record(), []
    sampled = nrdob.NRDOB.sampled
    monkeypatch.setattr(
        nrdob.NRDOB, "sampled", lambda self, dt: judged.append(self) or sampled(self, dt)
    )
    proposal = propose(found, **MATCHED, time_constant=0.2)
    tried = [loop for loop in judged if loop.filter is proposal.loop.filter]
    assert len(proposal.trials) > 4 and len(tried) == len(proposal.trials)


@pytest.mark.thorough
@pytest.mark.parametrize(("samples", "delay"), [(20, 2), (5, 0)])
def test_a_filter_is_slow_enough_for_the_samples_of_the_record(samples, delay):
    dt = 1 / samples
    rng = np.random.default_rng(1)
    u = np.repeat(np.sign(rng.standard_normal(30)), 2 * samples)
    y = np.zeros(u.size)
    for k in range(delay + 1, u.size):
        y[k] = np.exp(-dt) * (y[k - 1] - u[k - 1 - delay]) + u[k - 1 - delay]
    y += 0.01 * rng.standard_normal(u.size)
    found = identify(dt * np.arange(u.size), u, y)
    alone, proposal = propose(found.process), propose(found)
    assert not proposal.warnings and proposal.loop.filter.time_constant > max(
        dt, alone.loop.filter.time_constant
    )
    for process in found.corners.values():
        fast = nrdob.NRDOB(process, *blocks(alone.loop)).sampled(dt)
        if not fast.stability().stable or fast.margins().ms > 2.5:
            break
    else:
        pytest.fail("the filter for the process alone would do")
    sampled = nrdob.NRDOB(process, *blocks(proposal.loop)).sampled(dt)
    peaks = [each.sampled.ms for each in proposal.trials]
    assert sampled.stability().stable and sampled.margins().ms in peaks and max(peaks) <= 2.5
    assert f"λ is {proposal.loop.filter.time_constant:.3g} s instead of" in proposal.words[-2]
    # On the process that made the record the loop settles, sample by sample.
    true = nrdob.NRDOB(nrdob.delay(delay * dt) * (1 / (s + 1)), *blocks(proposal.loop)).sampled(dt)
    y, _ = true.step_response("d", dt * np.arange(60 * samples)).outputs[:, 0]
    assert abs(y[-1]) < 1e-3 * np.abs(y).max()


@pytest.mark.thorough
def test_a_tank_that_only_integrates_gets_a_loop_as_slow_as_its_samples():
    rng, share = np.random.default_rng(4), {}
    u = np.repeat(rng.choice([-1.0, 1.0], size=40), 8)
    level = np.cumsum(0.02 * np.r_[0.0, u[:-1]]) + 0.005 * rng.standard_normal(u.size)
    for dt in (0.01, 60.0):
        found = identify(dt * np.arange(u.size), u, level, input_before=0.0)
        proposal = propose(found)
        assert "for a dead time of one sample" in proposal.words[0] and not proposal.warnings
        assert proposal.loop.delay == nrdob.NRDOB(found.process, *blocks(proposal.loop)).delay
        true = nrdob.NRDOB(0.02 / dt / s, *blocks(proposal.loop)).sampled(dt)
        assert true.stability().stable and true.margins().ms < 2.5
        share[dt] = proposal.loop.filter(0.1j / dt)
    assert share[60.0] == pytest.approx(share[0.01], rel=1e-3)


@pytest.mark.thorough
def test_where_no_slower_filter_helps_the_samples_the_loop_stays_and_the_page_says_so():
    # A pole at 10 rad/s grows by e within a sample.
    process = 1 / (s - 10)
    found = replace(slow_record(), process=process, candidates=(), least_squares=None, corners={})
    alone, proposal = propose(process), propose(found)
    assert proposal.loop.filter == alone.loop.filter
    (trial,) = proposal.trials
    assert trial.continuous.holds and trial.sampled.stable is False
    assert "none of the slower filters tried helps. Let the controller" in proposal.warnings[0]
    # With a corner that has a dead time, the filter becomes slower for continuous time alone.
    late = propose(replace(found, corners={"dead time": nrdob.delay(0.012) * process}))
    assert late.loop.filter.time_constant > alone.loop.filter.time_constant
    assert all(each.continuous.holds and not each.sampled.holds for each in late.trials)
    assert "does not exclude, so λ is" in late.words[-1] and "Sampled" in late.warnings[0]


def blocks(loop):
    return loop.model, loop.controller, loop.filter


@pytest.mark.slow
def test_no_loop_rests_on_a_process_that_the_record_denies():
    found = nrdob.report(replace(slow_record(), unsure="the gain of the process may be zero"))
    assert found.loop is None and found.mood == "bad"
    assert "No loop is proposed, because the gain of the process may be zero." in found.verdict


@pytest.mark.thorough
def test_a_loop_that_fails_on_what_the_record_does_not_exclude_is_the_headline():
    unlike = replace(slow_record(), corners={"gain low": -2 / (s + 1)})
    found = nrdob.report(unlike)
    assert found.loop.stability().stable and found.mood == "bad"
    assert "it is unstable on 1" in found.verdict


@pytest.mark.slow
def test_a_verdict_that_is_not_decided_is_the_headline(monkeypatch):
    loop = nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), 1 / s, (1, [1, 1]))
    verdict = replace(loop.stability(), stable=None)
    monkeypatch.setattr(nrdob.NRDOB, "stability", lambda self: verdict)
    found = nrdob.report(loop)
    assert found.verdict.startswith("Whether the loop is stable could not be decided.")
    assert found.mood == "bad"


@pytest.mark.thorough
def test_a_part_that_cannot_be_written_is_a_warning(monkeypatch):
    loop = nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), 1 / s, nrdob.LowPassFilter(1.0, 1))
    assert nrdob.report(loop).mood == "good"

    def fails(self, *arguments):
        raise ValueError("no ink")

    monkeypatch.setattr(nrdob.NRDOB, "plot_step", fails)
    found = nrdob.report(loop)
    assert found.mood == "open" and "What it does" in found.verdict and "no ink" in found.verdict


@pytest.mark.thorough
def test_a_report_is_an_object_that_holds_what_it_found(tmp_path):
    parts = []
    found = nrdob.report(nrdob.delay(1) * ct.tf([1], [10, 1]), progress=parts.append)
    assert found.loop.stability().stable and found.loop is found.proposal.loop
    assert found.process.delay == 1 and found.identification is None and found.warnings == ()
    assert parts[0] == "What is proposed, and why" and "On a processor" in parts
    found.save(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == found.html
    frame = BeautifulSoup(found._repr_html_(), "html.parser").iframe
    assert frame["srcdoc"] == found.html and "sandbox" in frame.attrs
    assert found.verdict in str(found) and "e^(−1 s)" in str(found)
    assert "svg" not in repr(found)


@pytest.mark.thorough
def test_a_report_on_a_record_holds_the_identification():
    found = nrdob.report(slow_record())
    assert found.identification is slow_record()
    assert found.process is slow_record().process and found.loop.process is found.process


def run(capsys, *arguments):
    code = main([str(each) for each in arguments])
    return code, capsys.readouterr()


@pytest.mark.thorough
def test_the_command_writes_a_report_of_formulas(tmp_path, capsys):
    page = tmp_path / "out.html"
    code, said = run(
        capsys, "report", "--process", "2/(s+1)", "--model", "2/(s+1)", "--controller=1/s",
        "--time-constant", 0.2, "--output", page,
    )  # fmt: skip
    assert code == 0 and not said.err
    assert "The loop is stable" in said.out and "is written" in said.out
    assert "The loop is stable" in page.read_text(encoding="utf-8")


@pytest.mark.thorough
def test_the_exit_status_tells_warnings_from_none(tmp_path, capsys):
    page = tmp_path / "out.html"
    code, said = run(capsys, "report", "--process", "exp(-s)/(10s+1)", "--output", page)
    assert code == 0 and "Warning" not in said.out
    code, said = run(
        capsys, "report", "--process", "100/(s^2+0.04s+100)", "--model", "100/(s^2+0.04s+100)",
        "--time-constant", 0.0316, "--order", 2, "--output", page,
    )  # fmt: skip
    assert code == 3 and said.out.startswith("With the process' resonance at 10 rad/s 2 % lower")
    code, said = run(capsys, "report", "--process", "exp(-2s)/(s-1)", "--output", page)
    assert code == 3 and said.out.startswith("No loop that works was found.")


@pytest.mark.thorough
def test_the_command_reads_columns_and_the_input_before(tmp_path, capsys):
    t = 100 * np.arange(300)
    u, y = 0 * t + 50, 20 + 15 * (1 - np.exp(-t / 3000))
    path = tmp_path / "data.csv"
    rows = [f"{a},{b},{c:.3f},{c - 1:.3f}" for a, b, c in zip(t, u, y, strict=True)]
    path.write_text("\n".join(["Time [ms],Q1,T1,T2", *rows]), encoding="utf-8")
    page = tmp_path / "out.html"
    code, said = run(capsys, "report", path, "--output", page)
    assert code == 1 and "choose, such as --columns" in said.err
    asked = ("report", path, "--output", page, "--columns", "t=Time,u=Q1,y=T1")
    code, said = run(capsys, *asked)
    assert code == 1 and "--input-before 0" in said.err
    code, said = run(capsys, *asked, "--input-before", 0)
    assert code in (0, 3), said.err
    assert "Times are in ms; they were converted to seconds." in words(page.read_text("utf-8"))
    assert "Before it u is 0, as you say, and the plant at rest" in words(page.read_text("utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("report", "data.csv", "--columns", "Time,Q1"), "write it as t=Time,u=Q1,y=T1"),
        (("report", "data.csv", "--columns", "u=1,u=2"), "write it as t=Time,u=Q1,y=T1"),
        (("report", "--process", "1/s", "--columns", "u=1"), "--columns belongs to a file"),
        (("report", "--process", "1/s", "--input-before", "1"), "--input-before belongs to a"),
        (("report",), "give either a file of data or --process"),
        (("report", "missing.csv"), "missing.csv: No such file"),
        (("report", "--process", "1/(s+"), '--process, "1/(s+": it breaks off'),
        (("report", "--process", "1/s", "--model", "exp(1)"), "--model"),
        (("report", "--process", "1/s", "--time-constant", "-1"), "time_constant is -1"),
        (("report", "--process", "1/s", "--sampling-time", "1"), "belongs to a file"),
    ],
)
def test_the_command_says_in_a_sentence_what_is_wrong(capsys, arguments, said):
    code, out = run(capsys, *arguments)
    assert code == 1 and said in out.err and out.err.count("\n") == 1 and "Traceback" not in out.err


def test_the_command_names_the_line_of_a_table(tmp_path, capsys):
    path = tmp_path / f"{UNKIND.replace('/', '')}.csv"
    rows = (f"{k},{k % 2},{k if k - 7 else 'off'}" for k in range(30))
    path.write_text("t,u,y\n" + "\n".join(rows))
    code, out = run(capsys, "report", path)
    assert code == 1 and out.err == (
        "nrdob: line 9: y is 'off', which is no finite number; cut the record there, take the line "
        "out (a few missing lines are filled in), or fill a short gap yourself\n"
    )


def test_the_command_tells_how_it_is_used(capsys):
    for arguments in (["--help"], ["report", "--help"]):
        with pytest.raises(SystemExit) as left:
            main(arguments)
        assert left.value.code == 0 and "report" in capsys.readouterr().out
    with pytest.raises(SystemExit) as left:
        main(["report", "--nonsense"])
    assert left.value.code == 2


@pytest.mark.thorough
def test_a_model_that_keeps_its_integrator_gets_the_filter_that_was_compared():
    """1 - F ~ s^2 then: nothing is left of a constant disturbance at the input."""
    proposal = propose(nrdob.delay(1.0) * ct.tf([1], [1, 0]))
    assert proposal.candidates[0].family is not None
    assert proposal.loop.stability().stable
    assert abs(proposal.loop.S_delta.dc_gain) < 1e-9
    assert proposal.loop.margins().plant_loop.ms < 2.001


@pytest.mark.thorough
def test_a_resonance_gets_a_controller_that_does_not_make_it_swing():
    loop = propose(ct.tf([1], [1, 0.02, 1])).loop
    assert loop.margins().model_loop.ms < 2.001


def test_where_only_noise_limits_the_filter_it_passes_ten_times_what_a_constant_gets():
    # F/model = (2s + 1)/(3 (λs + 1)) tends to 2/(3λ), and is 1/3 at rest.
    model = 3 / (2 * s + 1)
    found, said, warnings = filter_for(model, model, as_family(1), 1.5)
    assert found.time_constant == pytest.approx(0.2, rel=5e-3)
    assert "10 times" in said and warnings == []


def test_a_filter_that_cannot_be_found_is_named_by_its_order():
    lag = 1 / (s + 1)
    _, _, (warned,) = filter_for(10 * lag, lag, as_family(4), 1.7)
    assert warned.startswith("No filter of order 4 gives a loop")


@pytest.mark.thorough
def test_a_model_without_any_filter_is_passed_over_for_a_slower_one_that_is_calm():
    # The process without its resonance has the zero at 2, too: its inverse is unstable.
    proposal = propose((2 - s) / ((s + 1) * (s**2 + 0.02 * s + 1)))
    assert "so λ is 0.854 s instead of 0.494 s" in proposal.words[-1]
    assert "designed for a crossover" in " ".join(proposal.words)
    loop = proposal.loop
    for factor in (0.98, 1.02):
        process = (2 - s) / ((s + 1) * ((s / factor) ** 2 + 0.02 * s / factor + 1))
        assert nrdob.NRDOB(process, *blocks(loop)).stability().stable


@pytest.mark.slow
def test_a_loop_that_is_not_stable_is_called_so_where_its_stability_cannot_be_drawn(monkeypatch):
    def fails(*arguments):
        raise ValueError("no ink")

    monkeypatch.setattr("nrdob.reporting.loopsections.nyquist_plot", fails)
    loop = nrdob.NRDOB(-1 / (s + 1), 1 / (s + 1), 1 / s, nrdob.LowPassFilter(1.0, 1))
    assert nrdob.report(loop).verdict.startswith("The loop is NOT stable. But: ")


def section(loop, title, **given):
    return dict(sections_of(loop, **given))[title]()


@pytest.mark.thorough
def test_a_peak_in_the_first_moment_is_told():
    C = (100 * s + 0.001) / (s * (0.001 * s + 1))
    loop = nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), C, nrdob.LowPassFilter(0.1, 1))
    told = section(loop, "What it does").words[0]
    u = loop.step_response("R", np.linspace(0, 0.2, 20_001)).outputs[1, 0]
    assert f"u reaches {np.abs(u).max():.3g} per unit" in told


def test_a_gain_next_to_the_limit_is_not_told_as_one():
    loop = nrdob.NRDOB(8.998 / (s + 1) ** 3, 1 / (s + 1) ** 3, 1, nrdob.LowPassFilter(0.1, 3))
    told = " ".join(section(loop, "How nearly not?").warnings)
    assert "if the gain of the plant rises: times 1.00022 is too much" in told  # 9/8.998


@pytest.mark.thorough
def test_a_response_that_cannot_be_computed_to_its_end_is_told_to_go_on():
    lag = 1 / (s + 1) ** 10
    loop = nrdob.NRDOB(lag, lag, 0.02 / s, nrdob.LowPassFilter(1.0, 10))
    told = section(loop, "What it does").words[0]
    assert "Later values cannot be computed to nine digits; y goes to 1." in told


def test_an_order_of_zero_is_refused_and_not_passed_over():
    with pytest.raises(ValueError, match="order"):
        propose(1 / (s + 1), order=0)


def test_filters_are_listed_for_this_order_and_the_next():
    loop = nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), 1 / s, nrdob.LowPassFilter(0.5, 1))
    found = section(loop, "Which filters would do?")
    assert [row[0] for row in found.tables[0].rows] == ["n = 1", "n = 2"] and not found.warnings


@pytest.mark.slow
def test_a_loop_that_is_stable_on_the_processor_raises_no_alarm():
    loop = nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), 1 / s, nrdob.LowPassFilter(0.5, 1))
    assert loop.sampled(0.1).stability().stable
    for step, chosen in ((0.1, "the plant was measured"), (None, "chosen here")):
        found = section(loop, "On a processor", step=step)
        assert chosen in found.words[-1] and "loop is stable" in found.words[-1]
        assert not found.alarms


def test_a_loop_whose_largest_sampling_time_is_not_known_is_sampled_every_tenth_of_a_second():
    loop = nrdob.NRDOB(1 / (s + 1), nrdob.delay(3.0) / (s + 1), 0.1, 1 / (0.003 * s + 1))
    found = section(loop, "On a processor")
    assert "not clearly at dt = 0.03 s, the shortest in the search: F H" in found.warnings[0]
    assert "At dt = 0.1 s, chosen here, the sampled loop is " in found.words[-1]


@pytest.mark.slow
def test_counts_that_are_not_known_are_question_marks():
    # λ = 2θ/π: a root on the imaginary axis
    process, F = nrdob.delay(1.0) / (s + 1), nrdob.LowPassFilter(2 / np.pi, 1)
    row = section(nrdob.NRDOB(process, 1 / (s + 1), 1, F), "Is it stable?").tables[0].rows[1]
    assert row[3] == "?"


@pytest.mark.slow
@pytest.mark.parametrize("lam", [0.1, 0.2])
def test_a_controller_is_designed_for_the_bandwidth_of_the_observer(lam):
    model = 1 / (s - 1)
    found, said = controller_for(model, nrdob.LowPassFilter(lam, 2))
    omega = 1 / (2 * lam)
    assert f"a crossover at {omega:g} rad/s" in said
    assert abs(found(1j * omega) * model(1j * omega)) == pytest.approx(1.0)


@pytest.mark.thorough
def test_no_loop_proposed_for_a_record_is_unstable_on_the_plant_that_made_it():
    tally = proposals.campaign(5, seed=11)
    assert sum(tally.values()) == 5 and any("proposed, stable" in outcome for outcome in tally)
    assert not any("UNSTABLE" in outcome or "WRONG" in outcome for outcome in tally)
