"""What the compiled engine needs of a program beside its own arrays, made once per program."""

from __future__ import annotations

from typing import Any

import numpy as np

from .cone_projection import SECOND_ORDER
from .step_program import StepProgram

__all__ = ["engine_arrays"]


def engine_arrays(program: StepProgram) -> tuple[Any, ...]:
    """(p, G, Gᵀ, Gram matrices, q₀, q₁ᵀ, h₀, h₁ᵀ, C, c₁, kinds, starts, sizes, numbers, guess) in the order of `solve_points`.

    The Gram matrix of a cone is GᵀG over its rows, of a second-order cone without the first. `guess` (n, m) gives the multipliers of least
    norm with Gᵀλ = −q: those of a step in which nothing flows, wherever they lie in their cones.
    """
    kinds, starts, sizes, alphas, betas = program.cone_arrays()
    G = np.ascontiguousarray(program.G)
    n = program.p.size
    grams = np.zeros((kinds.size, n, n))
    for b, (kind, start, size) in enumerate(zip(kinds, starts, sizes, strict=True)):
        rows = G[start + (1 if kind == SECOND_ORDER else 0) : start + size]
        grams[b] = rows.T @ rows
    guess = -np.linalg.pinv(G, rcond=1e-10) if G.size else np.zeros((n, G.shape[0]))
    return (
        program.p,
        G,
        np.ascontiguousarray(G.T),
        grams,
        program.q0,
        np.ascontiguousarray(program.q1.T),
        program.h0,
        np.ascontiguousarray(program.h1.T),
        program.C,
        program.c1,
        kinds,
        starts,
        sizes,
        alphas,
        betas,
        np.ascontiguousarray(guess),
    )
