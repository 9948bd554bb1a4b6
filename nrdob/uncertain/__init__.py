"""Robustness to an uncertain plant: families of plants, judged together, and exact boxes."""

from .boxes import Box, delay_intervals, gain_intervals, largest_box
from .intervalplants import IntervalShares, interval_plants
from .plantfamily import PlantFamily, plant_family
from .smallgain import Conservatism, conservatism, fit_weight, small_gain
from .sweeping import Share, SweepTable, sweep

__all__ = [
    "Box", "Conservatism", "IntervalShares", "PlantFamily", "Share", "SweepTable",
    "conservatism", "delay_intervals", "fit_weight", "gain_intervals", "interval_plants",
    "largest_box", "plant_family", "small_gain", "sweep",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__
