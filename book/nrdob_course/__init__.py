"""What teaches: the ledger of the paper's claims, and the graded problem sets.

Each is loaded where it is asked for, as in ``from nrdob_course import claims``.
"""

__all__ = ["claims", "exercises", "grading"]


def __dir__() -> list[str]:
    return __all__
