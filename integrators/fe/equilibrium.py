"""Quasi-static equilibrium in steps: Newton with the consistent tangent, line search, and cuts of the step.

The prescribed part of an increment enters through the linear predictor: it is spread over the body by the tangent of the last
equilibrium before any stress is computed. The residual is the gradient of the convex incremental energy, so the line search looks
for a zero of its slope along the Newton direction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse.linalg as sla
from numpy.typing import NDArray

from ...errors import ConvergenceError, InputError
from .body import Body
from .loads import Pressure, Support, at_time, nodal_pressure, supported

__all__ = ["Equilibrium", "solve", "walk"]

Array = NDArray[np.float64]
LINE_SEARCH = 0.8
MAXIMUM_CUTS = 10
SINGULAR = 1e-15


@dataclass(frozen=True)
class Equilibrium:
    """A converged state at `time` [s].

    `displacement` and `force` (internal, so that on supports it is the reaction) by degree of freedom [m], [N] (per unit thickness in plane
    strain and stress); at the quadrature points `strain` [-], `stress` [Pa] (point_count, m), `tangent` [Pa] (point_count, m, m), m = 6 or
    `body.components`, `state` by name, `dissipation` accumulated [J/m³]; `residual` relative, `iterations` of the step, `residuals` of its
    last Newton loop.
    """

    time: float
    displacement: Array
    force: Array
    strain: Array
    stress: Array
    tangent: Array
    state: dict[str, Array]
    dissipation: Array
    residual: float = 0.0
    iterations: int = 0
    residuals: tuple[float, ...] = ()

    @classmethod
    def virgin(cls, body: Body, time: float = 0.0) -> Equilibrium:
        """The body at rest, without strain."""
        state = body.update.initial_state(body.point_count)
        out = body.update(np.zeros((body.point_count, body.components)), state, **body.values)
        zero = np.zeros(body.basis.N)
        return cls(
            time,
            zero,
            body.internal_force(out.stress),
            np.zeros((body.point_count, body.components)),
            out.stress,
            out.tangent,
            state,
            np.zeros(body.point_count),
        )

    def save(self, path: str | Path) -> None:
        """Write a checkpoint, replaced in one move."""
        from ...errors import StorageError

        states: dict[str, Any] = {f"state_{k}": v for k, v in self.state.items()}
        place = Path(path)
        part = place.with_name(place.name + ".part")
        try:
            with part.open("wb") as file:
                np.savez(
                    file,
                    time=self.time, displacement=self.displacement, force=self.force, strain=self.strain, stress=self.stress,
                    tangent=self.tangent, dissipation=self.dissipation, **states,  # type: ignore[arg-type]
                )  # fmt: skip
            part.replace(place)
        except OSError as error:
            part.unlink(missing_ok=True)
            raise StorageError(f"cannot write the checkpoint {str(path)!r}: {error.strerror}") from error

    @classmethod
    def load(cls, path: str | Path, body: Body) -> Equilibrium:
        """Read a checkpoint of this body; going on from it gives the same numbers as never having stopped."""
        try:
            with np.load(path, allow_pickle=False) as data:
                found = {k: data[k] for k in data.files}
        except (OSError, ValueError, EOFError) as error:
            raise InputError(f"checkpoint {str(path)!r} cannot be read: {error}") from error
        wanted = {f"state_{k}" for k in body.update.layout}
        fields = {"time", "displacement", "force", "strain", "stress", "tangent", "dissipation"}
        if (
            set(found) != fields | wanted
            or found["displacement"].shape != (body.basis.N,)
            or len(found["stress"]) != body.point_count
        ):
            raise InputError(f"checkpoint {str(path)!r} belongs to another body (other mesh, element or law)")
        state = {k.removeprefix("state_"): found[k] for k in wanted}
        return cls(float(found["time"]), **{k: found[k] for k in fields - {"time"}}, state=state)


def walk(
    body: Body,
    times: Any,
    supports: Sequence[Support] = (),
    pressures: Sequence[Pressure] = (),
    *,
    start: Equilibrium | None = None,
    tolerance: float = 1e-9,
    limit: int = 25,
    checkpoint: str | Path | None = None,
) -> Iterator[Equilibrium]:
    """Equilibrium at every time [s], one after the other, from `start` (virgin if None, at the first of `times`).

    `tolerance` is on the free part of the residual, relative to the largest of the internal and external forces; `limit` on Newton steps
    per attempt. A step that does not converge, or whose law fails at a point, is halved up to 10 times; then `ConvergenceError` says when
    and how far. With `checkpoint` every state is written to that file.
    """
    found = [float(t) for t in times]
    if len(found) < 2 or not all(b > a for a, b in pairwise(found)):
        raise InputError("times must be at least two increasing numbers")
    task = _Task(body, tuple(supports), tuple(pressures), tolerance, limit)
    state = Equilibrium.virgin(body, found[0]) if start is None else start
    for goal in (t for t in found if t > state.time):
        state = task.advance(state, goal)
        if checkpoint is not None:
            state.save(checkpoint)
        yield state


def solve(
    body: Body,
    times: Any,
    supports: Sequence[Support] = (),
    pressures: Sequence[Pressure] = (),
    **options: Any,
) -> list[Equilibrium]:
    """All equilibria of `walk`, in a list."""
    return list(walk(body, times, supports, pressures, **options))


class _Task:
    def __init__(
        self, body: Body, supports: tuple[Support, ...], pressures: tuple[Pressure, ...], tolerance: float, limit: int
    ) -> None:
        self.body, self.tolerance, self.limit = body, tolerance, limit
        self.held, self.parts = supported(body, supports)
        self.free = np.setdiff1d(np.arange(body.basis.N), self.held)
        self.pressures = [(nodal_pressure(body, p.where), p.value) for p in pressures]

    def prescribed(self, time: float) -> Array:
        """Displacements of the supports; zero elsewhere."""
        found = np.zeros(self.body.basis.N)
        for dofs, history in self.parts:
            found[dofs] = at_time(history, time)
        return found

    def load(self, time: float) -> Array:
        """Nodal forces of the pressures."""
        return sum((at_time(value, time) * unit for unit, value in self.pressures), np.zeros(self.body.basis.N))

    def advance(self, state: Equilibrium, goal: float) -> Equilibrium:
        """Equilibrium at `goal`, in as many halved steps as it takes."""
        whole = goal - state.time
        step, iterations = whole, 0
        while state.time < goal:
            target = goal if state.time + step > goal - 1e-12 * whole else state.time + step
            try:
                state = self.step(state, target)
            except ConvergenceError as error:
                step *= 0.5
                if step < whole * 0.5**MAXIMUM_CUTS:
                    raise ConvergenceError(
                        f"no equilibrium at time {target:g} after {MAXIMUM_CUTS} cuts of the step: {error}"
                    ) from None
                continue
            iterations += state.iterations
            step = min(2.0 * step, whole)
        return replace(state, iterations=iterations)

    def step(self, old: Equilibrium, time: float) -> Equilibrium:
        """One attempt."""
        external = self.load(time)
        change = np.zeros_like(old.displacement)
        change[self.held] = (self.prescribed(time) - old.displacement)[self.held]
        stiffness = self.body.stiffness(old.tangent)
        right = external - old.force - stiffness @ change
        change[self.free] = self._solved(stiffness, right)
        displacement, history = old.displacement + change, []
        out = self._stress(displacement, old, time)
        for turn in range(1, self.limit + 1):
            force = self.body.internal_force(out.stress)
            rest = (external - force)[self.free]
            scale = max(
                float(np.linalg.norm(force)),
                float(np.linalg.norm(external)),
                self._rounding(displacement, out) / self.tolerance,
            )
            size = float(np.linalg.norm(rest))
            history.append(size / scale if scale > 0.0 else 0.0)
            if size <= self.tolerance * scale:
                return Equilibrium(
                    time, displacement, force, self.body.strain(displacement), out.stress, out.tangent, out.state,
                    old.dissipation + out.dissipation, history[-1], turn, tuple(history),
                )  # fmt: skip
            direction = np.zeros_like(displacement)
            direction[self.free] = self._solved(self.body.stiffness(out.tangent), external - force)
            displacement, out = self._searched(displacement, direction, rest, old, time, external)
        raise ConvergenceError(f"Newton stops at a relative residual of {history[-1]:.1e} after {self.limit} steps")

    def _searched(
        self, start: Array, direction: Array, rest: Array, old: Equilibrium, time: float, external: Array
    ) -> tuple[Array, Any]:
        first = float(direction[self.free] @ rest)
        low, up, factor = 0.0, -1.0, 1.0
        best: tuple[Array, Any] | None = None
        for _ in range(12):
            trial = start + factor * direction
            try:
                out = self._stress(trial, old, time)
            except ConvergenceError:
                up, factor = factor, 0.5 * (low + factor)
                continue
            slope = float(direction @ (external - self.body.internal_force(out.stress)))
            best = (trial, out)
            if abs(slope) <= LINE_SEARCH * abs(first) or (slope > 0.0 and up < 0.0):
                break
            low, up = (factor, up) if slope > 0.0 else (low, factor)
            factor = 0.5 * (low + up)
        if best is None:
            raise ConvergenceError("the law has no answer anywhere along the Newton direction")
        return best

    def _stress(self, displacement: Array, old: Equilibrium, time: float) -> Any:
        return self.body.update(self.body.strain(displacement), old.state, dt=time - old.time, **self.body.values)

    def _rounding(self, displacement: Array, out: Any) -> float:
        """Force that rounding of strain times stiffness makes."""
        stiff = np.abs(out.tangent).max(axis=(1, 2)) * np.abs(self.body.strain(displacement)).max(axis=1)
        return 1e-15 * float(
            np.linalg.norm(
                np.abs(self.body.strain_matrix).T @ np.repeat(self.body.weights * stiff, self.body.components)
            )
        )

    def _solved(self, stiffness: Any, right: Array) -> Array:
        if self.free.size == 0:
            return np.zeros(0)
        singular = "the tangent stiffness is singular: the body is not held, or a limit load is reached under prescribed forces"
        try:
            factors = sla.splu(stiffness[self.free][:, self.free].tocsc(), permc_spec="MMD_AT_PLUS_A")
        except RuntimeError:
            raise ConvergenceError(singular) from None
        pivots = np.abs(factors.U.diagonal())
        if pivots.min() <= SINGULAR * pivots.max():
            raise ConvergenceError(singular)
        found = factors.solve(right[self.free])
        return found
