r"""Where the search begins: every dead time against many denominators, by correlation.

A whole dead time only shifts a response, so for one denominator the misfit at all of them comes out
of a few correlations, computed by the fast Fourier transform. Nothing is guessed from the shape of
a step; any input will do.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from ..numerics import FloatArray
from .residuals import Whitening
from .structures import Structure

__all__ = ["starting_points"]

VALLEYS = 2  # dead times that are kept of each denominator


def starting_points(
    structure: Structure,
    inputs: FloatArray,
    outputs: FloatArray,
    mode: tuple[Whitening, bool],
    most: int,
) -> list[FloatArray]:
    """Find at most so many shapes of small misfit, no two of them alike, the best first.

    Mode is the filter through which the record is seen, and whether the plant may move before the
    input does.
    """
    count = outputs.size
    whitening, moving = mode
    seen = whitening.applied(inputs), whitening.applied(outputs)
    found = []
    for shape in structure.shapes(count):
        own, _ = np.linalg.qr(whitening.applied(structure.own(shape, count, moving).T))
        misfit = _misfits(structure.forced(shape, seen[0]), seen[1], own.T)
        for best in _valleys(misfit):
            found.append((float(misfit[best]), np.concatenate([[float(best)], shape[1:]])))
    found.sort(key=lambda each: each[0])
    kept: list[FloatArray] = []
    for _, shape in found:
        if all(np.abs(shape - other).max() > 1.0 for other in kept):
            kept.append(shape)
    return kept[:most]


def _valleys(misfit: FloatArray) -> list[int]:
    """Dead times, in samples, of the deepest local minima."""
    padded = np.concatenate([[np.inf], misfit, [np.inf]])
    low = np.flatnonzero((misfit <= padded[:-2]) & (misfit < padded[2:]))
    return [int(k) for k in low[np.argsort(misfit[low])][:VALLEYS]]


def _misfits(forced: FloatArray, outputs: FloatArray, own: FloatArray) -> FloatArray:
    """Sum of squares that is left at each whole dead time, up to half the record."""
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
    gain = np.linalg.solve(gram, onto.T[..., None])[..., 0]
    return np.asarray(rest @ rest - np.einsum("md,dm->d", onto, gain))
