"""Certificates of stability and instability that a checker of 200 lines accepts or refuses."""

from .certificate import Certificate, certify
from .checker import check
from .points import half_plane_points

__all__ = ["Certificate", "certify", "check", "half_plane_points"]


def __dir__() -> list[str]:
    return __all__
