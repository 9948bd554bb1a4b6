"""Certificates of stability and instability that a checker of 200 lines of code accepts or refuses.

``loop.stability().certificate().save("certificate.json")`` writes a verdict with its proof, and
``python -m nrdob.certificates certificate.json`` says what is proved (exit status 0) or why
nothing is (1). The checker is one file of the standard library, which also runs alone. It builds
the characteristic functions from the blocks, in exact fractions, and trusts nothing else.
"""

from .certificate import Certificate, W, certify
from .checker import check

__all__ = ["Certificate", "W", "certify", "check"]


def __dir__() -> list[str]:
    return __all__
