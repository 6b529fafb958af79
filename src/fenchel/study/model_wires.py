"""Claims 11 and 12: the energy of wires that resist extension only, ψ_w = λ/2 ⟨tr ε⟩² + μ ε^≥:ε^≥.

Strains are made from chosen principal values e and directions, so that the stress Q diag(λ⟨Σe⟩ + 2μ⟨e⟩) Qᵀ is known without an eigenvalue
solver. ψ_w is of degree two: ψ_w = ½ σ:ε and σ = D²ψ_w[ε] (Euler). Its conjugate is the supremum, as a semidefinite program, of

    s:ε − λ/2 t² − μ‖E‖²   over   E ⪰ ε, E ⪰ 0, t ≥ tr ε, t ≥ 0,

also where s is singular or has equal principal values. The work over a closed cycle is integrated piece by piece, between the
zeros of det ε (a cubic along a straight piece) and of tr ε, where the stress is analytic.
"""

from __future__ import annotations

import warnings
from itertools import pairwise
from typing import Any

import numpy as np

from ..potentials import unilateral_conjugate, unilateral_energy
from ..potentials.library import LAWS
from ..potentials.spectral import as_matrix, from_matrix, to_matrix
from .formulation_states import Array, difference, dot, elasticity, from_kinks, size_of
from .models import equivalent_stress

__all__ = ["closed_cycles", "wire_energy"]

LAMBDA, MU = 5e6 / 3, 2.5e6
CONJUGATES = {
    (1.0, 1.0, 1.0): 0.375,
    (3.0, 1.0, 0.2): 4.26,
    (1.0, 0.0, 0.0): 0.5,
    (2.0, 2.0, 0.1): 3.615,
    (1.0, 0.5, 0.5): 0.25,
}
STRAIN = np.array([2.0, 1.0, -15.0, 0.0, 0.0, 3.0 * np.sqrt(2.0)]) * 1e-4
STRESS = np.array([1321.99494, 948.69570, 0.0, 0.0, 0.0, 1119.89772 * np.sqrt(2.0)])
ENERGY = 0.5156035949


def _step(strains: Array) -> Any:
    return LAWS["wire"].compile()(strains, None, lambda_w=LAMBDA, mu_w=MU)


def _principal(rng: np.random.Generator, n: int) -> Array:
    """Principal strains (n, 3): a quarter all compression, a quarter with two equal, an eighth with three equal."""
    e = rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-4, -1, size=(n, 1))
    part = n // 8
    e[: 2 * part] = -np.abs(e[: 2 * part])
    e[2 * part : 4 * part, 1] = e[2 * part : 4 * part, 0]
    e[4 * part : 5 * part, 1:] = e[4 * part : 5 * part, :1]
    return e


def _turned(e: Array, q: Array) -> Array:
    return from_matrix(np.einsum("nik,nk,njk->nij", q, e, q))


def _derivatives(strain: Array, out: Any) -> dict[str, float]:
    """Stress and tangent against differences of the energy and of the stress, away from kinks; and Euler's relations, everywhere."""
    h = 1e-3
    clear = from_kinks(strain) > 20 * h * size_of(strain)
    near, size = strain[clear], size_of(strain[clear])
    energy, stress = unilateral_energy(strain, LAMBDA, MU), out.stress
    directions = np.eye(6)[:, None, :] * size[:, None]
    slope = np.stack(
        [difference(lambda t, d=d: unilateral_energy(near + t * d, LAMBDA, MU), h) for d in directions], axis=-1
    )
    columns = np.stack([difference(lambda t, d=d: _step(near + t * d).stress, h) for d in directions], axis=-1)
    stiff = MU * size_of(strain)
    return {
        "gradient": float((size_of(slope / size[:, None] - stress[clear]) / stiff[clear]).max()),
        "hessian": float(np.abs(columns / size[:, None, None] - out.tangent[clear]).max() / MU),
        "euler": float(
            max(
                (np.abs(dot(stress, strain) / 2 - energy) / (stiff * size_of(strain))).max(),
                (size_of(np.einsum("nij,nj->ni", out.tangent, strain) - stress) / stiff).max(),
            )
        ),
        "differentiable": float(clear.mean()),
    }


def _supremum(s: Array, lam: float, mu: float) -> float:
    """s:ε − ψ_w(ε) where a semidefinite program leaves ε; +∞ if it is unbounded."""
    import cvxpy as cp

    eps, part, t = cp.Variable(6), cp.Variable(6), cp.Variable(nonneg=True)
    value = s @ eps - lam / 2 * cp.square(t) - mu * cp.sum_squares(part)
    rows = [as_matrix(part) >> 0, as_matrix(part - eps) >> 0, t >= cp.sum(eps[:3])]
    problem = cp.Problem(cp.Maximize(value), rows)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # asked for more than it can reach; what was reached is compared
        problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-11, tol_gap_rel=1e-11, tol_feas=1e-11)
    if eps.value is None:
        return np.inf
    found = np.asarray(eps.value)
    return float(s @ found - unilateral_energy(found, lam, mu))


