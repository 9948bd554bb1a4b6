"""Section III: stability and robustness."""

from .ledger import Section

SECTION = Section()
