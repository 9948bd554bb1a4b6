"""What was measured on a plant, and the process behind it."""

from .identification import Candidate, Identification, identified, identify
from .parameters import Parameter
from .records import Record, checked_record
from .residuals import ResidualCheck
from .structures import STRUCTURES
from .tables import heated_air, read_data

__all__ = [
    "STRUCTURES",
    "Candidate",
    "Identification",
    "Parameter",
    "Record",
    "ResidualCheck",
    "checked_record",
    "heated_air",
    "identified",
    "identify",
    "read_data",
]


def __dir__() -> list[str]:
    return __all__
