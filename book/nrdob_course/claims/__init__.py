"""The ledger: every checkable statement of the paper, its check, and the verdict.

>>> from nrdob_course import claims
>>> claims.check("ex3.FH.pm").verdict.value
'reproduced'
"""

from . import (
    bands,
    conclusions,
    example3,
    example4,
    examples12,
    lemma1,
    mismatch,
    robustness,
    section2,
)
from .ledger import Amendment, Claim, Entry, Finding, LedgerError, Verdict, in_one_ledger, settle
from .signals import loop_modes

__all__ = [
    "LEDGER", "Amendment", "Claim", "Entry", "Finding", "LedgerError", "Verdict",
    "check", "loop_modes",
]  # fmt: skip

_PARTS = (  # as in the paper
    section2, bands, lemma1, mismatch, robustness, examples12, example3, example4, conclusions,
)  # fmt: skip

LEDGER = in_one_ledger(part.SECTION for part in _PARTS)
"""Every claim by its id, in the order of the paper."""


def check(id: str) -> Entry:
    """Run the check of one claim now, and give the entry with what it found.

    Parameters
    ----------
    id : str
        Of the claim, as "eq05.S_eta".

    Raises
    ------
    KeyError
        If there is no such claim.
    LedgerError
        If the check did not find what the ledger says.
    """
    if id not in LEDGER:
        near = [known for known in LEDGER if known.split(".")[0] == id.split(".")[0]]
        raise KeyError(f"there is no claim {id!r}; near it: {', '.join(near) or 'nothing'}")
    return settle(LEDGER[id])
