"""The ledger's pages: every claim on them, and nothing between ledger and chapters that misfits.

Tried on small made-up ledgers and chapters. That the real ledger is in order is asked, with the
finished site, in test_site.py.
"""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest
from sphinx.errors import ConfigError

import conf
import ledger
from nrdob_course.claims import LEDGER, Amendment, Claim, Finding, Verdict


def claim(
    id: str, verdict: Verdict = Verdict.REPRODUCED, chapter: str = "11_one", holds: bool = True
) -> Claim:
    """Make up a claim that gets its verdict, or, if it does not hold, gets none."""
    amendment = None if verdict is Verdict.REPRODUCED else Amendment(verdict, f"The truth of {id}.")

    how = "Count on *fingers*."

    def check() -> Finding:
        return Finding(
            as_printed=holds and amendment is None,
            computed=f"{id} computed",
            tolerance="±1",
            conditions={f"the truth of {id}": holds} if amendment else {},
        )

    return Claim(id, f"place of {id}", f"Says ${id}$.", "0.3", chapter, amendment, how, check)


def ledger_of(*claims: Claim) -> dict[str, Claim]:
    return {claim.id: claim for claim in claims}


EVERY_VERDICT = ledger_of(
    claim("eq03"),
    claim("eq05.S_d", Verdict.CONDITION),
    claim("eq05.S_eta", Verdict.CORRECTED),
    claim("sec3.speculation", Verdict.REFUTED),
    claim("ref02.year", Verdict.CORRECTED, "12_two"),
)


def write_chapter(folder: Path, stem: str, *cells: str) -> None:
    """Store a notebook; behind ">>>" is the claim that a cell of code names in its metadata."""
    folder.mkdir(exist_ok=True)
    notebook = nbformat.v4.new_notebook()
    notebook.cells = [
        nbformat.v4.new_code_cell("x = 1", metadata={"claims": [cell.removeprefix(">>> ")]})
        if cell.startswith(">>>")
        else nbformat.v4.new_markdown_cell(cell)
        for cell in cells
    ]
    nbformat.write(notebook, folder / f"{stem}.ipynb")


@pytest.fixture
def chapters(tmp_path: Path) -> Path:
    """Two chapters that cite every claim of EVERY_VERDICT, in prose and in the metadata of code."""
    folder = tmp_path / "notebooks"
    write_chapter(
        folder,
        "11_one",
        "# The loop\n\nAs in `claim:eq03`.",
        "## Two bands of $S_d$\n\nThe claim (`claim:eq05.S_d`) and `claim:eq05.S_eta`.",
        "<details><summary>Solution</summary>\n\nSee `claim:eq03`.\n\n</details>",
        ">>> sec3.speculation",
    )
    write_chapter(folder, "12_two", "# The second\n\n## End\n\n`claim:ref02.year` `claim:eq03`")
    return folder


def run(
    claims: dict[str, Claim], chapters: Path, capsys: pytest.CaptureFixture[str]
) -> tuple[int, str]:
    """Run the tool; give its exit code and what it says went wrong."""
    code = ledger.main(
        ["--output", str(chapters.parent / "book"), "--notebooks", str(chapters)], claims
    )
    return code, capsys.readouterr().err


def page(chapters: Path, name: str) -> str:
    return (chapters.parent / "book" / name).read_text(encoding="utf-8")


