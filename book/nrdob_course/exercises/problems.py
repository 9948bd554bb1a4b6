"""Graders that test properties, recognise how a mistake came about, and say so kindly.

A problem draws its cases from a seed: the same difficulty for everyone, other numbers for each.
An answer is a function of a case, or a value for the student's own case. It is judged by what it
must satisfy, never by comparison with a stored number. If it fails, the grader looks whether it is
what somebody would answer who holds one of the problem's typical misconceptions, and tells what
went wrong and what to do; else it shows the first case that fails. A right answer that was rounded
is told so, and accused of nothing.

A case holds what the problem's text names, and nothing else: what a grader knows besides, it
computes from the case, in functions of the problem's module.
"""

import copy
import hashlib
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache, lru_cache
from html import escape
from importlib.resources import files
from typing import Any, Self

import numpy as np

from .comparing import same
from .reading import as_given

__all__ = [
    "BUDGET", "Case", "Feedback", "Lack", "Misconception", "Points", "Problem", "any_of",
    "first_of", "lack_of", "lacking", "lacks_of", "pose", "put_right", "reading", "texts_of",
    "words",
]  # fmt: skip

Case = Any
"""What a problem is posed with: a dataclass whose fields the problem's text names."""

Draw = Callable[[np.random.Generator], Case]
"""Draws a case."""

Parts = Callable[[Case, Any], Mapping[str, str]]
"""Tells what each part of an answer to a case lacks."""

BUDGET = 60.0
"""Seconds that a cell may take when it is graded; `check` tells how much of them it needs."""


@dataclass(frozen=True)
class Misconception:
    """A typical mistake: a function of a case, that somebody who holds it would answer.

    It is recognised by the answer being the same as the example's, unless one of the others tells.

    Attributes
    ----------
    example : callable
        What somebody who holds it answers to a case.
    recognises : callable, optional
        Tells whether an answer to a case is of this kind.
    kind : str
        What an answer lacks, see `Lack`, if it is recognised by that.
    back : callable, optional
        Converts what was given, if it is recognised by being right then.
    several : callable, optional
        All answers that it leads to, if there are more than the example's.
    name : str
        Short, for the instructor: "counter-clockwise counted as positive".
    says : str
        What the student reads: what seems to have happened, why it is not right, what to do.
    marks : float
        Share of the points that it deserves, from 0 to 1.
    """

    example: Callable[[Case], Any]
    recognises: Callable[[Case, Any], bool] | None = None
    kind: str = ""
    back: Callable[[Any], Any] | None = None
    several: Callable[[Case], Sequence[Any]] | None = None
    name: str = ""
    says: str = ""
    marks: float = 0.0


def any_of(examples: Callable[[Case], Sequence[Any]]) -> Misconception:
    """Make a misconception that leads to one of several answers; the first is its example."""
    return Misconception(lambda case: examples(case)[0], several=examples)


def put_right(example: Callable[[Case], Any], back: Callable[[Any], Any]) -> Misconception:
    """Make a misconception recognised by being right once its unit, or order, is put right."""
    return Misconception(example, back=back)


def lacking(kind: str, example: Callable[[Case], Any]) -> Misconception:
    """Make a misconception that is recognised by what its answers lack."""
    return Misconception(example, kind=kind)


def first_of(parts: Parts) -> Callable[[Case, Any], str]:
    """Tell of an answer what the first of its parts that is not right lacks."""
    return lambda case, got: next(filter(None, parts(case, got).values()), "")


def reading(readings: Callable[[Case], Mapping[str, Any]], *names: str) -> Misconception:
    """Make a misconception that leads to one of the readings of a case with these names."""
    return any_of(lambda case: [readings(case)[name] for name in names])


class Lack(str):
    """What an answer lacks, in words, and in one word by which a misconception knows it.

    >>> Lack("sign", "the gain has the wrong sign").kind
    'sign'
    """

    kind: str

    def __new__(cls, kind: str, words: str) -> Self:
        """Say it in words; the kind goes with them."""
        found = super().__new__(cls, words)
        found.kind = kind
        return found


@dataclass(frozen=True)
class Feedback:
    """What comes of an answer.

    Attributes
    ----------
    share : float
        Share of the points earned, from 0 to 1.
    text : str
        What the student reads.
    recognised : str
        Name of the misconception recognised; empty if there is none.
    notes : tuple of str
        What is to be said besides, about the time and the group.
    """

    share: float
    text: str
    recognised: str = ""
    notes: tuple[str, ...] = field(default=(), compare=False)

    def __repr__(self) -> str:
        return "\n".join([self.text, *self.notes])

    def _repr_html_(self) -> str:
        # A word and a mark, not colour alone.
        mark = "✓" if self.share == 1 else "→"
        notes = "".join(f"<p>{escape(note)}</p>" for note in self.notes)
        return f"<p><strong>{mark}</strong> {escape(self.text)}</p>{notes}"


class Points(float):
    """Points, and the words that go with them.

    nbgrader reads the number; whoever reads the marked notebook sees the words.

    Parameters
    ----------
    feedback : Feedback
        What comes of the answer.
    most : float
        Points for an answer that has all that is asked for.
    """

    def __new__(cls, feedback: Feedback, most: float) -> Self:
        """Give the share of the feedback, of the points that there are at most."""
        return super().__new__(cls, most * feedback.share)

    def __init__(self, feedback: Feedback, most: float) -> None:
        self.feedback, self.most = feedback, most

    def _repr_html_(self) -> str:
        return f"<p>{float(self):g} of {self.most:g} points</p>{self.feedback._repr_html_()}"


