"""The duality gap of a step that is driven by the stress, evaluated outside the compiled step.

    gap = [W_n(ε) at the new state] + W_n*(σ) − σ:ε ≥ 0    (Fenchel's inequality; zero where σ = ∂W_n/∂ε),

both functions by the engine, with what their own programs leave open. It needs no unique strain: every ε that carries σ has gap zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .certificate import duality_gap, solution_gap, term_values
from .declared import declared_step
from .general_step import GeneralStep, Part, StepSolution

__all__ = ["minimum_values", "stress_gap"]

Array = NDArray[np.float64]


def minimum_values(solution: StepSolution, count: int) -> Array:
    """Minimum of the program at every point [J/m³], shape (count,): W_n(ε), or −W_n*(σ) of one that is driven by the stress."""
    found = np.zeros(count)
    for part in solution.parts:
        found[part.points] = _values(part)
    return found


def _values(part: Part) -> Array:
    program = part.program.compact.program
    y, d = part.found.y, part.data
    q, s = program.q0 + d @ program.q1.T, program.h0 + d @ program.h1.T - y @ program.G.T
    terms = np.array([term_values(program, row) for row in s]) if len(s) else np.zeros(0)
    constant = program.c0 + d @ program.c1 + 0.5 * np.einsum("ij,ij->i", d, d @ program.C.T)
    return constant + np.einsum("ij,ij->i", y, 0.5 * y * program.p + q) + terms


def stress_gap(
    update: Any,
    sig: Array,
    eps: Array,
    old: Array,
    new: Array,
    values: Array,
    *,
    dt: float = 1.0,
    temperature: Array | None = None,
) -> Array:
    """Gap [J/m³] per point, shape (n,): stresses [Pa] and strains (n, 6), packed states, packed parameter values."""
    law, n = update.law, len(sig)
    numbers = {p.name: float(v) for p, v in zip(law.parameters, values, strict=True)}
    declared = declared_step(law, whole=True)
    primal = GeneralStep.of(law, numbers, dt, declared).solve(eps, old, temperature, tangent=False)
    dual = GeneralStep.of(law, numbers, dt, declared, True).solve(sig, old, temperature, tangent=False)
    apart = minimum_values(primal, n) - minimum_values(dual, n) - np.einsum("ij,ij->i", sig, eps)
    own = duality_gap(update, eps, old, new, values, dt=dt, temperature=temperature)
    return own + np.abs(apart) + solution_gap(primal, n) + solution_gap(dual, n)
