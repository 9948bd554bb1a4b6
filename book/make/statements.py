"""The numbered theorems of the chapters, as written, and what is amiss with them.

A theorem is a quotation in a chapter; the page makes a box of it, and the index of theorems an
entry. Read, it gives its parts as Markdown:

    > **Theorem 17.1 (Lemma 1, exact).** *Let*
    >
    > 1. the blocks be proper;
    > 2. $F$ be stable.
    >
    > *Then* the loop is stable if and only if …
    >
    > *Without 1:* the loop … breaks.
    >
    > *Without 2:* …
    >
    > *Proof:* the determinant above.
    >
    > *Known:* textbook.

Nothing here needs Sphinx: the tests and the build ask the same functions.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from pages import prose_of

HEAD = re.compile(r"\*\*Theorem ((?:\d+|[A-D])\.\d+) \((.+?)\)\.\*\*\s*")
NUMBERED = re.compile(r"\*\*Theorem\b")
# A mention, such as "the loop of *Without 2*", has no colon and begins no part.
PART = re.compile(r"\*(Then|(?:Without|Proof|Known)(?=[^*]*:\*))\b([^*]*?)[:.]?\*[:.,]?\s*")
SENTENCE = re.compile(r"[.:;?!∎]\W*\Z|\$\Z|\|\Z")
NUMBER = re.compile(r"(?:\d+|[A-D])\.\d+")
MENTION = re.compile(
    rf"\bTheorems?\s+({NUMBER.pattern}(?:(?:,\s+|,?\s+and\s+|\s+to\s+|–){NUMBER.pattern})*)"
)
NOT_PROSE = re.compile(r"```.*?```|`[^`]*`|\$\$.*?\$\$|\$[^$]*\$", re.DOTALL)


@dataclass(frozen=True)
class Theorem:
    """A theorem as its chapter writes it, with its number, as 17.1; every text is Markdown."""

    page: str
    number: str
    name: str
    setting: str
    conditions: Mapping[int, str]
    listed: tuple[int, ...]
    without: Mapping[int, str]
    then: str = ""
    proof: str = ""
    known: str = ""

    @property
    def anchor(self) -> str:
        """Where its page has it."""
        return anchor(self.number)

    @property
    def parts(self) -> dict[str, str]:
        """What follows the conditions, by label."""
        without = {f"Without {k}": text for k, text in self.without.items()}
        return {"Then": self.then, **without, "Proof": self.proof, "Known": self.known}

    def __str__(self) -> str:
        """Name it and its place, as a complaint about it begins."""
        return f"{self.page}: Theorem {self.number} ({self.name})"


def anchor(number: str) -> str:
    """Give the anchor of a theorem; addresses in letters and papers rely on it."""
    return f"theorem-{number.replace('.', '-').lower()}"


def quotations(cells: Iterable[str]) -> Iterator[str]:
    """Give the quotations in Markdown texts, without their marks."""
    for text in cells:
        for block in re.findall(r"(?:^ {0,3}>.*(?:\n|\Z))+", text, re.MULTILINE):
            yield re.sub(r"^ {0,3}> ?", "", block, flags=re.MULTILINE).strip()


def read(page: str, cells: Iterable[str]) -> list[Theorem]:
    """Read the theorems of a chapter in their order; what is no theorem is passed over."""
    found = ((HEAD.match(text), text) for text in quotations(cells))
    return [parse(page, head, text[head.end() :]) for head, text in found if head]


def parse(page: str, head: re.Match[str], body: str) -> Theorem:
    """Read one theorem: its conditions before *Then*, and the parts that follow."""
    before, *marked = PART.split(body)
    setting, *items = re.split(r"^(\d+)\.\s+", before, flags=re.MULTILINE)
    listed = tuple(map(int, items[::2]))
    parts: dict[str, str] = {}
    without: dict[int, str] = {}
    for kind, which, said in zip(marked[::3], marked[1::3], marked[2::3], strict=True):
        if kind == "Without":
            without |= dict.fromkeys(map(int, re.findall(r"\d+", which)), said.strip())
        else:
            parts.setdefault(kind.lower(), said.strip())
    setting = "" if setting.strip() == "*Let*" else setting.strip()
    conditions = dict(zip(listed, map(str.strip, items[1::2]), strict=True))
    return Theorem(page, head[1], head[2], setting, conditions, listed, without, **parts)


def mentions(text: str) -> list[str]:
    """Give the numbers of the theorems that a text refers to, code and formulas left out."""
    spans = MENTION.findall(NOT_PROSE.sub(" ", text))
    return [number for span in spans for number in NUMBER.findall(span)]


def title_of(notebook: Path) -> str:
    """Give the title of a chapter, or its name where it has none."""
    titles = (re.search(r"^# +(.+?) *$", text, re.MULTILINE) for text in prose_of(notebook))
    return next((title[1] for title in titles if title), notebook.stem)


def theorems_of(folder: Path) -> dict[str, list[Theorem]]:
    """Read the theorems of all chapters in a folder, by chapter, in reading order."""
    return {path.stem: read(path.stem, prose_of(path)) for path in sorted(folder.glob("*.ipynb"))}


def faults(page: str, cells: Iterable[str]) -> list[str]:
    """Name what is amiss with the theorems of a chapter, each with its place."""
    cells = list(cells)
    theorems = read(page, cells)
    return [
        *(
            f"{page}: a theorem begins with {text.splitlines()[0]!r}; it must begin with "
            "'**Theorem 17.1 (Name).**'"
            for text in quotations(cells)
            if NUMBERED.match(text) and not HEAD.match(text)
        ),
        *(f"{theorem} {fault}" for theorem in theorems for fault in faults_of(theorem)),
        *faults_of_order(theorems),
    ]


def faults_of(theorem: Theorem) -> Iterator[str]:
    """Say what one theorem lacks."""
    if theorem.page.partition("_")[0].lstrip("0") != theorem.number.partition(".")[0]:
        yield f"stands in {theorem.page}, and has the number of another chapter"
    if not theorem.listed:
        yield "has no numbered conditions"
    elif theorem.listed != tuple(range(1, len(theorem.listed) + 1)):
        yield f"numbers its conditions {', '.join(map(str, theorem.listed))}, not from 1 on"
    for k in sorted(theorem.conditions.keys() - theorem.without.keys()):
        yield f"does not say what happens without condition {k}: '*Without {k}:*'"
    for k in sorted(theorem.without.keys() - theorem.conditions.keys()):
        yield f"says what happens without condition {k}, which it does not have"
    for label, text in theorem.parts.items():
        mark = "'*Then*'" if label == "Then" else f"'*{label}:*'"
        if not text:
            yield f"does not say who knew it: {mark}" if label == "Known" else f"has no {mark}"
        elif not SENTENCE.search(text):
            yield f"has a {mark} that ends within a sentence: {text[-40:]!r}"


def faults_of_order(theorems: list[Theorem]) -> Iterator[str]:
    """Say which numbers of a chapter come twice, else where the first is left out."""
    counts = [int(theorem.number.partition(".")[2]) for theorem in theorems]
    for place, theorem in enumerate(theorems):
        if counts[place] in counts[:place]:
            yield f"{theorem} has a number that an earlier theorem has"
    odd = [place for place, count in enumerate(counts, 1) if count != place]
    if odd and len(set(counts)) == len(counts):
        said = f"comes where {odd[0]} is expected: a number is left out, or out of order"
        yield f"{theorems[odd[0] - 1]} {said}"


def lost_mentions(page: str, cells: Iterable[str], there: set[str]) -> list[str]:
    """Name the theorems that a page mentions and the book does not have."""
    return [
        f"{page}: mentions Theorem {number}, which the book does not have"
        for number in dict.fromkeys(number for cell in cells for number in mentions(cell))
        if number not in there
    ]


def faults_of_book(folder: Path) -> list[str]:
    """Name everything that is amiss with the theorems of the chapters in a folder."""
    cells = {path.stem: prose_of(path) for path in sorted(folder.glob("*.ipynb"))}
    there = {theorem.number for page, of in cells.items() for theorem in read(page, of)}
    return [
        fault
        for page, of in cells.items()
        for fault in faults(page, of) + lost_mentions(page, of, there)
    ]
