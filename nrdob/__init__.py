"""Stability and robustness of loops with a noise-reduction disturbance observer (NR-DOB)."""

from . import paper
from .delay import DelayedTransferFunction, delay
from .filters import LowPassFilter
from .loop import NRDOB

__all__ = ["NRDOB", "DelayedTransferFunction", "LowPassFilter", "delay", "paper"]
