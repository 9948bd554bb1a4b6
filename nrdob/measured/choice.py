"""Which of several fits is taken: what each is worth, and which others are about as good."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, log, nan

import numpy as np
from scipy.signal import correlate

from ..numerics import FloatArray
from .disturbance import scatter_of
from .fitting import Fit, Problem, refined
from .parameters import Parameter, told
from .residuals import DECISIVE

__all__ = ["chosen", "criterion", "denied_sign", "estimates", "judge", "mirrored", "weighed"]

ALIKE = 1.5  # factor between two gains that are nearly the same
TINY = 1e-12  # of the misfit in the part fitted, what is none
CLOSE = 1.0  # per cent of the part held out that make no difference
OUTDONE = 8.0  # per cent of both parts by which another explains far more
# How many times as decisive an integrator must be where no part of the record was held out.
ALONE = 3
FAR_LONGER = 3.0  # durations of the record that a lag lasts which is as good as an integrator
TOGETHER = 0.9  # correlation of gain and lag from which on the one is not told from the other
# Correlation of the input with itself, half a period later, from which on it is its own opposite.
OPPOSITE = -0.9
SETTLED = 8.0  # longest lags after which nothing is left of how an input began
# Names of the number that tells how long the plant takes to come to rest.
SLOWNESS = {"lag", "slow lag", "natural frequency"}


@dataclass(frozen=True, eq=False)
class Judged:
    """A fit and what it is worth."""

    fit: Fit
    bic: float
    fit_percent: float
    validation: float
    predicted: FloatArray
    parameters: dict[str, Parameter]
    covariance: FloatArray
    hides: bool

    def vague(self, duration: float) -> bool:
        """Whether the gain may be zero, or a lag lasts longer than the record.

        So does an integrator whose zero hides it: what it adds is no more than a drift. A fit that
        moves by itself as the input does is no better known.
        """
        gain = self.parameters["gain"]
        return self.hides or gain.low <= 0 <= gain.high or self.fit.slowest > duration

    def outdone(self, other: Judged) -> bool:
        """Whether one that is no richer explains both parts of the record far better.

        What drives its likelihood up is then a drift, and not the plant.
        """
        return (
            other.fit.structure.told <= self.fit.structure.told
            and other.fit_percent > self.fit_percent + OUTDONE
            and other.validation > self.validation + OUTDONE
        )

    @property
    def unsettled(self) -> bool:
        """Whether gain and lag are not told from each other, since y does not come to rest."""
        k = next((k for k, name in enumerate(self.parameters) if name in SLOWNESS), 0)
        (own, both), (_, other) = self.covariance[np.ix_([0, k], [0, k])]
        return bool(k and abs(both) > TOGETHER * np.sqrt(own * other))


def criterion(fit: Fit, samples: float) -> float:
    """Compute the Bayesian information criterion of a fit to so many samples."""
    return samples * log(fit.misfit) + fit.structure.count(fit.moving) * log(samples)


def weighed(begun: list[Fit], problem: Problem, start: int) -> Fit:
    """Search on from `start`, resting and moving, and take the more likely one.

    Where both tell the same gain it is taken by the squares made least: a motion of its own can
    explain a step at the beginning, with a gain that has no meaning.
    """
    fits = [refined(fit, problem, start) for fit in begun]
    samples = problem.samples(start)
    gains = [float(fit.linear[0]) for fit in fits]
    agree = min(gains) * ALIKE > max(gains) > 0 or max(gains) * ALIKE < min(gains) < 0
    drifts = any(fit.whitening.theta < 1 for fit in fits)

    def merit(fit: Fit) -> float:
        plain = agree and not drifts
        compared = replace(fit, misfit=fit.loss / samples + TINY) if plain else fit
        return criterion(compared, samples)

    return min(fits, key=lambda fit: (problem.hides(fit), merit(fit)))


def judge(fit: Fit, whole: Problem, problem: Problem, units: tuple[float, float]) -> Judged:
    """Find what a fit to the first part of a record is worth for all of it."""
    rest, used = whole.left(fit), whole.used[fit.start :]
    # Over all of the record: what was held out takes part, with numbers that do not know it.
    everywhere = whole.whitening(rest).applied(rest)[used]
    misfit = max(float(np.mean(everywhere**2)), fit.misfit * TINY)
    bic = criterion(replace(fit, misfit=misfit), everywhere.size)
    predicted, percents = _foretold(fit, whole, problem)
    told_of = estimates(fit, whole, units)
    return Judged(fit, bic, *percents, predicted, *told_of, whole.hides(fit))


def estimates(
    fit: Fit, whole: Problem, units: tuple[float, float]
) -> tuple[dict[str, Parameter], FloatArray]:
    """Tell the numbers of a fit, with intervals by the whole record, and their covariance."""
    used, readings = whole.used[fit.start :], whole.outputs[fit.start :]
    jacobian = fit.jacobian(whole.inputs)
    return told(fit, scatter_of(whole.left(fit), jacobian, used, readings, whole.grain), units)


def _foretold(fit: Fit, whole: Problem, problem: Problem) -> tuple[FloatArray, tuple[float, float]]:
    """Go on from the part that was fitted, with plant and drift in the state they are in."""
    first = problem.outputs.size - fit.start
    rest = whole.left(fit)
    level = float(rest[:first][problem.used[fit.start :]].mean())
    drift = fit.whitening.carried_on(rest[:first], rest.size - first)
    response = fit.response(whole.inputs) + np.concatenate([np.full(first, level), drift])
    percents = []
    for part in (slice(None, first), slice(first, None)):
        used = whole.used[fit.start :][part]
        outputs = whole.outputs[fit.start :][part][used]
        percents.append(_percent(outputs - response[part][used], outputs))
    return np.concatenate([np.full(fit.start, nan), response]), (percents[0], percents[1])


def _percent(rest: FloatArray, outputs: FloatArray) -> float:
    if not outputs.size or not np.ptp(outputs):
        return nan
    return float(100 * (1 - np.linalg.norm(rest) / np.linalg.norm(outputs - outputs.mean())))


def chosen(judged: list[Judged], duration: float) -> tuple[Judged, list[Judged], str]:
    """Take the smallest criterion among those without a flaw; and all that are about as good."""
    possible = [each for each in judged if np.isfinite(each.covariance).all()]
    if not possible:
        raise ValueError(
            "the record does not tell the numbers of the process from each other: let the input "
            "move more often, record longer or, if the plant answers at once, sample faster"
        )

    sound = [each for each in possible if not (each.validation < 0 or each.vague(duration))]

    def flawed(each: Judged) -> tuple[int, float]:
        flaw = each.vague(duration) or any(map(each.outdone, sound))
        return 2 * (each.validation < 0) + flaw, each.bic

    first = min(possible, key=flawed)
    equal = [each for each in possible if flawed(each)[0] == flawed(first)[0]]
    close = [each for each in equal if each.bic < first.bic + DECISIVE]
    # A drift that is no random walk looks like an integrator, and here nothing was held out.
    alone = first.fit.structure.integrates and np.isnan(first.validation)
    enough = DECISIVE * (ALONE if alone else 1)
    lasting = [each for each in equal if each.bic < first.bic + enough]
    close = (
        [each for each in lasting if not each.fit.structure.integrates]
        or (_settling(possible, first, duration) if first.fit.structure.integrates else [])
        or close
    )
    best = min(close, key=lambda each: (each.fit.structure.told, each.bic))
    reason = "of all structures it has the smallest Bayesian information criterion"
    if len(judged) == 1:
        reason = "it was asked for"
    elif best is not first:
        reason = f"the record does not tell {first.fit.structure.name} from it"
    elif best.bic > min(each.bic for each in possible):
        reason = (
            "of the structures that foretell the part held out and rest until the input moves, "
            "whose gain cannot be zero and whose lags are not longer than the record, it has the "
            "smallest Bayesian information criterion"
        )
    rivals = [
        each
        for each in possible
        if each is not best
        and each.fit.structure.integrates <= best.fit.structure.integrates
        and (each in close or (each in equal and each.validation > best.validation - CLOSE))
    ]
    return best, rivals, reason


def _settling(possible: list[Judged], rival: Judged, duration: float) -> list[Judged]:
    """Find lags that are likelier than an integrator, though where y comes to rest be open.

    One longer than the record must be told from it, and is none if it is far longer.
    """
    found = [
        each
        for each in possible
        if each.bic < rival.bic - ALONE * DECISIVE * (each.fit.slowest > duration)
        and each.fit.slowest < FAR_LONGER * duration
        and not (each.fit.structure.integrates or each.validation < 0 or each.hides)
    ]
    least = min((each.bic for each in found), default=0.0)
    return [each for each in found if each.bic < least + DECISIVE]


def mirrored(fit: Fit, problem: Problem) -> bool:
    """Tell whether a gain of the other sign, half a period of the input away, is about as good.

    If u is its own opposite half a period later, as a square wave or a sine is, the sign is known
    together with the dead time only, unless the plant is seen at rest before u begins to move.
    """
    half = _half_period(problem.inputs)
    if not half:
        return False
    # As if u had always gone on like that.
    length = 2 * half * ceil((fit.shape[0] + half + SETTLED * fit.slowest) / (2 * half))
    longer = problem.after(np.resize(problem.inputs[: 2 * half], length))
    samples, start = problem.samples(fit.start), length + fit.start
    for delay in fit.shape[0] + np.array([-half, half]):
        if delay < 0:
            continue
        begun = replace(fit, shape=np.append(delay, fit.shape[1:]))
        turned = [replace(begun, moving=moving) for moving in {False, fit.moving}]
        other = weighed(turned, longer, start)
        close = criterion(other, samples) < criterion(fit, samples) + DECISIVE
        if close and other.linear[0] * fit.linear[0] < 0:
            return True
    return False


def _half_period(inputs: FloatArray) -> int:
    """Find after how many samples the input is its own opposite; 0 if it never is."""
    u = inputs - inputs.mean()
    energy, lags = np.cumsum(u**2), np.arange(1, u.size // 4)
    products = correlate(u, u)[u.size - 1 :][lags]
    alike = products / np.sqrt(energy[-1 - lags] * (energy[-1] - energy[lags - 1]))
    return int(lags[alike.argmin()]) if alike.min(initial=0.0) <= OPPOSITE else 0


def denied_sign(
    best: Judged, rivals: list[Judged], judged: list[Judged], needless: bool, turned: bool
) -> tuple[dict[str, Parameter], list[str]]:
    """Let the interval of the gain reach to 0, or to the gain of a rival of the other sign.

    One that is clearly likelier denies the sign as well, however little it knows of the gain; and
    so does the process itself, `turned` with the input.
    """
    gain = best.parameters["gain"]
    if needless:
        gain = replace(gain, low=min(gain.low, 0.0), high=max(gain.high, 0.0))
        return best.parameters | {"gain": gain}, []
    likelier = [
        each
        for each in judged
        if each not in rivals
        and each.bic < best.bic - DECISIVE / 2
        and not each.validation < 0
        and each.fit.structure.integrates <= best.fit.structure.integrates
        and np.isfinite(each.covariance).all()
    ]
    others = [each for each in rivals + likelier if each.parameters["gain"].value * gain.value < 0]
    if not (others or turned):
        return best.parameters, []
    low, high = min(gain.low, -abs(gain.value)), max(gain.high, abs(gain.value))
    if turned:
        said = (
            "u is its own opposite half a period later, so that a gain of the other sign with a "
            "dead time longer or shorter by that explains the record about as well, and the sign "
            "is open: begin the record with the plant at rest, or move u irregularly"
        )
    else:
        names = " and ".join(each.fit.structure.name for each in others)
        said = (
            f"{names} explains the record about as well with a gain of the other sign, so that the "
            "sign is open and the interval of the gain is widened: make a larger step, and let the "
            "output come to rest before and after it"
        )
    return best.parameters | {"gain": replace(gain, low=low, high=high)}, [said]
