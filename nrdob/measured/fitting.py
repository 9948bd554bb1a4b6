r"""Output-error least squares: the plant whose exact response comes nearest to what was measured.

The residual is :math:`y - \Phi(\vartheta)b` with the responses :math:`\Phi` of dead time and
denominator :math:`\vartheta`, and with b found by linear least squares for each of them: the
search has three unknowns at most (Golub and Pereyra's variable projection). Both sides go through
the filter of the disturbance, see `nrdob.measured.residuals`; filter and process are found in turn.

The search begins at the best of every dead time against many denominators. A whole dead time only
shifts a response, so for one denominator the misfit at all of them comes out of a few correlations,
computed by the fast Fourier transform. Nothing is guessed from the shape of a step; any input will
do.

.. rubric:: References

Golub, G., V. Pereyra, Separable nonlinear least squares: the variable projection method and its
applications, Inverse Problems 19 (2003) R1-R26.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import exp, log
from operator import attrgetter

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.optimize import least_squares

from ..numerics import ROUNDING, BoolArray, FloatArray
from .residuals import DECISIVE, Whitening, whitening_of
from .structures import STRUCTURES, Structure

__all__ = ["FEWEST", "Fit", "Problem", "best_fit", "refined", "simple_fit"]

STEP, WIDE = 1e-5, 0.5  # of logarithms, and of the dead time in samples, for derivatives
# Of the dead time in samples: for a lag the misfit has a kink at each whole one.
SHIFTS = (0.0, -0.5, 0.5)
ROUGHLY, FINELY = 8, 25  # most steps of a search, to compare starting points and to the end
# Most times that filter and process are found in turn, and the gain in misfit that ends it.
ROUNDS, SAME = 3, 1e-3
# Filters with which a search begins: without drift, and with much.
BEGINNINGS = (Whitening(), Whitening(theta=0.8))
TRIES = 3  # starting points for each structure, with and without drift
# Share of the output by which a fit with drift may explain less, from rest, than one without.
FAR = 0.15
LONG = 2000  # samples to which longer records are thinned, to begin with
# Share of the output from which on a motion of its own is looked at, and how fast it must have been
# before the input moves, against its mean over the record: from any state, one lag is slowing down.
OWN, BEFORE = 0.05, 0.5
FEWEST = 5  # samples before the input moves in which rest can be seen
DENSE = 0.95  # share of the samples that must count for a drift to be told from them
INSIDE = 1e-9  # distance from the bounds at which a search begins
VALLEYS = 2  # dead times that are kept of each denominator


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be explained: the record, less its values at rest, and which samples count.

    Grain is what the sensor resolves; 0 if it does not round.
    """

    inputs: FloatArray
    outputs: FloatArray
    used: BoolArray
    grain: float

    def part(self, which: slice) -> Problem:
        """Keep some samples in a row."""
        return Problem(self.inputs[which], self.outputs[which], self.used[which], self.grain)

    def after(self, before: FloatArray) -> Problem:
        """Let other inputs go before; their outputs are not known, and must not be compared."""
        ahead = before.size, 0
        outputs = np.pad(self.outputs, ahead, mode="edge")
        used = np.pad(self.used, ahead, constant_values=True)
        return Problem(np.append(before, self.inputs), outputs, used, self.grain)

    def thinned(self, factor: int) -> Problem:
        """Take means of so many samples."""
        if factor == 1:
            return self
        count = self.outputs.size // factor * factor
        inputs, outputs, used = (
            each[:count].reshape(-1, factor) for each in (self.inputs, self.outputs, self.used)
        )
        return Problem(inputs.mean(axis=1), outputs.mean(axis=1), np.asarray(used.all(axis=1)), 0.0)

    def liveliest(self, count: int) -> Problem:
        """Keep so many samples in a row, where the input moves most."""
        moves = np.abs(np.diff(self.inputs, prepend=self.inputs[0]))
        parts = moves[: moves.size // count * count].reshape(-1, count)
        first = count * int(parts.sum(axis=1).argmax())
        return self.part(slice(first, first + count))

    def left(self, fit: Fit) -> FloatArray:
        """Compute the residual from the first sample compared on."""
        return np.asarray(self.outputs[fit.start :] - fit.response(self.inputs))

    def hides(self, fit: Fit) -> bool:
        """Whether a fit moves by itself although the plant rests until the input moves.

        It then takes what the input does for what the plant does by itself.
        """
        first = int(np.flatnonzero(self.inputs)[0])
        times = np.flatnonzero(self.used[:first])
        if not fit.moving or times.size < FEWEST:
            return False
        motion = fit.motion(self.inputs)
        moved = motion - motion[0]
        far = float(moved[np.abs(moved).argmax()])
        slope, intercept = np.polyfit(times, self.outputs[times], 1)
        scatter = np.std(self.outputs[times] - slope * times - intercept, ddof=2)
        sure = slope * np.sign(far) + 2 * scatter / np.sqrt(times.size * np.var(times))
        rests = scatter < OWN * abs(far)  # and does not swing
        return bool(abs(far) > OWN and rests and sure < BEFORE * abs(far) / moved.size)

    def whitening(self, residual: FloatArray) -> Whitening:
        """Find the filter that whitens a residual; none where many samples are missing."""
        return whitening_of(residual) if self.dense else Whitening()

    def explained(self, fit: Fit) -> float:
        """Give the share of the output that the response explains, drift left out; 1 for all."""
        used = self.used[fit.start :]
        return 1 - float(np.std(self.left(fit)[used]) / np.std(self.outputs[fit.start :][used]))

    def criterion_without(self, start: int) -> float:
        """Give the criterion of a level alone, upon which the input does not act."""
        level = self.outputs[start:] - self.outputs[start:].mean()
        rest = self.whitening(level).applied(level)[self.used[start:]]
        return rest.size * log(float(np.mean(rest**2))) + log(rest.size)

    def samples(self, start: int) -> float:
        """Count the samples that are compared, from `start` on."""
        return float(self.used[start:].sum())

    @property
    def dense(self) -> bool:
        """Whether nearly all samples count."""
        return bool(np.mean(self.used) > DENSE)


@dataclass(frozen=True)
class Fit:
    """A structure with numbers.

    The shape is the dead time in samples and what shapes the denominator; linear are the
    coefficients of the numerator, and of what the plant does by itself; start is the first sample
    compared; moving says whether the plant may move before the input does. In the residual that
    `whitening` is of, a memory without drift is left. The loss is the sum of squares that the
    search has made least, the misfit the mean square of the most likely innovations, at least what
    rounding makes of the output.
    """

    structure: Structure
    shape: FloatArray
    linear: FloatArray
    start: int
    moving: bool
    whitening: Whitening
    loss: float
    misfit: float

    @property
    def unknowns(self) -> FloatArray:
        """Shape and linear coefficients in one array."""
        return np.concatenate([self.shape, self.linear])

    @property
    def slowest(self) -> float:
        """Longest lag in samples, or inverse frequency; the lead of a zero beside an integrator."""
        lead = 0.0
        if self.structure.integrates and self.structure.zero:
            lead = abs(float(self.linear[1] / self.linear[0])) if self.linear[0] else np.inf
        return max(self.structure.slowest(self.shape), lead)

    def response(self, inputs: FloatArray) -> FloatArray:
        """Compute the output from `start` on."""
        return np.asarray(self._columns(self.shape, inputs) @ self.linear)

    def motion(self, inputs: FloatArray) -> FloatArray:
        """Compute what the plant does by itself, from `start` on."""
        own = self.structure.own(self.shape, inputs.size - self.start, self.moving)
        return np.asarray(self.linear[self.structure.numerators :] @ own)

    def jacobian(self, inputs: FloatArray) -> FloatArray:
        """Differentiate the output by all unknowns, at all samples from `start` on.

        By the dead time over half a sample to either side: the slope jumps at each whole one.
        """
        slopes = []
        for k, unit in enumerate(np.eye(self.shape.size)):
            step = STEP if k else WIDE
            below, above = self.shape - step * unit, self.shape + step * unit
            below[0] = max(below[0], 0.0)
            low, high = (self._columns(shape, inputs) for shape in (below, above))
            slopes.append((high - low) @ self.linear / (above[k] - below[k]))
        return np.column_stack([*slopes, self._columns(self.shape, inputs)])

    def _columns(self, shape: FloatArray, inputs: FloatArray) -> FloatArray:
        return self.structure.columns(shape, inputs, self.start, self.moving)


def best_fit(structure: Structure, problem: Problem, moving: bool) -> Fit:
    """Search from several starting points for the fit of smallest misfit.

    Moving: the plant may move before the input does.
    """
    factor = problem.outputs.size // LONG
    if factor > 1:
        rough = best_fit(structure, problem.thinned(factor), moving)
        # In means over many samples what is fast, such as a resonance, is not seen.
        near = best_fit(structure, problem.liveliest(LONG), True)
        shapes = structure.stretched(rough.shape, factor), near.shape
        fits = (_search(structure, problem, rough.whitening, each, 0, moving) for each in shapes)
        return _least(fits, problem)
    # Where it rests a drift may hide the plant; where it moves its own motion takes that part.
    drifts = problem.dense and moving == structure.integrates
    best = [_begun(structure, problem, whitening, moving) for whitening in BEGINNINGS[: 1 + drifts]]
    doubt = exp(DECISIVE / problem.outputs.size)
    return best[-1] if best[-1].misfit * doubt < best[0].misfit else best[0]


@lru_cache(maxsize=32)  # a fit is made with a filter, and may be made again without
def _begun(structure: Structure, problem: Problem, whitening: Whitening, moving: bool) -> Fit:
    points = _starting_points(structure, problem, whitening, moving)
    fits = (_search(structure, problem, whitening, shape, 0, moving) for shape in points)
    return _least(fits, problem)


def _plain_fit(structure: Structure, problem: Problem, start: int, moving: bool) -> Fit:
    """Find the response that comes nearest, whatever disturbs it: no filter."""
    factor = max(1, problem.outputs.size // LONG)
    rough = _begun(structure, problem.thinned(factor), Whitening(), moving).shape
    shape = structure.stretched(rough, factor)
    shifts = (shape + shift * np.eye(shape.size)[0] for shift in SHIFTS)
    found = (_search(structure, problem, Whitening(), at, start, moving, FINELY) for at in shifts)
    return replace(_least(found, problem), whitening=Whitening())


def simple_fit(problem: Problem, rival: Fit) -> Fit | None:
    """Fit one lag with dead time, from rest, by least squares; None if a rival is far better."""
    simple = _plain_fit(STRUCTURES[1], problem, rival.start, False)
    enough = max(problem.explained(rival) - FAR, 0.0)
    return simple if problem.explained(simple) > enough else None


def refined(fit: Fit, problem: Problem, start: int) -> Fit:
    """Search on from a fit, and with the dead time half a sample off, comparing from `start`."""

    def searched(shift: float) -> Fit:
        moved = fit.shape + shift * np.eye(fit.shape.size)[0]
        return _search(fit.structure, problem, fit.whitening, moved, start, fit.moving, FINELY)

    fit = _least(map(searched, SHIFTS), problem)
    for _ in range(ROUNDS):
        before, fit = fit, _least([searched(0.0)], problem)
        if abs(fit.misfit / before.misfit - 1) < SAME:
            break
    if fit.whitening.theta == 1:
        return fit
    # A structure that is too simple leaves motion that looks like drift, and is driven to ever
    # poorer responses by the filter.
    plain = _plain_fit(fit.structure, problem, start, fit.moving)
    return plain if problem.explained(plain) > problem.explained(fit) + FAR else fit


def _search(
    structure: Structure,
    problem: Problem,
    whitening: Whitening,
    shape: FloatArray,
    start: int,
    moving: bool,
    most: int = ROUGHLY,
) -> Fit:
    low, high = structure.bounds(problem.outputs.size)
    used = problem.used[start:]
    outputs = whitening.applied(problem.outputs[start:])[used]

    def solved(at: FloatArray) -> tuple[FloatArray, FloatArray]:
        columns = structure.columns(at, problem.inputs, start, moving)
        columns = whitening.applied(columns)[used]
        linear = np.linalg.lstsq(columns, outputs, rcond=None)[0]
        return linear, outputs - columns @ linear

    result = least_squares(
        lambda at: solved(at)[1], np.clip(shape, low + INSIDE, high - INSIDE), bounds=(low, high),
        max_nfev=most, xtol=1e-8, ftol=1e-10, gtol=1e-14,
    )  # fmt: skip
    linear, rest = solved(result.x)
    return Fit(structure, result.x, linear, start, moving, whitening, float(rest @ rest), 0.0)


def _least(fits: Iterable[Fit], problem: Problem) -> Fit:
    """Take the fit of least loss, and find the filter of what it leaves."""
    fit = min(fits, key=attrgetter("loss"))
    left = problem.left(fit)
    whitening = problem.whitening(left)
    floor = (ROUNDING * np.ptp(problem.outputs)) ** 2
    misfit = np.mean(whitening.applied(left)[problem.used[fit.start :]] ** 2) + floor
    # A drift must not be fitted; without one the nearest response is looked for.
    kept = whitening if whitening.theta < 1 else Whitening()
    return replace(fit, whitening=kept, misfit=float(misfit))


def _starting_points(
    structure: Structure, problem: Problem, whitening: Whitening, moving: bool
) -> list[FloatArray]:
    """Find shapes of small misfit through a filter, no two of them alike, the best first."""
    with_zero = replace(structure, name="", zero=True)
    found = _landscape(with_zero, problem, whitening, moving)[structure.numerators - 1]
    kept: list[FloatArray] = []
    for _, shape in sorted(found, key=lambda each: each[0]):
        if len(kept) < TRIES and all(np.abs(shape - other).max() > 1.0 for other in kept):
            kept.append(shape)
    return kept


@lru_cache(maxsize=32)  # two structures differ by a zero alone
def _landscape(
    structure: Structure, problem: Problem, whitening: Whitening, moving: bool
) -> tuple[list[tuple[float, FloatArray]], ...]:
    """Give misfits and shapes at the best dead times of many denominators, without a zero and with.

    Without lags there is no zero.
    """
    count = problem.outputs.size
    seen = whitening.applied(problem.inputs), whitening.applied(problem.outputs)
    found: tuple[list[tuple[float, FloatArray]], ...] = ([], [])
    for shape in structure.shapes(count):
        own, _ = np.linalg.qr(whitening.applied(structure.own(shape, count, moving).T))
        misfits = _misfits(structure.forced(shape, seen[0]), seen[1], own.T)
        for places, misfit in zip(found, misfits, strict=False):
            for best in _valleys(misfit):
                at = np.concatenate([[float(best)], shape[1:]])
                places.append((float(misfit[best]), at))
    return found


def _valleys(misfit: FloatArray) -> list[int]:
    """Dead times, in samples, of the deepest local minima."""
    padded = np.concatenate([[np.inf], misfit, [np.inf]])
    low = np.flatnonzero((misfit <= padded[:-2]) & (misfit < padded[2:]))
    return [int(k) for k in low[np.argsort(misfit[low])][:VALLEYS]]


def _misfits(forced: FloatArray, outputs: FloatArray, own: FloatArray) -> list[FloatArray]:
    """Sum of squares that is left at each whole dead time, up to half the record.

    By the first response alone, by the first two, and so on.
    """
    count, delays = outputs.size, outputs.size // 2
    rest = outputs - (own @ outputs) @ own
    size = next_fast_len(2 * count, real=True)
    spectra = rfft(np.vstack([rest, own]), size)
    shifted = rfft(forced, size).conj()
    # correlations[i, m, d]: the i-th column against the m-th response, d samples late.
    correlations = irfft(spectra[:, None] * shifted[None], size)[..., :delays]
    onto, within = correlations[0], correlations[1:]
    # Products of two responses equally late: what has not left the record yet.
    products = np.cumsum(forced[:, None] * forced[None], axis=-1)[..., ::-1][..., :delays]
    gram = (products - np.einsum("imd,ind->mnd", within, within)).transpose(2, 0, 1)
    ridge = 1e-9 * np.trace(products[..., 0]) + np.finfo(float).tiny
    gram += ridge * np.eye(forced.shape[0])
    misfits = []
    for m in range(1, len(forced) + 1):
        gain = np.linalg.solve(gram[:, :m, :m], onto[:m].T[..., None])[..., 0]
        misfits.append(np.asarray(rest @ rest - np.einsum("md,dm->d", onto[:m], gain)))
    return misfits
