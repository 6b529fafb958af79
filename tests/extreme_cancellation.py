"""Cancellation: trial points at relative distances 1e-1 … 1e-16 from where the flank of a cone ends and its apex begins, and nearly equal
eigenvalues.

The truth of the cones (Drucker–Prager, sand) and of the wires is a closed form in forty digits, at the strains as they are in double
precision; tangents are its difference quotients over 1e-25 of the strain, where that does not cross an edge (distances from 1e-12 on). Laws
of principal values are judged by the conditions of optimality in extended precision (`step_optimality`).

Bounds, stated before any run; ε = 2.2e-16:

* stress: 32 ε ‖𝕂‖ ‖ε‖. A projection moves no further than its trial, so that only the rounding of some thirty operations on it remains;
* tangent of a cone: 100 ε ‖𝕂‖ ‖ε‖/‖dev ε‖, the rounding of the direction of the deviator;
* tangent of the wires: 1e-6 ‖𝕂‖. (e_a − e_b)/(a − b) is replaced by its limit for gaps below 1e-9; above, it has some 4 ε/1e-9 of rounding.
  Across zero it is the ratio of two eigenvalues, each known to ε of the largest: 4 ε/gap there;
* tangent of laws of principal values: symmetric to 1e-8 ‖𝕂‖ and between 0 and 𝕂, which is what a convex step allows. As the stress turns
  with the strain, 𝕋(Wε − εW) = Wσ − σW for every spin W, to 100 ε ‖𝕂‖ ‖ε‖: of a pair of eigenvalues that is the quotient of differences.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import mpmath
import numpy as np
from extreme_roundoff import I6, moduli, stiffness
from extreme_rows import Cell, Measured, near
from extreme_steps import Cell as StepCell
from extreme_steps import excess
from law_truth import mandel, matrix, turned

from fenchel.potentials.library import ENTRIES

EPS = float(np.finfo(float).eps)
mp = mpmath.mp.clone() if hasattr(mpmath.mp, "clone") else mpmath.MPContext()
mp.dps = 40
SMOOTH = 1e-12  # distances from which on a tangent is looked at
DISTANCES = tuple(10.0**-k for k in (1, 2, 4, 6, 8, 10, 12, 13, 14, 15, 16))


# -- closed forms in forty digits ---------------------------------------------------------------------------------------------------


def elastic(e: list[Any], lam: Any, mu: Any) -> list[Any]:
    trace = sum(e[:3])
    return [2 * mu * x + (lam * trace if i < 3 else 0) for i, x in enumerate(e)]


def exact_moduli(values: dict[str, float]) -> tuple[Any, Any]:
    E, nu = mp.mpf(values.get("E", values.get("E_s", 0.0))), mp.mpf(values.get("nu", values.get("nu_s", 0.0)))
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def cone(e: list[Any], values: dict[str, float]) -> list[Any]:
    """Stress of a virgin cone √J₂ + t tr/3 ≤ C_0 + H_i p with kinematic hardening H_k of the tensor, at one strain."""
    lam, mu = exact_moduli(values)
    t, K = mp.tan(mp.mpf(values["theta_f"])), lam + 2 * mu / 3
    Hk, Hi, C0 = (mp.mpf(values.get(name, 0.0)) for name in ("H_k", "H_i", "C_0"))
    trial = elastic(e, lam, mu)
    mean = sum(trial[:3]) / 3
    dev = [x - (mean if i < 3 else 0) for i, x in enumerate(trial)]
    root = mp.sqrt(sum(x * x for x in dev) / 2)
    f = root + t * mean - C0
    if f <= 0:
        return trial
    gamma = f / (mu + Hk / 2 + t * t * (K + Hk / 3) + Hi)
    if root >= gamma * (mu + Hk / 2):
        flow = [gamma * x / (2 * root) for x in dev]
    else:
        gamma = (t * mean - C0) / (t * t * (K + Hk / 3) + Hi)
        flow = [x / (2 * mu + Hk) for x in dev]
    return [x - 2 * mu * y - (K * t * gamma if i < 3 else 0) for i, (x, y) in enumerate(zip(trial, flow, strict=True))]


def wires(e: list[Any], lam: Any, mu: Any) -> list[Any]:
    """λ⟨tr ε⟩I + 2μ ε⁺ at one strain."""
    r = mp.sqrt(mp.mpf(1) / 2)
    m = mp.matrix([[e[0], r * e[5], r * e[4]], [r * e[5], e[1], r * e[3]], [r * e[4], r * e[3], e[2]]])
    values, q = mp.eigsy(m)
    out = [mp.mpf(0)] * 6
    trace = max(sum(e[:3]), mp.mpf(0))
    for place, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
        total = sum(2 * mu * max(values[k], mp.mpf(0)) * q[i, k] * q[j, k] for k in range(3))
        out[place] = total / r if place > 2 else total + lam * trace
    return out


def law_stress(name: str, strain: list[Any], values: dict[str, float]) -> list[Any]:
    found = [mp.mpf(0)] * 6
    if "theta_f" in values:
        found = cone(strain, values)
    if "mu_w" in values:
        more = wires(strain, mp.mpf(values["lambda_w"]), mp.mpf(values["mu_w"]))
        found = [x + y for x, y in zip(found, more, strict=True)]
    return found


def truth(name: str, strain: Any, values: dict[str, float], slopes: bool) -> tuple[Any, Any]:
    """Stress (6,) and tangent (6, 6) or None in double precision, from forty digits at one strain."""
    e = [mp.mpf(float(x)) for x in strain]
    base = law_stress(name, e, values)
    stress = np.array([float(x) for x in base])
    if not slopes:
        return stress, None
    h = mp.mpf(float(np.abs(strain).max())) * mp.mpf(10) ** -25
    tangent = np.empty((6, 6))
    for j in range(6):
        moved = law_stress(name, [x + (h if i == j else 0) for i, x in enumerate(e)], values)
        tangent[:, j] = [float((a - b) / h) for a, b in zip(moved, base, strict=True)]
    return stress, tangent


def against_truth(name: str, eps: Any, slopes: bool, allowed: Any) -> Measured:
    """Stress and tangent of a law at strains (n, 6) from the virgin state against forty digits."""
    values = dict(ENTRIES[name].values)
    out = ENTRIES[name].law.compile()(eps, None, **values)
    size = stiffness(values)
    errors: dict[str, tuple[float, float]] = {}
    stresses, tangents = zip(*(truth(name, e, values, slopes) for e in eps), strict=True)
    length = np.linalg.norm(eps, axis=1)
    errors["stress [Pa]"] = near(out.stress, np.array(stresses), abs=32 * EPS * size * length[:, None])
    if slopes:
        errors["tangent [Pa]"] = near(out.tangent, np.array(tangents), abs=np.asarray(allowed)[:, None, None] * size)
    else:
        errors["tangent is finite"] = (float((~np.isfinite(out.tangent)).sum()), 0.0)
    return errors


# -- the apex -----------------------------------------------------------------------------------------------------------------------


def directions(count: int, seed: int) -> Any:
    """Unit deviators."""
    n = turned(np.random.default_rng(seed), np.random.default_rng(seed + 1).normal(size=(count, 3)))
    n -= n[:, :3].mean(axis=1, keepdims=True) * I6
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def flank_to_apex(name: str, distance: float) -> Measured:
    """Trials whose flow would end at √J₂ = ± distance times that of the trial: on the flank, and beyond its end."""
    values = dict(ENTRIES[name].values)
    lam, mu = moduli(values)
    K, t, Hk, Hi = lam + 2 * mu / 3, np.tan(values["theta_f"]), values.get("H_k", 0.0), values["H_i"]
    gamma = 3 * values["C_0"] / mu
    root = gamma * (mu + Hk / 2)
    mean = (gamma * (mu + Hk / 2 + t * t * (K + Hk / 3) + Hi) + values["C_0"] - root) / t
    eps = []
    for side in (1.0, -1.0):
        for n in directions(2, 5):
            eps.append(np.sqrt(2.0) * root * (1 + side * distance) / (2 * mu) * n + mean / (3 * K) * I6)
    strains = np.array(eps)
    shear = np.linalg.norm(strains - strains[:, :3].mean(axis=1, keepdims=True) * I6, axis=1)
    allowed = 100 * EPS * np.linalg.norm(strains, axis=1) / shear
    if name == "texsol":
        allowed = np.maximum(allowed, 1e-6)
    return against_truth(name, strains, distance >= SMOOTH, allowed)


def near_the_axis(name: str, distance: float) -> Measured:
    """Deviators of `distance` times the mean beyond the apex: the stress of the sand ends in it, or beside it by its hardening."""
    values = dict(ENTRIES[name].values)
    lam, mu = moduli(values)
    mean = 5 * values["C_0"] / np.tan(values["theta_f"]) / (3 * lam + 2 * mu)
    eps = mean * (I6 + distance * directions(3, 9))
    allowed = np.full(len(eps), max(100 * EPS / distance, 1e-6 if name == "texsol" else 0.0))
    return against_truth(name, eps, distance >= SMOOTH, allowed)


# -- principal values -----------------------------------------------------------------------------------------------------------------


def spins() -> tuple[Any, ...]:
    """The three unit spins."""
    found = []
    for i, j in ((0, 1), (1, 2), (2, 0)):
        w = np.zeros((3, 3))
        w[i, j], w[j, i] = 1.0, -1.0
        found.append(w)
    return tuple(found)


def commutator(w: Any, tensor: Any) -> Any:
    """W a − a W in Mandel components, (n, 6)."""
    a = matrix(tensor)
    return mandel(w @ a - a @ w)


def by_optimality(name: str, eps: Any) -> Measured:
    """A law of principal values at strains (n, 6): conditions of optimality over their tolerance, and a tangent between 0 and 𝕂."""
    values = dict(ENTRIES[name].values)
    update = ENTRIES[name].law.compile()
    old = update.initial_state(len(eps))
    out = update(eps, old, **values)
    lam, mu = moduli(values)
    whole = lam * np.outer(I6, I6) + 2 * mu * np.eye(6)
    size = float(np.linalg.norm(whole, 2))
    turn = out.tangent.transpose(0, 2, 1)
    low, high = np.linalg.eigvalsh(0.5 * (out.tangent + turn)), np.linalg.eigvalsh(whole - 0.5 * (out.tangent + turn))
    turned_strain, turned_stress = (np.stack([commutator(w, x) for w in spins()], axis=1) for x in (eps, out.stress))
    spin = np.einsum("nij,nkj->nki", out.tangent, turned_strain) - turned_stress
    return {
        "stress of a turned strain [Pa]": near(
            spin, 0.0, abs=100 * EPS * size * np.linalg.norm(eps, axis=1)[:, None, None]
        ),
        "residual over its tolerance [-]": (excess(StepCell(name, ""), eps, old, out), 1.0),
        "asymmetry of the tangent [Pa]": (float(np.abs(out.tangent - turn).max()), 1e-8 * size),
        "tangent below 0 [Pa]": (float(max(0.0, -low.min())), 1e-8 * size),
        "tangent above 𝕂 [Pa]": (float(max(0.0, -high.min())), 1e-8 * size),
    }


@cache
def frames() -> tuple[Any, ...]:
    """Rotations: none, and three at random."""
    rng = np.random.default_rng(3)
    return (np.eye(3), *(np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(3)))


def with_gap(gap: float, size: float, frame_count: int) -> Any:
    """Strains with eigenvalues two of which lie `gap` apart, relative to the largest, in several axes."""
    r, found = np.sqrt(2.0), []
    for values in ((1.0, 1.0 - gap, -0.5), (1.0, -0.5, -0.5 - gap), (1.0, 1.0 - gap, 1.0 + gap), (0.7, gap, -gap)):
        for q in frames()[:frame_count]:
            m = (q * np.array(values)) @ q.T
            found.append([m[0, 0], m[1, 1], m[2, 2], r * m[1, 2], r * m[0, 2], r * m[0, 1]])
    return size * np.array(found)


def equal_eigenvalues(name: str, gap: float) -> Measured:
    """Two or three eigenvalues of the strain that lie `gap` apart, some on either side of zero, at ten yield strains."""
    values = dict(ENTRIES[name].values)
    if name in ("wire", "texsol"):
        eps = with_gap(gap, 1e-2, 2)
        return against_truth(name, eps, gap >= SMOOTH, np.full(len(eps), max(1e-6, 4 * EPS / gap)))
    strength = values.get("sigma_y", values.get("sigma_t", values.get("c", 0.0)))
    return by_optimality(name, with_gap(gap, 10 * strength / values["E"], 4))


def tip_of_the_pyramid(name: str, distance: float) -> Measured:
    """Trials beyond the apex of Mohr–Coulomb or Rankine whose deviator is `distance` times the mean."""
    values = dict(ENTRIES[name].values)
    strength = values.get("c", values.get("sigma_t", 0.0))
    eps = 10 * strength / values["E"] * (I6 + distance * directions(8, 11))
    return by_optimality(name, eps)


FLANK, AXIS, EQUAL = "distance to the end of the flank, ", "deviator over mean at the apex, ", "gap of eigenvalues, "
SHORT = {"drucker_prager": "DP", "mohr_coulomb": "Mohr–Coulomb"}
CELLS: list[Cell] = [
    *(
        Cell(title + SHORT.get(law, law), f"{d:.0e}", lambda run=run, law=law, d=d: run(law, d))
        for title, run, laws in (
            (FLANK, flank_to_apex, ("drucker_prager", "sand", "texsol")),
            (AXIS, near_the_axis, ("drucker_prager", "sand", "texsol")),
            (AXIS, tip_of_the_pyramid, ("mohr_coulomb", "rankine")),
            (EQUAL, equal_eigenvalues, ("wire", "texsol", "tresca", "mohr_coulomb", "rankine")),
        )
        for law in laws
        for d in DISTANCES
    )
]
