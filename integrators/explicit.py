"""The step by explicit sub-steps with error control: there for the trade between speed and accuracy, not as a default.

Over a step the strain moves on a straight line. The rates of the internal variables are

    Ẋ = ∂φ*_finite(Y) + Σ γ_j ∂f_j(Y),   Y = −∂ψ/∂X,   γ ≥ 0 from the consistency of the active surfaces (ḟ_j ≤ 0, γ_j ḟ_j = 0),

integrated by Heun's method with the embedded Euler step as estimate of the error. A sub-step is accepted where the two stresses differ by
less than `tolerance` times the stress scale (the largest of the stresses met and of the distance to the surface at rest), and is followed
by a correction of the drift off the surface. The method knows the old strain, so the state holds it under the observable's name. It has
no tangent. At a vertex the gradient of f is one element of the normal cone, and the error control shortens the sub-steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, DeclarationError, InputError, Status
from ..potentials import Law
from ..potentials.derivative import partial
from ..potentials.evaluate import evaluate
from ..potentials.scalars import ScalarVariable
from .declared import components
from .dimension import SPACE
from .step_result import StepResult

__all__ = ["ExplicitUpdate", "Integration"]

Array = NDArray[np.float64]
SMALLEST = 1e-9
SWEEPS = 60


@dataclass(frozen=True)
class ExplicitUpdate:
    """Same call as `Update`; `tolerance` is the error per sub-step relative to the stress scale, `limit` the number of sub-steps."""

    law: Law
    tolerance: float = 1e-6
    limit: int = 100_000
    solver: str = "explicit"
    why: str = "asked for by name; there for the trade between speed and accuracy"

    def __post_init__(self) -> None:
        law = self.law
        law.check_evolution()
        if law.phi is not None or law.observable in law.forces or law.temperature is not None:
            raise DeclarationError(
                f"law '{law.name}': the explicit step takes laws declared by phi_star, isothermal, without a force of the observable; "
                "use solver='auto'"
            )
        if not 0.0 < self.tolerance < 1.0:
            raise InputError(f"explicit: tolerance {self.tolerance:g} must lie between 0 and 1")

    @property
    def layout(self) -> dict[str, tuple[int, int]]:
        """Place of each variable in a packed row: internal variables, then the old strain."""
        found, start = {}, 0
        for variable in (*self.law.internal, self.law.observable):
            found[variable.name] = (start, components(variable))
            start += components(variable)
        return found

    def initial_state(self, point_count: int = 1) -> dict[str, Array]:
        """Virgin state: all internal variables and the old strain zero."""
        if point_count < 0:
            raise InputError(f"initial_state: the number of points is {point_count}; it must not be negative")
        return {n: np.zeros((point_count, k) if k > 1 else point_count) for n, (_, k) in self.layout.items()}

    def __call__(
        self,
        eps_new: Any,
        state: Mapping[str, Any] | None = None,
        dt: float = 1.0,
        *,
        certify: bool = False,
        **values: Any,
    ) -> StepResult:
        """See `Update.__call__`; `certify` is not available (an explicit step is not optimal), the tangent is None."""
        if certify:
            raise InputError(
                "certify=True is not available with the explicit solver: its step is not the minimum of a program"
            )
        if not (np.isfinite(dt) and dt > 0):
            raise InputError(f"dt = {dt}: the time step must be positive and finite")
        goal = SPACE.strains(eps_new)
        return Integration(
            self, self.law.admissible_values(values), goal, self._packed(state, len(goal)), float(dt)
        ).run()

    def _packed(self, state: Mapping[str, Any] | None, count: int) -> Array:
        found = self.initial_state(count) if state is None else state
        parts = []
        for name, (_, size) in self.layout.items():
            if name not in found:
                raise InputError(
                    f"law '{self.law.name}': the state lacks '{name}'; an explicit step begins at the old strain and state"
                )
            value = np.asarray(found[name], dtype=float).reshape(count, size)
            if not np.isfinite(value).all():
                raise InputError(f"state '{name}' holds a value that is not finite")
            parts.append(value)
        return np.concatenate(parts, axis=1)


class Integration:
    """One call: all points side by side, each with its own sub-step."""

    def __init__(self, update: ExplicitUpdate, values: dict[str, float], goal: Array, packed: Array, dt: float) -> None:
        law = update.law
        self.update, self.law, self.dt, self.goal = update, law, dt, goal
        self.parameters = {p: values[p.name] for p in law.parameters}
        self.size = packed.shape[1] - 6
        self.old, self.start = packed[:, : self.size], packed[:, self.size :]
        self.layout = {v: update.layout[v.name] for v in law.internal}
        self.moving = [v for v in law.internal if v in law.forces]
        self.slopes = [{v: partial(f, law.forces[v]) for v in self.moving} for f in law.surfaces]
        self.creep = {v: partial(law.viscous, law.forces[v]) for v in self.moving} if law.viscous != 0 else {}

    # -- the law ------------------------------------------------------------------------------------------------------------

    def _state(self, strain: Array, x: Array) -> dict[Any, Any]:
        found = {self.law.observable: strain, **self.parameters}
        for v, (start, size) in self.layout.items():
            found[v] = x[:, start] if isinstance(v, ScalarVariable) else x[:, start : start + size]
        return found

    def forces(self, strain: Array, x: Array) -> Array:
        """Forces Y, packed like the state."""
        env, out = self._state(strain, x), np.zeros_like(x)
        for v in self.moving:
            start, size = self.layout[v]
            out[:, start : start + size] = np.reshape(
                np.broadcast_to(_column(evaluate(self.law.force_laws[v], env), v, len(x)), (len(x), size)),
                (len(x), size),
            )
        return out

    def _environment(self, y: Array, rows: NDArray[np.intp]) -> dict[Any, Any]:
        found: dict[Any, Any] = dict(self.parameters)
        old = self.old[rows]
        from ..potentials import frozen

        for v in self.moving:
            start, size = self.layout[v]
            found[self.law.forces[v]] = y[:, start] if isinstance(v, ScalarVariable) else y[:, start : start + size]
        for v in self.law.frozen:
            if v == self.law.observable:
                found[frozen(v)] = self.start[rows]
                continue
            start, size = self.layout[v]
            found[frozen(v)] = old[:, start] if isinstance(v, ScalarVariable) else old[:, start : start + size]
        return found

    def _pack(self, parts: Mapping[Any, Any], env: dict[Any, Any], count: int) -> Array:
        out = np.zeros((count, self.size))
        for v, expression in parts.items():
            start, size = self.layout[v]
            out[:, start : start + size] = _column(evaluate(expression, env), v, count)
        return out

    def surfaces(self, y: Array, rows: NDArray[np.intp]) -> Array:
        """f_j(Y), (n, surfaces)."""
        env = self._environment(y, rows)
        return (
            np.stack([np.broadcast_to(evaluate(f, env), (len(y),)) for f in self.law.surfaces], axis=1)
            if self.law.surfaces
            else np.zeros((len(y), 0))
        )

    def normals(self, y: Array, rows: NDArray[np.intp]) -> Array:
        """∂f_j(Y), (n, surfaces, size)."""
        env = self._environment(y, rows)
        found = [self._pack(slope, env, len(y)) for slope in self.slopes]
        return np.stack(found, axis=1) if found else np.zeros((len(y), 0, self.size))

    def creep_flow(self, y: Array, rows: NDArray[np.intp]) -> Array:
        """Increment dt ∂φ*(Y) of the finite part of φ*, (n, size)."""
        return self.dt * self._pack(self.creep, self._environment(y, rows), len(y)) if self.creep else np.zeros_like(y)

    def stress(self, strain: Array, x: Array) -> Array:
        """∂ψ/∂ε [Pa], (n, 6)."""
        return np.broadcast_to(evaluate(self.law.stress, self._state(strain, x)), (len(x), 6)).copy()

    def _along(self, strain: Array, x: Array, d_strain: Array, d_x: Array) -> Array:
        """Directional derivative of the forces, by a central difference (exact for a quadratic ψ)."""
        scale = np.maximum(np.abs(d_strain).max(axis=1), np.abs(d_x).max(axis=1, initial=0.0))
        h = (1e-3 * np.maximum(np.abs(strain).max(axis=1), 1e-6) / np.maximum(scale, 1e-300))[:, None]
        return (self.forces(strain + h * d_strain, x + h * d_x) - self.forces(strain - h * d_strain, x - h * d_x)) / (
            2.0 * h
        )

    def rate(self, strain: Array, x: Array, d_strain: Array, rows: NDArray[np.intp], active: Any) -> tuple[Array, Any]:
        """Ẋ for strain rate `d_strain` per unit of the step, and which surfaces flow."""
        y = self.forces(strain, x)
        flow = self.creep_flow(y, rows)
        if not active.any():
            return flow, active
        normals = np.where(active[:, :, None], self.normals(y, rows), 0.0)
        drive = np.einsum("njk,nk->nj", normals, self._along(strain, x, d_strain, flow))
        gamma = self._multipliers(strain, x, normals, drive)
        return flow + np.einsum("nj,njk->nk", gamma, normals), gamma > 0.0

    def _multipliers(self, strain: Array, x: Array, normals: Array, drive: Array) -> Array:
        """γ ≥ 0 with drive − A γ ≤ 0 complementary, A_jk = −∂f_j·(∂Y/∂X)·∂f_k, by projected Gauss–Seidel."""
        count, surfaces, _ = normals.shape
        matrix = np.zeros((count, surfaces, surfaces))
        for k in range(surfaces):
            matrix[:, :, k] = -np.einsum(
                "njk,nk->nj", normals, self._along(strain, x, np.zeros_like(strain), normals[:, k])
            )
        gamma = np.zeros((count, surfaces))
        for _ in range(1 if surfaces == 1 else SWEEPS):
            for j in range(surfaces):
                diagonal = matrix[:, j, j]
                rest = drive[:, j] - np.einsum("nk,nk->n", matrix[:, j], gamma)
                gamma[:, j] = np.where(
                    diagonal > 0.0, np.maximum(gamma[:, j] + rest / np.where(diagonal > 0.0, diagonal, 1.0), 0.0), 0.0
                )
        return gamma

    # -- the step -----------------------------------------------------------------------------------------------------------

    def run(self) -> StepResult:
        count = len(self.goal)
        whole = self.goal - self.start
        x, done, h = self.old.copy(), np.zeros(count), np.ones(count)
        lost, status = np.zeros(count), np.zeros(count, dtype=np.int64)
        scale = np.zeros(count)
        everyone = np.arange(count)
        if self.law.surfaces:
            # the distance to the surface at rest sets the scale of stress
            scale += np.abs(self.surfaces(np.zeros((count, self.size)), everyone)).max(axis=1)
        limit = 0
        while (open_ := np.flatnonzero((done < 1.0) & (status == 0))).size:
            limit += 1
            if limit > self.update.limit:
                status[open_] = int(Status.ITERATION_LIMIT)
                break
            step = np.minimum(h[open_], 1.0 - done[open_])
            strain = self.start[open_] + done[open_, None] * whole[open_]
            moved, d_lost, error, size, wrong = self._substep(strain, x[open_], whole[open_], step, open_)
            reached = np.maximum(scale[open_], size)
            with np.errstate(over="ignore"):
                relative = error / np.maximum(reached, np.finfo(float).tiny)
            good = (relative <= self.update.tolerance) & ~wrong
            rows = open_[good]
            # a stress that is known to a tenth is one that is met; what a far too long sub-step overshoots to is not
            sound = relative <= 0.1
            scale[open_[sound]] = reached[sound]
            x[rows], lost[rows] = moved[good], lost[rows] + d_lost[good]
            done[rows] += step[good]
            done[rows] = np.where(done[rows] > 1.0 - 1e-14, 1.0, done[rows])
            factor = np.clip(0.9 * np.sqrt(self.update.tolerance / np.maximum(relative, 1e-300)), 0.1, 4.0)
            h[open_] = np.where(wrong, 0.1, factor) * step
            status[open_[(h[open_] < SMALLEST) & ~good]] = int(Status.ITERATION_LIMIT)
        if status.any():
            row = int(np.flatnonzero(status)[0])
            reason = (
                f"it needs more than {self.update.limit} sub-steps (a step of many relaxation times)"
                if limit > self.update.limit
                else "its sub-steps became too short (a vertex, or a tolerance out of reach)"
            )
            raise ConvergenceError(
                f"the explicit step fails at {int((status != 0).sum())} of {count} points, first {row}, strain {self.goal[row]}: "
                f"{reason}; use solver='auto'"
            )
        stress = self.stress(self.goal, x)
        packed = np.concatenate([x, self.goal], axis=1)
        new = {n: (packed[:, s] if k == 1 else packed[:, s : s + k]) for n, (s, k) in self.update.layout.items()}
        return StepResult(stress, None, new, lost, status, None)

    def _substep(
        self, strain: Array, x: Array, whole: Array, step: Array, rows: NDArray[np.intp]
    ) -> tuple[Array, Array, Array, Array, Any]:
        column = step[:, None]
        end = strain + column * whole
        y0 = self.forces(strain, x)
        near = (
            self.update.tolerance * (1.0 + np.abs(self.surfaces(np.zeros_like(y0), rows)))
            if self.law.surfaces
            else np.zeros((len(x), 0))
        )
        active = self.surfaces(y0, rows) >= -near
        first, flowing = self.rate(strain, x, whole, rows, active)
        euler = x + column * first
        y1 = self.forces(end, euler)
        late = active | (self.surfaces(y1, rows) > near)
        second, _ = self.rate(end, euler, whole, rows, late)
        moved = x + 0.5 * column * (first + second)
        # a surface met within the sub-step, from inside or after leaving it: the sub-step begins elastic there and must be short
        met = ((self.surfaces(y1, rows) > near) & ~flowing).any(axis=1)
        long = (step > 1e-3 * self.update.tolerance**0.5) & ~self._small(strain, x, end, rows, near)
        wrong = met & long
        moved = self._returned(end, moved, rows)
        y = self.forces(end, moved)
        stress_two = evaluate(self.law.stress, self._state(end, moved))
        stress_one = evaluate(self.law.stress, self._state(end, self._returned(end, euler, rows)))
        error = np.abs(stress_two - stress_one).max(axis=1)
        size = np.abs(stress_two).max(axis=1)
        finite = np.isfinite(moved).all(axis=1) & np.isfinite(error)
        lost = np.einsum("nk,nk->n", 0.5 * (y0 + y), moved - x)
        return moved, lost, np.where(finite, error, np.inf), np.where(finite, size, 0.0), wrong & finite

    def _small(self, strain: Array, x: Array, end: Array, rows: NDArray[np.intp], near: Array) -> Any:
        """True where the elastic trial oversteps the surfaces by less than the tolerance allows."""
        if not self.law.surfaces:
            return np.ones(len(x), dtype=bool)
        return (self.surfaces(self.forces(end, x), rows) <= 1e2 * near).all(axis=1)

    def _returned(self, strain: Array, x: Array, rows: NDArray[np.intp]) -> Array:
        """Correction of the drift: two Newton steps back to the violated surfaces, along their normals."""
        for _ in range(2 if self.law.surfaces else 0):
            y = self.forces(strain, x)
            f = self.surfaces(y, rows)
            if not (f > 0.0).any():
                break
            normals = np.where((f > 0.0)[:, :, None], self.normals(y, rows), 0.0)
            gamma = self._multipliers(strain, x, normals, np.maximum(f, 0.0))
            x = x + np.einsum("nj,njk->nk", gamma, normals)
        return x


def _column(value: Any, variable: Any, count: int) -> Array:
    found = np.asarray(value, dtype=float)
    if isinstance(variable, ScalarVariable):
        return np.broadcast_to(found, (count,))[:, None]
    return np.broadcast_to(found, (count, components(variable)))
