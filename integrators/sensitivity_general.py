"""Derivatives of the step that the general engine takes: the cone program of every point, differentiated at its solution.

    p∘dy + Gᵀdλ = −r,    (𝕀 − V) dλ − V G dy = −V g,      V ∈ ∂Π_{K*}(λ − s),

r and g the changes of slope and slack by the data at fixed (y, λ), in the units of the program at the parameters themselves (Fiacco 1976;
Busseti, Moursi and Boyd 2019). Nothing is differenced but the data (`program_slopes`): the arrays of the stacked program are closed-form
functions of the parameters without a solver between, their differences are right to some 1e-12 (at a bound of a parameter 1e-10). The
answer of the engine is differentiated exactly.

Programs with exponential or power cones (powers, exponentials, logarithms and entropies that no reduction takes) are refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DeclarationError
from .batch import ROUNDING, solve_batch
from .compact import Compact
from .cone_projection import ORTHANT, SEMIDEFINITE, project
from .failures import raise_failures
from .general_step import GeneralStep, Part
from .program_slopes import SPACING, ProgramSlopes, central_difference
from .sensitivity_strain import add_declared_energy
from .step_program import Stacked
from .thermal import thermal_input

__all__ = ["general_derivatives"]

Array = NDArray[np.float64]


def general_derivatives(
    update: Any,
    eps: Array,
    old: Array,
    dt: Any,
    values: Mapping[str, Any],
    names: tuple[str, ...],
    d_old: Array,
    d_eps: Array,
) -> tuple[Array, Array, Array]:
    """See `sensitivity.derivatives`; the packed state ends with the old strain where the law has a force of its observable."""
    n, width = len(eps), d_eps.shape[2]
    heat, given = thermal_input(update.law, values, n)
    numbers = update.law.admissible_values(given)
    temperature = None
    if update.law.temperature is not None:
        temperature = np.array(np.broadcast_to(heat.temperature, (n,)))
    steps = np.array(np.broadcast_to(np.asarray(dt, dtype=float), (n,)))
    d_stress, d_new, d_lost = np.zeros((n, 6, width)), np.zeros((n, old.shape[1], width)), np.zeros((n, width))
    for value in np.unique(steps):
        points = np.flatnonzero(steps == value)
        heated = None if temperature is None else temperature[points]
        part = _Group(update, numbers, float(value), names, eps[points], old[points], heated)
        raise_failures(part.status, eps[points])
        d_stress[points], d_new[points], d_lost[points] = part.derivatives(d_old[points], d_eps[points])
    return d_stress, d_new, d_lost


class _Group:
    """Points with one time step."""

    def __init__(
        self, update: Any, numbers: Any, dt: float, names: Any, eps: Array, old: Array, temperature: Array | None
    ) -> None:
        self.update, self.law, self.dt, self.names = update, update.law, dt, names
        self.eps, self.old, self.temperature = eps, old, temperature
        self.step: GeneralStep = update.step(numbers, dt)
        self.rows = self.step.declared.coefficient_rows(self.step.parameters, old, temperature)
        distinct, place = np.unique(self.rows, axis=0, return_inverse=True)
        if not self.rows.shape[1]:
            distinct, place = np.zeros((1, 0)), np.zeros(len(eps), dtype=np.int64)
        self.distinct, self.place = distinct, place.reshape(-1)
        self.status = np.zeros(len(eps), dtype=np.int64)
        self.solved = {}
        for k in range(len(distinct)):
            points = np.flatnonzero(self.place == k)
            heated = None if temperature is None else temperature[points]
            alone = GeneralStep(
                self.law, self.step.parameters, dt, self.step.declared, _programs=self.step._programs, _affine=False
            )
            found = alone.solve(eps[points], old[points], heated, tangent=False)
            self.status[points] = found.status
            self.solved[k] = points, found

    def derivatives(self, d_old: Array, d_eps: Array) -> tuple[Array, Array, Array]:
        count, width = len(self.eps), d_eps.shape[2]
        d_rows = self._row_slopes(d_old)
        wide = self.old.shape[1]
        d_stress, d_new, d_lost = np.zeros((count, 6, width)), np.zeros((count, wide, width)), np.zeros((count, width))
        for k, (points, found) in self.solved.items():
            part = found.parts[0]
            program = part.program
            if any(c.kind > SEMIDEFINITE for c in program.cones):
                raise DeclarationError(
                    f"law '{self.law.name}': no sensitivities by the general method for powers, exponentials and logarithms"
                )
            slopes = ProgramSlopes(self.step, self.distinct[k])
            weights: list[tuple[Any, Array]] = []
            for j, name in enumerate(self.names):
                if name in [p.name for p in self.law.parameters]:
                    unit = np.zeros((len(points), width))
                    unit[:, j] = 1.0
                    weights.append((name, unit))
            weights += [(i, d_rows[points, i]) for i in range(self.rows.shape[1]) if d_rows[points, i].any()]
            changes = [(slopes.by(what), weight) for what, weight in weights]
            d_data = np.concatenate([d_eps[points], d_old[points]], axis=1)
            base = slopes.base
            # the program as it is assembled: what the compact form leaves out has a derivative too
            whole = solve_batch(program, part.data, tangent=False, form=Compact.whole(program))
            raise_failures(np.where(whole.status > ROUNDING, 1, 0), self.eps[points])
            one = _Solution(program, base, Part(part.points, program, part.data, whole)).answered(changes, d_data)
            d_slope, d_step = one
            size = d_step.shape[1]
            d_stress[points] = d_slope[:, :6]
            d_new[points] = d_old[points]
            d_new[points, :size] += d_step
            change, d_change = found.increment, d_step
            if wide > size:
                d_new[points, size:] = d_eps[points]
                change = np.hstack([change, self.eps[points] - self.old[points][:, size:]])
                d_change = np.concatenate([d_change, d_eps[points] - d_old[points][:, size:]], axis=1)
            d_lost[points] = -np.einsum("pik,pi->pk", d_slope[:, 6:], change)
            d_lost[points] -= np.einsum("pik,pi->pk", d_change, found.slopes[:, 6:])
        self._outside(d_stress, d_eps)
        return d_stress, d_new, d_lost

    def _outside(self, d_stress: Array, d_eps: Array) -> None:
        """The terms of ψ in the strain alone, which the program does not hold."""
        energy = self.step.declared.strain_energy.energy
        if energy == 0:
            return
        known: dict[Any, Any] = {**self.step.parameters, self.law.observable: self.eps}
        symbols = {p.name: p for p in self.law.parameters}
        if self.temperature is not None:
            known[self.law.temperature] = self.temperature
            symbols[self.law.temperature.name] = self.law.temperature
        add_declared_energy(d_stress, self.law, energy, known, d_eps, [symbols[name] for name in self.names])

    def _row_slopes(self, d_old: Array) -> Array:
        """Derivatives of the coefficients of temperature and frozen state (p, width of a row, K)."""
        found = np.zeros((len(self.eps), self.rows.shape[1], d_old.shape[2]))
        if not self.rows.shape[1]:
            return found
        declared = self.step.declared
        for j, name in enumerate(self.names):
            heat = self.temperature is not None and name == self.law.temperature.name
            symbol = None if heat else next(p for p in self.law.parameters if p.name == name)
            value = 1.0 if heat else self.step.parameters[symbol]

            def at(shift: float, heat: bool = heat, symbol: Any = symbol) -> Array:
                if heat:
                    assert self.temperature is not None
                    return declared.coefficient_rows(self.step.parameters, self.old, self.temperature * (1.0 + shift))
                moved = {**self.step.parameters, symbol: self.step.parameters[symbol] + shift}
                return declared.coefficient_rows(moved, self.old, self.temperature)

            slope = central_difference(at, SPACING * (abs(value) or 1.0))
            if heat:
                assert self.temperature is not None
                slope = slope / self.temperature[:, None]
            found[:, :, j] += slope
        for i in range(self.old.shape[1]):
            if not d_old[:, i].any():
                continue
            size = float(np.abs(self.old[:, i]).max()) or 1e-3

            def beside(shift: float, i: int = i) -> Array:
                moved = self.old.copy()
                moved[:, i] += shift
                return declared.coefficient_rows(self.step.parameters, moved, self.temperature)

            found += central_difference(beside, SPACING * size)[:, :, None] * d_old[:, i][:, None, :]
        return found


@dataclass(frozen=True)
class _Solution:
    """Reduced `program`, its `base` before reduction, and the `part` that the engine solved."""

    program: Any
    base: Stacked
    part: Any

    def answered(self, changes: list[tuple[dict[str, Array], Array]], d_data: Array) -> tuple[Array, Array]:
        """(d slopes (p, D, K), d increment (p, size, K))."""
        base, program, part = self.base, self.program, self.part
        count, width = len(part.data), d_data.shape[2]
        k = 1 + part.data.shape[1]
        known = np.hstack([np.ones((count, 1)), part.data])
        y, scaled = part.found.y, part.found.multipliers
        unknowns = np.hstack([known, y]) @ program.whole.T
        v = np.hstack([known, unknowns])
        multipliers = scaled / program.units
        T = program.whole[:, k:]
        full, E, G = base.full, base.E, base.G
        # ν from the slope of the Lagrangian by the unknowns
        inverse = np.linalg.pinv(E[:, k:], rcond=1e-12)
        pull = v @ full[:, k:] + multipliers @ G
        nu = -pull @ inverse
        d_known = np.concatenate([np.zeros((count, 1, width)), d_data], axis=1)
        # explicit changes of slope, equalities, slack, slopes by the data, and increments
        slope = np.zeros((count, full.shape[0], width))
        equal, slack = np.zeros((count, len(E), width)), np.einsum("rd,pdk->prk", base.H, d_known)
        step = np.zeros((count, len(base.X), width))
        for change, weight in changes:
            lagrange = v @ change["full"] + nu @ change["E"]
            lagrange[:, :k] -= multipliers @ change["H"]
            lagrange[:, k:] += multipliers @ change["G"]
            slope += lagrange[:, :, None] * weight[:, None, :]
            equal += (v @ change["E"].T)[:, :, None] * weight[:, None, :]
            moved = known @ change["H"].T - unknowns @ change["G"].T
            slack += moved[:, :, None] * weight[:, None, :]
            step += (v @ change["X"].T)[:, :, None] * weight[:, None, :]
        # unknowns that keep the equalities, before dy
        d_unknown = np.einsum("ij,pjk->pik", program.whole[:, :k], d_known)
        d_unknown -= np.einsum("ij,pjk->pik", inverse, equal)
        d_v = np.concatenate([d_known, d_unknown], axis=1)
        right = np.einsum("ji,pjk->pik", T, slope[:, k:] + np.einsum("ji,pjk->pik", full[:, k:], d_v))
        gap = (slack - np.einsum("ri,pik->prk", G, d_unknown)) / program.units[:, None]
        dy, d_scaled = self._solved(part.data, y, scaled, right, gap)
        d_v[:, k:] += np.einsum("ij,pjk->pik", T, dy)
        d_multipliers = d_scaled / program.units[:, None]
        # dν closes the slope of the Lagrangian; then the slopes by the data
        total = slope + np.einsum("ji,pjk->pik", full, d_v)
        rest = total[:, k:] + np.einsum("ri,prk->pik", G, d_multipliers)
        d_nu = -np.einsum("ie,pik->pek", inverse, rest)
        total = total[:, 1:k] + np.einsum("ed,pek->pdk", E[:, 1:k], d_nu)
        total -= np.einsum("rd,prk->pdk", base.H[:, 1:], d_multipliers)
        size = len(base.X)
        step += np.einsum("ij,pjk->pik", base.X, d_v) - d_data[:, 6 : 6 + size]
        return total, step

    def _solved(self, data: Array, y: Array, multipliers: Array, right: Array, gap: Array) -> tuple[Array, Array]:
        program = self.program
        n, m = program.p.size, program.h0.size
        dy, dl = np.zeros_like(right), np.zeros((len(data), m, right.shape[2]))
        kinds, starts, sizes, alphas, _ = program.cone_arrays()
        slack = program.h0 + data @ program.h1.T - y @ program.G.T
        for i in range(len(data)):
            V = _projection_slope(kinds, starts, sizes, alphas, multipliers[i] - slack[i])
            matrix = np.zeros((n + m, n + m))
            matrix[:n, :n] = np.diag(program.p)
            matrix[:n, n:] = program.G.T
            matrix[n:, :n] = -V @ program.G
            matrix[n:, n:] = np.eye(m) - V
            goal = -np.concatenate([right[i], V @ gap[i]])
            found = np.linalg.lstsq(matrix, goal, rcond=1e-12)[0]
            dy[i], dl[i] = found[:n], found[n:]
        return dy, dl


def _projection_slope(kinds: Any, starts: Any, sizes: Any, alphas: Array, point: Array) -> Array:
    """V, an element of the generalised Jacobian of the projection on the dual cone."""
    m = point.size
    found, image = np.zeros((m, m)), np.zeros(m)
    work = np.zeros(64)
    for kind, start, size, alpha in zip(kinds, starts, sizes, alphas, strict=True):
        rows = slice(start, start + size)
        if kind == ORTHANT:
            found[rows, rows] = np.diag((point[rows] > 0.0).astype(float))
            continue
        jacobian = np.zeros((max(size, 6), max(size, 6)))
        mark = project(kind, alpha, point, start, size, image, jacobian, work)
        found[rows, rows] = np.eye(size) if mark == 1 else jacobian[:size, :size] if mark == 2 else 0.0
    return found
