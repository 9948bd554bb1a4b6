"""The command `nrdob`: a report out of a file or out of formulas."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

from ..measured import read_data
from .expressions import read_block
from .page import Page
from .reports import compose

__all__ = ["main"]

EXAMPLES = """\
examples:
  nrdob report data.csv --output report.html
  nrdob report data.csv --sampling-time 0.08      (a table of u and y, without times)
  nrdob report --process "exp(-0.3s)/(s+1)^2"     (model, filter and controller are chosen)
  nrdob report --process "4/(2-s-s^2)" --model=-1/(s^2+3s+2) \\
        --controller=-1.8(0.5s+1)/s --time-constant 0.05 --order 2

A table has columns t (seconds), u and y. Formulas are made of s, numbers, + - * / ^, brackets and
exp(-T s). One that begins with a minus sign needs the equals sign, as above.

Exit status: 0 a report was written, 1 it could not be, 2 the command was not understood.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows the name of the command; by default that of the shell.

    Returns
    -------
    int
        0 if a report was written, 1 if not.
    """
    asked = _parser().parse_args(arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what must be known stands in the report
        try:
            page = _page(asked)
            Path(asked.output).write_text(page.html(), encoding="utf-8")
        except (ArithmeticError, OSError, TypeError, ValueError) as error:
            print(f"nrdob: {_sentence(error)}", file=sys.stderr)
            return 1
    print(f"{page.verdict}\n{asked.output} is written.")
    return 0


def _page(asked: argparse.Namespace) -> Page:
    if (asked.data is None) == (asked.process is None):
        raise ValueError("give either a file of data or --process, see nrdob report --help")
    blocks = {
        name: None if text is None else read_block(text, f"--{name}")
        for name, text in (("model", asked.model), ("controller", asked.controller))
    }
    if blocks["controller"] is not None and not blocks["controller"].delay:
        blocks["controller"] = blocks["controller"].tf
    options = {
        **blocks, "time_constant": asked.time_constant, "order": asked.order, "title": asked.title
    }  # fmt: skip
    if asked.data is not None:
        return compose(read_data(asked.data, sampling_time=asked.sampling_time), **options)
    if asked.sampling_time is not None:
        raise ValueError("--sampling-time belongs to a file of data")
    return compose(read_block(asked.process, "--process"), **options)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="nrdob", description="Loops with a noise-reduction disturbance observer."
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="report")
    each = commands.add_parser(
        "report",
        help="write a report on measured data, a process or a loop, as one HTML file",
        description="Write a report on measured data, a process or a loop, as one HTML file.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    each.add_argument("data", nargs="?", help="a table of t, u and y (CSV)")
    each.add_argument("--output", default="report.html", help="the page (default: report.html)")
    each.add_argument("--process", metavar="FORMULA", help="the plant G, in place of data")
    each.add_argument("--model", metavar="FORMULA", help="the model; chosen if not given")
    each.add_argument("--controller", metavar="FORMULA", help="C; designed if not given")
    each.add_argument("--time-constant", type=float, metavar="SECONDS", help="λ of the filter")
    each.add_argument("--order", type=int, help="n of the filter 1/(λs + 1)^n")
    each.add_argument("--sampling-time", type=float, metavar="SECONDS", help="of a table without t")
    each.add_argument("--title", default="", help="heading of the page")
    return parser


def _sentence(error: BaseException) -> str:
    if isinstance(error, OSError):
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split())
