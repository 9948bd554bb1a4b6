"""The command line: what can be asked of the graders."""

from __future__ import annotations

import argparse
import getpass
from pathlib import Path

__all__ = ["COURSE", "GRADING", "parse"]

# Beside each other in the folder where the command is run.
RELEASE = Path("build") / "exercises"
GRADING = Path("grading")
COURSE = Path("course.toml")


def login() -> str:
    """Tell who is at the keyboard; where the system does not know, nobody does."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return "unknown"


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Give out problem sets, and grade them.")
    commands = parser.add_subparsers(dest="command", required=True)
    giving = commands.add_parser("release", help="make the students' copies and the solutions")
    giving.add_argument("sets", nargs="*", metavar="SET", help="set1, set2, …; by default all")
    giving.add_argument("--output", type=Path, default=RELEASE, metavar="FOLDER")
    grading = commands.add_parser("grade", help="grade what students handed in")
    grading.add_argument("folder", type=Path, metavar="FOLDER")
    grading.add_argument(
        "--set", dest="wanted", action="append", default=[], help="only this one, e.g. set2"
    )
    grading.add_argument(
        "--trust", action="store_true", help="run suspicious code even where there is no sandbox"
    )
    reporting = commands.add_parser("report", help="after marks were written into written.csv")
    reporting.add_argument(
        "tables", nargs="*", type=Path, metavar="TABLE", help="marked.csv, from marking.html"
    )
    again = commands.add_parser("regrade", help="judge students, or problems, anew; it is logged")
    for what, name, about in (("student", "NAME", None), ("problem", "ID", "e.g. 2.3")):
        again.add_argument(
            f"--{what}", dest=f"{what}s", action="append", default=[], metavar=name, help=about
        )
    by_hand = commands.add_parser("override", help="change the points of one answer; it is logged")
    by_hand.add_argument("--student", required=True, metavar="NAME")
    by_hand.add_argument("--problem", required=True, metavar="ID", help="e.g. 2.3")
    by_hand.add_argument(
        "--points", required=True, metavar="NUMBER", help="or auto, to withdraw earlier ones"
    )
    for command in (again, by_hand):
        command.add_argument("--why", required=True, metavar="REASON")
        command.add_argument("--who", default=login(), metavar="NAME", help="yours")
    for command in (grading, again):
        command.add_argument("--jobs", type=int, default=2, help="how many at a time")
        command.add_argument(
            "--limit", type=float, default=1200, metavar="SECONDS", help="for one submission"
        )
        command.add_argument(
            "--as-root", action="store_true", help="run students' code even if you are root"
        )
    for command in (grading, reporting, again, by_hand):
        command.add_argument(
            "--output", dest="target", type=Path, default=GRADING, metavar="FOLDER"
        )
        command.add_argument(
            "--course", type=Path, metavar="FILE", help="roster, deadlines; by default course.toml"
        )
    return parser.parse_args(arguments)
