"""Set 7: the bench, by simulation: a generated controller, and a motor on an elastic shaft."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import control as ct
import numpy as np

from nrdob.diagram import LowPassFilter, delay
from nrdob.digital import ActuatorLimits, SampledLoop
from nrdob.drives import Counting, Drive, Encoder, Friction, OneMass, TwoMasses, encoded
from nrdob.loop import NRDOB

from .cases import not_around, s
from .comparing import unlike
from .drawing import draw, few, first_fitting, fitting, kept
from .problems import Lack, first_of, lacking, pose
from .reading import UnreadableError, number, things

__all__ = ["PROGRAM", "SHAFT"]


# --- 7.4 Read a program, and run it -------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ProgramCase:
    """A generated controller, and the drive that it is to run.

    `program`: text of a Python class `Speed`, and `module`: what it defines; `drive`: a
    `nrdob.drives.Drive`; `delay`: from a command to its torque, in s; `dt`: sampling time in s;
    `reference`: speed in rad/s; `limit`: largest torque in N m; `time`: how long the test lasts, in
    s.
    """

    program: str
    drive: Drive
    delay: float
    dt: float
    reference: float
    limit: float
    time: float

    @property
    def module(self) -> dict[str, Any]:
        """What the program defines, by name: FILTER, INVERSE, … and the class Speed."""
        space: dict[str, Any] = {}
        exec(self.program, space)  # a text that this module has made
        return space

    def __repr__(self) -> str:
        inertia = self.drive.inertia.inertia if isinstance(self.drive.inertia, OneMass) else 0.0
        return (
            f"a program of {len(self.program.splitlines())} lines for {1000 * self.dt:g} ms; the "
            f"drive: J = {inertia:g} kg m², {self.drive.friction.coulomb:g} N m of dry friction, "
            f"{1000 * self.delay:g} ms from command to torque, at most {self.limit:g} N m; "
            f"to {self.reference:g} rad/s, {self.time:g} s"
        )


class Reading(NamedTuple):
    """Time constant and inertia that stand in a program, and whether the drive settles."""

    value: float
    inertia: float
    settles: bool


@kept
def _made(case: ProgramCase) -> Reading:
    """Read the program's tables, and run the drive with its equations."""
    space = case.module
    (_, _, _, a1, *_), (b0, _, _, _, _, rest, *_) = space["FILTER"][0], space["INVERSE"][0]
    value = case.dt * (1 / a1 - 0.5)
    inertia = (b0 * (2 * value + case.dt) - rest * case.dt) / 2
    controller, motion = space["Speed"](), case.drive.motion(case.dt, case.delay)
    read, way = case.drive.reader(motion), []
    for _ in range(round(case.time / case.dt)):
        torque = controller.step(case.reference, read(motion.angle))
        motion.advance(torque, 0.0)
        way.append(motion.speed)
    late = np.array(way[-len(way) // 5 :]) / case.reference
    return Reading(value, inertia, bool(np.abs(late - 1).max() < SETTLED))


SETTLED = 0.05
"""Share of the reference within which a drive has settled."""


def _program_case(settles: bool) -> Callable[[np.random.Generator], ProgramCase]:
    def drawn(rng: np.random.Generator) -> tuple[ProgramCase, SampledLoop]:
        dt = float(rng.choice([0.001, 0.002]))
        inertia, value = draw(rng, 0.002, 0.02), few(dt * rng.uniform(3, 8))
        friction = few(inertia * rng.uniform(3, 10))
        model = 1 / (inertia * s + friction)
        C = (few(8 * inertia) * s + few(8 * friction)) / s
        late = few(value * (rng.uniform(0.1, 0.3) if settles else rng.uniform(1.0, 2.0)))
        own = few(inertia * rng.uniform(*((0.9, 1.3) if settles else (0.4, 0.7))))
        drive = Drive(
            OneMass(own),
            Friction(draw(rng, 0.02, 0.1), viscous=friction),
            Encoder(10_000),
            Counting(),
        )
        reference = few(rng.uniform(5, 30))
        limit = few(friction * reference * 3 + 0.5 + inertia * reference / 0.05)
        process = delay(late) * ct.tf([1], [own, friction])
        loop = NRDOB(process, model, C, LowPassFilter(value, 1)).sampled(dt)
        text = loop.code(ActuatorLimits(-limit, limit)).to_python("Speed")
        return ProgramCase(text, drive, late, dt, reference, limit, 1.0), loop

    def fits(pair: tuple[ProgramCase, SampledLoop]) -> bool:
        case, loop = pair
        radius = encoded(loop, Counting()).stability().spectral_radius
        clear = radius < 0.998 if settles else radius > 1.02
        return clear and _made(case).settles is settles

    return lambda rng: first_fitting(lambda: drawn(rng), fits)[0]


def _read_program(given: Any) -> Reading:
    wanted = "three things are asked for, (time constant, inertia, True or False)"
    value, inertia, verdict = things(given, wanted, (3,), names="lam, inertia, settles")
    return Reading(number(value), number(inertia), _yes_or_no(verdict))


def _yes_or_no(given: Any) -> bool:
    """Read True or False, also as 1 or 0 and as a word."""
    if isinstance(given, bool | np.bool_):
        return bool(given)
    words = {"true": True, "yes": True, "false": False, "no": False}
    if isinstance(given, str) and given.strip().casefold() in words:
        return words[given.strip().casefold()]
    value = number(given)
    if value not in (0, 1):
        raise UnreadableError(
            f"the last of the three is True if the drive settles, and else False, not {value:g}"
        )
    return bool(value)


def _misread(case: ProgramCase, got: Reading) -> dict[str, str]:
    says = "settles" if got.settles else "does not settle"
    return unlike(
        _made(case),
        got,
        {
            "time constant": "the time constant is not the one whose filter, by Tustin's rule, is "
            "in FILTER",
            "inertia": "the inertia is not the one of the model that INVERSE, which is F/Gm, holds",
            "verdict": f"you say that the drive {says}; run it from rest, and look at its last "
            "fifth",
        },
    )


PROGRAM = pose(
    "7.4",
    case=(_program_case(True), _program_case(False)),
    reads=_read_program,
    lacks=first_of(_misread),
    parts=_misread,
    misconceptions={
        "Euler's rule read into Tustin's": lambda case: _made(case)._replace(
            value=_made(case).value + case.dt / 2
        ),
        "the first coefficient taken for J/λ": lambda case: _made(case)._replace(
            inertia=case.module["INVERSE"][0][0] * _made(case).value
        ),
        "judged on its own model": lambda case: _made(case)._replace(settles=True),
    },
)


# --- 7.6 A motor on an elastic shaft ------------------------------------------------------------

LOADS = (0.5, 1.0, 2.0)
"""Inertia of the load, as a share of the usual one."""


@dataclass(frozen=True, eq=False)
class ShaftCase:
    """A motor that turns one of three loads through a shaft.

    `motor`, `load`: inertias in kg m²; `stiffness`, `damping` of the shaft, in N m/rad and N m s;
    `friction` of the motor, in N m s; `dt`: sampling time in s, and that of the computation;
    `max_ms`: largest sensitivity peak; `max_sag`: how far the speed of the motor may fall, in
    rad/s, after a step of 1 N m on the motor's side of the shaft.
    """

    motor: float
    load: float
    stiffness: float
    damping: float
    friction: float
    dt: float
    max_ms: float = 1.7
    max_sag: float = 0.0

    @property
    def processes(self) -> tuple[ct.TransferFunction, ...]:
        """From torque to speed of the motor, with half the load, with the load, and with twice."""
        return tuple(
            TwoMasses(self.motor, share * self.load, self.stiffness, self.damping).speed(
                self.friction
            )
            for share in LOADS
        )

    @property
    def process(self) -> ct.TransferFunction:
        """The one with the usual load."""
        return self.processes[1]

    def __repr__(self) -> str:
        return (
            f"motor {self.motor:g} and load {self.load:g} kg m², shaft {self.stiffness:g} N m/rad "
            f"with {self.damping:g} N m s, friction {self.friction:g} N m s, "
            f"h = {1000 * self.dt:g} ms; Ms ≤ {self.max_ms:g}, sag ≤ {self.max_sag:g} rad/s per N m"
        )


def _shaft_design(case: ShaftCase, value: float, rigid: bool = False, speed: float = 0.03) -> NRDOB:
    """Design on one mass; λ in samples, and the bandwidth of the model loop as a share of 1/h."""
    inertia = case.motor + (case.load if rigid else 0.0)
    model = 1 / (inertia * s + case.friction)
    C = speed / case.dt * (inertia * s + case.friction) / s if speed else 0
    return NRDOB(case.process, model, C, LowPassFilter(value * case.dt, 1))


def _on_bench(case: ShaftCase, loop: NRDOB, plant: ct.TransferFunction) -> SampledLoop:
    return replace(loop, process=plant).sampled(case.dt, computation_delay=case.dt)


REACHED, WITHIN = 2000, 0.02
"""After how many samples the speed must be at the reference, and within which share of it."""
SAMPLES = 2 * REACHED
"""How long a loop is simulated."""


def _peak(loop: SampledLoop) -> float:
    """Ms, from the response to an impulse of d, of which the sensitivity is the spectrum."""
    impulse = loop.simulate({"d": np.append(1.0, np.zeros(SAMPLES - 1))}).y
    return float(np.abs(np.fft.rfft(impulse, 2**15)).max())


def _sag(loop: SampledLoop) -> float:
    """Tell how far the speed falls after a step of the load by 1 N m."""
    return float(np.abs(loop.simulate({"delta": np.full(SAMPLES, -1.0)}).y).max())


def _shaft_shortcoming(case: ShaftCase, got: Any) -> str:
    if lack := not_around(case.process, got):
        return lack
    loops = [_on_bench(case, got, plant) for plant in case.processes]
    for share, loop in zip(LOADS, loops, strict=True):
        verdict = loop.stability()
        if verdict.stable is not True:
            fast = verdict.model_loop.stable is True
            return Lack(
                "unstable" if fast else "model loop",
                f"with {share:g} times the load the sampled loop is not stable",
            )
        if (peak := _peak(loop)) > case.max_ms * 1.001:
            return Lack("ms", f"with {share:g} times the load Ms is {peak:.3g}")
    usual = loops[LOADS.index(1.0)]
    if (sag := _sag(usual)) > case.max_sag * 1.001:
        return Lack("sag", f"the speed falls by {sag:.3g} rad/s for each N m")
    way = usual.simulate({"R": np.ones(SAMPLES)}).y
    if not (off := float(np.abs(way[REACHED:] - 1).max())) <= WITHIN:
        words = f"after {REACHED} samples the speed is still up to {off:.1%} off the reference"
        return Lack("rest", words)
    return ""


SHAFT_MISTAKES: dict[str, tuple[str, Callable[[ShaftCase], NRDOB]]] = {
    "the rigid model's edge taken for the shaft's": (
        "unstable",
        lambda case: _shaft_design(case, 1.0, rigid=True),
    ),
    "stable, and no more": ("ms", lambda case: _shaft_design(case, 2.5)),
    "so slow that nothing can happen": ("sag", lambda case: _shaft_design(case, 12.0)),
    "an observer and no controller": ("rest", lambda case: _shaft_design(case, 4.0, speed=0.0)),
}
"""What each of them lacks, and what it designs."""


def _tells_apart(case: ShaftCase) -> bool:
    return not _shaft_shortcoming(case, _shaft_design(case, 4.0)) and all(
        getattr(_shaft_shortcoming(case, design(case)), "kind", "") == kind
        for kind, design in SHAFT_MISTAKES.values()
    )


@fitting(_tells_apart)
def _shaft_case(rng: np.random.Generator) -> ShaftCase:
    dt = float(rng.choice([0.0005, 0.001, 0.002]))
    motor = draw(rng, 0.0005, 0.005)
    load = few(motor * rng.uniform(2, 6))
    frequency = rng.uniform(0.1, 0.25) / dt  # antiresonance
    stiffness = few(load * frequency**2)
    damping = few(2 * rng.uniform(0.02, 0.05) * stiffness / frequency)
    bare = ShaftCase(motor, load, stiffness, damping, few(motor * rng.uniform(2, 10)), dt)
    sag = _sag(_on_bench(bare, _shaft_design(bare, 4.0), bare.process))
    return replace(bare, max_sag=few(1.25 * sag))


SHAFT = pose(
    "7.6",
    case=_shaft_case,
    lacks=_shaft_shortcoming,
    misconceptions={name: lacking(*mistake) for name, mistake in SHAFT_MISTAKES.items()},
)
