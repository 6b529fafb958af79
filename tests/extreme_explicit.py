"""Largest stable steps of what is explicit, against the theory of each, and that what is implicit has none.

* The explicit scheme of a law (`solver="explicit"`) is Heun's. A sub-step multiplies a deviation from steady flow by 1 − z + z²/2,
  z = dt/τ, so that it is stable up to z = 2. With J = 1/τ from the law: Maxwell and Bingham 2G/2η; Norton and Perzyna
  3G n ε̇₀/σ₀ (f/σ₀)^(n−1). Measured by bisection; right to 1e-3, as the deviation is 1e-6 of the state and not infinitely small.
* The whole option controls its error and shortens sub-steps at that limit. A relaxation asks for ∫ e^(−z/2) dz/√(2 tol) = √(2/tol) of them
  until the stress has gone, and for z/2 more: with `limit` sub-steps z = 2 (limit − √(2/tol)) is reached, measured within a factor of two;
  beyond it is refused. Where it goes through, the stress is right to a hundred times the tolerance of a sub-step.
* The implicit step multiplies by 1/(1 + z) at any z (to 1e-9).
* Grains: directions of links and normals are those of the mid configuration, and explicit; along them all is implicit. A pendulum is
  stepped as v⁺ = v − h ω² x, x⁺ = x + h v⁺, stable up to h ω = 2; right to 1e-2 (400 steps, growth seen from 1e3 on).
* Compliant contacts are implicit Euler on q_m, whatever θ: for a convex potential the energy at (v, q_m) never grows (64 ε of its start).
* A servo, w = λ(F − R) with R at the end of the step, on a sphere of mass m between two contacts of stiffness k: the implicit equations of
  sphere and plane, solved in closed form step by step, to 1e-9 F; an explicit servo would be stable to h k λ = 2 only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from extreme_roundoff import moduli
from extreme_rows import Cell, Measured, near, nothing_but

from fenchel.dem import Assembly, Drive, Laws, Plane, Simulation, Solver
from fenchel.dem.laws import CompliantSignoriniCoulomb, ElasticRod, RigidWire
from fenchel.errors import ConvergenceError
from fenchel.integrators.explicit import ExplicitUpdate, Integration
from fenchel.potentials.library import ENTRIES

EPS = float(np.finfo(float).eps)
G = 9.81
TIGHT = Solver(tolerance=1e-14, sweep_limit=1_000_000)
SHEAR = np.array([1.0, -1.0, 0.0, 0.0, 0.0, 0.0]) / np.sqrt(2.0)
VISCOUS = ("maxwell", "bingham", "norton", "perzyna")


def bisected(stable: Callable[[float], bool], low: float, high: float, halvings: int = 40) -> float:
    """Largest argument at which `stable` holds, between one where it does and one where it does not."""
    assert stable(low) and not stable(high)
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


# -- laws -------------------------------------------------------------------------------------------------------------------------


def steady(law: str) -> tuple[dict[str, float], float, float, float]:
    """(values, ‖dev σ‖ of a steady flow [Pa], its rate ‖ε̇‖ [1/s], J = 1/τ [1/s])."""
    values = dict(ENTRIES[law].values)
    _, mu = moduli(values)
    if law == "maxwell":
        size = 1e-3 * values["E"]
        return values, size, size / (2 * values["eta"]), mu / values["eta"]
    if law == "bingham":
        size = 3 * np.sqrt(2) * values["tau_y"]
        return values, size, (size - np.sqrt(2) * values["tau_y"]) / (2 * values["eta"]), mu / values["eta"]
    n, unit, rate = values["n"], values["sigma_0"], values["rate_0"]
    over = 2.0 * unit
    if law == "perzyna":
        values["H_i"] = 0.0
    size = (over + values.get("sigma_y", 0.0)) / np.sqrt(1.5)
    return values, size, np.sqrt(1.5) * rate * (over / unit) ** n, 3 * mu * n * rate / unit * (over / unit) ** (n - 1)


def heun(law: str) -> tuple[Measured, str]:
    """One sub-step of the explicit scheme from beside a steady flow: does the deviation grow?"""
    values, size, rate, J = steady(law)
    _, mu = moduli(values)
    update = ExplicitUpdate(ENTRIES[law].law)
    numbers = update.law.admissible_values(values)
    deviation = 1e-6 * size / (2 * mu)

    def stable(dt: float) -> bool:
        start, whole = (size / (2 * mu)) * SHEAR, (rate * dt) * SHEAR
        state = update.initial_state(1)
        name = "eps_v" if law == "maxwell" else "eps_p"
        state[name] = -deviation * SHEAR[None]
        packed = np.concatenate([np.reshape(state[k], (1, -1)) for k in update.layout], axis=1)
        packed[0, -6:] = start
        run = Integration(update, numbers, (start + whole)[None], packed, dt)
        moved, *_ = run._substep(start[None], run.old, whole[None], np.ones(1), np.arange(1))
        place, width = update.layout[name]
        left = (moved[0, place : place + width] - whole) @ SHEAR
        return abs(left) <= deviation

    found = bisected(stable, 0.5 / J, 8.0 / J)
    return {"largest dt over 2τ [-]": near(found * J / 2, 1.0, abs=1e-3)}, f"dt/τ: {found * J:.4f}, theory 2"


def relaxed(z: float, tolerance: float, limit: int) -> tuple[Any, Any]:
    """Stress (6,) of Maxwell strained by shear at once and held for z relaxation times in one explicit step, and its start."""
    values = dict(ENTRIES["maxwell"].values)
    _, mu = moduli(values)
    strain = 1e-3 * SHEAR
    update = ExplicitUpdate(ENTRIES["maxwell"].law, tolerance, limit)
    state = update.initial_state(1)
    state["eps"] = strain[None]
    out = update(strain, state, z * values["eta"] / mu, **values)
    return out.stress[0], 2 * mu * strain


def controlled(z: float, limit: int = 1000) -> Measured:
    """One explicit step of z relaxation times, by at most `limit` sub-steps: exp(−z)."""
    stress, start = relaxed(z, 1e-4, limit)
    return {"stress [Pa]": near(stress, start * np.exp(-z), abs=1e-2 * float(np.abs(start).max()))}


def reach(tolerance: float, limit: int) -> tuple[Measured, str]:
    """Largest step of the whole option with `limit` sub-steps."""

    def stable(log: float) -> bool:
        try:
            relaxed(10.0**log, tolerance, limit)
        except ConvergenceError:
            return False
        return True

    theory = 2 * (limit - np.sqrt(2 / tolerance))
    found = bisected(stable, np.log10(theory) - 2.0, np.log10(theory) + 2.0, 8)
    return {
        "decades off theory": near(found, np.log10(theory), abs=np.log10(2.0))
    }, f"z: {10**found:.0f}, theory {theory:.0f}"


def implicit(z: float) -> Measured:
    """The implicit step of Maxwell over z relaxation times: 1/(1 + z)."""
    values = dict(ENTRIES["maxwell"].values)
    _, mu = moduli(values)
    strain = 1e-3 * SHEAR
    out = ENTRIES["maxwell"].law.compile()(strain, None, z * values["eta"] / mu, **values)
    start = 2 * mu * 1e-3
    # beside the answer stands the rounding of 2G(ε − ε_v)
    return {"stress [Pa]": near(out.stress[0] @ SHEAR, start / (1 + z), rel=1e-9, abs=4 * EPS * start)}


def radial_jump(strains: float) -> Measured:
    """One explicit step of so many yield strains along a radial path of von Mises with linear hardening: the truth is one implicit step,
    the bound ten times the tolerance of the largest stress."""
    values = dict(ENTRIES["von_mises"].values)
    _, mu = moduli(values)
    eps = strains * values["sigma_y"] / mu * SHEAR
    update = ExplicitUpdate(ENTRIES["von_mises"].law)
    out = update(eps, update.initial_state(1), **values)
    truth = ENTRIES["von_mises"].law.compile()(eps, None, **values)
    return {"stress [Pa]": near(out.stress, truth.stress, abs=1e-5 * float(np.abs(truth.stress).max()))}


def no_force() -> Measured:
    """Kelvin–Voigt has a force of the observable, which the explicit scheme does not take: refused in one line."""
    ExplicitUpdate(ENTRIES["kelvin_voigt"].law)
    return {"not refused": nothing_but(False)}


# -- grains -----------------------------------------------------------------------------------------------------------------------


def swing(law: RigidWire | ElasticRod) -> tuple[Measured, str]:
    """A pendulum of 10 cm beside its rest: largest h ω."""
    length, omega = 0.1, np.sqrt(G / 0.1)
    give = 0.01 * G / law.stiffness * length if isinstance(law, ElasticRod) else 0.0

    def stable(number: float) -> bool:
        x = np.array([[0.0, 0.0, 0.0], [1e-9, 0.0, -length - give]])
        wire, rank = np.zeros(2, dtype=np.int64), np.arange(2)
        a = Assembly.of_spheres(x, np.full(2, 0.001), np.array([np.inf, 0.01]), wire=wire, rank=rank)
        a.link_length[:] = length
        simulation = Simulation(a, Laws(wire=law), TIGHT)
        largest = 0.0
        for _ in range(400):
            simulation.advance(number / omega, Drive(gravity=np.array([0.0, 0.0, -G])))
            largest = max(largest, abs(float(a.x[1, 0])))
            if largest > 1e-6:
                return False
        return True

    found = bisected(stable, 1.0, 3.1, 10)
    return {"largest h ω over 2 [-]": near(found / 2, 1.0, abs=1e-2)}, f"h ω: {found:.3f}, theory 2"


def bounce(number: float, theta: float) -> Measured:
    """A sphere pressed ten times as far into a compliant floor as its weight does, at h ω = number, ω² = k/m: energy at (v, q_m)."""
    m, k = 0.1, 1e5
    h = number / np.sqrt(k / m)
    depth = 10 * m * G / k
    a = Assembly.of_spheres(np.array([[0.0, 0.0, 0.01 - depth]]), np.array([0.01]), np.array([m]))
    floor = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.5)
    law = CompliantSignoriniCoulomb(friction=0.5, k_n=k, k_t=0.8 * k)
    simulation = Simulation(a, Laws(contact=law), TIGHT, planes=[floor], theta=theta)
    gravity = Drive(gravity=np.array([0.0, 0.0, -G]))

    def energy() -> float:
        gap = float(a.x[0, 2]) - 0.01
        return 0.5 * m * float(a.velocity[0, 2]) ** 2 + 0.5 * k * min(gap, 0.0) ** 2 + m * G * gap

    before = start = energy()
    grown = 0.0
    for _ in range(200):
        simulation.advance(h, gravity)
        now = energy()
        grown, before = max(grown, now - before), now
    return {"energy gained in a step [J]": (grown, 64 * EPS * max(start, m * G * 0.01))}


def servo(gain: float) -> tuple[Measured, str]:
    """A sphere on a compliant floor under a servo plane, at h k λ = gain: 200 steps against the implicit equations

    m(v⁺ − v) = h (R_f − R_l),  R_f = k⟨a − h v⁺⟩,  R_l = k⟨b + h v⁺ + h w⟩,  w = λ(F − R_l),

    a and b the overlaps with floor and plane."""
    k, h, m, force = 1e5, 1e-3, 1.0, 2.0
    mobility = gain / (h * k)
    a = Assembly.of_spheres(np.array([[0.0, 0.0, 0.01]]), np.array([0.01]), np.array([m]), locked=np.array([True]))
    floor = Plane(normal=(0, 0, 1), point=(0, 0, 0))
    lid = Plane(normal=(0, 0, -1), point=(0, 0, 0.02), force=force, mobility=mobility)
    law = CompliantSignoriniCoulomb(friction=0.0, k_n=k, k_t=0.8 * k)
    simulation = Simulation(a, Laws(contact=law), TIGHT, planes=[floor, lid])
    low = up = v = worst = missing = 0.0
    for _ in range(200):
        simulation.advance(h, Drive())
        rows = simulation.contacts
        assert rows is not None
        found = -float(rows.wall_impulse[rows.touching[:, 1] == 1, 2].sum()) / h
        for on_floor, on_lid in ((1.0, 1.0), (0.0, 1.0), (1.0, 0.0), (0.0, 0.0)):
            # R_l (1 + h k λ) = k (b + h v⁺ + h λ F) where the plane touches
            slope, level = on_lid * k * h / (1 + gain), on_lid * k * (up + h * mobility * force) / (1 + gain)
            new = (m * v + h * (on_floor * k * low - level)) / (m + h * (on_floor * k * h + slope))
            right = level + slope * new
            if (low - h * new >= 0) == bool(on_floor) and (up + h * new + h * mobility * (force - right) >= 0) == bool(
                on_lid
            ):
                break
        w = mobility * (force - right)
        low, up, v = low - h * new, up + h * new + h * w, new
        worst, missing = max(worst, abs(found - right)), abs(force - found)
    return {"force on the plane [N]": (worst, 1e-9 * force)}, f"|F − R|/F at the end: {missing / force:.0e}"


ROD = ElasticRod(stiffness=1e6)
HEUN, WHOLE, IMPLICIT, JUMP = "Heun's limit", "error control", "implicit step, dt/τ", "one explicit step, yield strains"
SWING, BOUNCE, SERVO = "pendulum", "compliant contact, h ω", "servo, h k λ"
CELLS: list[Cell] = [
    *(Cell(HEUN, law, lambda law=law: heun(law)) for law in VISCOUS),
    *(Cell(WHOLE, f"dt/τ {z:g}", lambda z=z: controlled(z)) for z in (1e-2, 1.0, 1e2, 1e3)),
    Cell(WHOLE, "dt/τ 1e5", lambda: controlled(1e5, 200), says="more than 200 sub-steps"),
    Cell(WHOLE, "reach of 100 sub-steps", lambda: reach(1e-2, 100)),
    *(Cell(IMPLICIT, f"{z:.0e}", lambda z=z: implicit(z)) for z in (1e-2, 1.0, 1e2, 1e6, 1e12)),
    *(Cell(JUMP, f"{k:g}", lambda k=k: radial_jump(k)) for k in (1e1, 1e2, 1e3)),
    Cell("law with a viscous stress", "kelvin_voigt", no_force, says="explicit step takes laws declared by phi_star"),
    Cell(SWING, "rigid wire", lambda: swing(RigidWire())),
    Cell(SWING, "stiff elastic rod", lambda: swing(ROD)),
    *(
        Cell(BOUNCE, f"{w:g}, θ {theta:g}", lambda w=w, theta=theta: bounce(w, theta))
        for theta in (0.5, 1.0)
        for w in (1e-2, 1.0, 1e2, 1e4, 1e6)
    ),
    *(Cell(SERVO, f"{g:g}", lambda g=g: servo(g)) for g in (1e-3, 1.0, 10.0, 1e3, 1e6)),
]
