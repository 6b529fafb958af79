"""Claims 13 and 14: what sand dissipates, and its cone beside the hexagon of Mohr and Coulomb.

Along a deviator d of norm one at the pressure P the surfaces stand at ‖dev σ‖ = r,

    cone √J₂ + a I₁ = k:   r = √2 (k + 3aP),        hexagon:   r = 2 (c cos φ + P sin φ)/(d₁ − d₃ + (d₁ + d₃) sin φ).

A cone through the compressive edges contains the hexagon and stands (3 + sin φ)/(3 − sin φ) times as far at the extensive edges; the one
through these is that much too near at the others; the plane-strain one touches the hexagon from inside at |tan ω| = sin φ/√3
from pure shear (Drucker and Prager 1952). Both are linear along d, so that the radii of the declared laws follow from two values of f.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..potentials.derivative import partial
from ..potentials.library import ENTRIES, cone, cone_values
from .formulation_states import DEVIATOR, IDENTITY, Array, Numbers, corners, difference, dot, size_of

__all__ = ["ANGLES", "READINGS", "dissipated", "elastic_domain", "hexagon_radius", "lode_angle"]

READINGS = ("compression", "extension", "plane_strain")
ANGLES = (0.079, 0.3, 0.6)  # rad: that of the study, and sands
COHESION, PRESSURE = 2842.0, 5e4


# -- claim 13 -------------------------------------------------------------------------------------------------------------------


def dissipated(seed: int, paths: int, steps: int) -> dict[str, Any]:
    """Claim 13 at every step of random paths that end at the apex: `texsol` beside `sand`, and C_0 Δp; K1 and K2."""
    rng = np.random.default_rng(seed)
    numbers = {"sand": 0.0, "C_0": 0.0, "forces": 0.0, "negative": 0.0, "flowing": 0.0, "apex": 0.0}
    entry = ENTRIES["texsol"]
    strains = np.stack([corners(entry, rng, 3, steps) for _ in range(paths)], axis=1)
    strains = np.concatenate([strains, strains[-1] + np.linspace(0.0, 8e-3, 7)[1:, None, None] * IDENTITY])
    for pair in (("texsol", "sand"), ("texsol_k2", "sand_k2")):
        together, alone = (ENTRIES[name] for name in pair)
        updates = [e.law.compile() for e in (together, alone)]
        both = Numbers(together.law, together.values)
        states = [update.initial_state(paths) for update in updates]
        for strain in strains:
            outs = [
                update(strain, state, **e.values)
                for update, state, e in zip(updates, states, (together, alone), strict=True)
            ]
            out, other = outs
            growth = out.state["p"] - states[0]["p"]
            unit = together.values["C_0"] * np.maximum(growth, 1e-3 * out.state["p"].max() + 1e-12)
            here = {"eps": strain, **out.state}
            forces = {v: both.force(v, here) for v in together.law.internal}
            products = sum(dot(f, out.state[v.name] - states[0][v.name]) for v, f in forces.items())
            for key, found in (
                ("sand", other.dissipation),
                ("C_0", together.values["C_0"] * growth),
                ("forces", products),
            ):
                numbers[key] = max(numbers[key], float((np.abs(out.dissipation - found) / unit).max()))
            numbers["negative"] = max(numbers["negative"], float((-out.dissipation / unit).max()))
            A, chi, _ = forces.values()
            numbers["apex"] += int(
                ((size_of((A + chi) @ DEVIATOR) < 1e-6 * together.values["C_0"]) & (growth > 0)).sum()
            )
            numbers["flowing"] += float((growth > 0).mean()) / (2 * len(strains))
            states = [out.state, other.state]
    return {"numbers": numbers | {"steps": 2 * paths * len(strains)}}


# -- claim 14 -------------------------------------------------------------------------------------------------------------------


def lode_angle(count: int) -> tuple[Array, Array]:
    """Angles [rad] from triaxial compression (0) over extension (π/3) around the axis of pressure, and unit deviators (n, 3)."""
    angle = np.linspace(0.0, 2.0 * np.pi, count)
    return angle, _deviator(angle)


def hexagon_radius(phi: float, c: float, pressure: float, angle: Array) -> Array:
    """‖dev σ‖ [Pa] at which Mohr and Coulomb's hexagon stands at Lode angles."""
    direction = _deviator(angle)
    high, low = direction.max(axis=1), direction.min(axis=1)
    return 2 * (c * np.cos(phi) + pressure * np.sin(phi)) / (high - low + (high + low) * np.sin(phi))


