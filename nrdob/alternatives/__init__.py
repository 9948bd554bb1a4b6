"""Other schemes on the same plant, each as a loop that can be judged, and all in one table."""

from .adrc import adrc_chart, adrc_stabilizing_bandwidths, adrc_stabilizing_gains, linear_adrc
from .comparison import Comparison, Row, compare
from .measures import LoadErrors, load_errors
from .simc import LagModel, half_rule, simc_pi, simc_pid
from .structures import controller_alone, conventional_observer, smith_predictor
from .tuning import Scheme, Tuned, candidates, tune

__all__ = [
    "Comparison", "LagModel", "LoadErrors", "Row", "Scheme", "Tuned", "adrc_chart",
    "adrc_stabilizing_bandwidths", "adrc_stabilizing_gains", "candidates", "compare",
    "controller_alone", "conventional_observer", "half_rule", "linear_adrc", "load_errors",
    "simc_pi", "simc_pid", "smith_predictor", "tune",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__
