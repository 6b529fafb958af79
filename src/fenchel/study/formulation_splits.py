"""Claim 9: the response does not depend on which strain is the state variable.

Total strain: the compiled step. Reversible strain: ψ̂(ε^r, ε^p, α, p) = ψ(ε^r + ε^p, …) is declared anew; its stress σ =
∂ψ̂/∂ε^r is that of sand and wires together, and the wires pull on ε^p by Â = −∂ψ̂/∂ε^p at fixed ε^r. One implicit step solves

    ε^r + ε^p = ε,   (Δε^p, Δα) = γ ∂f(σ + Â, χ, R),   f = 0,   Δp = γ,

by Newton's method with difference quotients, beginning at γ = 0; at the apex of the cone, where f has no gradient, dev(σ + Â + χ) = 0,
Δε^p = Δα and tr Δε^p = γ tan θ_f take the place of the flow rule. Nothing of the compiled step is used. A third run drives the
same law by the stresses of the first, with ψ* in the place of ψ.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import ConvergenceError
from ..potentials.derivative import partial
from ..potentials.library import ENTRIES, Entry
from .formulation_dissipation import reversible_law
from .formulation_states import DEVIATOR, IDENTITY, Array, Numbers, corners, size_of

__all__ = ["responses"]

LAWS = ("sand", "reinforced_sand", "texsol")


class _ReversibleStep:
    """The step in the reversible strain at n points; unknowns (Δε^p, Δα, γ)."""

    def __init__(self, entry: Entry) -> None:
        law = entry.law
        self.values, self.numbers = entry.values, Numbers(reversible_law(law), entry.values)
        self.surface = Numbers(law, entry.values)
        self.eps_p, self.alpha, self.p = law.internal
        self.A, self.chi, self.R = (law.forces[v] for v in law.internal)
        self.f = law.surfaces[0]
        self.normals = partial(self.f, self.A), partial(self.f, self.chi)
        self.unit = entry.values["E_s"]

    def at(self, strain: Array, old: dict[str, Array], z: Array) -> tuple[Array, dict[str, Array], dict[Any, Array]]:
        """Stress, state and forces."""
        flow, change, gamma = z[:, :6], z[:, 6:12], z[:, 12]
        state = {"eps_p": old["eps_p"] + flow, "alpha": old["alpha"] + change, "p": old["p"] + gamma}
        state["eps_r"] = strain - state["eps_p"]
        stress = self.numbers.stress(state)
        pull, chi, R = (self.numbers.force(v, state) for v in (self.eps_p, self.alpha, self.p))
        return stress, state, {self.A: stress + pull, self.chi: chi, self.R: R}

    def cone(self, strain: Array, old: dict[str, Array], z: Array) -> Array:
        """What is left of the flow rule and of f = 0."""
        forces = self.at(strain, old, z)[2]
        flow = [z[:, 6 * k : 6 * k + 6] - z[:, 12:] * self.surface(m, {}, forces) for k, m in enumerate(self.normals)]
        return np.column_stack([*flow, self.surface(self.f, {}, forces) / self.unit])

    def apex(self, strain: Array, old: dict[str, Array], z: Array) -> Array:
        """The same at the apex."""
        forces = self.at(strain, old, z)[2]
        B, t = forces[self.A] + forces[self.chi], np.tan(self.values["theta_f"])
        f = t / 3 * (B @ IDENTITY) + forces[self.R] - self.values["C_0"]
        dilation = z[:, :6] @ IDENTITY - t * z[:, 12]
        return np.column_stack(
            [z[:, :6] - z[:, 6:12], B @ DEVIATOR / self.unit + dilation[:, None] * IDENTITY, f / self.unit]
        )

    def __call__(self, strain: Array, old: dict[str, Array]) -> tuple[Array, dict[str, Array], Array]:
        """Stress and state at the end of the step, and which points are at the apex; `ConvergenceError` if there is no solution."""
        n, size = len(strain), float(np.abs(strain).max())
        z, apex = np.zeros((n, 13)), np.zeros(n, dtype=bool)
        flowing = self.surface(self.f, {}, self.at(strain, old, z)[2]) > 0.0
        for kind, residual in (("cone", self.cone), ("apex", self.apex)):
            rows = np.flatnonzero(flowing)
            if not rows.size:
                break
            part = {k: v[rows] for k, v in old.items()}

            def repeated(y: Array, r: Any = residual, s: Array = strain[rows], o: dict[str, Array] = part) -> Array:
                m = len(y) // len(s)
                return r(np.tile(s, (m, 1)), {k: np.tile(v.T, m).T for k, v in o.items()}, y)

            found = _newton(repeated, len(rows), size)
            misfit = np.abs(residual(strain[rows], part, found)).max(axis=1)
            deviator = size_of(found[:, :6] @ DEVIATOR) * np.sqrt(2.0)
            fits = (misfit <= 1e-12 * size) & (found[:, 12] > 0) & (deviator <= found[:, 12] * (1 + 1e-9))
            forces = self.at(strain[rows], part, found)[2]
            B = forces[self.A] + forces[self.chi]
            fits &= ((found[:, :6] @ DEVIATOR) * B).sum(axis=1) >= -1e-9 * size * self.values["C_0"]
            z[rows[fits]], flowing[rows[fits]] = found[fits], False
            apex[rows[fits]] = kind == "apex"
        if flowing.any():
            raise ConvergenceError(f"the step in the reversible strain has no solution at {int(flowing.sum())} points")
        stress, state, _ = self.at(strain, old, z)
        return stress, {k: state[k] for k in old}, apex


def _newton(residual: Callable[[Array], Array], count: int, size: float) -> Array:
    """Newton's method at `count` points together, from zero; the derivatives by central differences, in one call."""
    width = 13
    z, h = np.zeros((count, width)), 1e-6 * size
    for _ in range(25):
        moved = np.concatenate([z + d for d in h * np.vstack([np.eye(width), -np.eye(width)])])
        there, back = residual(moved).reshape(2, width, count, width)
        jacobian = np.moveaxis(there - back, 0, 2) / (2 * h)
        step = np.stack([np.linalg.lstsq(j, -r, rcond=1e-13)[0] for j, r in zip(jacobian, residual(z), strict=True)])
        z = z + step
        if np.abs(step).max() <= 1e-14 * size:
            break
    return z