@dataclass(frozen=True)
class Problem:
    """One problem.

    Attributes
    ----------
    id : str
        Number of the set and of the problem: "2.1".
    title : str
        What it is about.
    case : callable or tuple of callable
        Draws a case from a random generator. Several are used in turn, so that every student meets
        each kind of case.
    lacks : callable
        Tells which of the properties asked for an answer to a case lacks, as a sentence or as a
        `Lack`; empty if it has them all.
    praise : str
        What the student reads when all is well: a sentence that says what was shown.
    misconceptions : tuple of Misconception
        In the order in which they are looked for.
    own : bool
        Whether the answer is a value for the student's own case rather than a function of a case.
    reads : callable
        Reads what a student gives, see `nrdob_course.exercises.reading`; all that judges an answer
        gets what this returns.
    rounded : callable, optional
        Tells whether an answer that fails is right but for rounding.
    parts : callable, optional
        Tells what each of several independent parts of an answer lacks, by its name. An answer
        earns the share of the parts that lack nothing in any case.
    drawn_as : str
        The name under which cases are drawn, if several problems share them; else their own.
    """

    id: str
    title: str
    case: Draw | tuple[Draw, ...]
    lacks: Callable[[Case, Any], str]
    praise: str
    misconceptions: tuple[Misconception, ...] = ()
    own: bool = False
    reads: Callable[[Any], Any] = as_given
    rounded: Callable[[Case, Any], bool] | None = None
    parts: Parts | None = None
    drawn_as: str = ""

    def cases(self, seed: Any, count: int) -> list[Case]:
        """Give cases as `drawn`, in copies: whoever changes a case changes nobody else's.

        Parameters
        ----------
        seed, count : object, int
            As of `drawn`.
        """
        return copy.deepcopy(self.drawn(seed, count))

    def drawn(self, seed: Any, count: int) -> list[Case]:
        """Draw cases, once, the first of them a group's own; what graders know of them stays.

        Parameters
        ----------
        seed : object
            A group, or a hidden seed.
        count : int
            How many.
        """
        if isinstance(seed, float) and seed.is_integer():
            seed = int(seed)
        # Anything can be a seed, so that a group's number that is none does not stop the grading.
        digest = hashlib.sha256(f"{self.drawn_as or self.id}/{seed}".encode()).digest()
        kinds = self.case if isinstance(self.case, tuple) else (self.case,)
        start = int.from_bytes(digest[:8], "big")
        rng, cases = _begun(kinds, start)
        while len(cases) < count:
            cases.append(kinds[(start + len(cases)) % len(kinds)](rng))
        return cases[:count]


@lru_cache(maxsize=2048)
def _begun(kinds: tuple[Draw, ...], seed: int) -> tuple[np.random.Generator, list[Case]]:
    """Give what draws the cases of one seed, and those that were asked for before."""
    return np.random.default_rng(seed), []


def pose(
    id: str,
    *,
    lacks: Callable[[Case, Any], str],
    misconceptions: Mapping[str, Misconception | Callable[[Case], Any]],
    alike: Callable[[Any, Any], bool] = same,
    texts: Mapping[str, Any] | None = None,
    **how: Any,
) -> Problem:
    """Make a problem of what judges it, and of its texts in the TOML file of its set.

    Misconceptions come by name, in the order in which they are looked for, as such or as what is
    answered; `alike` compares that with what was given. Each has a text, and no text is left over.
    """
    text = texts or texts_of(f"set{id.partition('.')[0]}")[id]
    said = text["misconceptions"]
    if lonely := sorted(said.keys() ^ misconceptions.keys()):
        names = ", ".join(lonely)
        raise ValueError(f"problem {id}: {names}: in the texts of its set, or in its code, alone")

    def known(name: str, given: Misconception | Callable[[Case], Any]) -> Misconception:
        this = given if isinstance(given, Misconception) else Misconception(given)
        marks = float(Fraction(str(said[name].get("marks", 0))))
        found = replace(this, name=name, says=words(said[name]["says"]), marks=marks)
        return replace(found, recognises=this.recognises or _by(this))

    def _by(this: Misconception) -> Callable[[Case, Any], bool]:
        if this.kind:
            return lambda case, got: False
        if back := this.back:
            return lambda case, got: not lacks(case, back(got))
        answers = this.several or (lambda case: (this.example(case),))
        return lambda case, got: any(alike(each, got) for each in answers(case))

    how["misconceptions"] = tuple(known(*each) for each in misconceptions.items())
    return Problem(id, text["title"], lacks=lacks, praise=words(text["praise"]), **how)


@cache
def texts_of(module: str) -> dict[str, Any]:
    """Read what is said to students, as of the problems of a set by their ids."""
    file = files(__package__).joinpath(f"{module}.toml")
    return tomllib.loads(file.read_text(encoding="utf-8"))


def lacks_of(id: str, *kinds: str, **values: Any) -> dict[str, str]:
    """Say what answers to a problem lack, by kind, with some values: of some kinds, or of all."""
    said = texts_of(f"set{id.partition('.')[0]}")[id]["lacks"]
    return {kind: words(said[kind]).format(**values) for kind in kinds or said}


def lack_of(id: str, kind: str, **values: Any) -> Lack:
    """Say what an answer to a problem lacks, with some values."""
    return Lack(kind, lacks_of(id, kind, **values)[kind])


def words(text: str) -> str:
    """Write a text of several lines in one."""
    return " ".join(text.split())
