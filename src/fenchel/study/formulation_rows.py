"""Claims 7 and 8: every row of the table of laws, and the sign in its column of force functions, on a metal that conducts heat.

`thermo_elasto_plastic` has all rows: ψ(ε, ε^p, p, T) and φ* = I{√(3/2) ‖dev A‖ + R ≤ σ_y} + k|∇T|²/2T. State laws of compiled
steps are held against differences of ψ and of its supremum ψ*. That the rates lie in ∂φ* and the forces in ∂φ is tested by what it means,

    φ*(F′) ≥ φ*(F) + rate·(F′ − F),   φ(r′) ≥ φ(r) + F·(r′ − r),   slot by slot, and φ + φ* = Σ force·rate,

with φ = σ_y ṗ + T|j|²/2k on tr ε̇^p = 0, ‖ε̇^p‖ ≤ √(3/2) ṗ, written here (Moreau 1970; Fourier 1822). By the envelope theorem
the conjugate of φ in its first slot alone has ∂φ*₁/∂α̇ = −A in the others, where the total conjugate has ∂φ*/∂A = +α̇: the signs
differ, both are right.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..potentials import partial_conjugate, rates, scalar, total_conjugate
from ..potentials.evaluate import evaluate
from ..potentials.library import ENTRIES
from .formulation_dissipation import reversible_law
from .formulation_states import (
    DEVIATOR,
    IDENTITY,
    Array,
    Numbers,
    difference,
    dot,
    magnitude,
    random_states,
    size_of,
    supremum,
)

__all__ = ["rows_of_table", "signs_of_forces"]

LAW = "thermo_elasto_plastic"
PRINTED = {
    ("strain", "total"): ("sig_r = dpsi/deps =", "-s = dpsi/dT =", "A = -dpsi/deps_p =", "R = -dpsi/dp ="),
    ("strain", "reversible"): ("sig = dpsi/deps_r =", "-s = dpsi/dT =", "A_r = -dpsi/deps_p =", "R = -dpsi/dp ="),
    ("stress", "total"): ("eps = dpsi_star/dsig =", " s = dpsi_star/dT =", "A = dpsi_star/deps_p =", "R = dpsi_star/dp ="),
    ("stress", "reversible"): ("eps_r = dpsi_star/dsig =", " s = dpsi_star/dT =", "A_r = dpsi_star/deps_p =", "R = dpsi_star/dp ="),
}  # fmt: skip
ALWAYS = (
    "in dphi/d(deps_p/dt)", "R in dphi/d(dp/dt)", "grad_T = dphi/d(-q/T)", "inner(-q/T, grad_T) >= 0", "-q/T = k/T*grad_T",
    "(deps_p/dt, dp/dt, -q/T) in dphi_star(A, R, grad_T)",
)  # fmt: skip


class _Steps:
    """One compiled step at n points from different plastic states, with a temperature and its gradient."""

    def __init__(self, rng: np.random.Generator, n: int) -> None:
        entry = ENTRIES[LAW]
        self.entry, self.law, self.values = entry, entry.law, entry.values
        update, start, end = entry.law.compile(), random_states(entry, rng, n), random_states(entry, rng, n)
        self.T, self.gradient = end["T"], 100.0 * rng.normal(size=(n, 3))
        old = update(1.5 * start["eps"], None, 1.0, **entry.values, T=start["T"]).state
        out = update(1.5 * end["eps"], old, 1.0, **entry.values, T=self.T, grad_T=self.gradient)
        self.state = {"eps": 1.5 * end["eps"], "T": self.T, **out.state}
        self.flow, self.growth = out.state["eps_p"] - old["eps_p"], out.state["p"] - old["p"]
        self.stress, self.entropy, self.flux = out.stress, out.entropy, out.flux
        numbers = Numbers(entry.law, entry.values)
        self.numbers = {"total": numbers, "reversible": Numbers(reversible_law(entry.law), entry.values)}
        self.A, self.R = (numbers.force(v, self.state) for v in entry.law.internal)
        self.size = magnitude(entry)

    def phi(self, flow: Array, growth: Array, flux: Array) -> Array:
        """The dissipation potential, written out."""
        trace = np.abs(flow @ IDENTITY) > 1e-9 * (size_of(flow) + 1e-3 * self.size)
        outside = size_of(flow) > np.sqrt(1.5) * growth * (1 + 1e-9) + 1e-15 * self.size
        finite = self.values["sigma_y"] * growth + self.T * dot(flux, flux) / (2 * self.values["k"])
        return np.where(trace | outside, np.inf, finite)

    def yielding(self, A: Array, R: Array) -> Array:
        """f."""
        return np.sqrt(1.5) * size_of(A @ DEVIATOR) + R - self.values["sigma_y"]

    def phi_star(self, A: Array, R: Array, gradient: Array) -> Array:
        """The force function, written out."""
        outside = self.yielding(A, R) > 1e-9 * self.values["sigma_y"]
        return np.where(outside, np.inf, self.values["k"] * dot(gradient, gradient) / (2 * self.T))


def _worst(residual: Array, scale: Any) -> float:
    return float(np.nan_to_num(np.abs(residual) / scale, nan=np.inf).max())


def _state_laws(s: _Steps, split: str, rng: np.random.Generator) -> dict[str, float]:
    """Residual of each state law of a split, in the strain form and the stress form, by differences along random directions."""
    numbers = s.numbers[split]
    name = numbers.law.observable.name
    strain = s.state["eps"] - (s.state["eps_p"] if split == "reversible" else 0.0)
    state = {**s.state, name: strain}
    force = {"eps_p": np.zeros_like(s.A) if split == "reversible" else s.A, "p": s.R}
    unit = {name: s.size, "eps_p": s.size, "p": s.size, "T": 20.0}
    slopes = {name: s.stress, "T": -s.entropy, **{k: -v for k, v in force.items()}}
    found = {}
    for key, slope in slopes.items():
        along = rng.normal(size=np.shape(state[key]))
        step = unit[key] * along
        size = size_of(slope) * size_of(along) + 1e-3 * size_of(s.stress) * (s.size / unit[key])
        psi = difference(lambda t, key=key, d=step: numbers.energy({**state, key: state[key] + t * d}), 0.05)
        found[f"strain, {key}"] = _worst(psi / unit[key] - dot(slope, along), size)
        if key == name:  # ε = ∂ψ*/∂σ
            step = size_of(s.stress)[:, None] * along
            star = difference(lambda t, d=step: supremum(numbers, s.stress + t * d, state, strain)[0], 0.05)
            found[f"stress, {key}"] = _worst(star - dot(strain, step), size_of(strain) * size_of(step))
            continue
        star = difference(
            lambda t, key=key, d=step: supremum(numbers, s.stress, {**state, key: state[key] + t * d}, strain)[0], 0.05
        )
        found[f"stress, {key}"] = _worst(star / unit[key] + dot(slope, along), size)
    return found


def _admissible_force(s: _Steps, rng: np.random.Generator) -> Array:
    """Any A with f(A, R) ≤ 0, with a mean stress."""
    A = s.values["sigma_y"] * rng.normal(size=s.A.shape)
    room = (s.values["sigma_y"] - s.R) / (np.sqrt(1.5) * size_of(A @ DEVIATOR))
    return A @ DEVIATOR * (rng.random(len(A)) ** 0.2 * np.minimum(room, 1.0))[:, None] + (A @ (np.eye(6) - DEVIATOR))


def _complementary(s: _Steps, rng: np.random.Generator) -> dict[str, float]:
    """How far the inclusions of rates and forces are broken, slot by slot, over the power of the step."""
    n, here = len(s.T), s.phi(s.flow, s.growth, s.flux)
    there = s.phi_star(s.A, s.R, s.gradient)
    power = dot(s.A, s.flow) + s.R * s.growth + dot(s.gradient, s.flux)
    scale = size_of(s.A) * size_of(s.flow) + np.abs(s.R * s.growth) + dot(s.gradient, s.flux)
    found = {"phi + phi*": _worst(here + there - power, scale), "power": float((-power / scale).max())}

    def broken(above: Array) -> float:  # −∞ where the other point is outside
        return float(np.nan_to_num(-above / scale, nan=np.inf, neginf=0.0).max())

    names = {"rate, eps_p": 0.0, "rate, p": 0.0, "rate, T": 0.0, "force, eps_p": 0.0, "force, p": 0.0, "force, T": 0.0}
    for _ in range(20):
        flow = rng.normal(size=s.flow.shape) @ DEVIATOR
        flow *= (np.sqrt(1.5) * s.growth * rng.random(n) ** 0.2 / size_of(flow))[:, None]
        growth = size_of(s.flow) / np.sqrt(1.5) + s.size * rng.exponential(size=n)
        flux, gradient = (size_of(a)[:, None] * rng.normal(size=(n, 3)) for a in (s.flux, s.gradient))
        A, R = _admissible_force(s, rng), s.R - s.yielding(s.A, s.R) - s.values["sigma_y"] * rng.exponential(size=n)
        trial = {
            "rate, eps_p": s.phi(flow, s.growth, s.flux) - here - dot(s.A, flow - s.flow),
            "rate, p": s.phi(s.flow, growth, s.flux) - here - s.R * (growth - s.growth),
            "rate, T": s.phi(s.flow, s.growth, flux) - here - dot(s.gradient, flux - s.flux),
            "force, eps_p": s.phi_star(A, s.R, s.gradient) - there - dot(s.flow, A - s.A),
            "force, p": s.phi_star(s.A, R, s.gradient) - there - s.growth * (R - s.R),
            "force, T": s.phi_star(s.A, s.R, gradient) - there - dot(s.flux, gradient - s.gradient),
        }
        names = {k: max(v, broken(trial[k])) for k, v in names.items()}
    fourier = -s.values["k"] * s.gradient + s.T[:, None] * s.flux  # q = −T j = −k ∇T
    return found | names | {"fourier": _worst(size_of(fourier), s.values["k"] * size_of(s.gradient))}


def rows_of_table(seed: int, count: int) -> dict[str, Any]:
    """Claim 7 at `count` steps."""
    rng = np.random.default_rng(seed)
    s = _Steps(rng, count)
    states = {split: _state_laws(s, split, rng) for split in ("total", "reversible")}
    inclusions = _complementary(s, rng)
    driving = _worst(size_of(s.stress - s.A), size_of(s.stress))  # block 1 is driven by σ + Â, Â = 0 without wires
    missing = 0
    for (formulation, split), lines in PRINTED.items():
        text = s.law.table(formulation, split).text()
        missing += sum(line not in text for line in (*lines, *ALWAYS))
    numbers = {
        "state": max(v for rows in states.values() for v in rows.values()),
        "inclusions": max(v for k, v in inclusions.items() if k != "power"),
        "negative": inclusions["power"],
        "driving": driving,
        "missing": missing,
        "rows": sum(map(len, states.values())) + 6,
        "plastic": float((s.growth > 0).mean()),
        "steps": count,
    }
    return {"numbers": numbers, "by row": {**states, "complementary": inclusions}}


# -- claim 8 --------------------------------------------------------------------------------------------------------------------


def _apart(found: Array, wanted: Array) -> float:
    return float(size_of(found - wanted).max() / size_of(wanted).max())


def _quadratic(rng: np.random.Generator) -> dict[str, float]:
    """φ = a/2 x² + b x y + c/2 y²: slopes in the second slot of both conjugates, by differences, and their curvature."""
    x, y = rates(scalar("x"), scalar("y"))
    a, c = 0.5 + 2.0 * rng.random(2)
    b = 0.9 * np.sqrt(a * c) * (2.0 * rng.random() - 1.0)
    phi = a / 2 * x**2 + b * x * y + c / 2 * y**2
    one, both = partial_conjugate(phi, x, names="s"), total_conjugate(phi, x, y, names="s A")
    (s,), (s_both, force) = one.duals.values(), both.duals.values()
    x_n, y_n = rng.normal(size=(2, 20))
    s_n, A_n = a * x_n + b * y_n, b * x_n + c * y_n

    def slope(function: Callable[[Array], Array], at: Array) -> tuple[Array, Array]:
        return difference(lambda t: function(at + t), 0.05), function(at + 1.0) + function(at - 1.0) - 2 * function(at)

    first, bend = slope(lambda v: one.value({s: s_n, y: v}), y_n)
    second, other = slope(lambda v: both.value({s_both: s_n, force: v}), A_n)
    return {
        "partial": _apart(first, -A_n),
        "total": _apart(second, y_n),
        "printed, total": _apart(second, -y_n),
        "bend": float(max(bend.max(), -other.min())),  # concave where not exchanged, convex where exchanged
    }


def _of_law(rng: np.random.Generator, n: int) -> dict[str, float]:
    """The same of the metal: slopes of both conjugates of its φ in ṗ, j and ∇T, and φ by the rules against the steps."""
    s = _Steps(rng, n)
    one, both = partial_conjugate(s.law, potential="dissipation"), total_conjugate(s.law)
    parameters = Numbers(s.law, s.values).values | {s.law.temperature: s.T}
    dual = {v: both.duals[s.law.forces[v]] for v in (*s.law.internal, s.law.temperature)}
    plastic = s.growth > 0
    rows: Mapping[Any, Any] = {
        **parameters, s.law.forces[s.law.internal[0]]: s.A, dual[s.law.internal[1]]: s.growth, dual[s.law.temperature]: s.flux,
    }  # fmt: skip

    def along(symbol: Any, step: Array) -> Array:
        return difference(lambda t: one.value({**rows, symbol: rows[symbol] + t * step}), 0.05)

    growth = along(dual[s.law.internal[1]], s.growth)[plastic] / s.growth[plastic]
    direction = size_of(s.flux)[:, None] * rng.normal(size=s.flux.shape)
    heat = along(dual[s.law.temperature], direction)
    gradient, push = s.law.forces[s.law.temperature], size_of(s.gradient)[:, None] * rng.normal(size=s.gradient.shape)
    force = {**parameters, gradient: s.gradient}
    slope = difference(lambda t: evaluate(s.law.viscous, {**force, gradient: s.gradient + t * push}), 0.05)
    rule = both.value({**parameters, **dict(zip(dual.values(), (s.flow, s.growth, s.flux), strict=True))})
    return {
        "partial": max(_apart(growth, -s.R[plastic]), _apart(heat, -dot(s.gradient, direction))),
        "total": _apart(slope, dot(s.flux, push)),
        "printed, total": _apart(slope, -dot(s.flux, push)),
        "phi": _worst(rule - s.phi(s.flow, s.growth, s.flux), np.abs(rule)),
    }


def signs_of_forces(seed: int, count: int, potentials: int) -> dict[str, Any]:
    """Claim 8 at `count` steps of the metal and for `potentials` random quadratic ones."""
    rng = np.random.default_rng(seed)
    tables = [_quadratic(rng) for _ in range(potentials)]
    law = _of_law(rng, count)
    numbers = {
        "partial": max(t["partial"] for t in (*tables, law)),
        "total": max(t["total"] for t in (*tables, law)),
        "printed, total": min(t["printed, total"] for t in (*tables, law)),
        "bend": max(t["bend"] for t in tables),
        "phi": law["phi"],
        "potentials": potentials,
        "steps": count,
    }
    return {"numbers": numbers, "law": law}
