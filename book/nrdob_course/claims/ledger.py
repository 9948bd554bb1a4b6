"""What a claim is, how it is checked, and what may be said of it afterwards.

A check computes whether a statement of the paper holds *as printed*, and, where it does not,
whether the amended one that we put in its place does: each thing that it says is a condition with
a name of its own, so that a check that fails tells which. The verdict follows from what the check
found; a claim whose check has not run, or did not find what the ledger says, has none.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from textwrap import TextWrapper
from typing import Any

import numpy as np

from nrdob.numerics import number

__all__ = [
    "ABOUT", "EXACT", "NEAR", "STOPPED", "TOLERANCE", "WIDTH", "Amendment", "Check", "Claim",
    "Entry", "Finding", "LedgerError", "Section", "Verdict", "counted", "every", "in_one_ledger",
    "numbers", "same", "settle",
]  # fmt: skip

EXACT = 1e-8  # relative difference up to which two ways to compute one number agree
TOLERANCE = "1e-8 relative"
NEAR = 0.1
"""What "approximately" of the paper is taken to allow, of 1 or of the value compared with."""
ABOUT = "“≈” taken as within 10 %"
STOPPED = 0.01  # size of F where it is taken to be approximately zero

WIDTH = 95
"""Characters to a line of a printed entry: what a page of the book is wide."""


class Verdict(StrEnum):
    """What a check can show of a statement of the paper."""

    REPRODUCED = "reproduced"
    CONDITION = "needs a condition"
    CORRECTED = "corrected"
    REFUTED = "refuted"


@dataclass(frozen=True)
class Finding:
    """What a check found.

    Attributes
    ----------
    as_printed : bool
        Whether the statement holds as the paper prints it, in every case that was tried.
    computed : str
        The computed value, or the fact that decides, in a few words.
    tolerance : str
        What was allowed between printed and computed; empty for an exact comparison or a yes or no.
    conditions : mapping from str to bool
        What the amended statement says, one thing after the other in words, and whether it was
        found so; empty where nothing is amended.

    Examples
    --------
    >>> found = Finding(False, "2", conditions={"1 + 1 is 2": True, "2 is odd": False})
    >>> found.amended, found.unmet
    (False, ['2 is odd'])
    """

    as_printed: bool
    computed: str
    tolerance: str = ""
    conditions: Mapping[str, bool] = field(default_factory=dict)

    @property
    def amended(self) -> bool | None:
        """Whether the amended statement holds; None where nothing is amended."""
        return not self.unmet if self.conditions else None

    @property
    def unmet(self) -> list[str]:
        """Conditions of the amended statement that were found not to hold."""
        return [name for name, met in self.conditions.items() if not met]


def same(a: Any, b: Any, rtol: float = EXACT) -> bool:
    """Whether two arrays agree, entry by entry."""
    return bool(np.size(a) and np.allclose(a, b, rtol=rtol, atol=0))


def every(outcomes: Iterable[Any]) -> bool:
    """Whether all outcomes are true; unlike `all` it refuses to say so of none."""
    found = [bool(outcome) for outcome in outcomes]
    if not found:
        raise ValueError("nothing was tried")
    return all(found)


def counted(outcomes: Iterable[Any]) -> str:
    """Write how many outcomes are true: "3 of 4"."""
    found = [bool(outcome) for outcome in outcomes]
    return f"{sum(found)} of {len(found)}"


def numbers(values: Iterable[Any]) -> str:
    """Write numbers one after the other."""
    return ", ".join(number(float(value), 4) for value in values)


Check = Callable[[], Finding]


@dataclass(frozen=True)
class Amendment:
    """What we put in the place of a statement that does not hold as printed.

    Attributes
    ----------
    verdict : Verdict
        CONDITION: true under a condition that the paper does not state. CORRECTED: true once a
        sign, a word or a formula is put right. REFUTED: false; what is true instead is another
        statement.
    text : str
        The correct statement, in Markdown.
    """

    verdict: Verdict
    text: str


@dataclass(frozen=True)
class Claim:
    """A statement of the paper and its check.

    Attributes
    ----------
    id, place : str
        Short and stable, as "eq05.S_eta": the chapters cite it; where in the paper it stands.
    says, printed : str
        The statement, in our words, in Markdown; the printed value, empty where there is none.
    chapter : str
        Notebook that shows it, without ".ipynb".
    amendment : Amendment or None
        What is true instead, for a statement that does not hold as printed.
    method : str
        How the claim is checked, in words.
    check : callable
        Computes the `Finding`.
    """

    id: str
    place: str
    says: str
    printed: str
    chapter: str
    amendment: Amendment | None
    method: str
    check: Check = field(repr=False)


@dataclass(frozen=True)
class Entry:
    """A claim, what its check found, and the verdict that follows.

    Attributes
    ----------
    claim, finding, verdict : Claim, Finding, Verdict
        The statement, what its check found, and what follows.
    """

    claim: Claim
    finding: Finding
    verdict: Verdict

    def __repr__(self) -> str:
        claim, finding = self.claim, self.finding
        rows = {
            "the paper": claim.says + (f" [{claim.printed}]" if claim.printed else ""),
            "computed": finding.computed + (f" ({finding.tolerance})" if finding.tolerance else ""),
            "verdict": self.verdict.value,
            "instead": claim.amendment.text if claim.amendment else "",
        }
        page = TextWrapper(
            WIDTH, subsequent_indent=" " * 13, break_long_words=False, break_on_hyphens=False
        )
        lines = [f"{claim.id}, {claim.place}"]
        for label, text in rows.items():
            page.initial_indent = f"  {label + ':':<11}"
            lines += [page.fill(text)] if text else []
        return "\n".join(lines)


class LedgerError(AssertionError):
    """A check that did not find what the ledger says."""


def settle(claim: Claim) -> Entry:
    """Run the check of a claim and give the verdict that follows from it.

    A LedgerError says that the statement holds but the ledger amends it, that it fails and nothing
    is put in its place, or that what is put in its place fails as well, and on which conditions.
    """
    finding, wrong = claim.check(), ""
    found = f"({finding.computed})"
    if claim.amendment is None and not finding.as_printed:
        wrong = f"does not hold as printed {found}, and the ledger has no amendment for it"
    elif claim.amendment and finding.as_printed:
        wrong = f"holds as printed {found}, but the ledger amends it"
    elif claim.amendment and not finding.amended:
        unmet = "; ".join(finding.unmet) or "any condition, since none was tried"
        wrong = f"the amended statement fails as well {found}; not met: {unmet}"
    if wrong:
        raise LedgerError(f"{claim.id}: {wrong}")
    return Entry(claim, finding, claim.amendment.verdict if claim.amendment else Verdict.REPRODUCED)


class Section:
    """The claims of one part of the paper, in its order: their texts, and a check for each.

    The texts stand by id: chapter, place, says, method and, where there are any, printed; for what
    does not hold as printed the verdict and what is true instead.

    >>> part = Section({"sum": {"chapter": "chapter", "place": "p. 1", "says": "1 + 1 is 3",
    ...     "printed": "3", "method": "Count on fingers.", "verdict": "corrected",
    ...     "instead": "1 + 1 is 2"}})
    >>> @part.check("sum")
    ... def check() -> Finding:
    ...     return Finding(1 + 1 == 3, "2", conditions={"1 + 1 is 2": 1 + 1 == 2})
    >>> settle(part.claims[0])
    sum, p. 1
      the paper: 1 + 1 is 3 [3]
      computed:  2
      verdict:   corrected
      instead:   1 + 1 is 2
    """

    def __init__(self, texts: Mapping[str, Mapping[str, str]]) -> None:
        self.texts = texts
        self._entered: dict[str, Claim] = {}

    def check(self, id: str, **known: str) -> Callable[[Check], Check]:
        """Enter the decorated check of a claim; `known` are texts that are computed."""
        if id not in self.texts:
            raise ValueError(f"there is no text for the claim {id!r}; write it beside the others")
        if id in self._entered:
            raise ValueError(f"two checks have the id {id!r}; rename one")
        said = {key: " ".join(text.split()) for key, text in self.texts[id].items()}
        text = {"printed": ""} | said | known
        verdict, instead = text.pop("verdict", ""), text.pop("instead", "")
        amendment = Amendment(Verdict(verdict), instead) if verdict else None

        def enter(check: Check) -> Check:
            self._entered[id] = Claim(id=id, amendment=amendment, check=check, **text)
            return check

        return enter

    @property
    def claims(self) -> list[Claim]:
        """The claims, in the order of their texts; each must have a check."""
        if missing := [id for id in self.texts if id not in self._entered]:
            raise ValueError(f"no check for {', '.join(missing)}; write one below @SECTION.check")
        return [self._entered[id] for id in self.texts]


def in_one_ledger(sections: Iterable[Section]) -> dict[str, Claim]:
    """Put the claims of all sections together by id; a chapter cites one by it, so none is twice.

    >>> in_one_ledger([Section({}), Section({})])
    {}
    """
    ledger: dict[str, Claim] = {}
    for claim in (claim for section in sections for claim in section.claims):
        if (other := ledger.setdefault(claim.id, claim)) is not claim:
            raise ValueError(
                f"two claims have the id {claim.id!r}: those of {other.place} and {claim.place}; "
                "rename one"
            )
    return ledger
