"""Random laws that are admissible by construction, and states that an actual step has reached.

`random_law(rng)` composes pieces of which each keeps ψ convex and φ* convex, zero and least at zero: an elastic energy (moduli, Young and
Poisson, ψ* of the stress, wires that resist extension only), back strains and scalar hardening (linear, saturating, a power, late),
surfaces (Mises, balls, cones, ellipses, Cam-Clay, caps, principal stresses), finite parts (Newton, Norton, Perzyna, Bingham), a potential
of rates, Kelvin–Voigt, frozen hardening, temperature, density. Structure and numbers are drawn apart: the text of a law holds no number
that was drawn, so that its generated code is found again.

Everything is a function of the generator. `extreme=True` widens moduli, strengths and times to 1e±12.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from sympy import Rational, exp, log, sqrt

from fenchel.errors import FenchelError
from fenchel.potentials import (
    Law,
    dev,
    eig_max,
    eig_min,
    eig_sum,
    forces,
    frozen,
    indicator,
    inner,
    isotropic,
    norm,
    parameter,
    pos,
    rates,
    scalar,
    sym_tensor,
    temperature,
    tr,
)

__all__ = ["RandomLaw", "broken_law", "random_law", "random_states", "random_strains"]

I6 = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class RandomLaw:
    """A law with values: `strain` at which it roughly yields or flows, `stress` [Pa] there, a time step `dt` [s] that matters.

    `heat` holds the temperature by name, for a law that has one; `tags` name the pieces. A step is
    `law.compile()(eps, state, dt, **values, **heat)`.
    """

    law: Law
    values: dict[str, float]
    strain: float
    stress: float
    dt: float
    text: str
    heat: dict[str, float] = field(default_factory=dict)
    tags: tuple[str, ...] = ()

    @property
    def given(self) -> dict[str, float]:
        """Values and temperature together."""
        return {**self.values, **self.heat}


class _Draw:
    """The pieces of one law as they are drawn: expressions, values, tags."""

    def __init__(self, rng: np.random.Generator, extreme: bool) -> None:
        self.rng, self.extreme = rng, extreme
        self.values: dict[str, float] = {}
        self.tags: list[str] = []
        self.heat: dict[str, float] = {}
        self.modulus = self.size(-12, 12) if extreme else self.size(4, 11.5)
        self.strain = self.size(-12, 3) if extreme else self.size(-4.5, -2)
        self.strength = self.modulus * self.strain
        self.dt = self.size(-12, 12) if extreme else self.size(-3, 3)
        self.eps, self.eps_p = sym_tensor("eps"), sym_tensor("eps_p")
        self.backs: list[Any] = []
        self.scalars: list[Any] = []
        self.hardening: list[Any] = []
        self.heated: Any = None

    # -- drawing ------------------------------------------------------------------------------------------------------------------

    def chance(self, p: float) -> bool:
        return bool(self.rng.random() < p)

    def pick(self, table: Mapping[str, float]) -> str:
        names = list(table)
        weights = np.array([table[n] for n in names])
        return names[int(self.rng.choice(len(names), p=weights / weights.sum()))]

    def size(self, low: float, high: float) -> float:
        return float(10.0 ** self.rng.uniform(low, high))

    def factor(self, low: float, high: float) -> float:
        """A number over some decades, over ±12 of them where numbers are extreme."""
        return self.size(-12, 12) if self.extreme and self.chance(0.5) else self.size(low, high)

    def parameter(self, name: str, value: float, lower: float | None = 0.0, upper: float | None = None) -> Any:
        """A parameter with its value; the same name twice gets a number."""
        count = 0
        plain = name
        while name in self.values:
            count += 1
            name = f"{plain}_{count}"
        self.values[name] = value
        return parameter(name, lower=lower, upper=upper)

    def strong(self, name: str = "k", low: float = -0.5, high: float = 0.5) -> Any:
        """A strength of about the yield stress."""
        return self.parameter(name, self.strength * self.size(low, high))

    def soft(self, name: str, low: float = -4, high: float = 1) -> Any:
        """A modulus below, about or above the elastic one; zero now and then."""
        return self.parameter(name, 0.0 if self.chance(0.12) else self.modulus * self.factor(low, high))

    # -- the energy ---------------------------------------------------------------------------------------------------------------

    def poisson(self) -> float:
        if self.chance(0.85):
            return float(self.rng.uniform(0.0, 0.45))
        edge = self.size(-12, -1) if self.extreme else self.size(-5, -1)
        return [0.5 - edge, edge - 1.0, 0.0][self.rng.integers(3)]

    def bulk_and_shear(self) -> tuple[Any, Any]:
        ratio = self.size(-6, 6) if self.extreme else self.size(-1.5, 1.5)
        return self.parameter("K", self.modulus * ratio), self.parameter("G", self.modulus)

    def energy(self, strain: Any) -> Any:
        """A quadratic energy of the elastic strain."""
        if self.chance(0.6):
            self.tags.append("isotropic")
            E = self.parameter("E", self.modulus)
            nu = self.parameter("nu", self.poisson(), lower=-1, upper=0.5)
            return isotropic(E, nu).energy(strain)
        self.tags.append("moduli")
        K, G = self.bulk_and_shear()
        return K / 2 * tr(strain) ** 2 + G * inner(dev(strain), dev(strain))

    def networks(self) -> Any:
        """Energies of the whole strain beside the elastic one: nothing, wires of one or both signs, a smooth stiffening."""
        kind = self.pick({"none": 0.68, "bilateral": 0.1, "wires": 0.15, "stiffening": 0.05, "two": 0.02})
        if kind == "none":
            return 0
        self.tags.append(kind)
        eps = self.eps
        lam, mu = self.soft("lambda_w", -3, 1), self.parameter("mu_w", self.modulus * self.factor(-3, 1))
        unilateral = lam / 2 * pos(tr(eps)) ** 2 + mu * inner(pos(eps), pos(eps))
        if kind == "bilateral":
            return lam / 2 * tr(eps) ** 2 + mu * inner(eps, eps)
        if kind == "stiffening":
            a = self.parameter("a_w", self.modulus / self.strain * self.size(-2, 1))
            return eig_sum(lambda e: a / 3 * pos(e) ** 3, eps) + lam / 2 * tr(eps) ** 2
        if kind == "two":
            other = self.parameter("mu_v", self.modulus * self.factor(-3, 1))
            return unilateral + other * inner(eps, eps)
        return unilateral

    def warmth(self, strain: Any) -> Any:
        """Thermal stress and heat capacity; remembers the temperature."""
        if not self.chance(0.1):
            return 0
        self.tags.append("temperature")
        self.heated = T = temperature("T")
        self.heat["T"] = float(self.rng.uniform(280.0, 360.0))
        T_0 = self.parameter("T_0", 300.0)
        beta = self.parameter("beta", self.strength * self.size(-3, -1))
        C = self.parameter("C_v", self.strength * self.strain * self.size(-2, 2))
        return -beta * (T - T_0) * tr(strain) - C * (T * log(T / T_0) - T + T_0)

    # -- hardening ----------------------------------------------------------------------------------------------------------------

    def back(self) -> None:
        """Back strains with their energies."""
        count = int(self.pick({"0": 0.55, "1": 0.33, "2": 0.12}))
        names = ("alpha", "beta_p")[:count]
        self.backs = [sym_tensor(n) for n in names]
        if count:
            self.tags.append(f"back {count}")
        moduli = [self.soft(f"H_k{i}") for i in range(count)]
        self.hardening += [h / 2 * inner(x, x) for h, x in zip(moduli, self.backs, strict=True)]
        if count == 2 and self.chance(0.4) and all(self.values[str(h)] > 0 for h in moduli):
            self.tags.append("coupled")
            root = float(np.sqrt(self.values[str(moduli[0])]) * np.sqrt(self.values[str(moduli[1])]))
            self.hardening.append(self.parameter("H_c", 0.6 * root) * inner(*self.backs))

    def scalar_hardening(self, chance: float = 0.6) -> None:
        """An accumulated strain with its energy."""
        if not self.chance(chance):
            return
        p = scalar("p")
        self.scalars.append(p)
        kind = self.pick({"linear": 0.6, "saturating": 0.16, "power": 0.12, "late": 0.12})
        self.tags.append(f"{kind} hardening")
        energy = self.soft("H_i") / 2 * p**2
        if kind == "saturating":
            rise, width = self.strong("Q", -1, 1), self.parameter("b", self.strain * self.factor(-1, 1))
            energy = energy + rise * (p + width * exp(-p / width))
        elif kind == "power":
            n = self.parameter("n_h", float(self.rng.uniform(0.2, 2.0)))
            scale = self.parameter("p_0", self.strain)
            energy = energy + self.strong("Q", -1, 1) * scale / (n + 1) * (p / scale) ** (n + 1)
        elif kind == "late":
            begin = self.parameter("p_0", self.strain * self.factor(-1, 1))
            energy = energy + self.parameter("H_l", self.modulus / self.strain * self.size(-3, 0)) * pos(p - begin) ** 3
        self.hardening.append(energy)

    # -- surfaces -----------------------------------------------------------------------------------------------------------------

    def limit(self, k: Any) -> Any:
        """A strength, as it is or changed by temperature or by what p was at the start of the step."""
        if self.heated is not None and self.chance(0.5):
            self.tags.append("warm strength")
            return k * (2 - self.heated / parameter("T_0", lower=0.0))
        if self.scalars and self.chance(0.1):
            self.tags.append("frozen strength")
            more = self.strong("Q_f", -1, 0.5)
            width = self.parameter("b_f", self.strain * self.size(-1, 1))
            return k + more * (1 - exp(-frozen(self.scalars[0]) / width))
        return k

    def friction(self) -> Any:
        value = self.size(-6, 3) if self.extreme and self.chance(0.3) else float(self.rng.uniform(0.02, 0.9))
        t = self.parameter("t_f", value)
        if self.scalars and self.chance(0.15):
            self.tags.append("mobilised")
            more = self.parameter("t_m", float(self.rng.uniform(0.02, 0.5)))
            scale = self.parameter("p_m", self.strain * self.size(-1, 1))
            p = frozen(self.scalars[0])
            return t + more * p / (p + scale)
        return t

    def gauge(self, A: Any, B: Any, kind: str, k: Any) -> Any:
        """f of one surface without scalar hardening; A the force of the plastic strain, B the same less back stresses."""
        deviator = inner(dev(A), dev(A))
        if kind == "mises":
            return sqrt(Rational(3, 2)) * norm(dev(B)) - self.limit(k)
        if kind == "ball":
            return norm(B) - self.limit(k)
        if kind == "cone":
            return norm(dev(B)) / sqrt(2) + self.friction() / 3 * tr(B if self.chance(0.5) else A) - self.limit(k)
        if kind == "ellipse":
            return sqrt(deviator / 2 + self.parameter("m_e", self.factor(-1, 1)) ** 2 * tr(A) ** 2) - k
        if kind == "egg":
            shift = self.parameter("a_e", 0.9 * self.values[str(k)] * float(self.rng.random()))
            return sqrt(deviator / 2 + (tr(A) / 3 + shift) ** 2) - k
        if kind == "cap":
            begin, height = self.strong("L"), self.parameter("r", self.size(-1, 0.5))
            return sqrt(deviator / 2 + height**2 * pos(-tr(A) / 3 - begin) ** 2) - k
        if kind == "tension":
            return tr(A) / 3 - self.limit(k)
        if kind == "pressure":
            return -tr(A) / 3 - k
        if kind == "tresca":
            return eig_max(A) - eig_min(A) - self.limit(k)
        if kind == "mohr":
            s = self.parameter("s_f", float(self.rng.uniform(0.0, 0.95)), upper=1.0)
            return (1 + s) / 2 * eig_max(A) - (1 - s) / 2 * eig_min(A) - self.limit(k)
        if kind == "rankine":
            return eig_max(A) - self.limit(k)
        if kind == "crush":
            return -eig_min(A) - k
        raise AssertionError(kind)


SURFACES = {"mises": 4, "ball": 1, "cone": 4, "ellipse": 1, "egg": 1, "tresca": 1, "mohr": 1.5, "rankine": 1}
MORE = SURFACES | {"cap": 2, "tension": 2, "pressure": 1, "crush": 1}


def _forces(d: _Draw) -> tuple[Any, Any, list[Any]]:
    """(A, A less the back stresses, R of every scalar)."""
    found = forces(d.eps_p, *d.backs, *d.scalars)
    found = found if isinstance(found, tuple) else (found,)
    A, backs, hard = found[0], found[1 : 1 + len(d.backs)], list(found[1 + len(d.backs) :])
    B = A
    for chi in backs:
        B = B + chi
    return A, B, hard


def _surfaces(d: _Draw) -> Any:
    """An indicator of one to three surfaces, each internal variable moved by one of them at least."""
    A, B, hard = _forces(d)
    if not d.backs and d.scalars and d.chance(0.08):
        d.tags.append("cam clay")
        M, a = d.parameter("M", d.size(-0.7, 0.5)), d.strong("a")
        R = hard[0]
        return indicator(sqrt(Rational(3, 2) / M**2 * inner(dev(A), dev(A)) + (tr(A) / 3 + a - R) ** 2) + R - a)
    if len(d.backs) == 2 and d.chance(0.25):
        d.tags.append("two norms")
        one, two = forces(d.eps_p, *d.backs)[1:]
        k = d.strong()
        first = norm(dev(A + one)) + norm(dev(A + two)) / 2 - d.limit(k)
        return indicator(first + hard[0] if hard else first)
    count = int(d.pick({"1": 0.68, "2": 0.24, "3": 0.08}))
    kinds = [d.pick({n: w for n, w in SURFACES.items() if not d.backs or n in ("mises", "ball", "cone")})]
    kinds += [d.pick(MORE) for _ in range(count - 1)]
    found = []
    for i, kind in enumerate(kinds):
        d.tags.append(kind)
        k = d.strong("k", *((-0.5, 0.5) if i == 0 else (-0.3, 0.8)))
        f = d.gauge(A, B if i == 0 or d.chance(0.5) else A, kind, k)
        if hard and (i == 0 or d.chance(0.4)):
            f = f + hard[0]
        found.append(f)
    return indicator(*found)


def _finite(d: _Draw) -> Any:
    """A finite φ*: Newton, Norton, Perzyna, Bingham, tension and principal overstress, and sums of two."""
    A, B, hard = _forces(d)
    kinds = {"newton": 2, "whole": 1, "norton": 2, "bingham": 2, "perzyna": 3, "tension": 0.7, "principal": 0.6}
    if hard:
        kinds = {"perzyna": 3, "bingham": 1, "principal": 0.5}
    elif d.backs:
        kinds = {"norton": 1, "bingham": 2, "perzyna": 3}
    total: Any = 0
    for i in range(2 if d.chance(0.15) else 1):
        kind = d.pick(kinds)
        d.tags.append(kind)
        total = total + _overstress(d, kind, A, B, hard[0] if hard else 0)
        if i == 0:
            kinds = {"newton": 1, "bingham": 1, "tension": 1}
            B, hard = A, []
    return total


def _overstress(d: _Draw, kind: str, A: Any, B: Any, R: Any) -> Any:
    # a viscosity that matters in a time step: η ~ E·dt, over decades
    eta = d.parameter("eta", d.modulus * d.dt * d.factor(-3, 3))
    n = d.parameter("n", float(d.rng.choice([1.0, 2.0, 3.0, 5.0, d.rng.uniform(0.5, 12.0)])))
    k = d.strong()
    if kind == "newton":
        return inner(dev(A), dev(A)) / (4 * eta)
    if kind == "whole":
        return inner(A, A) / (2 * eta)
    if kind == "tension":
        return pos(tr(A) / 3 - k) ** 2 / (2 * eta)
    if kind == "principal":
        return pos(eig_max(A) + R - k) ** 2 / (2 * eta)
    if kind == "bingham":
        return pos(norm(dev(B)) + R - k) ** 2 / (2 * eta)
    d.values.pop(str(eta))
    rate = d.parameter("rate_0", d.strain / d.dt * d.factor(-3, 1))
    scale = d.strong("sigma_0")
    if kind == "norton":
        return scale * rate / (n + 1) * (sqrt(Rational(3, 2)) * norm(dev(B)) / scale) ** (n + 1)
    return scale * rate / (n + 1) * pos((sqrt(Rational(3, 2)) * norm(dev(B)) + R - k) / scale) ** (n + 1)


def _rates(d: _Draw) -> Any:
    """φ of the rates: a strength, a viscosity, plastic flow at constant volume or not."""
    k = d.strong()
    if d.scalars:
        rate, speed = rates(d.eps_p, d.scalars[0])
        d.tags.append("rates with hardening")
        return k * speed + indicator(norm(rate) - speed, tr(rate), -tr(rate))
    rate = rates(d.eps_p)
    kind = d.pick({"plastic": 1, "viscoplastic": 2, "volume": 1})
    d.tags.append(f"rates {kind}")
    if kind == "volume":
        return k * norm(rate)
    eta = d.parameter("eta", d.modulus * d.dt * d.factor(-3, 3))
    viscous = eta / 2 * inner(rate, rate) if kind == "viscoplastic" else 0
    return k * norm(rate) + viscous + indicator(tr(rate), -tr(rate))


def _dashpot(d: _Draw) -> Any:
    """φ* of Kelvin and Voigt: the force of the observable."""
    d.tags.append("kelvin voigt")
    S = forces(d.eps)
    eta = d.parameter("eta_v", d.modulus * d.dt * d.factor(-3, 3))
    zeta = d.parameter("zeta_v", d.modulus * d.dt * d.factor(-3, 3))
    return inner(dev(S), dev(S)) / (4 * eta) + tr(S) ** 2 / (18 * zeta)


def random_law(rng: np.random.Generator, *, extreme: bool = False) -> RandomLaw:
    """A law and its values, a function of the generator alone."""
    d = _Draw(rng, extreme)
    kind = d.pick({"elastic": 0.06, "surfaces": 0.52, "finite": 0.2, "both": 0.06, "rates": 0.08, "dashpot": 0.08})
    d.tags.append(kind)
    flows = kind in ("surfaces", "finite", "both", "rates")
    if flows:
        if kind != "rates":
            d.back()
            d.scalar_hardening()
        else:
            d.scalar_hardening(0.3)
    strain = d.eps - d.eps_p if flows else d.eps
    starred = flows and d.chance(0.06)
    energy: dict[str, Any]
    if starred:
        d.tags.append("psi_star")
        sig = sym_tensor("sig")
        K, G = d.bulk_and_shear()
        star = tr(sig) ** 2 / (18 * K) + inner(dev(sig), dev(sig)) / (4 * G) + inner(sig, d.eps_p)
        energy = {"psi_star": star - sum(d.hardening)}
    else:
        psi = d.energy(strain) + d.networks() + d.warmth(strain) + sum(d.hardening)
        energy = {"psi": psi}
        if d.chance(0.06):
            d.tags.append("density")
            rho = d.parameter("rho", d.size(2, 4))
            energy = {"psi": psi / rho, "density": rho}
    potential: dict[str, Any] = {}
    if kind in ("surfaces", "both"):
        potential["phi_star"] = _surfaces(d)
    if kind in ("finite", "both"):
        potential["phi_star"] = _finite(d) + potential.get("phi_star", 0)
    if kind == "rates":
        potential["phi"] = _rates(d)
    if kind == "dashpot" or (kind == "surfaces" and d.chance(0.03)):
        potential["phi_star"] = _dashpot(d) + potential.get("phi_star", 0)
    internal = (d.eps_p, *d.backs, *d.scalars) if flows else ()
    law = Law("drawn", observable=d.eps, internal=internal, **energy, **potential)
    used = {p.name for p in law.parameters}
    values = {name: value for name, value in d.values.items() if name in used}
    return RandomLaw(law, values, d.strain, d.strength, d.dt, law.text, dict(d.heat), tuple(d.tags))


def broken_law(drawn: RandomLaw, rng: np.random.Generator) -> tuple[str, Law, dict[str, float]]:
    """(what is wrong, law, values) of the same law with one term that no admissible law has."""
    law, eps = drawn.law, drawn.law.observable
    kinds = ["concave energy", "odd energy"] if law.psi is not None else []
    kinds += ["concave flow", "above zero"] if law.phi_star is not None and law.phi_star.surfaces else []
    kinds += ["negative viscosity"] if law.phi_star is not None and law.phi_star.finite != 0 else []
    kinds = kinds or ["hardening"]
    kind = kinds[int(rng.integers(len(kinds)))]
    more = {"psi": law.psi, "psi_star": law.psi_star, "phi": law.phi, "phi_star": law.phi_star, "density": law.density}
    size = parameter("z", lower=0.0)
    # larger than any coefficient that two of the values make
    sizes = [abs(v) for v in drawn.values.values() if v != 0.0] or [1.0]
    values = {**drawn.values, "z": 1e3 * max(1.0, *sizes, *(1.0 / v for v in sizes)) ** 2}
    if kind == "concave energy":
        more["psi"] = law.psi - size * inner(eps, eps)
    elif kind == "odd energy":
        more["psi"] = law.psi + size * tr(eps) ** 3
    elif kind == "concave flow":
        first, *rest = law.phi_star.surfaces
        symbol = next(s for s in law.forces.values() if getattr(s, "rank", 0) == 2)
        more["phi_star"] = law.phi_star.finite + indicator(first - size * norm(symbol), *rest)
    elif kind == "above zero":
        first, *rest = law.phi_star.surfaces
        more["phi_star"] = law.phi_star.finite + indicator(first + size, *rest)
    elif kind == "negative viscosity":
        symbol = next(s for s in law.forces.values() if getattr(s, "rank", 0) == 2)
        more["phi_star"] = law.phi_star - size * inner(symbol, symbol)
    else:
        x = law.internal[0]
        more["psi_star"] = law.psi_star + size * inner(x, x)
    found = Law("broken", observable=eps, internal=law.internal, **{k: v for k, v in more.items() if v is not None})
    return kind, found, values


# -- states ---------------------------------------------------------------------------------------------------------------------------


SHAPES = ("general", "spherical", "rounded", "pair", "near", "shears", "axes", "zero", "tiny", "uniaxial")


def random_strains(rng: np.random.Generator, n: int, low: float = -3.0, high: float = 3.0) -> np.ndarray:
    """Strains (n, 6) of 10^[low, high], general and of degenerate shape: spherical, with eigenvalues that repeat exactly or nearly, along
    the axes, zero."""
    found = rng.normal(size=(n, 6))
    kinds = rng.integers(0, 2 * len(SHAPES), n)  # half of them general
    for i, kind in enumerate(kinds):
        shape = SHAPES[kind] if kind < len(SHAPES) else "general"
        sign, pair = rng.choice([-1.0, 1.0]), rng.normal(size=2)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        if shape == "spherical":
            found[i] = sign * I6
        elif shape == "rounded":
            found[i] = sign * I6 + 2e-16 * rng.normal(size=6)
        elif shape == "pair":
            found[i] = 0.0
            found[i, :3] = np.roll([pair[0], pair[0], pair[1]], int(rng.integers(3)))
        elif shape == "near":
            gap = rng.choice([1e-8, 1e-12, 1e-15])
            found[i] = _turned(turn, [pair[0], pair[0] * (1 + gap), pair[1]])
        elif shape == "shears":
            found[i] = 0.0
            found[i, 3:] = pair[0]
        elif shape == "axes":
            found[i, 3:] = 0.0
        elif shape == "zero":
            found[i] = 0.0
        elif shape == "tiny":
            found[i] *= 1e-12
        elif shape == "uniaxial":
            found[i] = _turned(turn, [sign, 0.0, 0.0])
    size = np.linalg.norm(found, axis=1, keepdims=True)
    keep = np.isin([SHAPES[k] if k < len(SHAPES) else "general" for k in kinds], ["zero", "tiny"])
    found = np.where(keep[:, None], found, found / np.where(size > 0, size, 1.0))
    return found * 10.0 ** rng.uniform(low, high, (n, 1))


def _turned(turn: np.ndarray, values: Any) -> np.ndarray:
    m = turn @ np.diag(values) @ turn.T
    root = np.sqrt(2.0)
    return np.array([m[0, 0], m[1, 1], m[2, 2], root * m[1, 2], root * m[0, 2], root * m[0, 1]])


def random_states(
    drawn: RandomLaw, update: Any, rng: np.random.Generator, n: int, *, low: float = -3.0, high: float = 3.0
) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """(strains before (n, 6), states, new strains (n, 6)): half of the points virgin, half after a step of up to ten yield strains.

    New strains lie 10^[low, high] yield strains away from the old ones, a tenth of them exactly where the old ones are; where the earlier
    step was refused, the states are virgin.
    """
    before = random_strains(rng, n, -1.0, 1.0) * drawn.strain
    ahead = random_strains(rng, n, low, high) * drawn.strain
    ahead[rng.random(n) < 0.1] = 0.0
    half = n // 2
    state = {name: np.zeros_like(value) for name, value in update.initial_state(n).items()}
    before[:half] = 0.0
    if half < n:
        try:
            out = update(before[half:], None, drawn.dt, **drawn.values, **drawn.heat)
        except FenchelError:
            before[half:] = 0.0
        else:
            for name, value in out.state.items():
                state[name][half:] = value
    return before, state, before + ahead
