r"""Rows of the one-step problem: normals, gaps, warm impulses and diagonal blocks of the contacts that may close.

Contact between spheres i < j: n from j to i, g = |x_i − x_j| − r_i − r_j, detected at the mid configuration. Rigid grains take the
inelastic quasi-shock b = max(0, g)/h (penetration is not pushed back unless `signed`), compliant ones b = g/h with g signed and
c = 1/(k h²): the force at the end of the step is then exactly −k g (implicit Euler, unconditionally stable).

Columns of a contact row: n (3), p (3), p_t⁰ (3), b, 1/(W_n + c_n), 1/(W_t + c_t), μ, g, p_n⁰, candidate.
Wall row: p, b, 1/(W_n + c_n), g, p⁰, candidate. Link row: n (3), tension impulse, β, 1/(W_n + c), c, tension of the step before.

Jean (1999), CMAME 177, 235–257; theory of compliance as a diagonal term: Alart and Curnier (1991).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..cache import njit

__all__ = ["collect_contacts", "collect_links", "collect_walls", "keep_contacts"]

Array = NDArray[np.float64]
Ints = NDArray[np.int32]


@njit
def collect_contacts(
    x: Array,
    radius: Array,
    vel: Array,
    is_bead: NDArray[np.bool_],
    pairs: Ints,
    impulse: Array,
    reach: float,
    step: float,
    cn: float,
    ct: float,
    friction: float,
    bead_friction: float,
    signed: bool,
) -> tuple[Ints, Array]:
    """Contacts of the candidate `pairs` with gap below `reach` [m].

    `impulse`, shape (pair_count, 4), is the warm start: tangential part on the first body, and pressure.
    """
    total = pairs.shape[0]
    pair = np.empty((total, 2), dtype=np.int32)
    row = np.empty((total, 16))
    m = 0
    for k in range(total):
        i = pairs[k, 0]
        j = pairs[k, 1]
        d0 = x[i, 0] - x[j, 0]
        d1 = x[i, 1] - x[j, 1]
        d2 = x[i, 2] - x[j, 2]
        distance = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        gap = distance - radius[i] - radius[j]
        if gap > reach:
            impulse[k, :] = 0.0
            continue
        if distance > 0.0:
            n0, n1, n2 = d0 / distance, d1 / distance, d2 / distance
        else:
            n0, n1, n2 = 0.0, 0.0, 1.0
        # the tangential part turns with the tangent plane and keeps its size, the normal part is the old pressure: a pair that
        # turns as a whole carries its forces along
        pn = impulse[k, 3]
        t0, t1, t2 = impulse[k, 0], impulse[k, 1], impulse[k, 2]
        size = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
        out = t0 * n0 + t1 * n1 + t2 * n2
        t0, t1, t2 = t0 - out * n0, t1 - out * n1, t2 - out * n2
        kept = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
        if kept > 0.0:
            t0, t1, t2 = t0 * size / kept, t1 * size / kept, t2 * size / kept
        mu = bead_friction if is_bead[i] or is_bead[j] else friction
        if mu == 0.0:
            t0 = t1 = t2 = 0.0
        w = vel[i, 6] + vel[j, 6]
        pair[m, 0] = i
        pair[m, 1] = j
        row[m, 0], row[m, 1], row[m, 2] = n0, n1, n2
        row[m, 3] = pn * n0 + t0
        row[m, 4] = pn * n1 + t1
        row[m, 5] = pn * n2 + t2
        row[m, 6], row[m, 7], row[m, 8] = t0, t1, t2
        row[m, 9] = gap / step if signed else max(0.0, gap) / step
        row[m, 10] = 1.0 / (w + cn)
        row[m, 11] = 1.0 / (3.5 * w + ct)
        row[m, 12] = mu
        row[m, 13] = gap
        row[m, 14] = pn
        row[m, 15] = k
        m += 1
    return pair[:m].copy(), row[:m].copy()


@njit
def keep_contacts(row: Array, impulse: Array) -> None:
    """Write the solved impulses back to the candidates they came from."""
    for m in range(row.shape[0]):
        k = int(row[m, 15])
        pn = row[m, 0] * row[m, 3] + row[m, 1] * row[m, 4] + row[m, 2] * row[m, 5]
        for a in range(3):
            impulse[k, a] = row[m, 3 + a] - pn * row[m, a]
        impulse[k, 3] = pn


@njit
def collect_walls(
    x: Array,
    radius: Array,
    vel: Array,
    half: Array,
    box: Array,
    walls: Ints,
    impulse: Array,
    reach: float,
    step: float,
    cn: float,
    signed: bool,
) -> tuple[Ints, Array]:
    """Contacts with the frictionless walls |x_a| = half_a among the candidate rows (body, axis, side)."""
    total = walls.shape[0]
    wall = np.empty((total, 3), dtype=np.int32)
    row = np.empty((total, 6))
    m = 0
    for k in range(total):
        i, axis, side = walls[k, 0], walls[k, 1], walls[k, 2]
        gap = half[axis] - side * x[i, axis] - radius[i]
        if gap > reach:
            impulse[k] = 0.0
            continue
        wall[m, 0], wall[m, 1], wall[m, 2] = i, axis, side
        row[m, 0] = impulse[k]
        row[m, 1] = gap / step if signed else max(0.0, gap) / step
        row[m, 2] = 1.0 / (vel[i, 6] + box[axis, 1] + cn)
        row[m, 3] = gap
        row[m, 4] = impulse[k]
        row[m, 5] = k
        m += 1
    return wall[:m].copy(), row[:m].copy()


@njit
def collect_links(
    x: Array,
    vel: Array,
    links: Ints,
    length: Array,
    impulse: Array,
    step: float,
    stiffness: float,
    prestrain: float,
    corrected: bool,
) -> Array:
    r"""Link rows: β = (d − (1+π) l₀)/h and compliance c = l₀/(k h²); `stiffness` k [N] is a force per unit strain, inf if rigid.

    `corrected` False leaves β out (rigid rod of the field's codes: lengths drift with the time step).
    """
    row = np.empty((links.shape[0], 8))
    for k in range(links.shape[0]):
        i, j = links[k, 0], links[k, 1]
        d0 = x[i, 0] - x[j, 0]
        d1 = x[i, 1] - x[j, 1]
        d2 = x[i, 2] - x[j, 2]
        distance = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        row[k, 0], row[k, 1], row[k, 2] = d0 / distance, d1 / distance, d2 / distance
        compliance = length[k] / (stiffness * step * step) if np.isfinite(stiffness) else 0.0
        row[k, 3] = impulse[k]
        row[k, 4] = (distance - (1.0 + prestrain) * length[k]) / step if corrected else 0.0
        row[k, 5] = 1.0 / (vel[i, 6] + vel[j, 6] + compliance)
        row[k, 6] = compliance
        row[k, 7] = impulse[k]
    return row
