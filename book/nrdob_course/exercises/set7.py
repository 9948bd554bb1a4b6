"""Set 7: the bench: by calculation, and by simulation."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, exp, floor, inf, pi
from typing import Any, NamedTuple

import control as ct
import numpy as np

import nrdob
from nrdob import NRDOB, LowPassFilter, delay
from nrdob.digital import ActuatorLimits, SampledLoop
from nrdob.drives import Counting, Drive, Encoder, Friction, OneMass, TwoMasses, encoded
from nrdob.numerics import FloatArray

from .cases import around, s
from .comparing import rounds, same, unlike
from .drawing import apart, draw, few, first_fitting, fitting, kept
from .problems import Lack, first_of, lack_of, lacking, lacks_of, pose
from .reading import UnreadableError, number, numbers, things

__all__ = ["COUNTING", "DIFFERENCE", "PROGRAM", "REST", "SHAFT"]


# --- 7.1 What does one count cost? --------------------------------------------------------------

COUNTS = (500, 1000, 1024, 2000, 2048, 4000, 4096, 10_000)


@dataclass(frozen=True, eq=False)
class CountingCase:
    """A speed made of counts, and the observer that receives it."""

    counts: int  # of the encoder in one turn
    dt: float  # sampling time, in s
    inertia: float  # of the model, in kg m²
    time_constant: float  # λ, in s
    ripple: float  # largest jump of the torque, in N m

    def __repr__(self) -> str:
        return (
            f"{self.counts} counts, h = {1000 * self.dt:g} ms, J = {self.inertia:g} kg m², "
            f"λ = {1000 * self.time_constant:g} ms, ripple up to {self.ripple:g} N m"
        )


def _exact_window(case: CountingCase, turn: float = 2 * pi) -> float:
    """Give the window at which one count moves the torque by just the ripple, in samples."""
    return case.inertia / case.time_constant * turn / (case.counts * case.dt) / case.ripple


def _window(
    case: CountingCase,
    turn: float = 2 * pi,
    rounded: Callable[[float], int] = ceil,
    delay: Callable[[int], float] = lambda m: m / 2,
) -> tuple[float, int, float]:
    """Give the step, the window m, and its delay, which is asked for in samples here."""
    count = max(rounded(_exact_window(case, turn)), 1)
    return turn / (case.counts * case.dt), count, delay(count) * case.dt


@fitting(lambda case: 2 < _exact_window(case) < 25 and 0.03 < _exact_window(case) % 1 < 0.97)
def _counting_case(rng: np.random.Generator) -> CountingCase:
    counts, dt = int(rng.choice(COUNTS)), float(rng.choice([0.0005, 0.001, 0.002]))
    inertia, time_constant = draw(rng, 0.001, 0.03), draw(rng, 0.004, 0.03)
    jump = inertia / time_constant * 2 * pi / (counts * dt)
    return CountingCase(counts, dt, inertia, time_constant, few(jump / rng.uniform(3, 20)))


def _miscounted(case: CountingCase, got: FloatArray) -> dict[str, str]:
    jump = case.inertia / case.time_constant * got[0] / got[1] if got[1] > 0 else inf
    said = lacks_of("7.1", m=got[1], jump=jump, ripple=case.ripple)
    return unlike(_window(case), got, said)


COUNTING = pose(
    "7.1",
    case=_counting_case,
    reads=partial(numbers, names="step, m, delay"),
    lacks=first_of(_miscounted),
    parts=_miscounted,
    rounded=lambda case, got: rounds(_window(case), got),
    misconceptions={
        "turns taken for radians": partial(_window, turn=1.0),
        "rounded down": partial(_window, rounded=floor),
        "the whole window taken for the delay": partial(_window, delay=lambda m: m),
        "the last difference taken as prompt": partial(_window, delay=lambda m: (m - 1) / 2),
    },
)


# --- 7.2 Tustin by hand -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class DifferenceCase:
    """The block F/Gm with F = 1/(λs + 1) and Gm = 1/(Js + b), and a sampling time."""

    inertia: float  # J, in kg m²
    friction: float  # b, in N m s
    time_constant: float  # λ, in s
    dt: float  # h, in s

    def __repr__(self) -> str:
        return (
            f"J = {self.inertia:g} kg m², b = {self.friction:g} N m s, "
            f"λ = {1000 * self.time_constant:g} ms, h = {1000 * self.dt:g} ms"
        )


Row = tuple[float, float, float]  # c0, c1 and a of ``w[k] = c0 y[k] + c1 y[k-1] + a w[k-1]``


def _row(case: DifferenceCase, dz: float, one: float) -> Row:
    """Put s = dz (z - 1)/(1 + one (z - 1)) into (Js + b)/(λs + 1), both over the factor of z."""
    J, b, value = case.inertia, case.friction, case.time_constant
    row = J * dz + b * one, b * (1 - one) - J * dz, value * dz - (1 - one)
    c0, c1, a = (coefficient / (value * dz + one) for coefficient in row)
    return c0, c1, a


def _tustin(case: DifferenceCase) -> Row:
    return _row(case, 1 / case.dt, 0.5)


def _held(case: DifferenceCase) -> Row:
    """Give the block behind a hold: J/λ at once, and the rest with the pole exp(-h/λ)."""
    prompt, pole = case.inertia / case.time_constant, exp(-case.dt / case.time_constant)
    return prompt, case.friction * (1 - pole) - prompt, pole


DIFFERENCE_MISTAKES: dict[str, Callable[[DifferenceCase], Row]] = {
    "Euler's forward rule": lambda case: _row(case, 1 / case.dt, 0.0),
    "Euler's backward rule": lambda case: _row(case, 1 / case.dt, 1.0),
    "the 2 of 2/h left out": lambda case: _row(case, 0.5 / case.dt, 0.5),
    "a hold in front of the block": _held,
    "the old value with the sign of the denominator": lambda case: (
        *_tustin(case)[:2],
        -_tustin(case)[2],
    ),
}


@fitting(
    lambda case: apart(_tustin(case), *(wrong(case) for wrong in DIFFERENCE_MISTAKES.values()))
)
def _difference_case(rng: np.random.Generator) -> DifferenceCase:
    value = draw(rng, 0.004, 0.03)
    inertia = draw(rng, 0.001, 0.03)
    friction = few(inertia * rng.uniform(3, 20))
    return DifferenceCase(inertia, friction, value, few(value / rng.uniform(1.5, 6)))


def _difference_lacks(case: DifferenceCase, got: FloatArray) -> str:
    c0, c1, a = got
    if same(_tustin(case), (c0, c1, a)):
        return ""
    rest = (c0 + c1) / (1 - a) if a != 1 else inf
    if not same(case.friction, rest):
        words = f"for a constant y this comes to rest at w = {rest:.4g} y"
        return f"{words}, and F/Gm at {case.friction:g} y"
    words = "for a constant y it is right, but it is not Tustin's rule"
    return f"{words}: put 2/h (z - 1)/(z + 1) for s"


DIFFERENCE = pose(
    "7.2",
    case=_difference_case,
    reads=partial(numbers, names="c0, c1, a"),
    lacks=_difference_lacks,
    rounded=lambda case, got: rounds(_tustin(case), got),
    misconceptions=DIFFERENCE_MISTAKES,
)


# --- 7.4 Read a program, and run it -------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ProgramCase:
    """A generated controller, and the drive that it is to run."""

    program: str  # text of a Python class Speed
    drive: Drive
    delay: float  # from a command to its torque, in s
    dt: float  # sampling time, in s
    reference: float  # speed, in rad/s
    limit: float  # largest torque, in N m
    time: float  # how long the test lasts, in s

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


SETTLED = 0.05  # share of the reference within which a drive has settled


def _program_case(settles: bool) -> Callable[[np.random.Generator], ProgramCase]:
    def drawn(rng: np.random.Generator) -> tuple[ProgramCase, SampledLoop]:
        dt = float(rng.choice([0.001, 0.002]))
        inertia, value = draw(rng, 0.002, 0.02), few(dt * rng.uniform(3, 8))
        friction = few(inertia * rng.uniform(3, 10))
        model = 1 / (inertia * s + friction)
        C = (few(8 * inertia) * s + few(8 * friction)) / s
        late = few(value * (rng.uniform(0.1, 0.3) if settles else rng.uniform(1.0, 2.0)))
        own = few(inertia * rng.uniform(*((0.9, 1.3) if settles else (0.4, 0.7))))
        held = Friction(draw(rng, 0.02, 0.1), viscous=friction)
        drive = Drive(OneMass(own), held, Encoder(10_000), Counting())
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
    if isinstance(given, str) and (word := given.strip().casefold()) in words:
        return words[word]
    value = number(given)
    if value not in (0, 1):
        asked = "the last of the three is True if the drive settles, and else False"
        raise UnreadableError(f"{asked}, not {value:g}")
    return bool(value)


def _misread(case: ProgramCase, got: Reading) -> dict[str, str]:
    does = "settles" if got.settles else "does not settle"
    return unlike(_made(case), got, lacks_of("7.4", does=does))


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


# --- 7.5 Where does it rest? --------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RestCase:
    """A motor with friction, and two position loops around the same model."""

    calm: NRDOB  # 1 - F with one zero at s = 0
    keen: NRDOB  # 1 - F with two
    friction: Friction  # what holds the motor
    error: float  # where it stands in the second loop, in rad beside the reference

    def __repr__(self) -> str:
        J, b = self.calm.fractions.Gm.den[:2] / self.calm.fractions.Gm.num[-1]
        return (
            f"model 1/(s({J:g} s + {b:g})), breaks away at {self.friction.breakaway:g} N m, "
            f"moves at {self.friction.coulomb:g} N m + {self.friction.viscous:g} ω, "
            f"λ = {_constants(self)[0]:.3g} s, error {self.error:g} rad"
        )


def _constants(case: RestCase) -> tuple[float, float]:
    """Give λ of both filters, and the friction of the model."""
    den = case.calm.fractions.F.den  # (λs + 1)²
    Gm = case.calm.fractions.Gm
    return float((den[0] / den[-1]) ** 0.5), float(Gm.den[1] / Gm.num[-1])


def _rest(case: RestCase) -> tuple[float, float]:
    """Give the widest rest, ``|S_δ(0)|`` times stiction, and the time from -stiction to it.

    S_δ(0) is that of (1 - F)Gm, whatever the plant's own friction is: K(0)G(0) is infinite.
    """
    value, friction = _constants(case)
    holds = case.friction.breakaway
    return 2 * value / friction * holds, 2 * holds * 3 * value**2 / friction / case.error


def _times_rest(case: RestCase, widest: float, climb: float) -> tuple[float, float]:
    right = _rest(case)
    return right[0] * widest, right[1] * climb


def _by_the_controller(case: RestCase) -> tuple[float, float]:
    C = case.calm.fractions.C
    return case.friction.breakaway / float(C.num[-1] / C.den[-1]), _rest(case)[1]


REST_MISTAKES: dict[str, Callable[[RestCase], tuple[float, float]]] = {
    "friction in motion taken for the break-away": lambda case: _times_rest(
        case, *[case.friction.coulomb / case.friction.breakaway] * 2
    ),
    "the plant's friction taken for the model's": lambda case: _times_rest(
        case, *[_constants(case)[1] / case.friction.viscous] * 2
    ),
    "the controller's stiffness alone": _by_the_controller,
    "the torque starts from zero": lambda case: _times_rest(case, 1.0, 0.5),
}


@fitting(
    lambda case: (
        all(loop.stability().stable for loop in (case.calm, case.keen))
        and apart(_rest(case), *(wrong(case) for wrong in REST_MISTAKES.values()))
    )
)
def _rest_case(rng: np.random.Generator) -> RestCase:
    inertia = draw(rng, 0.002, 0.02)
    friction = few(inertia * rng.uniform(5, 15))
    value = draw(rng, 0.01, 0.04)
    angle = 1 / (s * (inertia * s + friction))
    stiff = few(inertia * (0.3 / value) ** 2 * 9)
    lead = stiff + few(stiff * 0.04) * s / (0.2 * value * s + 1)
    own = few(friction * rng.uniform(1.3, 2.0))
    process = 1 / (s * (inertia * s + own))
    filters = [nrdob.interpolating_filter(angle, value, ramp=ramp) for ramp in (1, 2)]
    calm, keen = (NRDOB(process, angle, lead, F) for F in filters)
    dry = draw(rng, 0.05, 0.3)
    held = Friction(dry, few(dry * rng.uniform(1.3, 1.8)), 0.05, own)
    return RestCase(calm, keen, held, draw(rng, 0.005, 0.05))


def _unrested(case: RestCase, got: FloatArray) -> dict[str, str]:
    widest, holds = _rest(case)[0], case.friction.breakaway
    said = lacks_of("7.5", rest=got[0], needed=got[0] / widest * holds, holds=holds)
    return unlike(_rest(case), got, said)


REST = pose(
    "7.5",
    case=_rest_case,
    reads=partial(numbers, names="widest, climb"),
    lacks=first_of(_unrested),
    parts=_unrested,
    rounded=lambda case, got: rounds(_rest(case), got),
    misconceptions=REST_MISTAKES,
)


# --- 7.6 A motor on an elastic shaft ------------------------------------------------------------

LOADS = (0.5, 1.0, 2.0)  # inertia of the load, as a share of the usual one


@dataclass(frozen=True, eq=False)
class ShaftCase:
    """A motor that turns one of three loads through a shaft."""

    motor: float  # inertias, in kg m²
    load: float
    stiffness: float  # of the shaft, in N m/rad
    damping: float  # of the shaft, in N m s
    friction: float  # of the motor, in N m s
    dt: float  # sampling time, and that of the computation, in s
    max_ms: float = 1.7
    max_sag: float = 0.0  # how far its speed may fall, in rad/s, after a step of 1 N m on its side

    @property
    def processes(self) -> tuple[ct.TransferFunction, ...]:
        """From torque to speed of the motor, with half the load, with the load, and with twice."""
        shaft = self.stiffness, self.damping
        masses = (TwoMasses(self.motor, share * self.load, *shaft) for share in LOADS)
        return tuple(each.speed(self.friction) for each in masses)

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
SAMPLES = 2 * REACHED  # how long a loop is simulated


def _peak(loop: SampledLoop) -> float:
    """Ms, from the response to an impulse of d, of which the sensitivity is the spectrum."""
    impulse = loop.simulate({"d": np.append(1.0, np.zeros(SAMPLES - 1))}).y
    return float(np.abs(np.fft.rfft(impulse, 2**15)).max())


def _sag(loop: SampledLoop) -> float:
    """Tell how far the speed falls after a step of the load by 1 N m."""
    return float(np.abs(loop.simulate({"delta": np.full(SAMPLES, -1.0)}).y).max())


@around
def _shaft_shortcoming(case: ShaftCase, got: NRDOB) -> str:
    loops = [_on_bench(case, got, plant) for plant in case.processes]
    for share, loop in zip(LOADS, loops, strict=True):
        verdict = loop.stability()
        if verdict.stable is not True:
            kind = "unstable" if verdict.model_loop.stable is True else "model loop"
            return Lack(kind, f"with {share:g} times the load the sampled loop is not stable")
        if (peak := _peak(loop)) > case.max_ms * 1.001:
            return Lack("ms", f"with {share:g} times the load Ms is {peak:.3g}")
    usual = loops[LOADS.index(1.0)]
    if (sag := _sag(usual)) > case.max_sag * 1.001:
        return Lack("sag", f"the speed falls by {sag:.3g} rad/s for each N m")
    way = usual.simulate({"R": np.ones(SAMPLES)}).y
    if not (off := float(np.abs(way[REACHED:] - 1).max())) <= WITHIN:
        return lack_of("7.6", "rest", samples=REACHED, off=off)
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


@fitting(
    lambda case: (
        not _shaft_shortcoming(case, _shaft_design(case, 4.0))
        and all(
            getattr(_shaft_shortcoming(case, design(case)), "kind", "") == kind
            for kind, design in SHAFT_MISTAKES.values()
        )
    )
)
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
