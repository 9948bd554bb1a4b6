"""A drive around the loop: encoder, friction, one mass or two, simulated event by event."""

from .encoder import Counting, EdgeTiming, EncodedLoop, Encoder, SpeedEstimate, Tracking, encoded
from .friction import Friction
from .motion import Motion
from .simulate import Drive, DriveResponse
from .two_mass import OneMass, TwoMasses

__all__ = [
    "Counting", "Drive", "DriveResponse", "EdgeTiming", "EncodedLoop", "Encoder", "Friction",
    "Motion", "OneMass", "SpeedEstimate", "Tracking", "TwoMasses", "encoded",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__
