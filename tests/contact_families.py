"""Families of one-step contact problems, written down from mechanics alone: M, H, f, w of bodies, without any code of the package.

H maps impulses at the contacts (normal, two tangents) to bodies with six degrees of freedom, u = Hᵀ v + w is the relative velocity.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

Global = dict[str, Any]  # mass, h, f, w, mu


def frame(normal: np.ndarray) -> np.ndarray:
    """Rows: the unit normal and two tangents."""
    n = normal / np.linalg.norm(normal)
    helper = np.eye(3)[np.argmin(np.abs(n))]
    t = np.cross(n, helper)
    t /= np.linalg.norm(t)
    return np.stack([n, t, np.cross(n, t)])


def assemble(
    masses: np.ndarray,
    inertias: np.ndarray,
    contacts: list[tuple[int, int, np.ndarray, np.ndarray, np.ndarray]],
    velocity: np.ndarray,
    shift: np.ndarray,
    mu: np.ndarray,
) -> Global:
    """Contacts (i, j, arm_i, arm_j, normal from j to i); j = −1 is the ground. `velocity` (bodies, 6) is free of contact impulses."""
    dofs = 6 * len(masses)
    mass = np.concatenate(
        [np.repeat(masses[:, None], 3, axis=1), np.repeat(inertias[:, None], 3, axis=1)], axis=1
    ).ravel()
    rows, columns, values = [], [], []
    for k, (i, j, arm_i, arm_j, normal) in enumerate(contacts):
        for s, direction in enumerate(frame(normal)):
            for body, arm, sign in ((i, arm_i, 1.0), (j, arm_j, -1.0)):
                if body < 0:
                    continue
                part = sign * np.concatenate([direction, np.cross(arm, direction)])
                rows += list(range(6 * body, 6 * body + 6))
                columns += [3 * k + s] * 6
                values += part.tolist()
    h = sp.csr_matrix((values, (rows, columns)), shape=(dofs, 3 * len(contacts)))
    w = np.zeros(3 * len(contacts))
    w[0::3] = shift
    return {
        "mass": sp.diags(mass).tocsr(),
        "h": h,
        "f": mass * velocity.ravel(),
        "w": w,
        "mu": np.asarray(mu, dtype=float),
    }


def spheres(seed: int, side: int = 4, *, mu: float = 0.5, mass_ratio: float = 1.0, gravity: float = 1e-2) -> Global:
    """A disturbed lattice of side³ spheres on a floor between four walls, one step under gravity: many contacts, some open."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * 2.0 + 1.0
    x = grid + 0.03 * rng.standard_normal(grid.shape)
    x[:, :2] += 0.25 * (grid[:, 2:] % 4.0 > 2.0)  # rows lean on each other
    radius = 1.0 + 0.04 * rng.random(len(x))
    masses = radius**3 * np.where(x[:, 2] > 2.0 * side - 2.0, mass_ratio, 1.0)
    contacts, gaps = [], []
    for i in range(len(x)):
        for j in range(i):
            d = x[i] - x[j]
            gap = np.linalg.norm(d) - radius[i] - radius[j]
            if gap < 0.02:
                n = d / np.linalg.norm(d)
                contacts.append((i, j, -radius[i] * n, radius[j] * n, n))
                gaps.append(gap)
        for axis, sign, reach in (
            (2, 1.0, 0.0),
            (0, 1.0, 0.0),
            (1, 1.0, 0.0),
            (0, -1.0, 2.0 * side + 0.2),
            (1, -1.0, 2.0 * side + 0.2),
        ):
            gap = abs(reach - x[i, axis]) - radius[i]
            if gap < 0.02:
                n = sign * np.eye(3)[axis]
                contacts.append((i, -1, -radius[i] * n, np.zeros(3), n))
                gaps.append(gap)
    velocity = 1e-3 * rng.standard_normal((len(x), 6))
    velocity[:, 2] -= gravity
    shift = np.maximum(np.array(gaps), 0.0)
    return assemble(masses, 0.4 * masses * radius**2, contacts, velocity, shift, np.full(len(contacts), mu))


def boxes(levels: int, *, mu: float = 0.7, push: float = 0.3, mass_ratio: float = 1.0) -> Global:
    """A tower of unit cubes with four contacts per face (rank of W about half its size), gravity and a sideways push on the top."""
    masses = np.ones(levels)
    masses[-1] = mass_ratio
    contacts = []
    corners = [np.array([a, b, 0.0]) for a in (-0.5, 0.5) for b in (-0.5, 0.5)]
    up, half = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 0.5])
    for k in range(levels):
        for corner in corners:
            contacts.append((k, k - 1, corner - half, corner + half if k else np.zeros(3), up))
    velocity = np.zeros((levels, 6))
    velocity[:, 2] = -1.0
    velocity[-1, 0] = push
    velocity[-1, 5] = 0.2 * push
    return assemble(masses, masses / 6.0, contacts, velocity, np.zeros(len(contacts)), np.full(len(contacts), mu))


def wedge(mu: float, squeeze: float = 0.0) -> Global:
    """A sphere in a groove of 60 degrees, pushed along it; `squeeze` drives the flanks together (no solution if positive)."""
    angle = np.pi / 6.0
    normals = [np.array([np.cos(angle), 0.0, np.sin(angle)]), np.array([-np.cos(angle), 0.0, np.sin(angle)])]
    if squeeze > 0.0:
        normals = [np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0])]
    contacts = [(0, -1, -n, np.zeros(3), n) for n in normals]
    velocity = np.array([[0.1, 0.4, -1.0, 0.0, 0.0, 0.3]])
    return assemble(np.ones(1), np.full(1, 0.4), contacts, velocity, np.full(2, -squeeze), np.full(2, mu))


def natural_maps(delassus: np.ndarray, q: np.ndarray, mu: np.ndarray, r: np.ndarray) -> tuple[float, float]:
    """(natural_map_q, natural_map_scaled) contact by contact in plain Python, with the projection found by cases."""
    u = delassus @ r + q
    plain = scaled = 0.0
    for k in range(len(mu)):
        block, velocity = r[3 * k : 3 * k + 3], u[3 * k : 3 * k + 3].copy()
        velocity[0] += mu[k] * np.linalg.norm(velocity[1:])
        for own, rho in ((False, 1.0), (True, 1.0 / delassus[3 * k, 3 * k])):
            z = block - rho * velocity
            size = np.linalg.norm(z[1:])
            if z[0] >= 0.0 and size <= mu[k] * z[0]:
                foot = z
            elif z[0] <= -mu[k] * size:
                foot = np.zeros(3)
            else:
                generator = np.concatenate([[1.0], mu[k] * z[1:] / size]) if size > 0.0 else np.array([1.0, 0.0, 0.0])
                foot = generator * max(0.0, z @ generator) / (generator @ generator)
            error = float(np.sum((block - foot) ** 2))
            plain += 0.0 if own else error
            scaled += error if own else 0.0
    return float(np.sqrt(plain) / np.linalg.norm(q)), float(np.sqrt(scaled) / max(np.linalg.norm(r), 1e-300))
