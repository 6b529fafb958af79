r"""Non-linear Gauss–Seidel sweeps on the contact and link impulses, matrix-free for spheres.

For one contact with the others held, u = ū + W p, where for solid spheres W is diagonal: W_n = 1/m_i + 1/m_j on the normal and
W_t = 7/2 W_n on the tangents (I = 2/5 m r²). The local problem has a closed solution:

    p_n = ⟨p_n − (u_n + b + c_n p_n)/(W_n + c_n)⟩,
    p_t = radial cut to μ p_n of  p_t − (u_t + c_t (p_t − p_t⁰))/(W_t + c_t),

with b = g/h, compliance c = 1/(k h²) (0 for rigid grains) and p⁰ the impulse of the step before. Velocities are kept per body and
updated at once, no Delassus matrix is stored. Row layout of `vel`: v (3), r·ω (3), 1/m, unused: one cache line a body.

Jean (1999), CMAME 177, 235–257; Radjai and Richefeu (2009), Mech. Mater. 41, 715–728.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..cache import njit

__all__ = ["apply_contacts", "apply_links", "apply_walls", "solve"]

Array = NDArray[np.float64]
Ints = NDArray[np.int32]


@njit(inline="always")
def _push(vel: Array, i: int, j: int, n0, n1, n2, d0, d1, d2):  # type: ignore[no-untyped-def]
    """Add the impulse d at the contact (i, j) of normal n (from j to i) to both bodies."""
    mi = vel[i, 6]
    mj = vel[j, 6]
    vel[i, 0] += mi * d0
    vel[i, 1] += mi * d1
    vel[i, 2] += mi * d2
    vel[j, 0] -= mj * d0
    vel[j, 1] -= mj * d1
    vel[j, 2] -= mj * d2
    # torque about both centres is −r n × d; r²/I = 5/(2m)
    c0 = 2.5 * (n1 * d2 - n2 * d1)
    c1 = 2.5 * (n2 * d0 - n0 * d2)
    c2 = 2.5 * (n0 * d1 - n1 * d0)
    vel[i, 3] -= mi * c0
    vel[i, 4] -= mi * c1
    vel[i, 5] -= mi * c2
    vel[j, 3] -= mj * c0
    vel[j, 4] -= mj * c1
    vel[j, 5] -= mj * c2


@njit
def apply_contacts(vel: Array, pair: Ints, row: Array) -> None:
    """Add the impulses stored in the contact rows to the body velocities (warm start)."""
    for k in range(pair.shape[0]):
        _push(vel, pair[k, 0], pair[k, 1], row[k, 0], row[k, 1], row[k, 2], row[k, 3], row[k, 4], row[k, 5])


@njit
def apply_walls(vel: Array, box: Array, wall: Ints, row: Array) -> None:
    """Add the wall impulses to bodies and box; `box` rows: velocity of the half length, 1/mass."""
    for k in range(wall.shape[0]):
        i, axis, side = wall[k, 0], wall[k, 1], wall[k, 2]
        vel[i, axis] -= side * row[k, 0] * vel[i, 6]
        box[axis, 0] += row[k, 0] * box[axis, 1]


@njit
def apply_links(vel: Array, link: Ints, row: Array) -> None:
    """Add the link tensions (impulses pulling the beads together) to the body velocities."""
    for k in range(link.shape[0]):
        i, j = link[k, 0], link[k, 1]
        for a in range(3):
            vel[i, a] -= row[k, 3] * row[k, a] * vel[i, 6]
            vel[j, a] += row[k, 3] * row[k, a] * vel[j, 6]


@njit
def _sweep_contacts(vel: Array, pair: Ints, row: Array, cn: float, ct: float) -> tuple[float, float]:
    change = 0.0
    size = 0.0
    for k in range(pair.shape[0]):
        i = pair[k, 0]
        j = pair[k, 1]
        n0 = row[k, 0]
        n1 = row[k, 1]
        n2 = row[k, 2]
        p0 = row[k, 3]
        p1 = row[k, 4]
        p2 = row[k, 5]
        s0 = vel[i, 3] + vel[j, 3]
        s1 = vel[i, 4] + vel[j, 4]
        s2 = vel[i, 5] + vel[j, 5]
        u0 = vel[i, 0] - vel[j, 0] - (s1 * n2 - s2 * n1)
        u1 = vel[i, 1] - vel[j, 1] - (s2 * n0 - s0 * n2)
        u2 = vel[i, 2] - vel[j, 2] - (s0 * n1 - s1 * n0)
        un = u0 * n0 + u1 * n1 + u2 * n2
        pn = p0 * n0 + p1 * n1 + p2 * n2
        new = pn - (un + row[k, 9] + cn * pn) * row[k, 10]
        if new <= 0.0:
            if pn == 0.0:
                continue
            q0 = 0.0
            q1 = 0.0
            q2 = 0.0
        else:
            # tangential trial: p_t − (u_t + c_t (p_t − p_t⁰))/(W_t + c_t)
            it = row[k, 11]
            q0 = p0 - pn * n0
            q1 = p1 - pn * n1
            q2 = p2 - pn * n2
            q0 -= (u0 - un * n0 + ct * (q0 - row[k, 6])) * it
            q1 -= (u1 - un * n1 + ct * (q1 - row[k, 7])) * it
            q2 -= (u2 - un * n2 + ct * (q2 - row[k, 8])) * it
            bound = row[k, 12] * new
            length2 = q0 * q0 + q1 * q1 + q2 * q2
            if length2 > bound * bound:
                cut = bound / np.sqrt(length2)
                q0 *= cut
                q1 *= cut
                q2 *= cut
            q0 += new * n0
            q1 += new * n1
            q2 += new * n2
            size += new * new
        d0 = q0 - p0
        d1 = q1 - p1
        d2 = q2 - p2
        change += d0 * d0 + d1 * d1 + d2 * d2
        row[k, 3] = q0
        row[k, 4] = q1
        row[k, 5] = q2
        _push(vel, i, j, n0, n1, n2, d0, d1, d2)
    return change, size


@njit
def _sweep_normal(vel: Array, pair: Ints, row: Array, cn: float) -> tuple[float, float]:
    """The frictionless sweep: one unknown a contact, no rotation."""
    change = 0.0
    size = 0.0
    for k in range(pair.shape[0]):
        i = pair[k, 0]
        j = pair[k, 1]
        n0 = row[k, 0]
        n1 = row[k, 1]
        n2 = row[k, 2]
        pn = row[k, 3] * n0 + row[k, 4] * n1 + row[k, 5] * n2
        un = (vel[i, 0] - vel[j, 0]) * n0 + (vel[i, 1] - vel[j, 1]) * n1 + (vel[i, 2] - vel[j, 2]) * n2
        new = max(0.0, pn - (un + row[k, 9] + cn * pn) * row[k, 10])
        size += new * new
        d = new - pn
        if d == 0.0:
            continue
        change += d * d
        row[k, 3] = new * n0
        row[k, 4] = new * n1
        row[k, 5] = new * n2
        mi = vel[i, 6] * d
        mj = vel[j, 6] * d
        vel[i, 0] += mi * n0
        vel[i, 1] += mi * n1
        vel[i, 2] += mi * n2
        vel[j, 0] -= mj * n0
        vel[j, 1] -= mj * n1
        vel[j, 2] -= mj * n2
    return change, size


@njit
def _sweep_walls(vel: Array, box: Array, wall: Ints, row: Array, cn: float) -> tuple[float, float]:
    change = 0.0
    size = 0.0
    for k in range(wall.shape[0]):
        i, axis, side = wall[k, 0], wall[k, 1], wall[k, 2]
        old = row[k, 0]
        un = box[axis, 0] - side * vel[i, axis]
        new = max(0.0, old - (un + row[k, 1] + cn * old) * row[k, 2])
        size += new * new
        d = new - old
        if d != 0.0:
            change += d * d
            row[k, 0] = new
            vel[i, axis] -= side * d * vel[i, 6]
            box[axis, 0] += d * box[axis, 1]
    return change, size


@njit
def _sweep_links(vel: Array, link: Ints, row: Array, unilateral: bool) -> tuple[float, float]:
    change = 0.0
    size = 0.0
    for k in range(link.shape[0]):
        i, j = link[k, 0], link[k, 1]
        n0, n1, n2 = row[k, 0], row[k, 1], row[k, 2]
        old = row[k, 3]
        un = (vel[i, 0] - vel[j, 0]) * n0 + (vel[i, 1] - vel[j, 1]) * n1 + (vel[i, 2] - vel[j, 2]) * n2
        new = old + (un + row[k, 4] - row[k, 6] * old) * row[k, 5]
        if unilateral and new < 0.0:
            new = 0.0
        size += new * new
        d = new - old
        if d != 0.0:
            change += d * d
            row[k, 3] = new
            mi = vel[i, 6] * d
            mj = vel[j, 6] * d
            vel[i, 0] -= mi * n0
            vel[i, 1] -= mi * n1
            vel[i, 2] -= mi * n2
            vel[j, 0] += mj * n0
            vel[j, 1] += mj * n1
            vel[j, 2] += mj * n2
    return change, size


@njit
def solve(
    vel: Array,
    box: Array,
    pair: Ints,
    contact: Array,
    wall: Ints,
    wall_row: Array,
    link: Ints,
    link_row: Array,
    cn: float,
    ct: float,
    frictional: bool,
    unilateral: bool,
    tolerance: float,
    floor: float,
    sweep_limit: int,
) -> tuple[int, float]:
    """Sweep until √(Σ|δp|²/Σp_n²) over one sweep falls below `tolerance`; returns (sweeps, that ratio).

    `floor` [N s] is an impulse below which the sample counts as force-free.
    """
    ratio = np.inf
    done = 0
    while done < sweep_limit:
        if frictional:
            change, size = _sweep_contacts(vel, pair, contact, cn, ct)
        else:
            change, size = _sweep_normal(vel, pair, contact, cn)
        c, s = _sweep_walls(vel, box, wall, wall_row, cn)
        change += c
        size += s
        c, s = _sweep_links(vel, link, link_row, unilateral)
        change += c
        size += s
        done += 1
        ratio = np.sqrt(change / max(size, floor * floor)) if floor > 0.0 or size > 0.0 else np.sqrt(change)
        if ratio <= tolerance:
            break
    return done, ratio