def _deviator(angle: Any) -> Array:
    x, y = np.array([1.0, 1.0, -2.0]) / np.sqrt(6.0), np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    return np.cos(angle)[..., None] * x + np.sin(angle)[..., None] * y


def _radius(law: Any, values: Any, direction: Array, pressure: float) -> Array:
    """‖dev σ‖ at which the surface of a law stands along unit deviators, from two values of f."""
    numbers = Numbers(law, values)
    A, *others = (law.forces[v] for v in law.internal)
    zero = {
        force: np.zeros((len(direction), 6) if getattr(force, "rank", 0) == 2 else len(direction)) for force in others
    }

    def f(length: float) -> Array:
        stress = np.zeros((len(direction), 6))
        stress[:, :3] = length * direction - pressure
        return numbers(law.surfaces[0], {}, zero | {A: stress})

    start, slope = f(0.0), f(pressure) - f(0.0)
    return -start * pressure / slope


def _distances(phi: float, angle: Array, direction: Array) -> tuple[dict[str, float], dict[str, Array]]:
    """Radius of each cone over that of the hexagon, by the laws; misfit to the formulas; and what the theorems say."""
    values = ENTRIES["mohr_coulomb"].values | dict(phi=phi, c=COHESION)
    hexagon = _radius(ENTRIES["mohr_coulomb"].law, values, direction, PRESSURE)
    misfit, ratio = float(np.abs(hexagon / hexagon_radius(phi, COHESION, PRESSURE, angle) - 1.0).max()), {}
    for reading in READINGS:
        a, k = cone(phi, COHESION, reading)
        found = _radius(ENTRIES["sand"].law, ENTRIES["sand"].values | cone_values(a, k), direction, PRESSURE)
        misfit = max(misfit, float(np.abs(found / (np.sqrt(2.0) * (k + 3 * a * PRESSURE)) - 1.0).max()))
        ratio[reading] = found / hexagon
    edges, third = (
        (3 + np.sin(phi)) / (3 - np.sin(phi)),
        len(angle) // 6,
    )  # the extensive edge is a sixth of a turn away
    touching = _deviator(np.array([np.pi / 6 + np.arctan(np.sin(phi) / np.sqrt(3.0))]))  # ω = 0 is pure shear
    a, k = cone(phi, COHESION, "plane_strain")
    tangent = (
        np.sqrt(2.0) * (k + 3 * a * PRESSURE) / _radius(ENTRIES["mohr_coulomb"].law, values, touching, PRESSURE)[0]
    )
    theorems = max(
        abs(ratio["compression"][0] - 1.0), max(1.0 - ratio["compression"].min(), 0.0), abs(ratio["compression"][third] / edges - 1.0),
        abs(ratio["extension"][0] * edges - 1.0), abs(ratio["extension"][third] - 1.0), max(ratio["plane_strain"].max() - 1.0, 0.0),
        abs(tangent - 1.0),
    )  # fmt: skip
    far = {f"far, {reading}": float(np.abs(r - 1.0).max()) for reading, r in ratio.items()}
    return {"misfit": misfit, "theorems": float(theorems), **far}, ratio


