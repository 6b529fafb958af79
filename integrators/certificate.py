"""Duality gaps, evaluated outside the compiled engine.

For a solution (y, λ) of min ½ yᵀPy + qᵀy + Σ g(s) over s = h − Gy ∈ K, with λ in K*,

    gap = primal − dual = yᵀPy + qᵀy + hᵀλ + Σ [g(s) + g*(−λ)] ≥ 0,

increased by what is missing to admissibility on both sides, so that a wrong answer cannot show a small gap. Of a step computed by another
method, the distance to that solution, weighed with the forces, is added.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..potentials.derivative import partial
from ..potentials.evaluate import evaluate
from ..potentials.spectral import decompose, from_matrix
from .cone_projection import ORTHANT, SECOND_ORDER, SEMIDEFINITE, project
from .declared import components, declared_step
from .general_step import GeneralStep, Part, StepSolution
from .scalar_terms import ENTROPY_TERM, EXPONENTIAL_TERM, POWER_TERM
from .step_program import StepProgram

__all__ = ["duality_gap", "natural_map", "relative_gap", "solution_gap", "term_values"]

Array = NDArray[np.float64]


def solution_gap(solution: StepSolution, count: int) -> Array:
    """Gap [J/m³] at every point of a solution, shape (count,)."""
    gap = np.zeros(count)
    for part in solution.parts:
        gap[part.points] = part_gap(part)
    return gap


def natural_map(part: Part) -> Array:
    """Largest entry of (Py + q + Gᵀλ, λ − Π_{K*}(λ − s)) per point, of a scalar term λ + g′(s), relative to the size that
    the data give to (q, h) before anything cancels."""
    program, y, multipliers, q, _, s = _arrays(part)
    stationary = y * program.p + q + multipliers @ program.G
    feasible = multipliers - dual_projection(program, multipliers - s)
    for cone, place in _terms(program):
        slack, multiplier = s[:, place], multipliers[:, place]
        # the natural map of a scalar term is at most the smaller of the mismatches in s and in λ
        in_slack = np.abs(slack - _inverse_slope(cone, multiplier, slack))
        in_slope = np.abs(multiplier + _slope(cone, slack))
        feasible[:, place] = np.fmin(in_slack, in_slope)
    given = np.abs(part.data)
    size = np.maximum(
        (np.abs(program.q0) + given @ np.abs(program.q1).T).max(axis=1, initial=0.0),
        (np.abs(program.h0) + given @ np.abs(program.h1).T).max(axis=1, initial=0.0),
    )
    found = np.maximum(np.abs(stationary).max(axis=1, initial=0.0), np.abs(feasible).max(axis=1, initial=0.0))
    return found / np.where(size > 0.0, size, 1.0)


def part_gap(part: Part) -> Array:
    """Gap [J/m³] of the points of one program."""
    return _gap(*_arrays(part))


def relative_gap(program: StepProgram, data: Array, y: Array, multipliers: Array) -> Array:
    """Gap over the sum of the sizes of the terms of primal and dual, per row of `data`; unknowns and multipliers are those of `program`."""
    q, h = program.q0 + data @ program.q1.T, program.h0 + data @ program.h1.T
    size = np.abs(q * y).sum(axis=1) + np.abs(h * multipliers).sum(axis=1) + (program.p * y * y).sum(axis=1)
    gap = _gap(program, y, multipliers, q, h, h - y @ program.G.T)
    return gap / np.where(size > 0.0, size, 1.0)


def _gap(program: StepProgram, y: Array, multipliers: Array, q: Array, h: Array, s: Array) -> Array:
    stationary = y * program.p + q + multipliers @ program.G
    value = np.einsum("ij,ij->i", y, y * program.p + q) + np.einsum("ij,ij->i", h, multipliers)
    # Moreau: what s lacks to K is the part of −s in K*
    missing = np.abs(dual_projection(program, -s))
    outside = np.abs(multipliers - dual_projection(program, multipliers))
    for cone, place in _terms(program):
        missing[:, place] = outside[:, place] = 0.0
        value = value + _term_gap(cone, s[:, place], multipliers[:, place])
    size = np.abs(multipliers)
    return (
        np.abs(value)
        + np.abs(stationary * y).sum(axis=1)
        + (missing * size).sum(axis=1)
        + (outside * np.abs(s)).sum(axis=1)
    )


def duality_gap(
    update: Any, eps: Array, old: Array, new: Array, values: Array, *, dt: float = 1.0, temperature: Array | None = None
) -> Array:
    """Gap [J/m³] per point, shape (n,), of a step computed by any method: packed states `old`, `new`, packed parameter values."""
    law = update.law
    numbers = {p.name: float(v) for p, v in zip(law.parameters, values, strict=True)}
    step = GeneralStep.of(law, numbers, dt, declared_step(law))
    best = step.solve(eps, old, temperature, tangent=False)
    size = best.increment.shape[1]
    known: dict[Any, Any] = {**step.parameters, law.observable: eps}
    if temperature is not None:
        known[law.temperature] = temperature
    start = 0
    for variable in law.internal:
        length = components(variable)
        known[variable] = new[:, start] if length == 1 else new[:, start : start + length]
        start += length
    given = []
    for variable in law.internal:
        force = np.asarray(-evaluate(partial(law.energy, variable), known))
        length = components(variable)
        given.append(np.broadcast_to(force.reshape(-1, length), (len(eps), length)))
    forces = np.hstack(given) if given else np.zeros((len(eps), 0))
    true = -best.slopes[:, 6 : 6 + size]
    change = new[:, :size] - old[:, :size]
    far, apart = change - best.increment, forces - true
    return (
        solution_gap(best, len(eps))
        + np.abs(true * far).sum(axis=1)
        + np.abs(apart * best.increment).sum(axis=1)
        + np.abs(apart * far).sum(axis=1)
    )


def _arrays(part: Part) -> tuple[StepProgram, Array, Array, Array, Array, Array]:
    program = part.program.compact.program
    y, multipliers = part.found.y, part.found.multipliers
    q = program.q0 + part.data @ program.q1.T
    h = program.h0 + part.data @ program.h1.T
    return program, y, multipliers, q, h, h - y @ program.G.T


def _terms(program: StepProgram) -> list[tuple[Any, int]]:
    found, start = [], 0
    for cone in program.cones:
        if cone.kind >= POWER_TERM:
            found.append((cone, start))
        start += cone.size
    return found


def dual_projection(program: StepProgram, v: Array) -> Array:
    """Π_{K*}(v) row by row, by numpy for the symmetric cones."""
    out = v.copy()
    start = 0
    for cone in program.cones:
        rows = slice(start, start + cone.size)
        part = v[:, rows]
        start += cone.size
        if cone.kind == ORTHANT:
            out[:, rows] = np.maximum(part, 0.0)
        elif cone.kind == SECOND_ORDER:
            t, length = part[:, 0], np.linalg.norm(part[:, 1:], axis=1)
            half = np.clip(0.5 * (t + length), 0.0, None)
            ratio = np.divide(half, length, out=np.zeros_like(half), where=length > 0.0)
            mixed = np.column_stack([half, ratio[:, None] * part[:, 1:]])
            out[:, rows] = np.where((length <= t)[:, None], part, np.where((length <= -t)[:, None], 0.0, mixed))
        elif cone.kind == SEMIDEFINITE:
            values, vectors = decompose(part)
            out[:, rows] = from_matrix(np.einsum("nik,nk,njk->nij", vectors, np.maximum(values, 0.0), vectors))
        elif cone.kind < POWER_TERM:
            jacobian, work = np.zeros((6, 6)), np.zeros(60)
            for row in range(len(v)):
                taken = np.ascontiguousarray(part[row])
                project(cone.kind, cone.alpha, taken, 0, 3, taken, jacobian, work)
                out[row, rows] = taken
    return out


def term_values(program: StepProgram, s: Array) -> float:
    """Σ g(s) of the scalar terms at one slack."""
    total = 0.0
    for cone, place in _terms(program):
        total += float(_term_value(cone, s[place : place + 1])[0])
    return total


def _term_value(cone: Any, slack: Array) -> Array:
    c, k = cone.alpha, cone.beta
    with np.errstate(all="ignore"):
        if cone.kind == POWER_TERM:
            return c * np.abs(slack) ** k
        if cone.kind == EXPONENTIAL_TERM:
            return c * np.exp(slack / k)
        if cone.kind == ENTROPY_TERM:
            r = np.maximum(-slack, 0.0)
            return c * np.where(r > 0.0, r * (np.log(r / k) - 1.0), 0.0)
        return -c * np.log(slack)


def _slope(cone: Any, slack: Array) -> Array:
    """g′(s)."""
    c, k = cone.alpha, cone.beta
    with np.errstate(all="ignore"):
        if cone.kind == POWER_TERM:
            return c * k * np.sign(slack) * np.abs(slack) ** (k - 1.0)
        if cone.kind == EXPONENTIAL_TERM:
            return c / k * np.exp(slack / k)
        return -c * np.log(-slack / k) if cone.kind == ENTROPY_TERM else -c / slack


def _inverse_slope(cone: Any, multiplier: Array, slack: Array) -> Array:
    """The s with −g′(s) = λ."""
    with np.errstate(all="ignore"):
        if cone.kind == POWER_TERM:
            return -np.sign(multiplier) * (np.abs(multiplier) / (cone.alpha * cone.beta)) ** (1.0 / (cone.beta - 1.0))
        if cone.kind == EXPONENTIAL_TERM:
            gone = multiplier == 0.0
            return np.where(gone, slack, cone.beta * np.log(-multiplier * cone.beta / cone.alpha))
        if cone.kind == ENTROPY_TERM:
            return -cone.beta * np.exp(multiplier / cone.alpha)
        return cone.alpha / multiplier


def _term_gap(cone: Any, slack: Array, multiplier: Array) -> Array:
    """g(s) + g*(−λ), to which λ s is added in the sum over rows."""
    c, k = cone.alpha, cone.beta
    with np.errstate(all="ignore"):
        if cone.kind == POWER_TERM:
            conjugate = (k - 1.0) * c * (np.abs(multiplier) / (c * k)) ** (k / (k - 1.0))
        elif cone.kind == EXPONENTIAL_TERM:
            u = np.maximum(-multiplier, 0.0)
            conjugate = np.where(u > 0.0, k * u * (np.log(k * u / c) - 1.0), 0.0)
        elif cone.kind == ENTROPY_TERM:
            conjugate = c * k * np.exp(multiplier / c)
        else:
            conjugate = -c - c * np.log(multiplier / c)
    return _term_value(cone, slack) + conjugate
