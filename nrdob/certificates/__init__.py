"""Certificates of stability and instability that a checker of 200 lines accepts or refuses."""

from .certificate import Certificate, W, certify
from .checker import check
from .points import half_plane_points

__all__ = ["Certificate", "W", "certify", "check", "half_plane_points"]


def __dir__() -> list[str]:
    return __all__
