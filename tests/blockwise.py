"""The diagram of Fig. 1 put together from its blocks: an oracle that knows nothing of p_A and p_B.

Every block is realised once, from numerator and denominator; what a block shares with itself is
divided out by hand, with the roots that the test itself has chosen. Nothing else cancels.
"""

from __future__ import annotations

from collections.abc import Sequence

import control as ct
import numpy as np
from scipy.linalg import block_diag, expm

Block = tuple[np.ndarray, np.ndarray]


def polynomial(roots: Sequence[complex]) -> np.ndarray:
    return np.atleast_1d(np.real(np.poly(list(roots))))


def divided(p: np.ndarray, roots: Sequence[complex]) -> np.ndarray:
    """Divide a polynomial by some of its roots, which must leave nothing but rounding."""
    quotient, rest = np.polydiv(p, polynomial(roots))
    assert np.abs(rest).max() <= 1e-9 * np.abs(p).max()
    return quotient


def diagram(
    G: Block, model: Block, C: Block, F: Block,
    zeros: Sequence[complex] = (), poles: Sequence[complex] = (),
) -> ct.StateSpace:  # fmt: skip
    """Interconnect G, C, F twice, F/Gm and (1-F)Gm, from R, d, delta, eta to y and u.

    Without `zeros` in F/Gm and `poles` in (1-F)Gm; u is the controller's output, for delta too.
    """
    (Nm, Dm), (Nf, Df) = model, F
    inverse = np.polymul(divided(Nf, zeros), Dm), np.polymul(Df, divided(Nm, zeros))
    rest = divided(np.polysub(Df, Nf), poles)
    prediction = np.polymul(rest, Nm), np.polymul(Df, divided(Dm, poles))
    blocks = [realised(*block) for block in (G, C, F, F, inverse, prediction)]
    A, B, K, D = (block_diag(*(block[k] for block in blocks)) for k in range(4))
    # Outputs: G without d, C e, F u, F(y + eta), (F/Gm)(y + eta), (1 - F)Gm u.
    u, y, e = np.array([[0, 1, 1, 0, -1, 0], [1, 0, 0, 0, 0, 0], [0, 0, 0, -1, 0, -1.0]])
    inside = np.array([u, e, u, y, y, u])
    outside = np.zeros((6, 4))
    outside[1, 0] = outside[0, 2] = outside[3, 1] = outside[4, 1] = 1
    outside[3, 3] = outside[4, 3] = 1
    solved = np.linalg.inv(np.eye(6) - inside @ D)
    to_inputs, from_outside = solved @ inside @ K, solved @ outside
    outputs, through = np.array([y, u]), np.array([[0, 1, 0, 0], [0, 0, 0, 0.0]])
    return ct.ss(
        A + B @ to_inputs,
        B @ from_outside,
        outputs @ (K + D @ to_inputs),
        through + outputs @ D @ from_outside,
    )


def realised(num: np.ndarray, den: np.ndarray) -> tuple[np.ndarray, ...]:
    """Companion form A, B, C, D of a proper fraction."""
    num = np.pad(num, (den.size - num.size, 0)) / den[0]
    den = den / den[0]
    n = den.size - 1
    A = np.eye(n, k=1)
    A[-1:] = -den[:0:-1]
    B = np.zeros((n, 1))
    B[-1:] = 1.0
    return A, B, (num[1:] - num[0] * den[1:])[::-1][None, :], np.array([[num[0]]])


def step(system: ct.StateSpace, column: int, times: np.ndarray) -> np.ndarray:
    """Response of y and u to a unit step, by the exponential of one matrix, shape (2, N)."""
    n = system.A.shape[0]
    held = np.zeros((n + 1, n + 1))
    held[:n, :n], held[:n, n] = system.A, system.B[:, column]
    states = np.array([expm(held * t)[:n, n] for t in times]).T
    return np.asarray(system.C @ states + system.D[:, [column]])
