"""Reports as pages that stand alone, and the command that writes them."""

from .command import main
from .expressions import read_block
from .formulas import character, formula, intervals
from .html import Picture, Section, Table
from .proposals import Proposal, propose
from .reports import Report, report

__all__ = [
    "Picture",
    "Proposal",
    "Report",
    "Section",
    "Table",
    "character",
    "formula",
    "intervals",
    "main",
    "propose",
    "read_block",
    "report",
]


def __dir__() -> list[str]:
    return __all__
