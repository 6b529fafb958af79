"""Laws of the library written a second time, in numpy and cvxpy, without fenchel: the truth that its tests are held against.

Formulas are those of the literature that the library names, in Mandel components (11, 22, 33, √2·23, √2·13, √2·12), tension positive.
A law is an energy ψ = Hooke(ε − ε^p) + couplings + hardening + wires(ε), surfaces f ≤ 0 and a finite (viscous) part of φ*. A law that
is not here is tested by what holds for every law.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

I6 = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
DEV = np.eye(6) - np.outer(I6, I6) / 3.0
ROOT2 = np.sqrt(2.0)


def matrix(mandel):
    """(…, 3, 3) from Mandel components (…, 6)."""
    a = np.asarray(mandel, dtype=float)
    out = np.empty((*a.shape[:-1], 3, 3))
    for i in range(3):
        out[..., i, i] = a[..., i]
    for place, (i, j) in zip((3, 4, 5), ((1, 2), (0, 2), (0, 1)), strict=True):
        out[..., i, j] = out[..., j, i] = a[..., place] / ROOT2
    return out


def mandel(m):
    """Mandel components of (…, 3, 3)."""
    return np.stack(
        [m[..., 0, 0], m[..., 1, 1], m[..., 2, 2], ROOT2 * m[..., 1, 2], ROOT2 * m[..., 0, 2], ROOT2 * m[..., 0, 1]],
        axis=-1,
    )


def turned(rng, eigenvalues):
    """Tensors with the given eigenvalues (…, 3) in random directions."""
    values = np.asarray(eigenvalues, dtype=float)
    q, _ = np.linalg.qr(rng.normal(size=(*values.shape[:-1], 3, 3)))
    return mandel(np.einsum("...ik,...k,...jk->...ij", q, values, q))


def lame(E, nu):
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def stiffness(lam, mu):
    return lam * np.outer(I6, I6) + 2 * mu * np.eye(6)


# -- wires (theory of the unilateral energy) -----------------------------------------------------------------------------------


def wire_energy(e, lam, mu):
    values = np.linalg.eigvalsh(matrix(e))
    return lam / 2 * np.maximum(values.sum(-1), 0) ** 2 + mu * (np.maximum(values, 0) ** 2).sum(-1)


def wire_stress(e, lam, mu):
    values, q = np.linalg.eigh(matrix(e))
    positive = mandel(np.einsum("...ik,...k,...jk->...ij", q, np.maximum(values, 0), q))
    return lam * np.maximum(values.sum(-1), 0)[..., None] * I6 + 2 * mu * positive


def wire_hessian(e, lam, mu):
    """λ H(tr) I⊗I + 2μ P[Θ ∘ (Pᵀ h P)]Pᵀ, Θ the divided differences of ⟨·⟩; one strain."""
    values, q = np.linalg.eigh(matrix(e))
    theta = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            a, b = values[i], values[j]
            theta[i, j] = float(a > 0) if a == b else (max(a, 0) - max(b, 0)) / (a - b)
    out = lam * float(values.sum() > 0) * np.outer(I6, I6)
    for k in range(6):
        h = matrix(np.eye(6)[k])
        out[:, k] += 2 * mu * mandel(q @ (theta * (q.T @ h @ q)) @ q.T)
    return out


def wire_conjugate(s, lam, mu):
    """I{σ ⪰ 0} + y²/2λ + Σ (σ_i − y)²/4μ, y = min(σ_min, λ tr σ/(2μ + 3λ))."""
    values = np.linalg.eigvalsh(matrix(s))
    low = values.min(-1)
    y = np.minimum(low, lam * values.sum(-1) / (2 * mu + 3 * lam))
    inside = (y**2 / (2 * lam) if lam > 0 else 0.0) + ((values - y[..., None]) ** 2).sum(-1) / (4 * mu)
    return np.where(low < 0, np.inf, inside)


# -- the same text for numpy arrays (points first) and for one point in cvxpy ----------------------------------------------------


class Numpy:
    """Operations on arrays of points."""

    def tr(self, a):
        return a[..., :3].sum(-1)

    def dev(self, a):
        return a @ DEV

    def norm(self, a):
        return np.sqrt((a * a).sum(-1))

    def length(self, tensor, scalar):
        return np.sqrt((tensor * tensor).sum(-1) + scalar**2)

    def pos(self, x):
        return np.maximum(x, 0)

    def power(self, x, n):
        return x**n

    def square(self, x):
        return x * x

    def eig_max(self, a):
        return np.linalg.eigvalsh(matrix(a))[..., 2]

    def eig_min(self, a):
        return np.linalg.eigvalsh(matrix(a))[..., 0]


class Cvxpy:
    """The same for one point of a convex program."""

    def __init__(self):
        import cvxpy

        self.cp = cvxpy

    def tr(self, a):
        return a[0] + a[1] + a[2]

    def dev(self, a):
        return DEV @ a

    def norm(self, a):
        return self.cp.norm(a, 2)

    def length(self, tensor, scalar):
        # a convex scalar may stand under the root if everything beside it is non-negative
        first = tensor if scalar.is_affine() else self.cp.norm(tensor, 2)
        return self.cp.norm(self.cp.hstack([first, scalar]), 2)

    def pos(self, x):
        return self.cp.pos(x)

    def power(self, x, n):
        return self.cp.power(x, n)

    def square(self, x):
        return self.cp.square(x)

    def matrix(self, a):
        f, e, d = (a[k] / ROOT2 for k in (3, 4, 5))
        return self.cp.bmat([[a[0], d, e], [d, a[1], f], [e, f, a[2]]])

    def eig_max(self, a):
        return self.cp.lambda_max(self.matrix(a))

    def eig_min(self, a):
        return self.cp.lambda_min(self.matrix(a))


# -- the laws ------------------------------------------------------------------------------------------------------------------

Function = Callable[..., Any]


def nothing(o, v, F, x):
    return []


@dataclass(frozen=True)
class Truth:
    """ψ by its moduli, f and the finite part of φ* as functions of (operations, values, forces by variable, state); `unit` [Pa] the
    stress in which a program is scaled; `weights` the hardening modulus of each further internal variable."""

    moduli: Function
    unit: Function
    weights: Function = lambda v: {}
    wires: Function | None = None
    bilateral: bool = False
    surfaces: Function = nothing
    finite: Function | None = None
    plastic: str | None = "eps_p"
    thermal: bool = False

    def energy(self, v, x):
        """ψ [J/m³]; x holds eps, the internal variables and T by name."""
        v = SimpleNamespace(**v)
        lam, mu = self.moduli(v)
        e = x["eps"] - x[self.plastic] if self.plastic else x["eps"]
        trace = e[..., :3].sum(-1)
        psi = lam / 2 * trace**2 + mu * (e * e).sum(-1)
        if self.thermal:
            bulk = lam + 2 * mu / 3
            psi = psi - 3 * bulk * v.alpha_T * (x["T"] - v.T_0) * trace
            psi = psi - v.C_v * (x["T"] * np.log(x["T"] / v.T_0) - x["T"] + v.T_0)
        for name, weight in self.weights(v).items():
            value = x[name]
            psi = psi + weight / 2 * ((value * value).sum(-1) if np.ndim(value) > np.ndim(trace) else value**2)
        if self.wires is not None:
            lam_w, mu_w = self.wires(v)
            if self.bilateral:
                e = x["eps"]
                psi = psi + lam_w / 2 * e[..., :3].sum(-1) ** 2 + mu_w * (e * e).sum(-1)
            else:
                psi = psi + wire_energy(x["eps"], lam_w, mu_w)
        return psi

    def phase_stress(self, v, x):
        """𝕂 (ε − ε^p) − 3K α_T (T − T_0) I: the force of ε^p."""
        v = SimpleNamespace(**v)
        lam, mu = self.moduli(v)
        e = x["eps"] - x[self.plastic] if self.plastic else x["eps"]
        out = e @ stiffness(lam, mu)
        if self.thermal:
            out = out - 3 * (lam + 2 * mu / 3) * v.alpha_T * (np.asarray(x["T"]) - v.T_0)[..., None] * I6
        return out

    def wire_part(self, v, x):
        """Stress of the wires."""
        v = SimpleNamespace(**v)
        if self.wires is None:
            return np.zeros_like(x["eps"])
        lam, mu = self.wires(v)
        return x["eps"] @ stiffness(lam, mu) if self.bilateral else wire_stress(x["eps"], lam, mu)

    def stress(self, v, x):
        """σ^r = ∂ψ/∂ε."""
        return self.phase_stress(v, x) + self.wire_part(v, x)

    def forces(self, v, x):
        """A_m = −∂ψ/∂α_m by variable."""
        found = {name: -weight * x[name] for name, weight in self.weights(SimpleNamespace(**v)).items()}
        if self.plastic:
            found[self.plastic] = self.phase_stress(v, x)
        return found

    def f(self, v, forces, old):
        """Surfaces at arrays of forces."""
        return self.surfaces(Numpy(), SimpleNamespace(**v), forces, old)

    def conjugate(self, v, stress, x):
        """ψ*(σ, X) of one point by Newton on the strain, exact to rounding; closed where the wires are alone or absent."""
        space = SimpleNamespace(**v)
        lam, mu = self.moduli(space)
        if self.wires is not None and mu == 0:
            return float(wire_conjugate(stress, *self.wires(space)))
        elastic = stiffness(lam, mu)
        eps = np.linalg.solve(elastic, stress) + (x[self.plastic] if self.plastic else 0)
        for _ in range(60):
            here = {**x, "eps": eps}
            residual = self.stress(v, here) - stress
            hessian = elastic.copy()
            if self.wires is not None:
                lam_w, mu_w = self.wires(space)
                hessian += stiffness(lam_w, mu_w) if self.bilateral else wire_hessian(eps, lam_w, mu_w)
            step = np.linalg.solve(hessian, residual)
            eps = eps - step
            if np.abs(step).max() <= 1e-16 * (1e-12 + np.abs(eps).max()):
                break
        here = {**x, "eps": eps}
        return float(stress @ eps - self.energy(v, here))


def sand_moduli(v):
    return lame(v.E_s, v.nu_s)


def plain_moduli(v):
    return lame(v.E, v.nu)


def von_mises_f(o, v, F, x):
    return [np.sqrt(1.5) * o.norm(o.dev(F["eps_p"] + F["alpha"])) + F["p"] - v.sigma_y]


def von_mises_isotropic_f(o, v, F, x):
    return [np.sqrt(1.5) * o.norm(o.dev(F["eps_p"])) + F["p"] - v.sigma_y]


def sand_f(o, v, F, x):
    B = F["eps_p"] + F["alpha"]
    return [o.norm(o.dev(B)) / ROOT2 + np.tan(v.theta_f) / 3 * o.tr(B) + F["p"] - v.C_0]


def sand_k2_f(o, v, F, x):
    A, chi = F["eps_p"], F["alpha"]
    return [o.norm(o.dev(A + chi)) / ROOT2 + np.tan(v.theta_f) / 3 * o.tr(A) + F["p"] - v.C_0]


def cone_f(o, v, F, x):
    A = F["eps_p"]
    return [o.norm(o.dev(A)) / ROOT2 + np.tan(v.theta_f) / 3 * o.tr(A) + F["p"] - v.C_0]


def mobilised_f(o, v, F, x):
    A, p = F["eps_p"], x["p"]
    t = np.tan(v.theta_0) + (np.tan(v.theta_f) - np.tan(v.theta_0)) * p / (p + v.p_m)
    return [o.norm(o.dev(A)) / ROOT2 + t / 3 * o.tr(A) + F["p"] - v.C_0]


def tresca_f(o, v, F, x):
    return [o.eig_max(F["eps_p"]) - o.eig_min(F["eps_p"]) + F["p"] - v.sigma_y]


def mohr_coulomb_f(o, v, F, x):
    s, A = np.sin(v.phi), F["eps_p"]
    return [(1 + s) / 2 * o.eig_max(A) - (1 - s) / 2 * o.eig_min(A) + F["p"] - v.c * np.cos(v.phi)]


def rankine_f(o, v, F, x):
    return [o.eig_max(F["eps_p"]) + F["p"] - v.sigma_t]


def cam_clay_f(o, v, F, x):
    A, R = F["eps_p"], F["p"]
    return [o.length(np.sqrt(1.5) / v.M * o.dev(A), o.tr(A) / 3 + v.a - R) + R - v.a]


def cap_f(o, v, F, x):
    A = F["eps_p"]
    cone = o.norm(o.dev(A)) / ROOT2 + np.tan(v.theta_f) / 3 * o.tr(A) + F["p"] - v.C_0
    return [cone, o.length(o.dev(A) / ROOT2, v.r * o.pos(-o.tr(A) / 3 - v.L)) + v.r * (F["v"] - v.W)]


def norton_phi(o, v, F, x):
    return v.sigma_0 * v.rate_0 / (v.n + 1) * o.power(np.sqrt(1.5) / v.sigma_0 * o.norm(o.dev(F["eps_p"])), v.n + 1)


def perzyna_phi(o, v, F, x):
    f = np.sqrt(1.5) * o.norm(o.dev(F["eps_p"])) + F["p"] - v.sigma_y
    return v.sigma_0 * v.rate_0 / (v.n + 1) * o.power(o.pos(f / v.sigma_0), v.n + 1)


def bingham_phi(o, v, F, x):
    return o.square(o.pos(o.norm(o.dev(F["eps_p"])) - ROOT2 * v.tau_y)) / (4 * v.eta)


def maxwell_phi(o, v, F, x):
    return o.square(o.norm(o.dev(F["eps_v"]))) / (4 * v.eta)


def wires(v):
    return v.lambda_w, v.mu_w


def mixed(v):
    return {"alpha": v.H_k, "p": v.H_i}


def isotropic_hardening(v):
    return {"p": v.H_i}


SAND = dict(moduli=sand_moduli, unit=lambda v: v.C_0, weights=mixed)
PLAIN = dict(moduli=plain_moduli, weights=isotropic_hardening)

TRUTHS = {
    "linear_elastic": Truth(plain_moduli, lambda v: 1e-3 * v.E, plastic=None),
    "wire": Truth(lambda v: (0.0, 0.0), lambda v: 1e-3 * v.mu_w, wires=wires, plastic=None),
    "sand": Truth(**SAND, surfaces=sand_f),
    "sand_k2": Truth(**SAND, surfaces=sand_k2_f),
    "reinforced_sand": Truth(**SAND, surfaces=sand_f, wires=wires, bilateral=True),
    "texsol": Truth(**SAND, surfaces=sand_f, wires=wires),
    "texsol_k2": Truth(**SAND, surfaces=sand_k2_f, wires=wires),
    "von_mises": Truth(
        plain_moduli, lambda v: v.sigma_y, weights=lambda v: {"alpha": 2 * v.H_k / 3, "p": v.H_i}, surfaces=von_mises_f
    ),
    "drucker_prager": Truth(**PLAIN, unit=lambda v: v.C_0, surfaces=cone_f),
    "mobilised_friction": Truth(**PLAIN, unit=lambda v: v.C_0, surfaces=mobilised_f),
    "tresca": Truth(**PLAIN, unit=lambda v: v.sigma_y, surfaces=tresca_f),
    "mohr_coulomb": Truth(**PLAIN, unit=lambda v: v.c, surfaces=mohr_coulomb_f),
    "rankine": Truth(**PLAIN, unit=lambda v: v.sigma_t, surfaces=rankine_f),
    "cam_clay": Truth(**PLAIN, unit=lambda v: v.a, surfaces=cam_clay_f),
    "drucker_prager_cap": Truth(
        plain_moduli, lambda v: v.W, weights=lambda v: {"p": v.H_i, "v": v.H_c}, surfaces=cap_f
    ),
    "norton": Truth(plain_moduli, lambda v: v.sigma_0, finite=norton_phi),
    "perzyna": Truth(**PLAIN, unit=lambda v: v.sigma_y, finite=perzyna_phi),
    "bingham": Truth(plain_moduli, lambda v: v.tau_y, finite=bingham_phi),
    "maxwell": Truth(plain_moduli, lambda v: 1e-3 * v.E, finite=maxwell_phi, plastic="eps_v"),
    "kelvin_voigt": Truth(plain_moduli, lambda v: 1e-3 * v.E, plastic=None),
    "thermo_elasto_plastic": Truth(**PLAIN, unit=lambda v: v.sigma_y, surfaces=von_mises_isotropic_f, thermal=True),
}


def projection_objective(truth, v, x_old, eps, forces, dt=1.0, temperature=None):
    """½|A − A_tr|²_{𝕂⁻¹} + Σ |A_m − A_m,n|²/2H_m + Δt φ*_finite [J/m³] at given forces of one point."""
    space = SimpleNamespace(**v)
    lam, mu = truth.moduli(space)
    trial = truth.forces(v, {**x_old, "eps": eps, **({} if temperature is None else {"T": np.float64(temperature)})})
    total = 0.0
    for name, start in trial.items():
        change = np.asarray(forces[name]) - start
        if name == truth.plastic:
            total += change @ np.linalg.solve(stiffness(lam, mu), change) / 2
        elif truth.weights(space)[name] != 0:
            total += np.vdot(change, change) / (2 * truth.weights(space)[name])
    return total + (0.0 if truth.finite is None else dt * float(truth.finite(Numpy(), space, forces, x_old)))


STRESSES = set(
    "E E_s lambda_w mu_w H_k H_i H_c C_0 sigma_y sigma_t c a L W sigma_0 tau_y eta zeta".split()  # noqa: SIM905
)


def projection(truth, v, x_old, eps, dt=1.0, temperature=None):
    """Forces at the end of the step at one point, by the dual program: the closest admissible forces to the trial forces,

        min ½|A − A_tr|²_{𝕂⁻¹} + Σ |A_m − A_m,n|²/2H_m + Δt φ*_finite   over   f ≤ 0,

    in units of a yield stress; returns the forces by name and the objective [J/m³]. A force with zero modulus keeps its value.
    """
    import cvxpy as cp

    unit = truth.unit(SimpleNamespace(**v))
    v = {name: value / unit if name in STRESSES else value for name, value in v.items()}
    space = SimpleNamespace(**v)
    lam, mu = truth.moduli(space)
    trial = truth.forces(v, {**x_old, "eps": eps, **({} if temperature is None else {"T": np.float64(temperature)})})
    variables, objective = {}, 0
    inverse_root = np.linalg.inv(np.linalg.cholesky(stiffness(lam, mu)))
    for name, start in trial.items():
        weight = None if name == truth.plastic else truth.weights(space)[name]
        if weight == 0:
            variables[name] = start
            continue
        variables[name] = cp.Variable(6) if np.ndim(start) else cp.Variable()
        change = variables[name] - start
        if weight is None:
            objective = objective + cp.sum_squares(np.sqrt(mu) * inverse_root @ change) / 2
        else:
            objective = objective + mu / weight / 2 * cp.sum_squares(change)
    o = Cvxpy()
    constraints = [f <= 0 for f in truth.surfaces(o, space, variables, x_old)]
    if truth.finite is not None:
        objective = objective + dt * mu * truth.finite(o, space, variables, x_old)
    problem = cp.Problem(cp.Minimize(objective), constraints)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # asked for more than it can reach; what was reached is compared
        problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-11, tol_gap_rel=1e-11, tol_feas=1e-11)
    assert problem.status in ("optimal", "optimal_inaccurate"), problem.status
    return {n: unit * (z.value if hasattr(z, "value") else z) for n, z in variables.items()}, problem.value / mu * unit
