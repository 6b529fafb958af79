"""Claim 15: the implicit step is a convex minimisation, and its dual a projection (Moreau 1976; Simo and Hughes 1998).

With A = 𝕂_s(ε − ε^p), χ = −H_k α, R = −H_i p, over a step to ε from ε^p_n, α_n, p_n, the wires apart,

    P(z) = ½ (ε − ε^p_n − Δ):𝕂_s(ε − ε^p_n − Δ) + H_k/2 ‖α_n + Δ‖² + H_i/2 (p_n + δ)² + C_0 δ,    tr Δ = tδ, √2 ‖dev Δ‖ ≤ δ,
    D(Σ) = A:(ε − ε^p_n) − ½ A:𝕂_s⁻¹A − χ:α_n − ‖χ‖²/2H_k − R p_n − R²/2H_i,                       f(A, χ, R) ≤ 0.

P ≥ D, equal at the solution. P and −D are strongly convex in the metrics of 𝕂_s, H_k, H_i and of their inverses, so that for any
admissible pair the gap P − D is at least the sum of both squared errors, ½‖z − z*‖² + ½‖Σ − Σ*‖².
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..potentials.library import ENTRIES, Entry
from .formulation_states import (
    DEVIATOR,
    IDENTITY,
    Array,
    Numbers,
    corners,
    dot,
    elasticity,
    given_heat,
    size_of,
    warmth,
)

__all__ = ["projections"]

Generator = np.random.Generator


@dataclass(frozen=True)
class _Sand:
    """P and D at n points: `strain` less ε^p_n, `alpha` and `p` at the start."""

    values: Any
    strain: Array
    alpha: Array
    p: Array

    @property
    def stiffness(self) -> Array:
        """𝕂_s."""
        young, poisson = self.values["E_s"], self.values["nu_s"]
        return elasticity(young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson)))

    @property
    def t(self) -> float:
        """tan θ_f."""
        return float(np.tan(self.values["theta_f"]))

    def primal(self, flow: Array, growth: Array) -> Array:
        """P."""
        v, e = self.values, self.strain - flow
        stored = dot(e, e @ self.stiffness) / 2 + v["H_k"] / 2 * dot(self.alpha + flow, self.alpha + flow)
        return stored + v["H_i"] / 2 * (self.p + growth) ** 2 + v["C_0"] * growth

    def dual(self, A: Array, chi: Array, R: Array) -> Array:
        """D."""
        v, compliance = self.values, np.linalg.inv(self.stiffness)
        value = dot(A, self.strain) - dot(A, A @ compliance) / 2 - dot(chi, self.alpha) - dot(chi, chi) / (2 * v["H_k"])
        return value - R * self.p - R**2 / (2 * v["H_i"])

    def room(self, A: Array, chi: Array) -> Array:
        """The largest R with f ≤ 0."""
        B = A + chi
        return self.values["C_0"] - size_of(B @ DEVIATOR) / np.sqrt(2.0) - self.t / 3 * (B @ IDENTITY)

    def programs(self, i: int) -> tuple[float, float]:
        """Least P and greatest D at a point, by cone programs in units of C_0."""
        import cvxpy as cp

        unit, K, t = self.values["C_0"], self.stiffness, self.t
        h, k, mu = self.values["H_i"] / unit, self.values["H_k"] / unit, self.stiffness[5, 5] / 2 / unit
        flow, growth = cp.Variable(6), cp.Variable()
        root, inverse = (np.linalg.cholesky(m).T for m in (K / unit, np.linalg.inv(K / unit)))
        e, alpha, p = self.strain[i], self.alpha[i], self.p[i]
        stored = (
            cp.sum_squares(root @ (e - flow)) / 2 + k / 2 * cp.sum_squares(alpha + flow) + h / 2 * cp.square(p + growth)
        )
        rules = [cp.sum(flow[:3]) == t * growth, np.sqrt(2.0) * cp.norm(DEVIATOR @ flow, 2) <= growth]
        below = cp.Problem(cp.Minimize(mu * (stored + growth)), rules)
        A, chi, R = cp.Variable(6), cp.Variable(6), cp.Variable()
        B = A + chi
        f = cp.norm(DEVIATOR @ B, 2) / np.sqrt(2.0) + t / 3 * cp.sum(B[:3]) + R - 1.0
        value = (
            A @ e
            - cp.sum_squares(inverse @ A) / 2
            - chi @ alpha
            - cp.sum_squares(chi) / (2 * k)
            - R * p
            - cp.square(R) / (2 * h)
        )
        above = cp.Problem(cp.Maximize(mu * value), [f <= 0])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # asked for more than it can reach; what was reached is compared
            for problem in (below, above):
                problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-11, tol_gap_rel=1e-11, tol_feas=1e-11)
        return tuple(float(problem.value) / mu * unit for problem in (below, above))  # type: ignore[arg-type,return-value]


def _model(entry: Entry, rng: Generator, n: int) -> tuple[_Sand, dict[str, Array], dict[str, Array]]:
    """n steps of a model from different states, a third of them to the apex: P and D, the compiled (Δ, δ) and (A, χ, R)."""
    update, values = entry.law.compile(), entry.values
    old = update(0.5 * corners(entry, rng, n, 1), None, **values).state
    strain = corners(entry, rng, n, 1)
    strain[::3] += 20 * np.abs(strain[::3]).max(axis=1, keepdims=True) * IDENTITY
    out = update(strain, old, **values)
    numbers = Numbers(entry.law, values)
    here = {"eps": strain, **out.state}
    A, chi, R = (numbers.force(v, here) for v in entry.law.internal)
    problem = _Sand(values, strain - old["eps_p"], old["alpha"], old["p"])
    moved = {"flow": out.state["eps_p"] - old["eps_p"], "growth": out.state["p"] - old["p"]}
    moved["alpha"] = out.state["alpha"] - old["alpha"]
    return problem, moved, {"A": A, "chi": chi, "R": R}


def _return_map(name: str, rng: Generator, n: int, programs: int) -> dict[str, float]:
    """The compiled step of a model as a pair of P and D: its gap, how admissible it is, and both values against the programs."""
    problem, z, s = _model(ENTRIES[name], rng, n)
    above, below = problem.primal(z["flow"], z["growth"]), problem.dual(**s)
    size = np.abs(above) + dot(np.abs(s["A"]), np.abs(problem.strain))
    flows = np.maximum(np.abs(z["flow"] @ IDENTITY - problem.t * z["growth"]), size_of(z["flow"] - z["alpha"]))
    flows = np.maximum(flows, np.sqrt(2.0) * size_of(z["flow"] @ DEVIATOR) - z["growth"])
    apex = (size_of((s["A"] + s["chi"]) @ DEVIATOR) < 1e-6 * problem.values["C_0"]) & (z["growth"] > 0)
    outside, off = s["R"] - problem.room(s["A"], s["chi"]), 0.0
    for i in range(programs):
        least, greatest = problem.programs(i)
        off = max(off, abs(above[i] / least - 1.0), abs(below[i] / greatest - 1.0), (least - greatest) / abs(least))
    return {
        "gap": float((np.abs(above - below) / size).max()),
        "admissible": float(max((flows / size_of(problem.strain)).max(), (outside / size_of(s["A"])).max())),
        "programs": float(off),
        "apex": int(apex.sum()),
        "plastic": float((z["growth"] > 0).mean()),
    }  # fmt: skip


def _pairs(rng: Generator, n: int) -> dict[str, Array]:
    """Gap and squared error [J/m³] of n random admissible pairs, near the solution and far from it, on the cone and at the apex."""
    problem, z, s = _model(ENTRIES["sand"], rng, n)
    size = 10.0 ** rng.uniform(-4, 0, size=n)
    growth = np.abs(z["growth"] + 1e-3 * size * rng.normal(size=n))
    flow = (z["flow"] + 1e-3 * size[:, None] * rng.normal(size=(n, 6))) @ DEVIATOR
    flow *= np.minimum(1.0, growth / (np.sqrt(2.0) * size_of(flow)))[:, None]
    flow = flow + problem.t / 3 * growth[:, None] * IDENTITY
    unit = problem.values["C_0"] * size
    A, chi = (s[k] + unit[:, None] * rng.normal(size=(n, 6)) for k in ("A", "chi"))
    R = np.minimum(s["R"] + unit * rng.normal(size=n), problem.room(A, chi))
    gap = problem.primal(flow, growth) - problem.dual(A, chi, R)
    v, compliance = problem.values, np.linalg.inv(problem.stiffness)
    dz, dp, dA, dchi, dR = flow - z["flow"], growth - z["growth"], A - s["A"], chi - s["chi"], R - s["R"]
    error = dot(dz, dz @ problem.stiffness) + v["H_k"] * dot(dz, dz) + v["H_i"] * dp**2
    error += dot(dA, dA @ compliance) + dot(dchi, dchi) / v["H_k"] + dR**2 / v["H_i"]
    rounding = np.abs(problem.primal(z["flow"], z["growth"])) + dot(np.abs(s["A"]), np.abs(problem.strain))
    return {"gap": gap, "error": error / 2, "rounding": 1e-13 * rounding}


def _reference(entry: Entry, rng: Generator, n: int) -> dict[str, float]:
    """Compiled steps of a law against its cone program as clarabel leaves it: stress and state, and the certified gap over the energy."""
    law, dt, values = entry.law, entry.worked.dt, dict(entry.values) | warmth(entry.law)
    update = law.compile()
    old = update(0.5 * corners(entry, rng, n, 1), None, dt, **values).state
    strain = corners(entry, rng, n, 1)
    out = update(strain, old, dt, certify=True, **values)
    other = law.compile(solver="cvxpy", tangent=False)(strain, old, dt, **values)
    state = {
        law.observable.name: strain,
        **out.state,
        **given_heat(law, {k: np.full(n, v) for k, v in warmth(law).items()}),
    }
    energy = np.abs(Numbers(law, entry.values).energy(state)) + dot(np.abs(out.stress), np.abs(strain))
    flows = [size_of(out.state[k] - v) / size_of(strain) for k, v in other.state.items()]
    return {
        "gap": float((np.abs(out.gap) / energy).max()),
        "stress": float((size_of(out.stress - other.stress) / size_of(out.stress)).max()),
        "state": float(max(np.max(f) for f in flows)),
    }


def projections(seed: int, count: int, programs: int, reference: int) -> dict[str, Any]:
    """Claim 15: `count` steps of sand and texsol, `programs` of them by cone programs; `reference` steps of every law."""
    rng = np.random.default_rng(seed)
    maps = {name: _return_map(name, rng, count, programs) for name in ("sand", "texsol")}
    pairs = _pairs(rng, count)
    laws: dict[str, Any] = {}
    for name, entry in ENTRIES.items():
        if entry.law.internal:
            laws[name] = _reference(entry, rng, reference)
    numbers = {key: max(m[key] for m in maps.values()) for key in ("gap", "admissible", "programs")}
    numbers |= {
        "apex": min(m["apex"] for m in maps.values()),
        "plastic": min(m["plastic"] for m in maps.values()),
        "bound": float((pairs["error"] / (pairs["gap"] + pairs["rounding"])).max()),
        "certified": max(r["gap"] for r in laws.values()),
        "reference": max(r["stress"] for r in laws.values()),
        "laws": len(laws),
        "steps": count,
    }
    return {"numbers": numbers, "maps": maps, "by law": laws, "pairs": pairs}
