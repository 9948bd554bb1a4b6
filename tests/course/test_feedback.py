"""The page that a student gets back: it can be read, and does nothing else."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import nbformat
import pytest
from bs4 import BeautifulSoup
from nbconvert import HTMLExporter
from nbconvert.filters import markdown2html
from nbgrader.converters import GenerateFeedback
from nbgrader.coursedir import CourseDirectory

from browser import CHROMIUM, browser
from nrdob_course.grading.autograde import is_sound
from nrdob_course.grading.feedback import offline, with_note
from problemsets import SETS, cells

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("tex", "shown"),
    [
        ("$x^2$", "<msup>"),
        ("$$x$$", 'display="block"'),
        (r"\(x\) and \[y\]", "<mi>y</mi>"),
        (r"\begin{align} a &= b \\ c &= d \end{align}", "<mtable"),
        (r"\begin{equation} a = b \end{equation}", 'display="block"'),
        (r"$a, \dots, b$", "…"),
        (r"$\dfrac12$", "<mfrac"),
        (r"$\frac1\pi$", "<mfrac>"),
        (r"$\tfrac 1{ab}$", "<mfrac"),
        (r"$\nonsense{x}$", r"<code>$\nonsense{x}$</code>"),
        ("it costs $5 and $6", "it costs $5 and $6"),
        (r"a price of \$5 and $x$", r"\$5 and <math"),
        ("<pre>echo $HOME $PATH</pre>", "<pre>echo $HOME $PATH</pre>"),
        ("<code>$x$</code>", "<code>$x$</code>"),
    ],
)
def test_formulas_become_mathml(tex: str, shown: str) -> None:
    assert shown in offline(f"<p>{tex}</p>")


@pytest.mark.parametrize("path", SETS, ids=lambda path: path.stem)
def test_every_formula_of_a_set_becomes_mathml(path: Path) -> None:
    for cell in cells(path):
        if cell.cell_type == "markdown":
            page = BeautifulSoup(offline(markdown2html(cell.source)), "html.parser")
            assert "$" not in page.get_text(), cell.id


def test_what_would_be_loaded_is_taken_out() -> None:
    page = offline(
        '<script src="https://a/b.js"></script><link href="//a/b.css"><iframe src="x"></iframe>'
        '<img src="https://a/b.png"><img src="data:image/png;base64,">'
    )
    assert page == '[https://a/b.png]<img src="data:image/png;base64,"/>'


@pytest.mark.parametrize(
    "harm",
    [
        "<img src=x onerror=alert(1)>",
        "<img src='data:image/svg+xml;base64,PHN2Zz4='>",
        "<svg onload=alert(1)><script>alert(1)</script></svg>",
        "<body onload=alert(1)>",
        "<a href='javascript:alert(1)'>a</a>",
        "<a href='java&#10;script:alert(1)'>a</a>",
        "<a href='data:text/html,<script>alert(1)</script>'>a</a>",
        "<meta http-equiv=refresh content='0;url=//evil.example'>",
        "<base href='//evil.example'>",
        "<p style='background: url(//evil.example)'>a</p>",
        "<style>* {display: none}</style>",
        "<form action='//evil.example'><input autofocus onfocus=alert(1)></form>",
        "<iframe srcdoc='<script>alert(1)</script>'></iframe>",
        "<math><mi xlink:href='javascript:alert(1)'>x</mi></math>",
        "<video src='//evil.example'></video><audio src='//evil.example'></audio>",
        "<object data='//evil.example'></object><embed src='//evil.example'>",
        r"$\href{javascript:alert(1)}{x}$ $\text{<img src=x onerror=alert(1)>}$",
        "</div></body></html><script>alert(1)</script>",
        "<details open ontoggle=alert(1)>a</details>",
        "<img src='data:image/png;base64,iVBO' onclick=alert(1) srcset='//evil.example'>",
    ],
)
def test_what_would_act_is_taken_out(harm: str) -> None:
    page = f"<html><head><title>t</title><style>p {{}}</style></head><body>{harm}</body></html>"
    for text in (offline(harm), offline(page).split("</head>")[1]):
        soup = BeautifulSoup(text, "html.parser")
        allowed = {"src", "href", "alt", "rel", "xmlns", "open", "display"}
        assert {name for tag in soup.find_all(True) for name in tag.attrs} <= allowed
        for tag in soup.find_all(src=True):
            assert tag["src"].startswith("data:image/png;base64,")
        assert not soup.find_all(href=True)
        assert not soup.find_all(["script", "style", "meta", "base", "svg", "form", "iframe"])


def test_a_page_tells_the_browser_to_load_nothing() -> None:
    page = offline("<html><head><title>t</title></head><body>a</body></html>")
    [rule] = BeautifulSoup(page, "html.parser").find_all("meta", attrs={"http-equiv": True})
    assert rule["http-equiv"] == "Content-Security-Policy"
    assert rule["content"].startswith("default-src 'none'")


def test_what_is_to_be_read_stays() -> None:
    text = "<h1 id='a'>A</h1><table><tr><td colspan='2'>b</td></tr></table><a href='#a'>c</a>"
    soup = BeautifulSoup(offline(text), "html.parser")
    assert soup.h1["id"] == "a" and soup.td["colspan"] == "2" and soup.a["href"] == "#a"


def output(kind: str, text: str = "") -> Any:
    if kind == "stream":
        return nbformat.v4.new_output("stream", name="stderr", text=text)
    if kind == "error":
        return nbformat.v4.new_output("error", ename="E", evalue="", traceback=[])
    return nbformat.v4.new_output(kind, data={"text/plain": text})


@pytest.mark.parametrize(
    ("found", "sound"),
    [
        (output("stream", "careful"), True),
        (output("execute_result", "2.5"), True),
        (output("error"), True),
        ({"output_type": "stream", "name": "stdout", "text": ["x"]}, False),
        ({"output_type": "display_data", "data": 3, "metadata": {}}, False),
        ({"output_type": "display_data", "data": {"text/plain": {}}, "metadata": {}}, False),
        ({"output_type": "execute_result", "data": {"text/plain": "3"}, "metadata": 3}, False),
        ({"output_type": "error", "ename": 1, "evalue": {}, "traceback": []}, False),
        ({"output_type": "error", "ename": "E", "evalue": "", "traceback": 3}, False),
        ({"output_type": "pyout"}, False),
    ],
)
def test_what_has_not_the_form_of_an_output_is_none(found: Any, sound: bool) -> None:
    assert is_sound(found) is sound


def test_a_student_cannot_write_the_teachers_note() -> None:
    forged = offline("<html><head></head><body><!--note--><p>late</p><!--/note-->x</body></html>")
    page = with_note(with_note(forged, "first <b>"), "two")
    assert "<!--note--><p><strong>two</strong></p><!--/note-->" in page
    assert "first" not in page and "<p>late</p>" in page
    assert with_note(page, "") == forged


@pytest.mark.thorough
@pytest.mark.skipif(CHROMIUM is None, reason="a page needs Chromium, and there is none here")
def test_a_page_fits_a_phone(tmp_path: Path) -> None:
    notebook = nbformat.read(SETS[1], as_version=4)
    code = nbformat.v4.new_code_cell(f"answer = {list(range(60))}", id="long")
    picture = base64.b64encode((ROOT / "book" / "_static" / "readme.png").read_bytes()).decode()
    shown = [{"image/png": picture}, {"text/plain": "x" * 300}]
    code.outputs = [nbformat.v4.new_output("display_data", data=data) for data in shown]
    notebook.cells.append(code)
    for cell in notebook.cells:
        cell.metadata.get("nbgrader", {}).update(score=0, points=0, comment="")
    exporter = HTMLExporter(config=GenerateFeedback(coursedir=CourseDirectory()).config)
    resources = {"nbgrader": dict.fromkeys(("score", "max_score", "late_penalty"), 0)}
    page, _ = exporter.from_notebook_node(notebook, resources)
    (tmp_path / "page.html").write_text(offline(page), "utf-8")
    with browser() as opened:
        tab = opened.new_page(viewport={"width": 360, "height": 700}, is_mobile=True)
        tab.goto((tmp_path / "page.html").as_uri())
        room = tab.evaluate("[window.innerWidth, document.documentElement.scrollWidth]")
    assert room == [360, 360]
