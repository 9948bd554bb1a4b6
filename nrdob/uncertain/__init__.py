"""Will it survive the real plant? Families of plants, and whole families judged at once."""

from .family import Family, family
from .farm import SweepStopped
from .sweeping import sweep
from .table import Share, SweepTable

__all__ = ["Family", "Share", "SweepStopped", "SweepTable", "family", "sweep"]
