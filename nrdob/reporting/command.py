"""The command `nrdob`: a report out of a file or out of formulas."""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from collections.abc import Sequence
from typing import Any

from ..measured import read_data
from .expressions import read_block
from .reports import Report, report

__all__ = ["main"]

EXAMPLES = """\
examples:
  nrdob report data.csv --output report.html
  nrdob report data.csv --columns t=Time,u=Q1,y=T1     (headings, or numbers from 1 on)
  nrdob report data.csv --columns "t=1 [ms],u=2,y=3"   (the unit of the times, if no heading has it)
  nrdob report data.csv --sampling-time 0.08           (a table of u and y, without times)
  nrdob report data.csv --input-before 0               (a record that begins with the step)
  nrdob report --process "exp(-0.3s)/(s+1)^2"          (model, filter and controller are chosen)
  nrdob report --process "4/(2-s-s^2)" --model=-1/(s^2+3s+2) \\
        --controller=-1.8(0.5s+1)/s --time-constant 0.05 --order 2

A table has columns of times, u and y, separated by commas, semicolons, tabs, blanks or bars. Times
are numbers in the unit of their heading (seconds if it names none), dates or times of day.
Formulas are made of s, numbers, + - * / ^, brackets and exp(-T s). One that begins with a minus
sign needs the equals sign, as above.

Exit status: 0 a report was written and nothing speaks against the loop; 3 it was written, with a
warning (the headline is the gravest); 1 it could not be written; 2 the command was not understood.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and give its exit status, see `EXAMPLES`; argparse exits with 2 itself.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows the name of the command; by default that of the shell.
    """
    asked = _parser().parse_args(arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what must be known is in the report
        try:
            found = _report(asked)
            found.save(asked.output)
        except (ArithmeticError, OSError, TypeError, ValueError) as error:
            print(f"nrdob: {_sentence(error)}", file=sys.stderr)
            return 1
    print(found.verdict)
    for each in found.warnings:
        if each not in found.verdict:
            print(f"Warning: {each}")
    print(f"{asked.output} is written.")
    return 3 if found.mood != "good" else 0


def _report(asked: argparse.Namespace) -> Report:
    if (asked.data is None) == (asked.process is None):
        raise ValueError("give either a file of data or --process, see nrdob report --help")
    blocks: dict[str, Any] = {
        name: None if text is None else read_block(text, f"--{name}")
        for name, text in (("model", asked.model), ("controller", asked.controller))
    }
    of_table = {name: getattr(asked, name) for name in ("sampling_time", "columns", "input_before")}
    of_table["columns"] = None if asked.columns is None else _columns(asked.columns)
    for name, each in of_table.items():
        if asked.data is None and each is not None:
            raise ValueError(f"--{name.replace('_', '-')} belongs to a file of data")
    if asked.data is None:
        subject: Any = read_block(asked.process, "--process")
    else:
        subject = read_data(asked.data, **of_table)
    return report(
        subject, title=asked.title, time_constant=asked.time_constant, order=asked.order,
        progress=_progress if sys.stderr.isatty() else lambda part: None, **blocks,
    )  # fmt: skip


def _columns(text: str) -> dict[str, str | int]:
    """Read t=Time,u=2,y=T1: a comma within a heading does not end it."""
    found: dict[str, str | int] = {}
    for part in re.split(r",\s*(?=\w+\s*=)", text):
        what, _, column = (each.strip() for each in part.partition("="))
        if not column or what in found:
            raise ValueError(f"--columns is {text!r}; write it as t=Time,u=Q1,y=T1")
        found[what] = column
    return found


def _progress(part: str) -> None:
    print(f"{part} …", file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="nrdob", description="Loops with a noise-reduction disturbance observer."
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="report")
    each = commands.add_parser(
        "report",
        help="write a report on measured data, a process or a loop, as one HTML file",
        description="Write a report on measured data, a process or a loop, as one HTML file.",
        epilog=EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
    )  # fmt: skip
    each.add_argument("data", nargs="?", help="a table of t, u and y (CSV)")
    each.add_argument("--output", default="report.html", help="the page (default: report.html)")
    each.add_argument("--process", metavar="FORMULA", help="the plant G, in place of data")
    each.add_argument("--model", metavar="FORMULA", help="the model; chosen if not given")
    each.add_argument("--controller", metavar="FORMULA", help="C; designed if not given")
    each.add_argument("--time-constant", type=float, metavar="SECONDS", help="λ of the filter")
    each.add_argument("--order", type=int, help="n of the filter 1/(λs + 1)^n")
    each.add_argument("--sampling-time", type=float, metavar="SECONDS", help="of a table without t")
    each.add_argument("--columns", metavar="t=…,u=…,y=…", help="headings or numbers of its columns")
    each.add_argument(
        "--input-before", type=float, metavar="U", help="u before a record that begins with a step"
    )
    each.add_argument("--title", default="", help="heading of the page")
    return parser


def _sentence(error: BaseException) -> str:
    if isinstance(error, OSError):
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split())
