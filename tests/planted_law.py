"""An independent truth: the law texsol along triaxial paths, written out in principal components with plain floats.

Return map: cone and apex in closed form; wire: the unilateral energy on principal strains; the lateral strain by
bisection-guarded
secant on the (monotone) lateral stress. Nothing of fenchel is used, so that planted data never come from the code under test.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np


@dataclass(frozen=True)
class Planted:
    E_s: float
    E_w: float
    nu: float
    theta_f: float
    C_0: float
    H_k: float
    H_i: float


def wire_stress(e, E_w, nu):
    """λ⟨tr e⟩ + 2μ⟨e_i⟩ for principal strains e."""
    lam, two_mu = E_w * nu / ((1 + nu) * (1 - 2 * nu)), E_w / (1 + nu)
    trace = max(sum(e), 0.0)
    return [lam * trace + two_mu * max(x, 0.0) for x in e]


def sand_step(e, plastic, alpha, p, law):
    """One implicit step at principal strains e; returns (stress, plastic, alpha, p)."""
    t = math.tan(law.theta_f)
    G, K = law.E_s / (2 * (1 + law.nu)), law.E_s / (3 * (1 - 2 * law.nu))
    elastic = [x - y for x, y in zip(e, plastic, strict=True)]
    mean = sum(elastic) / 3
    trial = [3 * K * mean + 2 * G * (x - mean) for x in elastic]
    B = [x - law.H_k * y for x, y in zip(trial, alpha, strict=True)]
    pi = sum(B) / 3
    dev = [x - pi for x in B]
    b = math.sqrt(sum(x * x for x in dev) / 2)
    f = b + t * pi - law.H_i * p - law.C_0
    if f <= 0:
        return trial, plastic, alpha, p
    h = G + law.H_k / 2 + t * t * (K + law.H_k / 3) + law.H_i
    gamma = f / h
    if b >= gamma * (G + law.H_k / 2):
        flow = [gamma * (x / (2 * b) + t / 3) for x in dev]
    else:
        gamma = (t * pi - law.C_0 - law.H_i * p) / (t * t * (K + law.H_k / 3) + law.H_i)
        flow = [x / (2 * G + law.H_k) + t * gamma / 3 for x in dev]
    m = sum(flow) / 3
    stress = [x - 3 * K * m - 2 * G * (y - m) for x, y in zip(trial, flow, strict=True)]
    return (
        stress,
        [x + y for x, y in zip(plastic, flow, strict=True)],
        [x + y for x, y in zip(alpha, flow, strict=True)],
        p + gamma,
    )


def triaxial(law, pressure, axial, *, linked=True):
    """Strain, sand stress and wire stress (n, 6) for axial strains `axial` at lateral stress −pressure, from −pressure I."""
    E_w = law.E_w if linked else 0.0
    start = pressure * (1 - 2 * law.nu) / law.E_s
    plastic, alpha, p, r = [start] * 3, [0.0] * 3, 0.0, 0.0
    strain, sand, wire = (np.zeros((len(axial), 6)) for _ in range(3))
    for i, z in enumerate(axial):

        def lateral(x, z=z, plastic=plastic, alpha=alpha, p=p):
            return (
                sand_step([x, x, z], plastic, alpha, p, law)[0][0] + wire_stress([x, x, z], E_w, law.nu)[0] + pressure
            )

        low, high = r - 1e-4, r + 1e-4
        while lateral(low) > 0:
            low -= 2 * (high - low)
        while lateral(high) < 0:
            high += 2 * (high - low)
        f_low, f_high = lateral(low), lateral(high)
        r = 0.5 * (low + high)
        for _ in range(200):  # Illinois variant of the false position
            r = (low * f_high - high * f_low) / (f_high - f_low)
            value = lateral(r)
            if abs(value) < 1e-9 * pressure:
                break
            if value * f_high < 0:
                low, f_low = high, f_high
            else:
                f_low *= 0.5
            high, f_high = r, value
        else:
            raise AssertionError("the reference did not converge")
        stress, plastic, alpha, p = sand_step([r, r, z], plastic, alpha, p, law)
        strain[i, :3] = r, r, z
        sand[i, :3] = stress
        wire[i, :3] = wire_stress([r, r, z], E_w, law.nu)
    return strain, sand, wire


def path(corners, step=5e-5):
    """Axial strain through the corners in steps of about `step`, and the leg of each frame."""
    strain, leg = [corners[0]], [0]
    for k, (a, b) in enumerate(pairwise(corners)):
        n = max(round(abs(b - a) / step), 1)
        strain += list(a + (b - a) * np.arange(1, n + 1) / n)
        leg += [k] * n
    return np.array(strain), np.array(leg)


def history(law, pressure, corners=(0.0, -0.01, 0.006, -0.01), *, linked=True, step=5e-5, noise=0.0, rng=None):
    """A `PhaseHistory` of the law; `noise` is relative to the pressure (stress) and to 1e-3 (strain), frame by frame."""
    from fenchel.dem.record import PhaseHistory

    axial, leg = path(corners, step)
    strain, sand, wire = triaxial(law, pressure, axial, linked=linked)
    if noise:
        sand = sand + noise * pressure * rng.standard_normal(sand.shape)
        wire = wire + noise * (np.abs(wire).max() * rng.standard_normal(wire.shape))
    zero = np.zeros_like(sand)
    return PhaseHistory(
        pressure=pressure,
        linked=linked,
        leg=leg,
        axial_strain=axial,
        wall_strain=strain,
        wall_stress=sand + wire,
        strain_sand=strain,
        strain_wire=strain.copy(),
        stress_grains=sand,
        stress_beads=zero,
        stress_links=wire,
    )


def record(
    law, pressure, seed, *, spread=0.03, corners=(0.0, -0.01, 0.006, -0.01), linked=True, step=5e-5, distort=None
):
    """A `TriaxialRecord` whose octants carry the law's stress and strain times 1 + spread·ξ (ξ normal, drawn by `seed`).

    `distort(frame tensors (n, 6) of strain, sand, wire)` may replace them, to make data that no law of the family follows.
    """
    from fenchel.dem.record import TriaxialRecord

    rng = np.random.default_rng([seed, round(pressure)])
    beads_rng = np.random.default_rng([seed, round(pressure), 7])
    axial, leg = path(corners, step)
    strain, sand, wire = triaxial(law, pressure, axial, linked=linked)
    if distort is not None:
        strain, sand, wire = distort(strain, sand, wire)

    def full(a):
        r = math.sqrt(0.5)
        m = np.empty((len(a), 3, 3))
        for (i, j), k in {(0, 0): 0, (1, 1): 1, (2, 2): 2, (1, 2): 3, (0, 2): 4, (0, 1): 5}.items():
            m[:, i, j] = m[:, j, i] = a[:, k] * (1.0 if k < 3 else r)
        return m

    volume = 1e-6
    n = len(axial)
    moments = {name: np.zeros((n, 8, 3, 3)) for name in ("grain", "link")}
    sums = {name: np.zeros((n, 8, 25)) for name in ("grain", "bead")}
    start = full(sand)[0]
    for o in range(8):
        stiff = 1.0 + spread * rng.standard_normal(2)
        moments["grain"][:, o] = volume * (start + stiff[0] * (full(sand) - start))
        moments["link"][:, o] = volume * stiff[1] * full(wire)
        corner = np.array([1 if o & b else -1 for b in (1, 2, 4)])
        for name, generator in (("grain", rng), ("bead", beads_rng)):
            x = corner * generator.uniform(0.0, 5e-3, (20, 3))
            gradient = full(strain) * (1.0 + spread * generator.standard_normal())
            u = np.einsum("fij,pj->fpi", gradient, x)
            out = sums[name][:, o]
            out[:, 0] = len(x)
            out[:, 1:4] = x.sum(axis=0)
            out[:, 4:7] = u.sum(axis=1)
            out[:, 7:16] = np.einsum("pi,pj->ij", x, x).ravel()
            out[:, 16:25] = np.einsum("fpi,pj->fij", u, x).reshape(n, 9)
    whole = full(sand + wire)
    mandel = np.stack([whole[:, i, j] for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))], axis=1)
    return TriaxialRecord(
        pressure=pressure,
        seed=seed,
        linked=linked,
        leg=leg,
        axial_strain=axial,
        wall_strain=strain,
        wall_stress=mandel,
        box_stress=mandel,
        octant_volume=np.full(8, volume),
        grain_moment=moments["grain"],
        bead_moment=np.zeros((n, 8, 3, 3)),
        link_moment=moments["link"],
        grain_fit=sums["grain"],
        bead_fit=sums["bead"],
        quality={"inertial_number": 5e-4, "unbalanced_force": 3e-4},
    )
