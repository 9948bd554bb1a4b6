"""What is wired to what: the blocks handed in, and the loop's maps as factored quotients."""

from .blocks import Fraction, as_fraction, is_number, nonzero, real_number, six_digits
from .delay import DelayedTransferFunction, delay, undelayed
from .equations import LoopEquations, ObserverEquations
from .families import FilterFamily, as_family, filter_family
from .filters import LowPassFilter, filter_fraction
from .interpolation import interpolating_filter
from .names import CLOSED_LOOP, INPUTS, MAPS
from .noise import rational_power
from .quotient import Quotient, as_quotient, as_shaping

__all__ = [
    "CLOSED_LOOP", "INPUTS", "MAPS", "DelayedTransferFunction", "FilterFamily", "Fraction",
    "LoopEquations", "LowPassFilter", "ObserverEquations", "Quotient", "as_family", "as_fraction",
    "as_quotient", "as_shaping", "delay", "filter_family", "filter_fraction",
    "interpolating_filter", "is_number", "nonzero", "rational_power", "real_number", "six_digits",
    "undelayed",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__
