"""A sampled loop by brute force: every block a state space of its own, wired by one matrix.

The blocks are sampled by python-control, the process by the exponential of a matrix with its delay
line in full, and the diagram is solved as it is drawn.
"""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np
from scipy.linalg import block_diag, expm

from .plain import Plain


def poles(
    loop: Plain, dt: float, method: str = "tustin", computation_delay: float = 0.0
) -> np.ndarray:
    """Poles of the loop from sample to sample, in the plane of z."""
    G, Gm, C, F = loop.G, loop.Gm, loop.C, loop.F

    def sampled(num: np.ndarray, den: np.ndarray) -> Any:
        block = ct.ss(ct.tf(num, den))
        if not block.nstates:
            return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), block.D
        found = ct.sample_system(block, dt, method)
        return found.A, found.B, found.C, found.D

    filter, inverse = sampled(*F), sampled(np.convolve(F.num, Gm.den), np.convolve(F.den, Gm.num))
    if method == "zoh":  # F/Gm and (1 - F) Gm are made of blocks that are sampled
        F_z, Gm_z = (ct.sample_system(ct.tf(*block), dt, "zoh") for block in (F, Gm))
        (n, d), (m, e) = ((b.num[0][0], b.den[0][0]) for b in (F_z, Gm_z))
        n, m = np.trim_zeros(n, "f"), np.trim_zeros(m, "f")
        inverse = realised(np.convolve(n, e), np.convolve(d, m))
    controller = sampled(*C)
    plant = behind_a_hold(G, loop.delay + computation_delay, dt)
    if loop.model_delay:
        # Outputs y, (late u), F u, F y, (F/Gm) y, Gm (u - F u), C e.
        model, wait = sampled(*Gm), late_mean(loop.model_delay / dt)
        blocks = plant, wait, filter, filter, inverse, model, controller
        u = np.array([0, 0, 1, 0, -1, 0, 1])
        y, late, f, g, _, m, _ = np.eye(7)
        wiring = [u, u, late, y, y, u - f, -(g + m)]
    else:
        part, den = np.polysub(F.den, F.num), Gm.den
        if den[-1] == 0:
            part, den = part[:-1], den[:-1]
        rest = sampled(np.convolve(part, Gm.num), np.convolve(F.den, den))
        if method == "zoh":
            part = np.polysub(d, n)
            if Gm.den[-1] == 0:  # both have a zero at z = 1
                part, e = (np.polydiv(p, [1.0, -1.0])[0] for p in (part, e))
            rest = realised(np.convolve(part, m), np.convolve(d, e))
        blocks = plant, filter, filter, inverse, rest, controller
        u = np.array([0, 1, 0, -1, 0, 1])
        y, _, g, _, m, _ = np.eye(6)
        wiring = [u, u, y, y, u, -(g + m)]
    A, B, C_, D = (block_diag(*parts) for parts in zip(*blocks, strict=True))
    W = np.array(wiring)
    return np.linalg.eigvals(A + B @ W @ np.linalg.solve(np.eye(len(D)) - D @ W, C_))


def realised(num: np.ndarray, den: np.ndarray) -> Any:
    block = ct.ss(ct.tf(num, den))
    return block.A, block.B, block.C, block.D


def behind_a_hold(G: Any, delay: float, dt: float) -> Any:
    """Process and its whole delay line; y is read before u is written."""
    block = ct.ss(ct.tf(*G))
    samples = int(delay / dt + 1e-9)
    part = delay / dt - samples
    part = part if part > 1e-9 else 0.0
    n = block.nstates

    def over(share: float) -> tuple[np.ndarray, np.ndarray]:
        whole = np.zeros((n + 1, n + 1))
        whole[:n, :n], whole[:n, n:] = block.A, block.B
        both = expm(whole * share * dt)
        return both[:n, :n], both[:n, n:]

    (late, young), (early, old) = over(1 - part), over(part)
    # States: x, and u one to samples + 1 samples ago.
    size = n + samples + 1
    A, B, C = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((1, size))
    A[:n, :n] = late @ early
    A[:n, n + samples] += (late @ old)[:, 0]
    if samples:
        A[:n, n + samples - 1] += young[:, 0]
    else:
        B[:n] = young
    B[n] = 1.0
    A[n + 1 :, n:-1] += np.eye(samples)
    C[0, :n], C[0, n + samples] = block.C[0], block.D[0, 0]
    return A, B, C, np.zeros((1, 1))


def late_mean(samples: float) -> Any:
    """(1 - φ) z^-m + φ z^-(m+1) as a delay line."""
    whole = int(samples + 1e-9)
    part = max(samples - whole, 0.0) if samples - whole > 1e-9 else 0.0
    C, D = np.zeros((1, whole + 1)), np.zeros((1, 1))
    C[0, whole] = part
    if whole:
        C[0, whole - 1] = 1 - part
    else:
        D[0, 0] = 1 - part
    B = np.zeros((whole + 1, 1))
    B[0] = 1.0
    return np.eye(whole + 1, k=-1), B, C, D
