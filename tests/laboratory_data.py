"""Laboratory files of a planted law: the curves by `planted_law` (nothing of fenchel), in soil-mechanics signs, per cent and kPa.

Noise and rounding are those of a laboratory: readings of strain to 1e-5, of stress to 0.1 kPa. The first row is the start, without noise.
"""

from __future__ import annotations

import numpy as np
import planted_law

LAW = planted_law.Planted(E_s=30e6, E_w=0.0, nu=0.25, theta_f=0.5, C_0=4e3, H_k=2e6, H_i=0.5e6)
VALUES = dict(E_s=LAW.E_s, nu_s=LAW.nu, theta_f=LAW.theta_f, C_0=LAW.C_0, H_k=LAW.H_k, H_i=LAW.H_i)


def effective_hardening(law=LAW):
    """What a monotonic test feels of H_k and H_i."""
    return law.H_k * (0.5 + np.tan(law.theta_f) ** 2 / 3.0) + law.H_i


def drained(law, pressure, axial):
    """q [Pa], positive in compression, and tr ε along axial strains (tension positive) at the lateral stress −pressure."""
    strain, stress, _ = planted_law.triaxial(law, pressure, axial, linked=False)
    return stress[:, 0] - stress[:, 2], strain[:, :3].sum(axis=1)


def undrained(law, pressure, axial):
    """q [Pa] and the change of the pore pressure [Pa] at constant volume, from the isotropic effective pressure."""
    plastic, alpha, p = [pressure * (1 - 2 * law.nu) / law.E_s] * 3, [0.0] * 3, 0.0
    q, u = [], []
    for z in axial:
        stress, plastic, alpha, p = planted_law.sand_step([-z / 2, -z / 2, z], plastic, alpha, p, law)
        q.append(stress[0] - stress[2])
        u.append(pressure + stress[0])
    return np.array(q), np.array(u)


def lab_text(
    law,
    pressure,
    *,
    water="drained",
    corners=(0.0, -0.03),
    step=3e-4,
    noise=1.0,
    seed=1,
    rounded=True,
    soil=True,
    back=0.0,
    lines=(),
    said=True,
):
    """Text of a LAB.csv; `noise` 1 is 0.5 kPa in stress and 5e-5 in volume strain."""
    rng = np.random.default_rng([seed, round(pressure), len(water)])
    axial, _ = planted_law.path(corners, step)
    q, second = (drained if water == "drained" else undrained)(law, pressure, axial)
    loose = noise * rng.standard_normal((2, len(axial))) * (np.arange(len(axial)) > 0)
    turn = -1.0 if soil else 1.0
    q = -turn * (q / 1e3 + 0.5 * loose[0])
    second = turn * (100 * second + 5e-3 * loose[1]) if water == "drained" else (back + second) / 1e3 + 0.5 * loose[1]
    digits = (3, 1, 3 if water == "drained" else 1) if rounded else (12, 12, 12)
    head = [f"# confining_pressure = {(pressure + (back if water != 'drained' else 0.0)) / 1e3:g} kPa"] if said else []
    names = "eps_a [%], q [kPa], " + ("eps_v [%]" if water == "drained" else "u [kPa]")
    rows = [
        ",".join(f"{x:.{d}f}" for x, d in zip(row, digits, strict=True))
        for row in zip(turn * 100 * axial, q, second, strict=True)
    ]
    return "\n".join([*head, *lines, names, *rows]) + "\n"


def lab_file(folder, name, *arguments, **options):
    """The same as a file; returns its path."""
    path = folder / name
    path.write_text(lab_text(*arguments, **options), encoding="utf-8")
    return path
