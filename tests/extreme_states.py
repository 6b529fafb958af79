"""The step at the ends of what can be asked, by other criteria than optimality: finite answers over 300 decades, units, stiffness ratios,
tangents of a convex problem, one step of all the strain there is, axes of awkward matrices.

What `extreme_steps` judges by the conditions of optimality with the same numbers is not repeated here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from extreme_rows import Cell, Measured, Row, near, nothing_but, rows_of

from fenchel.integrators import drive_arrays
from fenchel.integrators.spectral import eigen
from fenchel.potentials.library import LAWS, sand, texsol

SUITE = "states"
SAND = {"E_s": 12e6, "nu_s": 0.2, "theta_f": 0.079, "C_0": 2842.0, "H_k": 944e3, "H_i": 472e3}
WIRE = {"lambda_w": 6e6 * 0.2 / 1.2 / 0.6, "mu_w": 6e6 / 2.4}
STRAINS = 1e-3 * np.array(
    [
        [0, 0, 0, 0, 0, 0],
        [1, 1, 1, 0, 0, 0],
        [-1, -1, -1, 0, 0, 0],
        [1, 1, -3, 0, 0, 0],
        [1, 1 + 1e-15, 1 - 1e-15, 1e-16, 0, 0],
        [0, 0, 0, 1, 1, 1],
        [1, 0, 0, 0, 0, 0],
        [0.3, -0.2, 0.7, 0.1, -0.4, 0.25],
    ]
)


def sizes(law: Any, exponent: int) -> Measured:
    """Strains of 10^exponent: finite; nothing gained, as long as forces are more than the rounding of their trial (10¹⁰ yield strains)."""
    out = law.compile()(STRAINS * 1e3 * 10.0**exponent, None, **SAND | (WIRE if law is texsol else {}))
    parts = (out.stress, out.tangent, out.dissipation, *out.state.values())
    found = {"answers not finite": (float(sum((~np.isfinite(part)).sum() for part in parts)), 0.0)}
    if exponent <= 6:
        found["energy gained [J/m³]"] = (float(max(0.0, -out.dissipation.min())), 0.0)
    return found


def units(exponent: int) -> Measured:
    """Stresses 10^exponent times as large: the same answer."""
    scale = 10.0**exponent
    stiff = {k: v * (1 if k in ("nu_s", "theta_f") else scale) for k, v in (SAND | WIRE).items()}
    plain = texsol.compile()(STRAINS, None, **SAND, **WIRE)
    out = texsol.compile()(STRAINS, None, **stiff)
    return {
        "stress [Pa]": near(out.stress / scale, plain.stress, rel=1e-9, abs=1e-7),
        "plastic strain [-]": near(out.state["p"], plain.state["p"], rel=1e-9, abs=1e-16),
    }


def ratios(name: str, ratio: float) -> Measured:
    """A modulus of the wires as a multiple of that of the sand: f ≤ 0 at the stress of the sand alone."""
    values = SAND | WIRE | {name: 12e6 * ratio}
    out = texsol.compile()(STRAINS, None, **values)
    wires = LAWS["wire"].compile()(STRAINS, None, lambda_w=values["lambda_w"], mu_w=values["mu_w"])
    B = out.stress - wires.stress - values["H_k"] * out.state["alpha"]
    mean = B[:, :3].mean(axis=1)
    dev = B - mean[:, None] * np.array([1.0, 1, 1, 0, 0, 0])
    f = np.linalg.norm(dev, axis=1) / np.sqrt(2) + np.tan(0.079) * mean - values["H_i"] * out.state["p"] - 2842.0
    rounding = 1e-15 * (
        np.abs(out.stress).max(axis=1) + values["H_k"] * np.abs(out.state["alpha"]).max(axis=1) + 12e6 * 3e-3
    )
    return {
        "f [Pa]": near(np.maximum(f, 0.0), 0.0, abs=1e-10 * 2842 + 20 * rounding),
        "finite": nothing_but(bool(np.isfinite(out.stress).all() and np.isfinite(out.tangent).all())),
    }


def ends(change: Mapping[str, float]) -> Measured:
    """Parameters at the ends of their ranges: the tangent of a convex step is positive semidefinite."""
    out = texsol.compile()(STRAINS, None, **SAND | WIRE | change)
    least = np.linalg.eigvalsh(0.5 * (out.tangent + out.tangent.transpose(0, 2, 1))).min()
    return {
        "negative eigenvalue of the tangent [Pa]": (max(0.0, float(-least)), 1e-8 * float(np.abs(out.tangent).max())),
        "finite": nothing_but(bool(np.isfinite(out.stress).all())),
    }


def infinite(nu: float) -> Measured:
    """ν at which a modulus is infinite: there is no answer to give."""
    sand.compile()(STRAINS, None, **SAND | {"nu_s": nu})
    return {"not refused": nothing_but(False)}


def all_at_once() -> Measured:
    """Triaxial compression to −100 % in one step: the lateral stress as prescribed, the axial one as 400 steps have it."""
    control, values = [True, True, False, True, True, True], SAND | WIRE
    one = drive_arrays(texsol.compile(), control, [[-5e4, -5e4, -1.0, 0, 0, 0]], values)
    path = np.array([[-5e4, -5e4, -1.0 * s, 0, 0, 0] for s in np.linspace(1e-3, 1, 400)])
    many = drive_arrays(texsol.compile(), control, path, values)
    return {
        "lateral stress [Pa]": near(one.sig[0, :2], -5e4, rel=1e-6),
        "axial stress [Pa]": near(many.sig[-1, 2], one.sig[0, 2], rel=1e-3),
    }


def mandel_matrix(t: Any) -> Any:
    half = np.sqrt(0.5)
    return np.array(
        [[t[0], half * t[5], half * t[4]], [half * t[5], t[1], half * t[3]], [half * t[4], half * t[3], t[2]]]
    )


def awkward_matrices() -> dict[str, Any]:
    """Mandel components by kind; the seed is that of all kinds in turn."""
    rng = np.random.default_rng(1)
    sets = {"general": rng.normal(size=(500, 6))}
    for gap in (1e-4, 1e-8, 1e-12, 0.0):
        found = []
        for base in ([1.0, 1.0, -1.0], [1.0, 1.0, 2.0], [1.0, 1.0, 1.0], [0.0, 0.0, 1.0]):
            q, _ = np.linalg.qr(rng.normal(size=(60, 3, 3)))
            m = np.einsum("nij,j,nkj->nik", q, np.array(base) + gap * np.array([0, 1, 0.3]), q)
            r = np.sqrt(2)
            found.append(
                np.stack([m[:, 0, 0], m[:, 1, 1], m[:, 2, 2], r * m[:, 1, 2], r * m[:, 0, 2], r * m[:, 0, 1]], axis=1)
            )
        sets[f"gap {gap:g}"] = np.concatenate(found)
    spherical = np.array([1.0, 1, 1, 0, 0, 0])
    sets["spherical"] = np.concatenate(
        [
            np.ones((60, 6)) * spherical + 3e-16 * rng.normal(size=(60, 6)),
            spherical[None],
            -7.3 * spherical[None],
            spherical + 1e-17 * np.eye(6)[:, [3, 4, 5, 0, 1, 2]],
            np.zeros((1, 6)),
        ]
    )
    sets["graded"] = np.diag([1.0, 1e-6, 1e-12, 0, 0, 0])
    sets["1e150"], sets["1e-150"] = 1e150 * sets["general"], 1e-150 * sets["general"]
    return sets


def axes(kind: str) -> Measured:
    """Eigenvalues and axes: QᵀQ = 1, and Q Λ Qᵀ is the matrix."""
    out = np.empty(12)
    square = back = 0.0
    for t in awkward_matrices()[kind]:
        eigen(t, out)
        q, m = out[3:].reshape(3, 3), mandel_matrix(t)
        size = max(np.abs(m).max(), 1e-300)
        square = max(square, float(np.abs(q.T @ q - np.eye(3)).max()))
        back = max(back, float(np.abs((q * out[:3]) @ q.T / size - m / size).max()))
    return {"QᵀQ − 1": (square, 1e-14), "QΛQᵀ over ‖A‖": (back, 2e-14)}


ENDS = (
    {"theta_f": 0.0},
    {"theta_f": 1.5},
    {"nu_s": -0.99},
    {"nu_s": 0.499999},
    {"C_0": 0.0},
    {"H_k": 0.0},
    {"H_i": 0.0},
    {"H_k": 0.0, "H_i": 0.0},
)
CELLS: list[Cell] = [
    *(
        Cell(f"size of the strain, {law.name}", f"1e{k:+d}", lambda law=law, k=k: sizes(law, k))
        for law in (sand, texsol)
        for k in (-150, -100, -12, 0, 6, 100, 150)
    ),
    *(Cell("unit of stress", f"1e{k:+d} Pa", lambda k=k: units(k)) for k in (-150, 150)),
    *(
        Cell(f"{name} over E_s", f"{r:g}", lambda name=name, r=r: ratios(name, r))
        for name in ("lambda_w", "mu_w")
        for r in (1e-9, 1e9)
    ),
    *(
        Cell(
            "convex at the ends", ", ".join(f"{k} {v:g}" for k, v in change.items()), lambda change=change: ends(change)
        )
        for change in ENDS
    ),
    *(
        Cell("infinite moduli", f"nu_s {nu:g}", lambda nu=nu: infinite(nu), says=f"nu_s = {nu:g} makes")
        for nu in (0.5, -1.0)
    ),
    Cell("one step", "100 % axial strain", all_at_once),
    *(Cell("axes of matrices", kind, lambda kind=kind: axes(kind)) for kind in awkward_matrices()),
]


def rows() -> list[Row]:
    """The map of the states."""
    return rows_of(SUITE, CELLS)
