"""Will it survive the real plant? Families of plants, and whole families judged at once."""

from .designing import design_filter_for
from .exactly import Box, delay_intervals, gain_intervals, largest_box
from .family import Family, family
from .farm import SweepStopped
from .intervalplants import IntervalShares, interval_plants
from .smallgain import Conservatism, SmallGain, conservatism, fit_weight, small_gain
from .sweeping import sweep
from .table import Share, SweepTable

__all__ = [
    "Box",
    "Conservatism",
    "Family",
    "IntervalShares",
    "Share",
    "SmallGain",
    "SweepStopped",
    "SweepTable",
    "conservatism",
    "delay_intervals",
    "design_filter_for",
    "family",
    "fit_weight",
    "gain_intervals",
    "interval_plants",
    "largest_box",
    "small_gain",
    "sweep",
]


def __dir__() -> list[str]:
    return __all__