def _convex(rng: np.random.Generator, n: int) -> dict[str, float]:
    """f of `sand` at midpoints, and its gradient against differences, in forces of all sizes off the apex; and how the normal turns."""
    entry = ENTRIES["sand"]
    law, numbers = entry.law, Numbers(entry.law, entry.values)
    f, unit = law.surfaces[0], entry.values["C_0"]
    forces = [law.forces[v] for v in law.internal]
    size = unit * 10.0 ** rng.uniform(-2, 2, size=n)
    one, two = (
        [size[:, None] * rng.normal(size=(n, 6)), unit * rng.normal(size=(n, 6)), unit * rng.normal(size=n)]
        for _ in range(2)
    )

    def value(point: Any) -> Array:
        return numbers(f, {}, dict(zip(forces, point, strict=True)))

    middle = [(a + b) / 2 for a, b in zip(one, two, strict=True)]
    bulge = (value(middle) - (value(one) + value(two)) / 2) / (np.abs(value(one)) + np.abs(value(two)) + unit)
    B = one[0] + one[1]
    along = size_of(B @ DEVIATOR)[:, None] * rng.normal(size=(n, 6)) / 3.0
    slope = difference(lambda t: value([one[0] + t * along, *one[1:]]), 1e-2)
    normal = numbers(partial(f, forces[0]), {}, dict(zip(forces, one, strict=True)))
    gradient = np.abs(slope - dot(normal, along)) / size_of(along)
    return {"bulge": float(bulge.max()), "gradient": float(gradient.max())}


def _turning(direction: Array) -> dict[str, float]:
    """Largest turn of the unit normal between neighbours around the axis, over their angle: one for a circle."""
    found = {}
    for name, more in (("sand", {}), ("mohr_coulomb", dict(phi=0.3, c=COHESION))):
        law = ENTRIES[name].law
        values = ENTRIES[name].values | more
        numbers, A = Numbers(law, values), law.forces[law.internal[0]]
        stress = np.zeros((len(direction), 6))
        stress[:, :3] = _radius(law, values, direction, PRESSURE)[:, None] * direction - PRESSURE
        rest = {
            law.forces[v]: np.zeros_like(stress) if v.name == "alpha" else np.zeros(len(direction))
            for v in law.internal
        }
        normal = numbers(partial(law.surfaces[0], A), {}, rest | {A: stress}) @ DEVIATOR
        normal = normal / size_of(normal)[:, None]
        turn = 2.0 * np.arcsin(np.minimum(size_of(np.diff(normal, axis=0)) / 2.0, 1.0))
        found[f"turn, {name}"] = float(turn.max()) * (len(direction) - 1) / (2.0 * np.pi)
    return found


def _readings() -> dict[str, float]:
    """The friction angle of the study's pair in the readings of Mohr and Coulomb [deg], its cohesions and its apex [Pa]."""
    from scipy.optimize import brentq

    a, k = cone(ANGLES[0], COHESION)
    found = {"apex": k / (3 * a)}
    for reading in READINGS:
        phi = brentq(lambda angle, r=reading: cone(float(angle), 1.0, r)[0] - a, 1e-3, 0.5, xtol=1e-14)
        found[f"angle, {reading}"] = float(np.degrees(phi))
        found[f"cohesion, {reading}"] = k / cone(phi, 1.0, reading)[1]
    return found


def elastic_domain(seed: int, count: int, angles: int) -> dict[str, Any]:
    """Claim 14: `count` points of the domain, `angles` directions around the axis of pressure (a multiple of 6, and one)."""
    rng = np.random.default_rng(seed)
    angle, direction = lode_angle(angles)
    tables, ratios = {}, {}
    for phi in ANGLES:
        tables[f"{phi:g}"], ratios[f"{phi:g}"] = _distances(phi, angle, direction)
    numbers = {key: max(t[key] for t in tables.values()) for key in ("misfit", "theorems")}
    numbers |= {f"{key} at {phi}": t[key] for phi, t in tables.items() for key in t if key.startswith("far")}
    numbers |= _convex(rng, count) | _turning(direction) | _readings()
    given = {"angle, compression": 3.84, "angle, extension": 4.02, "angle, plane_strain": 4.55}
    given |= {"cohesion, compression": 2412.0, "cohesion, plane_strain": 2854.0, "apex": 35.9e3}
    numbers["given"] = max(abs(numbers[k] / v - 1.0) for k, v in given.items())
    return {"numbers": numbers | {"points": count}, "angle": angle, "ratio": ratios}