def _conjugates(rng: np.random.Generator, n: int) -> float:
    """Worst relative misfit of the closed conjugate: n stresses, some singular, some with equal principal values, a third with λ = 0."""
    q, _ = np.linalg.qr(rng.normal(size=(n, 3, 3)))
    s = np.abs(rng.normal(size=(n, 3)))
    s[::4, 2] = 0.0
    s[1::4, 1] = s[1::4, 0]
    s[2::4, :2] = 3.0 * s[2::4, 2:]
    worst = 0.0
    for i, stress in enumerate(_turned(s, q)):
        lam, mu = (0.0 if i % 3 == 0 else float(rng.uniform(0.2, 2.0))), float(rng.uniform(0.2, 2.0))
        exact = float(unilateral_conjugate(stress, lam, mu))
        worst = max(worst, abs(_supremum(stress, lam, mu) / exact - 1.0))
    return float(worst)


def _known() -> float:
    """Worst relative misfit of the regression values of the theory page."""
    found = [abs(float(unilateral_conjugate([*s, 0, 0, 0], 1.0, 0.5)) / value - 1.0) for s, value in CONJUGATES.items()]
    found.append(abs(float(unilateral_energy(STRAIN, LAMBDA, MU)) / ENERGY - 1.0))
    found.append(float(np.abs(_step(STRAIN[None]).stress[0] - STRESS).max() / np.abs(STRESS).max()))
    infinite = np.isinf(unilateral_conjugate([1.0, 1.0, -1.0, 0, 0, 0], 1.0, 0.5))
    return max(found) if infinite else np.inf


def wire_energy(seed: int, count: int, programs: int) -> dict[str, Any]:
    """Claim 11 at `count` strains and `programs` stresses."""
    rng = np.random.default_rng(seed)
    e, (q, _) = _principal(rng, count), np.linalg.qr(rng.normal(size=(count, 3, 3)))
    strain = _turned(e, q)
    out = _step(strain)
    exact = _turned(LAMBDA * np.maximum(e.sum(axis=1, keepdims=True), 0.0) + 2 * MU * np.maximum(e, 0.0), q)
    slack = (e <= 0.0).all(axis=1)
    both = strain @ elasticity(LAMBDA, MU)
    shear = equivalent_stress(out.stress) - equivalent_stress(both)
    pressure = -out.stress[:, :3].mean(axis=1) - np.minimum(0.0, -both[:, :3].mean(axis=1))
    young = (
        unilateral_energy(strain, LAMBDA, MU) + unilateral_conjugate(out.stress, LAMBDA, MU) - dot(out.stress, strain)
    )
    stiff = MU * size_of(strain)
    numbers = {
        "slack": float((size_of(out.stress) / stiff)[slack].max()),
        "stress": float((size_of(out.stress - exact) / stiff).max()),
        "fenchel": float(np.abs(young / (stiff * size_of(strain))).max()),
        "bounds": float(max((shear / stiff).max(), (pressure / stiff).max())),
        "conjugate": _conjugates(rng, programs),
        "known": _known(),
        "strains": count,
        "programs": programs,
    }
    return {"numbers": numbers | _derivatives(strain, out)}


# -- claim 12 -------------------------------------------------------------------------------------------------------------------


def _kinks(a: Array, b: Array) -> Array:
    """Times in (0, 1) at which det or tr of (1 − t) a + t b vanishes, with both ends."""
    nodes = np.array([0.0, 1 / 3, 2 / 3, 1.0])
    scale = np.abs([a, b]).max()
    determinants = np.linalg.det(to_matrix((a + nodes[:, None] * (b - a)) / scale))
    roots = np.roots(np.linalg.solve(np.vander(nodes), determinants))
    times = roots[np.abs(roots.imag) < 1e-9].real
    trace = (a[:3].sum(), b[:3].sum())
    times = np.append(times, trace[0] / (trace[0] - trace[1]))
    return np.sort(np.concatenate([[0.0], times[(times > 0.0) & (times < 1.0)], [1.0]]))


def closed_cycles(seed: int, cycles: int, sides: int) -> dict[str, Any]:
    """Claim 12: work of the wires over closed polygons of strain, over the work that passes to and fro."""
    rng = np.random.default_rng(seed)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    worst, lost, kinks = 0.0, 0.0, 0
    for _ in range(cycles):
        places = 1e-3 * rng.normal(size=(sides, 6))
        strains, rates, shares = [], [], []
        for a, b in zip(places, np.roll(places, -1, axis=0), strict=True):
            times = _kinks(a, b)
            kinks += len(times) - 2
            panels = np.concatenate([np.linspace(s, t, 16, endpoint=False) for s, t in pairwise(times)] + [[1.0]])
            for s, t in pairwise(panels):
                strains.append(a + (s + (t - s) * (nodes[:, None] + 1) / 2) * (b - a))
                rates.append(np.tile(b - a, (24, 1)))
                shares.append((t - s) / 2 * weights)
        out = _step(np.concatenate(strains))
        power = dot(out.stress, np.concatenate(rates)) * np.concatenate(shares)
        worst = max(worst, abs(float(power.sum())) / float(np.abs(power).sum()))
        lost = max(lost, float(np.abs(out.dissipation).max()))
    numbers = {"work": worst, "dissipation": lost, "kinks": kinks, "cycles": cycles, "sides": sides}
    return {"numbers": numbers}