def test_a_ledger_in_order(chapters: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(EVERY_VERDICT, chapters, capsys) == (0, "")


@pytest.mark.parametrize(
    ("odd", "complaint"),
    [
        (claim("eq04.T_R"), "eq04.T_R: not cited in its own chapter, 11_one"),
        (claim("ref02.doi", chapter="12_two"), "ref02.doi: not cited in its own chapter, 12_two"),
        (
            claim("eq03", chapter="13_gone"),
            "eq03: belongs to the chapter 13_gone, which does not exist",
        ),
        (
            claim("eq03", holds=False),
            "eq03: does not hold as printed (eq03 computed), and the ledger has no amendment",
        ),
        (
            claim("eq05.S_d", Verdict.CONDITION, holds=False),
            "eq05.S_d: the amended statement fails as well (eq05.S_d computed); not met: the truth "
            "of eq05.S_d",
        ),
        (claim("poem.1"), "poem.1: begins like no part of the paper"),
    ],
    ids=lambda value: value.id if isinstance(value, Claim) else "",
)
def test_what_is_not_in_order_is_told(
    odd: Claim, complaint: str, chapters: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = run(EVERY_VERDICT | {odd.id: odd}, chapters, capsys)
    assert code == 1
    assert complaint in said


def test_a_check_that_crashes_is_told_and_the_others_run(
    chapters: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def check() -> Finding:
        raise ZeroDivisionError("division by zero")

    crash = Claim("eq03", "p. 1", "Says.", "", "11_one", None, "", check)
    code, said = run(EVERY_VERDICT | {"eq03": crash}, chapters, capsys)
    assert code == 1
    assert "eq03: the check fails: division by zero" in said
    assert ":name: claim-eq05.S_d" in page(chapters, "ledger.md")


@pytest.mark.parametrize("cell", ["`claim:eq99`", ">>> eq99"])
def test_a_citation_of_nothing_is_told(
    cell: str, chapters: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_chapter(chapters, "13_three", "# Three\n\n## A section", cell)
    code, said = run(EVERY_VERDICT, chapters, capsys)
    assert code == 1
    assert "eq99: cited in 13_three, section 'A section', but there is no such claim" in said


def test_all_problems_are_told_at_once(chapters: Path, capsys: pytest.CaptureFixture[str]) -> None:
    odd = ledger_of(claim("eq04.T_R"), claim("eq03", holds=False), claim("eq07", chapter="gone"))
    _, said = run(EVERY_VERDICT | odd, chapters, capsys)
    assert all(f"  {id}: " in said for id in odd)


@pytest.mark.parametrize(
    ("text", "ids"),
    [
        ("both `claim:a.b` and `claim:c`.", ["a.b", "c"]),
        ("```\n`claim:a`\n```\n`claim:b`", ["b"]),
        ("claim:a, `claim: a` and ``claim:a``", []),
    ],
)
def test_citations_are_found(text: str, ids: list[str], tmp_path: Path) -> None:
    write_chapter(tmp_path, "chapter", text)
    found = ledger.read_chapter(tmp_path / "chapter.ipynb").citations
    assert list(found) == ids


def test_the_ledger_has_every_claim(chapters: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(EVERY_VERDICT, chapters, capsys)
    text = page(chapters, "ledger.md")
    assert re.findall(r"^:name: claim-(\S+)$", text, re.MULTILINE) == [
        "eq03", "eq05.S_d", "eq05.S_eta", "sec3.speculation", "ref02.year",
    ]  # fmt: skip
    for claim in EVERY_VERDICT.values():
        _, _, entry = text.partition(f":name: claim-{claim.id}\n")
        entry, _, _ = entry.partition("\n::::\n")
        for part in (claim.place, claim.says, "0.3", f"{claim.id} computed (±1)", "*fingers*"):
            assert part in entry
        assert f"(#shown-{claim.chapter}-{claim.id.lower()})" in entry


def test_the_totals_are_right(chapters: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(EVERY_VERDICT, chapters, capsys)
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in page(chapters, "ledger.md").splitlines()
        if line.startswith("|")
    ]
    assert rows[0] == ["Part", *(verdict.value for verdict in Verdict), "all"]
    assert rows[2:] == [
        ["Sections I, II", "1", "1", "1", "0", "3"],
        ["Section III", "0", "0", "0", "1", "1"],
        ["Conclusions", "0", "0", "1", "0", "1"],
        ["The paper", "1", "1", "2", "1", "5"],
    ]


def test_a_claim_links_all_its_chapters_its_own_first(
    chapters: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(EVERY_VERDICT, chapters, capsys)
    text = page(chapters, "ledger.md")
    assert (
        "[The loop](#shown-11_one-eq03); [The second › End](#shown-12_two-eq03)" in text
    )  # in the chapter's opening there is no section to name
    assert "[The loop › Two bands of $S_d$](#shown-11_one-eq05.s_d)" in text


def test_the_errata_are_what_is_not_reproduced(
    chapters: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(EVERY_VERDICT, chapters, capsys)
    text = page(chapters, "errata.md")
    assert "4 of the\n5 in the" in text
    cited = re.findall(r"`claim:(\S+?)`", text)
    # Grouped by kind: what is put right, what is conditional, what does not hold.
    assert cited == ["eq05.S_eta", "ref02.year", "eq05.S_d", "sec3.speculation"]
    for id in cited:
        assert f"True\n: The truth of {id}." in text


def test_the_same_ledger_leaves_the_pages_untouched(
    chapters: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(EVERY_VERDICT, chapters, capsys)
    target = chapters.parent / "book" / "ledger.md"
    before = target.stat().st_mtime_ns
    run(EVERY_VERDICT, chapters, capsys)
    assert target.stat().st_mtime_ns == before


def test_every_claim_of_the_paper_belongs_to_a_part() -> None:
    assert not [id for id in LEDGER if ledger.part_of(id) is None]


def test_a_book_without_its_ledger_says_what_makes_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(conf, "BOOK", tmp_path)
    (tmp_path / "errata.md").touch()
    with pytest.raises(ConfigError, match=r"ledger\.md not in .* python book/make/ledger\.py"):
        conf.require_generated(None, None)