def _paths(entry: Entry, rng: np.random.Generator, paths: int, steps: int) -> Array:
    """Random strain paths (3·steps + 6, paths, 6) that end in an isotropic extension, where sand stands at the apex of its cone."""
    strains = np.stack([corners(entry, rng, 3, steps) for _ in range(paths)], axis=1)
    extension = np.linspace(0.0, 8e-3, 7)[1:, None, None] * IDENTITY
    return np.concatenate([strains, strains[-1] + extension])


def _law(entry: Entry, rng: np.random.Generator, paths: int, steps: int) -> dict[str, float]:
    strains = _paths(entry, rng, paths, steps)
    step, compiled = _ReversibleStep(entry), entry.law.compile()
    dual = entry.law.compile(formulation="stress")
    state = dual_state = compiled.initial_state(paths)
    old, apex = {k: v.copy() for k, v in state.items()}, 0
    worst, largest, flow = {"stress": 0.0, "state": 0.0, "strain": 0.0}, 0.0, 0.0
    for strain in strains:
        out = compiled(strain, state, **entry.values)
        stress, old, at_apex = step(strain, old)
        other = dual(out.stress, dual_state, **entry.values)
        largest = max(largest, float(size_of(out.stress).max()))
        size = float(size_of(strains.reshape(-1, 6)).max())
        worst["stress"] = max(worst["stress"], float(size_of(stress - out.stress).max()) / largest)
        worst["state"] = max(worst["state"], float(size_of(old["eps_p"] - out.state["eps_p"]).max()) / size)
        worst["strain"] = max(worst["strain"], float(size_of(other.strain - strain).max()) / size)
        state, dual_state, apex = out.state, other.state, apex + int(at_apex.sum())
        flow = float(out.state["p"].min())
    return worst | {"apex": apex, "least p": flow}


def responses(seed: int, paths: int, steps: int) -> dict[str, Any]:
    """Claim 9 along `paths` random paths of each model, 3 pieces of `steps` steps and an extension."""
    rng = np.random.default_rng(seed)
    found = {name: _law(ENTRIES[name], rng, paths, steps) for name in LAWS}
    numbers = {k: max(f[k] for f in found.values()) for k in ("stress", "state", "strain")}
    numbers |= {"apex": min(f["apex"] for f in found.values()), "steps": len(LAWS) * paths * (3 * steps + 6)}
    numbers["least p"] = min(f["least p"] for f in found.values())
    return {"numbers": numbers, "by law": found}
