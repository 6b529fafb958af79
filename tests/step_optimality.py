"""Optimality of a step, judged from its answer alone: what the theory of the library's laws says of (ΔX, Y) at the end of an implicit step.

Nothing here asks fenchel. Moduli and surfaces are those of `law_truth`; subdifferentials, support functions, primal and dual values are
written here by hand. Numbers are taken in extended precision where the machine has it, so that the rounding seen is that of the answer.

Residuals are in Pa and measure the distance to a point of the graph of the law, in stress or (times a modulus) in strain, whichever is
smaller; they need no γ from the code under test, no active set, and hold at apex, edge and corner:

    direction     d ∈ aγ ∂‖·‖(B)  ⟺  d = Π(d + B/2G), Π onto the ball of radius aγ: one condition for the cone and for its apex;
    complementary γ ≥ 0, f ≤ 0, γ f = 0  ⟺  min(Gγ, −f) = 0;
    principal     D ∈ γ(a ∂λ_max − b ∂λ_min)(A): off-diagonals of D vanish in axes of A, D_i > 0 only where A_i = λ_max, D_i < 0 only where
                  A_i = λ_min, tr D = (a − b)γ, and Σ⟨D_i⟩ < aγ only where all A_i are equal;
    viscous       the smaller of the mismatches in strain (times G) and in stress.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from law_truth import I6, ROOT2, TRUTHS, Numpy, lame, matrix

L = np.longdouble
EPS = np.finfo(float).eps
ROOT32 = np.sqrt(L(1.5))
PRINCIPAL = ("tresca", "mohr_coulomb", "rankine")
VISCOUS = ("norton", "bingham", "maxwell")
ELASTIC = ("linear_elastic", "wire", "kelvin_voigt")


def wide(thing):
    """The arrays of a state in extended precision."""
    return {k: np.asarray(v, dtype=L) for k, v in thing.items()}


def dev(a):
    return a - a[..., :3].sum(-1, keepdims=True) / 3 * I6


def tr(a):
    return a[..., :3].sum(-1)


def length(a):
    size = np.abs(a).max(-1)
    safe = np.where(size > 0, size, 1)
    return size * np.sqrt(((a / safe[..., None]) ** 2).sum(-1))


def friction(name, v, old):
    """t of the cone: √J₂ + t tr/3."""
    if name == "mobilised_friction":
        t = np.tan(L(v.theta_0))
        return t + (np.tan(L(v.theta_f)) - t) * old["p"] / (old["p"] + L(v.p_m))
    return np.tan(L(v.theta_f)) if hasattr(v, "theta_f") else L(0)


def wedge(name, v):
    """(a, b, k) of the principal laws: a λ_max − b λ_min + R ≤ k."""
    if name == "tresca":
        return L(1), L(1), L(v.sigma_y)
    if name == "rankine":
        return L(1), L(0), L(v.sigma_t)
    s = np.sin(L(v.phi))
    return (1 + s) / 2, (1 - s) / 2, L(v.c) * np.cos(L(v.phi))


class Step:
    """One implicit step at n points: law `name`, `values`, old and new state by name, strains (n, 6), time step, temperature (n,)."""

    def __init__(self, name, values, eps, old, new, dt=1.0, temperature=None):
        self.name, self.truth, self.values, self.dt = name, TRUTHS[name], dict(values), L(dt)
        self.v = v = SimpleNamespace(**values)
        self.lam, self.mu = (L(x) for x in self.truth.moduli(v))
        if hasattr(v, "E") or hasattr(v, "E_s"):
            E, nu = (L(v.E), L(v.nu)) if hasattr(v, "E") else (L(v.E_s), L(v.nu_s))
            self.lam, self.mu = lame(E, nu)
        self.bulk = self.lam + 2 * self.mu / 3
        self.old, self.eps = wide(old), np.asarray(eps, dtype=L)
        self.new = wide(new) if new is not None else self.old
        self.unit = L(self.truth.unit(v))
        self.heat = L(0) * self.eps[:, 0]
        self.temperature = temperature
        if self.truth.thermal:
            self.heat = 3 * self.bulk * L(v.alpha_T) * (np.asarray(temperature, dtype=L) - L(v.T_0))
        self.plastic = self.truth.plastic
        self.weights = {k: L(w) for k, w in self.truth.weights(v).items()}

    # -- state laws ---------------------------------------------------------------------------------------------------------

    def elastic(self, e):
        return self.lam * tr(e)[..., None] * I6 + 2 * self.mu * e

    def phase(self, state):
        """𝕂(ε − ε^p) − 3Kα(T − T₀)I."""
        e = self.eps - state[self.plastic] if self.plastic else self.eps
        return self.elastic(e) - self.heat[:, None] * I6

    def forces(self, state):
        found = {name: -w * state[name] for name, w in self.weights.items()}
        if self.plastic:
            found[self.plastic] = self.phase(state)
        return found

    def wires(self):
        return self.truth.wire_part(self.values, {"eps": self.eps.astype(float)})

    def stress(self):
        """σ = ∂ψ/∂ε at the new state; of Kelvin–Voigt with its viscous part."""
        found = self.phase(self.new) + self.wires()
        if self.name == "kelvin_voigt":
            rate = (self.eps - self.old["eps"]) / self.dt
            found = found + 2 * L(self.v.eta) * dev(rate) + L(self.v.zeta) * tr(rate)[:, None] * I6
        return found

    def trial(self):
        """‖trial stress‖ [Pa]."""
        found = length(self.phase(self.old)) + length(self.wires().astype(L))
        if self.name == "kelvin_voigt":
            rate = (self.eps - self.old["eps"]) / self.dt
            found = found + length(2 * L(self.v.eta) * rate) + abs(L(self.v.zeta) * tr(rate))
        return found

    def tolerance(self):
        """1e-10 × yield stress + 100 × machine epsilon × ‖trial stress‖ [Pa]."""
        return 1e-10 * self.unit + 100 * EPS * self.trial()

    def change(self):
        return {k: self.new[k] - self.old[k] for k in self.truth_variables()}

    def truth_variables(self):
        return ([self.plastic] if self.plastic else []) + list(self.weights)

    def surfaces(self, forces):
        return self.truth.surfaces(Numpy(), self.v, forces, self.old)

    # -- residuals ------------------------------------------------------------------------------------------------------------

    def residuals(self, stress):
        """By condition, [Pa], (n,)."""
        found = {"state law": length(np.asarray(stress, dtype=L) - self.stress())}
        if self.name in ELASTIC:
            return found
        Y, X = self.forces(self.new), self.change()
        for i, f in enumerate(self.surfaces(Y)):
            if not self.truth.finite:
                found[f"feasibility {i}"] = np.maximum(f, 0)
        if self.name in PRINCIPAL:
            return found | self._principal(Y, X)
        if self.name in VISCOUS:
            return found | self._viscous(Y, X)
        if self.name == "cam_clay":
            return found | self._cam_clay(Y, X)
        if self.name == "drucker_prager_cap":
            return found | self._cap(Y, X)
        return found | self._cone(Y, X)

    def _ball(self, d, B, radius):
        """2G ‖d − Π(d + B/2G)‖, Π onto the ball of the given radius."""
        reach = d + B / (2 * self.mu)
        size = length(reach)
        inside = np.minimum(1, np.maximum(radius, 0) / np.where(size > 0, size, 1))
        return 2 * self.mu * length(d - inside[:, None] * reach)

    def _cone(self, Y, X):
        A, flow, gamma = Y[self.plastic], X[self.plastic], X["p"]
        t, a = friction(self.name, self.v, self.old), ROOT32 if "sigma_y" in self.values else 1 / np.sqrt(L(2))
        B = A + Y["alpha"] if "alpha" in Y else A
        found = {
            "direction": self._ball(dev(flow), dev(B), a * gamma),
            "dilatancy": self.bulk * abs(tr(flow) - t * gamma),
        }
        if "alpha" in X:
            same = X["alpha"] - (dev(flow) if self.name.endswith("k2") else flow)
            found["back strain"] = 2 * self.mu * length(same)
        (f,) = self.surfaces(Y) if self.truth.surfaces(Numpy(), self.v, Y, self.old) else (self._overstress(Y),)
        found["complementarity"] = self._power_law(f, gamma) if self.name == "perzyna" else self._switch(gamma, f)
        return found

    def _switch(self, gamma, f):
        return abs(np.minimum(self.mu * gamma, -f))

    def _overstress(self, Y):
        return ROOT32 * length(dev(Y["eps_p"])) + Y["p"] - L(self.v.sigma_y)

    def _power_law(self, f, gamma):
        """γ = dt ε̇₀ ⟨f/σ₀⟩^n, or f = σ₀ (γ/dt ε̇₀)^(1/n)."""
        v, rate = self.v, self.dt * L(self.v.rate_0)
        in_strain = abs(gamma - rate * (np.maximum(f, 0) / L(v.sigma_0)) ** L(v.n)) * self.mu
        positive = gamma > 0
        back = L(v.sigma_0) * (np.where(positive, gamma, 0) / rate) ** (1 / L(v.n))
        return np.minimum(in_strain, np.where(positive, abs(f - back), np.maximum(f, 0) + self.mu * abs(gamma)))

    def _viscous(self, Y, X):
        v, A, flow = self.v, dev(Y[self.plastic]), X[self.plastic]
        size, moved = length(A), length(dev(flow))
        found = {
            "direction": self._ball(dev(flow), A, moved),
            "volume": self.bulk * abs(tr(flow)),
        }
        if self.name == "norton":
            found["rate"] = self._power_law(ROOT32 * size, moved / ROOT32)
        else:
            limit = ROOT2 * L(v.tau_y) if self.name == "bingham" else L(0)
            fluid = self.dt / (2 * L(v.eta))
            in_strain = 2 * self.mu * abs(moved - fluid * np.maximum(size - limit, 0))
            found["rate"] = np.minimum(in_strain, np.where(moved > 0, abs(size - limit - moved / fluid), np.inf))
        return found

    def _cam_clay(self, Y, X):
        """Gradient of √(3/2M² ‖S‖² + (m + a − R)²) + R − a: no apex where R ≤ 0 < a."""
        v, A, R = self.v, Y["eps_p"], Y["p"]
        S = ROOT32 / L(v.M) * dev(A)
        x = tr(A) / 3 + L(v.a) - R
        size = np.sqrt((S * S).sum(-1) + x * x)
        gamma = X["p"] + tr(X["eps_p"])
        slope = S * (ROOT32 / L(v.M) * gamma / size)[:, None]
        (f,) = self.surfaces(Y)
        # a mismatch r of flow is made by a stress that is off by r over the curvature, if that is the smaller
        bend, bow = 3 * self.mu / L(v.M) ** 2 * abs(gamma) / size, self.bulk * abs(gamma) / size
        return {
            "direction": 2 * self.mu * length(dev(X["eps_p"]) - slope) / (1 + bend),
            "dilatancy": self.bulk * abs(tr(X["eps_p"]) - gamma * x / size) / (1 + bow),
            "complementarity": self._switch(gamma, f),
        }

    def _cap(self, Y, X):
        v, A = self.v, Y["eps_p"]
        S, excess = dev(A), np.maximum(-tr(A) / 3 - L(v.L), 0)
        r, g1, g2 = L(v.r), X["p"], X["v"] / L(v.r)
        root = np.sqrt((S * S).sum(-1) / 2 + (r * excess) ** 2)
        safe = np.where(root > 0, root, 1)
        t = friction(self.name, v, self.old)
        f = self.surfaces(Y)
        bend, bow = self.mu * abs(g2) / safe, self.bulk * r * r * abs(g2) / safe  # as in Cam-Clay
        return {
            "direction": self._ball(dev(X["eps_p"]) - S * (g2 / (2 * safe))[:, None], S, g1 / ROOT2) / (1 + bend),
            "dilatancy": self.bulk * abs(tr(X["eps_p"]) - t * g1 + g2 * r * r * excess / safe) / (1 + bow),
            "complementarity 0": self._switch(g1, f[0]),
            "complementarity 1": self._switch(g2, f[1]),
        }

    def _principal(self, Y, X):
        a, b, _ = wedge(self.name, self.v)
        D, gamma = X["eps_p"], X["p"]
        # axes of the trial: an isotropic projection keeps them, and its answer is a multiple of 1 where the trial is
        trial = matrix(self.phase(self.old).astype(float))
        _, q = np.linalg.eigh(trial)
        new, flow = (np.einsum("nki,nkl,nlj->nij", q, matrix(z.astype(float)), q) for z in (Y["eps_p"], D))
        off = ~np.eye(3, dtype=bool)
        values, moved = (np.einsum("nii->ni", z) for z in (new, flow))
        high, low = values.max(1)[:, None], values.min(1)[:, None]
        up, down = np.maximum(moved, 0), np.maximum(-moved, 0)
        G2 = float(2 * self.mu)
        (f,) = self.surfaces(Y)
        both = np.maximum(a * gamma - up.sum(1), 0)
        return {
            "axes": np.minimum(abs(new[:, off]), 1e300).max(1),
            "upper": np.minimum(G2 * up, high - values).max(1),
            "lower": np.minimum(G2 * down, values - low).max(1),
            "reach": G2 * np.maximum(up.sum(1) - a * gamma, 0),
            "both": np.minimum(G2 * both, (high - low)[:, 0]) if b > 0 else G2 * both,
            "dilatancy": self.bulk * abs(tr(D) - (a - b) * gamma),
            "complementarity": self._switch(gamma, f),
        }

    # -- primal and dual values -------------------------------------------------------------------------------------------------

    def support(self):
        """(admissible increments near the found ones, φ of the step there [J/m³])."""
        v, X, dt = self.v, self.change(), self.dt
        if self.name in PRINCIPAL:
            return self._wedge_support(X)
        flow = X[self.plastic]
        if self.name in VISCOUS:
            flow = dev(flow)
            d = length(flow)
            if self.name == "norton":
                return {self.plastic: flow}, self._power_support(d / ROOT32)
            limit = ROOT2 * L(v.tau_y) if self.name == "bingham" else 0
            return {self.plastic: flow}, limit * d + L(v.eta) * d * d / dt
        if self.name == "cam_clay":
            d, volume = length(dev(flow)) * L(v.M) / ROOT32, tr(flow)
            p = np.maximum(X["p"], np.sqrt(d * d + volume * volume) - volume)
            return {"eps_p": flow, "p": p}, L(v.a) * p
        t = friction(self.name, v, self.old)
        if self.name == "drucker_prager_cap":
            d, p, r = ROOT2 * length(dev(flow)), np.maximum(X["p"], 0), L(v.r)
            shrink = np.minimum(tr(flow) - t * p, 0)
            w = np.maximum(X["v"], -shrink)
            # a shear that is too large is left to the surface that takes it at the smaller price
            wider = np.maximum(w, np.sqrt(shrink**2 + (r * np.maximum(d - p, 0)) ** 2))
            more = np.maximum(p, d - np.sqrt(w * w - shrink * shrink) / r)
            by_cap = L(v.W) * (wider - w) <= L(v.C_0) * (more - p)
            p, w = np.where(by_cap, p, more), np.where(by_cap, wider, w)
            flow = dev(flow) + (t * p + shrink)[:, None] / 3 * I6
            return {"eps_p": flow, "p": p, "v": w}, L(v.C_0) * p + L(v.W) * w - L(v.L) * shrink
        a, k = (ROOT32, L(v.sigma_y)) if "sigma_y" in self.values else (1 / np.sqrt(L(2)), L(getattr(v, "C_0", 0)))
        p = np.maximum(X["p"], length(dev(flow)) / a)
        found = {self.plastic: dev(flow) + (t * p)[:, None] / 3 * I6, "p": p}
        if "alpha" in X:
            found["alpha"] = dev(flow) if self.name.endswith("k2") else found[self.plastic]
        return found, k * p + (self._power_support(p) if self.name == "perzyna" else 0)

    def _power_support(self, p):
        n, rate = L(self.v.n), self.dt * L(self.v.rate_0)
        return n / (n + 1) * L(self.v.sigma_0) * rate * (p / rate) ** ((n + 1) / n)

    def _wedge_support(self, X):
        a, b, k = wedge(self.name, self.v)
        values, q = np.linalg.eigh(matrix(X["eps_p"].astype(float)))
        values = values.astype(L)
        if self.name == "rankine":
            gain = np.maximum(-values, 0)  # D ⪰ 0
            gamma = (values + gain).sum(1)
        else:
            up, down = np.maximum(values, 0).sum(1), np.maximum(-values, 0).sum(1)
            gamma = np.maximum(np.maximum(up / a, down / b), X["p"])
            missing = (a - b) * gamma - (up - down)
            gain = np.zeros_like(values)
            gain[:, 2], gain[:, 0] = np.maximum(missing, 0), np.minimum(missing, 0)
        i, j, r = [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1], np.array([1, 1, 1, ROOT2, ROOT2, ROOT2])
        D = X["eps_p"] + np.einsum("nk,nck,nck->nc", gain, q[:, i], q[:, j]) * r
        return {"eps_p": D, "p": gamma}, k * gamma

    def primal(self):
        """(½ e:𝕂e + Σ ½H|s|² + φ(ΔX) [J/m³], state) of the admissible increments nearest to the answer; e holds the thermal strain."""
        X, phi = self.support()
        state = {name: self.old[name] + x for name, x in X.items()}
        e = self.eps - state[self.plastic]
        total = self.lam / 2 * tr(e) ** 2 + self.mu * (e * e).sum(-1) - self.heat * tr(e) + phi
        for name, w in self.weights.items():
            total = total + w / 2 * self._square(state[name])
        return total, state

    @staticmethod
    def _square(x):
        return (x * x).sum(-1) if x.ndim > 1 else x * x

    def admissible(self, forces):
        """The forces drawn along the ray to an inner point until no surface is passed: f is convex, and negative at zero or, of
        Cam-Clay, at the middle of its ellipse."""
        if self.truth.finite is not None:
            return forces
        inner = {k: 0 * y for k, y in forces.items()}
        if self.name == "cam_clay":
            inner["eps_p"] = inner["eps_p"] - L(self.v.a) * I6
        s = L(1)
        for f, f_0 in zip(self.surfaces(forces), self.surfaces(inner), strict=True):
            s = np.minimum(s, np.where(f > 0, -f_0 / (np.maximum(f, 0) - f_0), 1))
        return {k: inner[k] + (y - inner[k]) * (s[:, None] if y.ndim > 1 else s) for k, y in forces.items()}

    def dual(self, forces):
        """A:(ε − ε^p_n) − ½ (A+β):𝕂⁻¹(A+β) − Σ (R s_n + R²/2H) − dt φ*(Y) [J/m³], β the thermal stress."""
        A = forces[self.plastic]
        thermal = A + self.heat[:, None] * I6
        S, m = dev(thermal), tr(thermal) / 3
        total = (A * (self.eps - self.old[self.plastic])).sum(-1) - (S * S).sum(-1) / (4 * self.mu)
        total = total - m * m / (2 * self.bulk)
        for name, w in self.weights.items():
            R = forces[name]
            total = total - (R * self.old[name] if R.ndim == 1 else (R * self.old[name]).sum(-1))
            if w > 0:
                total = total - self._square(R) / (2 * w)
        if self.truth.finite is not None:
            total = total - self.dt * self.truth.finite(Numpy(), self.v, forces, self.old)
        return total

    def gap(self):
        """(gap, energy) [J/m³]: primal value of the answer made admissible minus dual value of its forces made so."""
        value, _ = self.primal()
        return value - self.dual(self.admissible(self.forces(self.new))), abs(value)

    def dissipation(self):
        """φ(ΔX) + Δt φ*(Y) [J/m³]: by Fenchel's equality Y·ΔX; φ alone, the support function, of a law without viscosity."""
        _, found = self.support()
        if self.truth.finite is not None:
            found = found + self.dt * self.truth.finite(Numpy(), self.v, self.forces(self.new), self.old)
        return found

    def floor(self):
        """Energy [J/m³] of a shear at the yield stress, unit²/4G."""
        return self.unit**2 / (4 * self.mu) if self.mu > 0 else self.unit**2 / (4 * L(self.v.mu_w))

    def from_forces(self, forces):
        """The step whose new state has the given forces; a state without modulus keeps its old value."""
        A = np.asarray(forces[self.plastic], dtype=L) + self.heat[:, None] * I6
        new = {self.plastic: self.eps - dev(A) / (2 * self.mu) - (tr(A) / (9 * self.bulk))[:, None] * I6}
        for name, w in self.weights.items():
            new[name] = -np.asarray(forces[name], dtype=L) / w if w > 0 else self.old[name]
        return Step(self.name, self.values, self.eps, self.old, new, float(self.dt), self.temperature)

    def distance(self, one, two):
        """‖Y₁ − Y₂‖ in the metric of complementary energy, √(J/m³)."""
        change = one[self.plastic] - two[self.plastic]
        S, m = dev(change), tr(change) / 3
        total = (S * S).sum(-1) / (2 * self.mu) + m * m / self.bulk
        for name, w in self.weights.items():
            if w > 0:
                total = total + self._square(one[name] - two[name]) / w
        return np.sqrt(total)
