"""Reports are always written, stand alone, and say what is true."""

import re
from functools import cache

import control as ct
import numpy as np
import pytest
from bs4 import BeautifulSoup

import nrdob
from nrdob.measured import checked_record, heated_air
from nrdob.reporting import main, propose

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
    return loop, nrdob.report(loop, title=UNKIND)


@cache
def of_record():
    return nrdob.report(heated_air())


def words(page):
    return " ".join(BeautifulSoup(page, "html.parser").get_text().replace("\xa0", " ").split())


@pytest.mark.slow
@pytest.mark.parametrize("page", [lambda: of_loop()[1], of_record], ids=["loop", "record"])
def test_a_page_stands_alone_and_names_its_pictures(page):
    tree = BeautifulSoup(page(), "html.parser")
    assert not tree.find_all(["script", "link", "iframe", "object", "embed"])
    for tag in tree.find_all(True):
        for name, value in tag.attrs.items():
            assert not name.startswith("on")
            if name in ("href", "src", "xlink:href"):
                assert value.startswith(("#", "data:image/png;base64,"))
    assert not re.search(r"url\((?!#)", page())
    drawn = tree.find_all(attrs={"role": "img"})
    assert len(drawn) >= 4 and all(len(each["aria-label"]) > 40 for each in drawn)
    named = [tag["id"] for tag in tree.find_all(id=True)]
    assert len(named) == len(set(named))
    assert {a["href"][1:] for a in tree.find_all("a")} <= set(named)


@pytest.mark.slow
def test_what_is_handed_in_is_escaped():
    assert UNKIND not in of_loop()[1] and "&lt;script&gt;alert(1)" in of_loop()[1]


def test_the_report_of_a_loop_tells_its_numbers():
    loop, page = of_loop()
    text = words(page)
    margins = loop.margins().plant_loop
    assert "The loop is stable" in text
    low = -20 * np.log10(margins.gm_low)
    assert f"Only {low:.2g} dB from instability if the gain of the plant falls" in text
    assert "0 s < λ < 0.7639 s" in text  # 3 - √5
    longest = nrdob.largest_sampling_time(loop)
    assert f"the loop is lost at dt = {longest:.4g} s" in text
    assert "cannot be written" not in text


@pytest.mark.slow
def test_the_report_of_a_record_tells_what_was_found():
    text = words(of_record())
    assert "two lags with dead time" in text and "89.1 %" in text and "85.5 %" in text
    assert "Tried on the process found" in text and "corners of the intervals" in text
    assert "The loop is stable" in text and "dt = 0.08 s, at which the plant was measured" in text
    assert "cannot be written" not in text


@pytest.mark.parametrize(
    ("process", "said"),
    [
        (nrdob.delay(2.5) / (s - 1), "their product is 2.5"),
        (s / (s + 1) ** 2, "zero at s = 0"),
        (s + 1, "improper"),
        (ct.tf([1], [1, 0.5], 0.1), "discrete-time"),
        ("nonsense", "process is a str"),
    ],
    ids=["too late", "no gain at rest", "improper", "discrete", "no block"],
)
def test_where_nothing_works_the_report_says_why(process, said):
    text = words(nrdob.report(process))
    assert "No loop that works was found" in text and said in text


def test_a_record_without_a_process_is_still_shown():
    rng = np.random.default_rng(0)
    u = np.zeros(60)
    u[58:] = 1.0
    text = words(nrdob.report(checked_record(np.arange(60.0), u, rng.standard_normal(60))))
    assert "60 samples every 1 s" in text


def test_a_loop_that_is_not_stable_is_called_so():
    page = nrdob.report(nrdob.NRDOB(1 / (s + 1), 1 / (s + 1), -5, (1, [1, 1])))
    text = words(page)
    assert "The loop is NOT stable" in text and "no margins" in text


def test_a_loop_has_its_blocks_already():
    with pytest.raises(ValueError, match="give the process alone"):
        nrdob.report(of_loop()[0], order=2)


def run(capsys, *arguments):
    code = main([str(each) for each in arguments])
    return code, capsys.readouterr()


@pytest.mark.slow
def test_the_command_writes_a_report_of_formulas(tmp_path, capsys):
    page = tmp_path / "out.html"
    code, said = run(
        capsys, "report", "--process", "2/(s+1)", "--model", "2/(s+1)", "--controller=1/s",
        "--time-constant", 0.2, "--output", page,
    )  # fmt: skip
    assert code == 0 and not said.err
    assert "The loop is stable" in said.out and "is written" in said.out
    assert "The loop is stable" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
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
    path.write_text("t,u,y\n" + "\n".join(f"{k},{k % 2},{k if k - 7 else ''}" for k in range(30)))
    code, out = run(capsys, "report", path)
    assert code == 1 and out.err == (
        "nrdob: line 9: y is empty; cut the record there, or fill a short gap yourself\n"
    )


def test_the_command_tells_how_it_is_used(capsys):
    for arguments in (["--help"], ["report", "--help"]):
        with pytest.raises(SystemExit) as left:
            main(arguments)
        assert left.value.code == 0 and "report" in capsys.readouterr().out
    with pytest.raises(SystemExit) as left:
        main(["report", "--nonsense"])
    assert left.value.code == 2


def test_a_model_that_keeps_its_integrator_gets_the_filter_that_was_compared():
    """1 - F ~ s^2 then: nothing is left of a constant disturbance at the input."""
    proposal = propose(nrdob.delay(1.0) * ct.tf([1], [1, 0]))
    assert proposal.candidates[0].family is not None
    assert proposal.loop.stability().stable
    assert abs(proposal.loop.S_delta.dc_gain) < 1e-9
    assert proposal.loop.margins().plant_loop.ms < 2.001


def test_a_resonance_gets_a_controller_that_does_not_make_it_swing():
    loop = propose(ct.tf([1], [1, 0.02, 1])).loop
    assert loop.margins().model_loop.ms < 2.001
