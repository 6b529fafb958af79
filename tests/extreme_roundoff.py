"""Round-off that adds up over 1e7 material steps and 1e6 contact steps, and numbers below the normal range (denormals).

Bounds, stated before any run; ε = 2.2e-16:

* a path of N material steps: N ε ‖𝕂‖ ‖ε_end‖, what N roundings of the state leave if all point the same way (a random walk leaves √N);
* a sum of N terms: N ε of its value;
* N contact steps: a speed whose truth is zero is zero to a rounding of what weight alone gives in a step, ε g h, or to what the solver was
  asked for, 1e-13 of the impulses: Δv ≤ 1e-13 n² g h for n grains on each other, Δx ≤ N h Δv; a speed that grows is right to N ε;
* a product of a denormal strain and a modulus: exact (rational numbers), up to 8 ε of the largest stress and 8 units of the last denormal
  digit, 5e-324, times ‖𝕂‖ where the state flows, which has no more digits than the strain; a tangent to 1e-12 ‖𝕂‖ and the digits that the
  strain has, 8 · 5e-324/‖ε‖;
* another unit of stress: 1e-12 of the largest stress (the condition of the step), and 64 units of the last denormal digit.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np
from extreme_rows import Cell, Measured, near
from extreme_steps import RADIAL, SHAPES, STRENGTH
from law_truth import lame

from fenchel.dem import Assembly, Drive, Laws, Plane, Simulation, Solver
from fenchel.dem.laws import SignoriniCoulomb
from fenchel.integrators import drive_arrays
from fenchel.potentials.library import ENTRIES

EPS = float(np.finfo(float).eps)
TINY = 5e-324
BLOCK = 100_000
MANY, CONTACT, CONTACT_SHORT = 10_000_000, 1_000_000, 10_000
G = 9.81
I6 = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


def moduli(values: Mapping[str, float]) -> tuple[float, float]:
    return lame(values.get("E", values.get("E_s", 0.0)), values.get("nu", values.get("nu_s", 0.0)))


def stiffness(values: Mapping[str, float]) -> float:
    """‖𝕂‖ = max(2G, 3K) [Pa], with the wires where there are some."""
    lam, mu = moduli(values)
    lam, mu = lam + values.get("lambda_w", 0.0), mu + values.get("mu_w", 0.0)
    return max(2 * mu, 3 * lam + 2 * mu)


def long_path(update: Any, values: Mapping[str, float], blocks: Any) -> tuple[Any, dict[str, Any]]:
    """Stress and state at the end of paths that follow one another, each a block of strains (n, 6)."""
    state, strain, stress = None, None, np.zeros(6)
    for block in blocks:
        history = drive_arrays(update, [False] * 6, block, values, initial_strain=strain, initial_state=state)
        state, strain, stress = {k: x[-1] for k, x in history.state.items()}, block[-1], history.sig[-1]
    return stress, state or {}


def radial(law: str, count: int = MANY) -> Measured:
    """`count` steps along a radial path to ten yield strains, on a surface that hardens linearly, against one step."""
    update, values = ENTRIES[law].law.compile(), dict(ENTRIES[law].values)
    end = 10 * values[STRENGTH[law]] / values.get("E", values.get("E_s", 1.0)) * np.array(RADIAL[law])
    ramp = (np.arange(first, first + BLOCK)[:, None] / count * end for first in range(1, count, BLOCK))
    stress, state = long_path(update, values, ramp)
    one = update(end, None, **values)
    assert one.state["p"][0] > 0.1 * np.abs(end).max(), "the path never left the elastic domain"
    bound = count * EPS * stiffness(values) * float(np.linalg.norm(end))
    return {
        "stress [Pa]": near(stress, one.stress[0], abs=bound),
        "accumulated plastic strain [-]": near(state["p"], one.state["p"][0], rel=count * EPS),
    }


def cycles(count: int = MANY) -> Measured:
    """Shear cycles between ±a of von Mises with kinematic hardening, a hundred steps each: the loop closes, in closed form
    x = (2G a − √⅔ σ_y)/(2G + ⅔H_k) at the peak, and every half cycle adds 2x to the path of plastic strain."""
    values = dict(ENTRIES["von_mises"].values) | {"H_i": 0.0}
    update = ENTRIES["von_mises"].law.compile()
    two_mu, hard, limit = 2 * moduli(values)[1], 2 * values["H_k"] / 3, np.sqrt(2 / 3) * values["sigma_y"]
    peak = 5 * limit / two_mu
    quarter = np.arange(1, 26) / 25
    cycle = np.concatenate([quarter, 1 - quarter, -quarter, quarter - 1])
    block = np.zeros((BLOCK, 6))
    block[:, 5] = peak * np.tile(cycle, BLOCK // 100)
    last = np.zeros((25, 6))
    last[:, 5] = peak * quarter
    repeated = (block for _ in range(count // BLOCK))
    stress, state = long_path(update, values, [*repeated, last])
    x = (two_mu * peak - limit) / (two_mu + hard)
    truth = np.zeros(6)
    truth[5] = two_mu * (peak - x)
    halves = 2 * (count // 100)  # from peak to peak, after the first
    return {
        "stress at the peak [Pa]": near(stress, truth, abs=count * EPS * two_mu * peak),
        "accumulated plastic strain [-]": near(state["p"], (x + 2 * x * halves) / np.sqrt(1.5), rel=count * EPS),
    }


def relaxation(count: int = MANY) -> Measured:
    """Maxwell at constant strain for one relaxation time in `count` implicit steps: dev σ = 2G dev ε (1 + 1/N)^−N."""
    values = dict(ENTRIES["maxwell"].values)
    _, mu = moduli(values)
    values["eta"] = mu * count
    strain = 1e-3 * np.array([1.0, 0.0, -1.0, 0.3, 0.0, 0.5])
    block = np.tile(strain, (BLOCK, 1))
    stress, _ = long_path(ENTRIES["maxwell"].law.compile(), values, (block for _ in range(count // BLOCK)))
    truth = 2 * mu * strain * np.exp(-count * np.log1p(1 / count))
    return {"stress [Pa]": near(stress, truth, abs=count * EPS * 2 * mu * float(np.linalg.norm(strain)))}


# -- contact steps ----------------------------------------------------------------------------------------------------------------


def on_slope(count: int, angle: float, friction: float, step: float, locked: bool) -> Assembly:
    """A sphere of radius 1 cm after `count` steps on a slope, from rest."""
    a = Assembly.of_spheres(np.array([[0.0, 0.0, 0.01]]), np.array([0.01]), np.array([0.1]), locked=np.array([locked]))
    floor = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=friction)
    solver = Solver(tolerance=1e-13, sweep_limit=1_000_000)
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), solver, planes=[floor])
    drive = Drive(gravity=G * np.array([np.sin(angle), 0.0, -np.cos(angle)]))
    for _ in range(count):
        simulation.advance(step, drive)
    return a


def stays(count: int) -> Measured:
    """A block below the angle of friction does not creep."""
    h = 1e-3
    a = on_slope(count, np.arctan(0.3), 0.5, h, True)
    speed = EPS * G * h
    return {
        "speed [m/s]": (float(np.abs(a.velocity).max()), speed),
        "creep [m]": (float(np.abs(a.x - [[0.0, 0.0, 0.01]]).max()), count * h * speed),
    }


def slides(count: int) -> Measured:
    """A block above it: v = g (sin θ − μ cos θ) t, x = ½ g (…) h² N(N + 1), the sum of the steps."""
    h, angle = 1e-5, np.deg2rad(40.0)
    a = on_slope(count, angle, 0.5, h, True)
    pull = G * (np.sin(angle) - 0.5 * np.cos(angle))
    return {
        "speed [m/s]": near(a.velocity[0, 0], pull * h * count, rel=count * EPS),
        "way [m]": near(a.x[0, 0], 0.5 * pull * h**2 * count * (count + 1.0), rel=2 * count * EPS),
        "height [m]": near(a.x[0, 2], 0.01, abs=count * h * EPS * G * h),
    }


def rolls(count: int) -> Measured:
    """A sphere that rolls: v = 5/7 g sin θ t, ω r = v; the solver stops at 1e-13 of the impulses."""
    h, angle = 1e-5, np.arctan(0.3)
    a = on_slope(count, angle, 0.5, h, False)
    truth = 5.0 / 7.0 * G * np.sin(angle) * h * count
    allowed = count * EPS + 1e-12
    return {
        "speed [m/s]": near(a.velocity[0, 0], truth, rel=allowed),
        "rolling speed [m/s]": near(a.spin[0, 1], truth, rel=allowed),
    }


def stands(count: int) -> Measured:
    """A stack of five rigid grains keeps its place."""
    n, r, h = 5, 0.01, 1e-3
    x = np.zeros((n, 3))
    x[:, 2] = r * (2 * np.arange(n) + 1)
    a = Assembly.of_spheres(x, np.full(n, r), np.full(n, 0.1))
    solver = Solver(tolerance=1e-13, sweep_limit=1_000_000)
    floor = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.5)
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), solver, planes=[floor])
    for _ in range(count):
        simulation.advance(h, Drive(gravity=np.array([0.0, 0.0, -G])))
    speed = 1e-13 * n**2 * G * h
    return {
        "speed [m/s]": (float(np.abs(a.velocity).max()), speed),
        "settlement [m]": (float(np.abs(a.x - x).max()), count * h * speed),
    }


# -- denormals --------------------------------------------------------------------------------------------------------------------


def rational(strain: Any, lam: float, two_mu: Fraction | float, bulk: Fraction | None = None) -> Any:
    """λ tr ε I + 2μ ε in rational numbers, rounded once; with `bulk` K tr ε I + 2μ dev ε."""
    out = np.empty((len(strain), 6))
    for row, e in zip(out, strain, strict=True):
        exact = [Fraction(float(x)) for x in e]
        trace = sum(exact[:3])
        m = Fraction(two_mu)
        share = Fraction(lam) if bulk is None else bulk - m / 3
        row[:] = [float(m * x + (share * trace if i < 3 else 0)) for i, x in enumerate(exact)]
    return out


ELASTIC_AT_FIRST = (
    "linear_elastic", "sand", "von_mises", "drucker_prager", "drucker_prager_cap", "mohr_coulomb", "tresca", "rankine", "cam_clay",
    "perzyna", "bingham", "maxwell",
)  # fmt: skip


def denormal_strain(exponent: int, unit: float) -> Measured:
    """Strains of 10^exponent of laws that begin elastic, and of Maxwell (2G/(1 + G dt/η) on the deviator); `unit` multiplies all stresses,
    so that moduli of 1 Pa make denormal products. A viscous strain is a denormal too: ‖𝕂‖ times its last digit comes in."""
    eps = SHAPES * 10.0**exponent
    found: dict[str, tuple[float, float]] = {}
    for name in ELASTIC_AT_FIRST:
        entry = ENTRIES[name]
        values = {
            p.name: entry.values[p.name] * (unit if str(p.unit).startswith("Pa") else 1.0) for p in entry.law.parameters
        }
        out = entry.law.compile()(eps, None, 1.0, **values)
        lam, mu = moduli(values)
        E, nu = (Fraction(values.get(a, values.get(b, 0.0))) for a, b in (("E", "E_s"), ("nu", "nu_s")))
        exact_mu, exact_bulk = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu))
        share = 1 / (1 + exact_mu / Fraction(values["eta"])) if name == "maxwell" else Fraction(1)
        truth = rational(eps, lam, 2 * exact_mu * share, exact_bulk)
        size = float(np.abs(truth).max())
        last = TINY * (1.0 + (stiffness(values) if name == "maxwell" else 0.0))
        found[f"stress of {name} [Pa]"] = near(out.stress, truth, abs=8 * EPS * size + 8 * last)
        shear, bulk = 2 * mu * float(share), lam + 2 * mu / 3
        tangent = shear * (np.eye(6) - np.outer(I6, I6) / 3) + bulk * np.outer(I6, I6)
        digits = 8 * TINY / np.abs(eps).max()
        found[f"tangent of {name} [Pa]"] = near(out.tangent, tangent, abs=(1e-12 + digits) * np.linalg.norm(tangent, 2))
        rest = (out.dissipation, *out.state.values())
        found[f"not finite, {name}"] = (float(sum((~np.isfinite(part)).sum() for part in rest)), 0.0)
    return found


def denormal_state(exponent: int) -> Measured:
    """An old plastic strain of 10^exponent at zero strain: σ = −𝕂 ε^p."""
    found = {}
    for name in ("sand", "von_mises", "drucker_prager", "mohr_coulomb", "tresca", "rankine", "cam_clay"):
        update, values = ENTRIES[name].law.compile(), dict(ENTRIES[name].values)
        old = update.initial_state(len(SHAPES))
        old["eps_p"] = SHAPES * 10.0**exponent
        out = update(np.zeros_like(SHAPES), old, **values)
        E, nu = (Fraction(values.get(a, values.get(b, 0.0))) for a, b in (("E", "E_s"), ("nu", "nu_s")))
        truth = rational(-old["eps_p"], 0.0, E / (1 + nu), E / (3 * (1 - 2 * nu)))
        found[f"stress of {name} [Pa]"] = near(out.stress, truth, abs=8 * EPS * np.abs(truth).max() + 8 * TINY)
        tangent = float((~np.isfinite(out.tangent)).sum())
        found[f"not finite, {name}"] = (tangent, 0.0)
    return found


def flow_at_denormals(exponent: int) -> Measured:
    """A strength of zero makes the step a projection onto a cone, homogeneous of degree one: strains of 10^exponent give 10^exponent times
    the stress of strains of one, to the digits that the strains have."""
    found = {}
    for name in ("sand", "von_mises", "drucker_prager", "mohr_coulomb", "tresca", "rankine"):
        update = ENTRIES[name].law.compile()
        values = dict(ENTRIES[name].values) | {STRENGTH[name]: 0.0}
        eps = SHAPES * 10.0**exponent
        one = update(eps * 2.0**1000, None, **values)
        out = update(eps, None, **values)
        truth = one.stress * 2.0**-1000
        allowed = 64 * EPS * np.abs(truth).max() + 64 * TINY * stiffness(values)
        found[f"stress of {name} [Pa]"] = near(out.stress, truth, abs=allowed)
        found[f"not finite, {name}"] = (float((~np.isfinite(out.tangent)).sum()), 0.0)
    return found


def unit_of_stress(law: str, exponent: int) -> Measured:
    """Stresses in units of 10^−exponent Pa: strains and flows of the same size."""
    entry = ENTRIES[law]
    factor = {p.name: 10.0**exponent if str(p.unit).startswith("Pa") else 1.0 for p in entry.law.parameters}
    values = {k: v * factor[k] for k, v in entry.values.items()}
    eps = 1e-2 * SHAPES
    update = entry.law.compile()
    plain, out = update(eps, None, **entry.values), update(eps, None, **values)
    stress, tangent = plain.stress * 10.0**exponent, plain.tangent * 10.0**exponent
    return {
        "stress": near(out.stress, stress, abs=1e-12 * float(np.abs(stress).max()) + 64 * TINY),
        "tangent": near(out.tangent, tangent, abs=1e-12 * float(np.abs(tangent).max()) + 64 * TINY),
        "not finite": (float(sum((~np.isfinite(x)).sum() for x in out.state.values())), 0.0),
    }


def light(gravity: float) -> Measured:
    """A sphere at rest on the floor under `gravity`: it carries m g, at impulses m g h below the normal range."""
    a = Assembly.of_spheres(np.array([[0.0, 0.0, 0.01]]), np.array([0.01]), np.array([0.1]))
    solver = Solver(tolerance=1e-13, sweep_limit=1000)
    floor = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.5)
    simulation = Simulation(a, Laws(contact=SignoriniCoulomb(friction=0.5)), solver, planes=[floor])
    for _ in range(3):
        simulation.advance(1e-3, Drive(gravity=np.array([0.0, 0.0, -gravity])))
    rows = simulation.contacts
    assert rows is not None
    truth = float(Fraction(0.1) * Fraction(gravity) * Fraction(1e-3))
    return {
        "impulse [N s]": near(rows.wall_impulse[0, 2], truth, rel=8 * EPS, abs=8 * TINY),
        "speed [m/s]": (float(np.abs(a.velocity).max()), 64 * EPS * gravity * 1e-3 + 64 * TINY),
        "height [m]": near(a.x[0, 2], 0.01, abs=EPS * 0.01),
    }


CURVED = ("maxwell", "cam_clay")
STEPS, SCENE, DENORMAL, UNIT = "material steps", "contact steps", "denormals", "unit of stress, "
RANGE = "leave the range of the exponent"
SCENES = (("block stays", stays), ("block slides", slides), ("sphere rolls", rolls), ("stack stands", stands))
CELLS: list[Cell] = [
    Cell(STEPS, "radial, DP, 1e7", lambda: radial("drucker_prager")),
    Cell(STEPS, "radial, sand, 1e7", lambda: radial("sand"), long=True),
    Cell(STEPS, "cycles, von Mises, 1e7", cycles),
    Cell(STEPS, "relaxation, Maxwell, 1e6", lambda: relaxation(MANY // 10)),
    Cell(STEPS, "relaxation, Maxwell, 1e7", relaxation, long=True),
    *(Cell(SCENE, f"{name}, 1e4", lambda run=run: run(CONTACT_SHORT)) for name, run in SCENES),
    *(Cell(SCENE, f"{name}, 1e6", lambda run=run: run(CONTACT), long=True) for name, run in SCENES),
    *(Cell(DENORMAL, f"strain 1e{k}", lambda k=k: denormal_strain(k, 1.0)) for k in (-310, -315, -320)),
    *(Cell(DENORMAL, f"strain 1e{k}, moduli /1e7", lambda k=k: denormal_strain(k, 1e-7)) for k in (-310, -315)),
    *(Cell(DENORMAL, f"old strain 1e{k}", lambda k=k: denormal_state(k)) for k in (-310, -320)),
    *(Cell(DENORMAL, f"flow at 1e{k}", lambda k=k: flow_at_denormals(k)) for k in (-305, -310)),
    *(Cell(DENORMAL, f"gravity 1e{k} m/s²", lambda k=k: light(10.0**k)) for k in (-300, -310, -318)),
    *(
        Cell(
            UNIT + law,
            f"1e{k:+d}",
            lambda law=law, k=k: unit_of_stress(law, k),
            says="is not finite" if k == -318 else "",
        )
        for law in ("sand", "mohr_coulomb")
        for k in (-318, -310, -200, -100, 100, 200, 290)
    ),
    *(
        Cell(UNIT + law, f"1e{k:+d}", lambda law=law, k=k: unit_of_stress(law, k), says=RANGE if k == 120 else "")
        for law in CURVED
        for k in (-90, 90, 120)
    ),
]
