"""Parsers given random and damaged input: documented errors only, in bounded time and memory.

Tables of measured records, formulas of blocks, options of the command, rosters and settings of a
course, and submissions. Right inputs are damaged at random: pieces are cut out, doubled, put
elsewhere, replaced by what is awkward. What comes out must be a result or a documented error with
a reason; nothing is executed, since nothing is written but what the parser was given.

    python -m tests.campaigns.fuzz --seconds 300 --seed 0            each parser for five minutes
    python -m tests.campaigns.fuzz --seconds 60 --only tables
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import random
import resource
import signal
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from nrdob import read_data
from nrdob.measured import Record
from nrdob.reporting.command import main
from nrdob.reporting.expressions import read_block
from nrdob_course.grading.roster import Course, read_course, read_roster
from nrdob_course.grading.submissions import Submission, find, read

SLOW = 20.0
"""Seconds of the processor that one input may take; a report is given `SLOW_REPORT`."""
SLOW_REPORT = 60.0

MEMORY = 3 << 30

AWKWARD = (
    "", " ", "\t", "\n", "\r\n", "\0", "\ufeff", "\u2028", "−", "½", "٣", "𝟙", "é", '"', "'", "''",
    ";", ",", "|", "#", "nan", "inf", "-inf", "1e400", "-1e-400", "1e308", "0x10", "1_000", "1,5",
    "1.5.2", "--1", "+-2", "9" * 400, "0" * 50, "(" * 60, ")" * 60, "s^" * 30, "^99", "/0", "exp(",
    "exp(-1e9s)", "exp(s)", "s**s", "__import__('os')", "lambda: 0", "{}", "[]", "[" * 3000, "null",
    "true", "../../x", "=cmd()", "%s%n", "2024-02-30", "25:61", "12:00:00.5", "1970-01-01T00:00Z",
    "t [ms]", "time", "u", "y", "u u", "a" * 2000,
)  # fmt: skip

Target = Callable[[random.Random, Path], str]


def damaged(rng: random.Random, text: str) -> str:
    """Change a text in one to six places."""
    for _ in range(rng.choice([1, 1, 2, 3, 6])):
        a, b = sorted(rng.randint(0, len(text)) for _ in range(2))
        b = min(b, a + rng.choice([1, 3, 20, 200]))
        piece = text[a:b]
        match rng.randrange(7):
            case 0:
                text = text[:a] + text[b:]
            case 1:
                text = text[:b] + piece * rng.choice([1, 2, 40]) + text[b:]
            case 2:
                text = text[:a] + rng.choice(AWKWARD) + text[b:]
            case 3:
                text = text[:a] + rng.choice(AWKWARD) + text[a:]
            case 4:
                text = (
                    text[:a]
                    + chr(rng.choice([rng.randrange(128), rng.randrange(0x2FFF)]))
                    + text[b:]
                )
            case 5:
                c = rng.randint(0, len(text))
                text = text[:c] + piece + text[c:]
            case _:
                lines = text.splitlines(keepends=True)
                rng.shuffle(lines)
                text = "".join(lines)
        text = text[:200_000]
    return text


def stored(rng: random.Random, text: str, path: Path) -> Path:
    """Write a text in some encoding, sometimes with damaged bytes."""
    encoding = rng.choice(["utf-8"] * 6 + ["utf-8-sig", "utf-16", "latin-1", "cp1252"])
    data = bytearray(text.encode(encoding, errors="replace"))
    if rng.random() < 0.2:
        for _ in range(rng.randint(1, 5) if data else 0):
            data[rng.randrange(len(data))] = rng.randrange(256)
    if rng.random() < 0.05:
        del data[rng.randint(0, len(data)) :]
    path.write_bytes(bytes(data))
    return path


# What is fuzzed. Each gives what came of one input.


def _table(rng: random.Random) -> str:
    mark, sep = rng.choice([".,", ".;", ",;", ".\t", ", ", ".|"])
    heads = rng.choice(["t,u,y", "t,u,y", "time,input,output", "Zeit,u[V],y[°C]", "t[ms],u,y", ""])
    rows = [heads.replace(",", sep)] if heads else []
    if rng.random() < 0.2:
        rows.insert(rng.randint(0, len(rows)), rng.choice(["# a remark", "s;V;V", "// x", "%"]))
    clock = rng.random() < 0.2
    for k in range(rng.choice([0, 2, 40, 60, 60, 90])):
        moment = f"12:{k // 60:02}:{k % 60:02}" if clock else f"{0.1 * k:.3f}"
        row = sep.join([moment, f"{k % 7 // 3:.2f}", f"{k % 5 + 0.25:.3f}"])
        rows.append(row.replace(".", mark))
    return "\n".join(rows)


def tables(rng: random.Random, folder: Path) -> str:
    """Measured records."""
    table = _table(rng)
    path = stored(rng, damaged(rng, table) if rng.random() < 0.8 else table, folder / "data.csv")
    options: dict = {}
    if rng.random() < 0.15:
        options["columns"] = {
            rng.choice("tuy"): rng.choice([1, 2, 3, "u", "1 [ms]", *AWKWARD]) for _ in range(2)
        }
    if rng.random() < 0.1:
        options["sampling_time"] = rng.choice([0.1, 1e-300, 1e300, 7])
    if rng.random() < 0.1:
        options["input_before"] = rng.choice([0, 1.5, 1e308])
    record = read_data(path, **options)
    assert isinstance(record, Record) and len(record.t) == len(record.u) == len(record.y)
    return "read"


FORMULAS = (
    "4/(s^2+3s+2)", "exp(-0.3s)/(s+1)^2", "-1.8(0.5s+1)/s", "1/(1+2s)(1+s)", "2*exp(-s)*exp(-2s)/s",
    "(s-1)/(s+1)**3", "1e-3 s / (s^2 + 0.1 s + 1)", "3", "((((s))))", "-(s+1)/-(s+2)",
)  # fmt: skip


def formulas(rng: random.Random, folder: Path) -> str:
    """Blocks written as formulas."""
    text = rng.choice(FORMULAS)
    if rng.random() < 0.3:
        pieces = ["s", "1", "2.5", "+", "-", "*", "/", "^", "(", ")", "exp(-s)", "3", " ", "s^2"]
        text = "".join(rng.choice(pieces) for _ in range(rng.randint(1, 40)))
    else:
        text = damaged(rng, text)
    block = read_block(text)
    assert block.delay >= 0 and block.tf.den[0][0][0] != 0
    return "read"


def options(rng: random.Random, folder: Path) -> str:
    """The command line of the report; only what is refused or cheap to compute."""
    number = ["0.05", "2", "0", "-1", "nan", "inf", "1e-300", "1e300", "x", "", "1e400", "3"]
    words = ["report"]
    if rng.random() < 0.85:
        words.append("--process=" + damaged(rng, rng.choice(FORMULAS))[:60])
    else:
        words.append(str(stored(rng, damaged(rng, _table(rng)), folder / "data.csv")))
    for name in ("time-constant", "order", "sampling-time", "input-before"):
        if rng.random() < 0.4:
            words.append(f"--{name}={rng.choice(number)}")
    for name in ("model", "controller"):
        if rng.random() < 0.7:
            words.append(f"--{name}={damaged(rng, rng.choice(FORMULAS))[:60]}")
    if rng.random() < 0.3:
        words.append("--columns=" + damaged(rng, "t=Time,u=2,y=3"))
    if rng.random() < 0.3:
        words.append("--title=" + rng.choice(AWKWARD))
    if rng.random() < 0.1:
        words.append(rng.choice(["--", "-x", "--process", "--output=", "--help", "", "extra"]))
    words.insert(1, f"--output={folder / 'report.html'}")
    told = io.StringIO()
    with contextlib.redirect_stderr(told), contextlib.redirect_stdout(io.StringIO()):
        try:
            status = main(words)
        except SystemExit as end:
            status = end.code
    assert status in {0, 1, 2, 3}, status
    assert status in {0, 3} or told.getvalue().strip(), "refused without a reason"
    return f"status {status}"


ROSTER = "id,name,group\n17,Anna Müller,3\n18,Ben Li,4\n,Cy,\n21,Çağlar Ö,7\n"
SETTINGS = """roster = "roster.csv"
[deadlines]
set1 = 2026-11-02T23:59:00
[late]
grace = 15
per_day = 10
[extensions.set1]
"Ben Li" = 2026-11-05T23:59:00
"""


def rosters(rng: random.Random, folder: Path) -> str:
    """Lists of students, and the settings of a course."""
    roster = damaged(rng, ROSTER) if rng.random() < 0.7 else ROSTER
    stored(rng, roster, folder / "roster.csv")
    settings = damaged(rng, SETTINGS) if rng.random() < 0.6 else SETTINGS
    path = stored(rng, settings, folder / "course.toml")
    with contextlib.suppress(ValueError):
        read_roster(folder / "roster.csv")
    course = read_course(path)
    assert isinstance(course, Course)
    for student in course.students:
        course.find(student.name, student.identifier)
        course.days_late("set1", course.called(student), course.due("set1", student.name))
    return f"read, {'some' if course.students else 'no'} students"


def _notebook(rng: random.Random) -> str:
    cell = {
        "cell_type": "code", "execution_count": None, "outputs": [], "source": ["group = 3\n"],
        "id": "a", "metadata": {"nbgrader": {"grade_id": "p1", "solution": True, "grade": False}},
    }  # fmt: skip
    text = {"cell_type": "markdown", "metadata": {}, "source": "An answer.", "id": "b"}
    content = {"nbformat": 4, "nbformat_minor": 5, "metadata": {}, "cells": [cell, text]}
    for _ in range(rng.randint(0, 3)):  # what is no notebook in this way or that
        target = rng.choice([content, cell, text])
        key = rng.choice(list(target))
        target[key] = rng.choice([None, 1, -1, "x", [], {}, [[]], {"a": []}, 1e400, True, ["s", 1]])
    return json.dumps(content)


def submissions(rng: random.Random, folder: Path) -> str:
    """What students hand in: notebooks that are none, folders and names of every kind."""
    import nbformat

    for k in range(rng.randint(1, 4)):
        odd = [
            name
            for name in AWKWARD
            if name.strip() and not set(name) & {"/", "\0"} and len(name) < 60
        ]
        name = rng.choice(["Anna", "Ben Li", "anna_set1", "17_set1_late", *odd])
        place = folder / (name if name not in {".", ".."} else "x")
        if rng.random() < 0.7:
            place.mkdir(exist_ok=True)
            place = place / rng.choice(["set1.ipynb", "set01 (1).ipynb", "x.ipynb", "notes.txt"])
        else:
            place = place.with_name(f"{place.name}{k}.ipynb")
        text = _notebook(rng)
        if not place.is_dir():
            stored(rng, damaged(rng, text) if rng.random() < 0.6 else text, place)
            notebook, problem = read(place)
            assert (notebook is None) == bool(problem)
    source = nbformat.from_dict(
        {"nbformat": 4, "nbformat_minor": 5, "metadata": {}, "cells": [
            {"cell_type": "code", "execution_count": None, "outputs": [], "source": "", "id": "a",
             "metadata": {"nbgrader": {"grade_id": "p1", "solution": True, "grade": False,
                                       "locked": False, "schema_version": 3, "task": False}}}]}
    )  # fmt: skip
    found = find(folder, {"set1": source})
    hidden = all(entry.name.startswith((".", "__")) for entry in folder.iterdir())
    assert (found or hidden) and all(isinstance(each, Submission) for each in found)
    assert all(each.reason or each.notebook is not None for each in found)
    return "some to grade" if any(not each.reason for each in found) else "none to grade"


TARGETS: dict[str, tuple[Target, tuple[type[Exception], ...]]] = {
    "tables": (tables, (ValueError, TypeError)),
    "formulas": (formulas, (ValueError,)),
    "options": (options, ()),
    "rosters": (rosters, (ValueError,)),
    "submissions": (submissions, ()),
}
"""What is fuzzed, and the errors that are documented."""


class TooSlow(BaseException):
    """An input takes longer than it may; nothing that is fuzzed catches this."""


def _too_slow(*_: object) -> None:
    raise TooSlow


def tried(name: str, seed: int) -> tuple[str, float]:
    """Fuzz one input: what came of it, "WRONG" at the front of every fault, and the seconds."""
    target, documented = TARGETS[name]
    start = time.process_time()
    signal.signal(signal.SIGPROF, _too_slow)
    signal.setitimer(signal.ITIMER_PROF, SLOW_REPORT if name == "options" else SLOW)
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            outcome = target(random.Random(f"{name} {seed}"), Path(folder))
        except documented as reason:
            outcome = f"refused: {type(reason).__name__}" if str(reason) else "WRONG: no reason"
        except Exception:
            outcome = "WRONG: " + " ".join(traceback.format_exc()[-400:].split())
        except TooSlow:
            outcome = "WRONG: too slow, in " + " ".join(traceback.format_exc()[-400:].split())
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
    return outcome, time.process_time() - start


def campaign(name: str, seconds: float, seed: int) -> tuple[Counter[str], float]:
    """Fuzz one parser for so long; what came out, and the longest time that an input took."""
    tally: Counter[str] = Counter()
    end, longest = time.monotonic() + seconds, 0.0
    while time.monotonic() < end:
        outcome, spent = tried(name, seed)
        if outcome.startswith("WRONG"):
            print(f"{name}, seed {seed}: {outcome}", flush=True)
            outcome = "WRONG"
        tally[outcome] += 1
        longest = max(longest, spent)
        seed += 1
    return tally, longest


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=TARGETS, action="append")
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    for name in given.only or TARGETS:
        tally, longest = campaign(name, given.seconds, given.seed)
        told = ", ".join(f"{number} {what}" for what, number in tally.most_common())
        print(f"{name}: {tally.total()} inputs: {told}; longest {longest:.2g} s", flush=True)
