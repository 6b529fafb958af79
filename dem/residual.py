r"""How good is a solved step? Recomputed from the impulses alone, by code that shares nothing with the sweeps.

Velocities are rebuilt as v = v_free + M⁻¹ H p. With the compliant relative velocity ũ = (u_n + b + c_n p_n, u_t + c_t (p_t − p_t⁰)),
the law is Coulomb's cone complementarity K_μ ∋ p ⊥ û ∈ K_μ*, û = ũ + μ‖ũ_t‖ n, and the natural map

    ‖p − P_K(p − ρ û)‖ / ‖p‖ ,   ρ = 1/(W_n + c_n) per contact,

is zero exactly at solutions (de Saxcé and Feng 1998; Acary, Brémond and Huber 2018). Walls and links are half lines (rods: lines).

Energy of the step (exact for the mid-point kinetic energy): ΔE_kin = W_ext + Σ p·(u⁻+u⁺)/2, split into the change of elastic energy, the
friction dissipation −p_t·ũ_t ≥ 0, the algorithmic dissipation ½c|p − p⁰|² ≥ 0 of the implicit compliance, the shock term
½Σ p·(u⁺−u⁻), and what is left: the change of geometry between steps (`balance`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..cache import njit

__all__ = ["MEASURES", "assess"]

Array = NDArray[np.float64]
Ints = NDArray[np.int32]

MEASURES = (
    "natural_map",  # relative, as above
    "natural_map_max",  # worst contact, relative to the mean impulse
    "violation_max",  # largest gap less elastic deflection [m]
    "overlap_mean",  # mean over closed contacts of the end-of-step overlap [m]
    "overlap_max",
    "force_mean",  # mean normal force of closed contacts [N]
    "unbalanced",  # mean net force of bodies / mean contact force
    "sliding",  # fraction of closed contacts on the cone
    "closed",  # number of closed contacts
    "elastic",  # stored elastic energy at the end of the step [J]
    "friction",  # dissipated by friction in the step [J]
    "algorithmic",  # dissipated by the implicit compliance [J]
    "shock",  # dissipated by inelastic shocks [J]
    "external",  # work of pressures and driven walls [J]
    "kinetic",  # kinetic energy at the end of the step [J]
    "balance",  # energy error of the step [J]
)


@njit
def assess(
    before: Array,
    free: Array,
    box_before: Array,
    box_free: Array,
    driven: NDArray[np.bool_],
    mass: Array,
    pair: Ints,
    contact: Array,
    wall: Ints,
    wall_row: Array,
    link: Ints,
    link_row: Array,
    step: float,
    cn: float,
    ct: float,
    unilateral: bool,
) -> Array:
    """The measures above for one step, shape (16,); `before` and `free` are the velocities before the step and without impulses."""
    out = np.zeros(16)
    bodies = before.shape[0]
    v = free.copy()
    box = box_free.copy()
    mean_body_force = 0.0
    for k in range(pair.shape[0]):
        i, j = pair[k, 0], pair[k, 1]
        n = contact[k, 0:3]
        p = contact[k, 3:6]
        spin0 = n[1] * p[2] - n[2] * p[1]
        spin1 = n[2] * p[0] - n[0] * p[2]
        spin2 = n[0] * p[1] - n[1] * p[0]
        for a in range(3):
            v[i, a] += p[a] * v[i, 6]
            v[j, a] -= p[a] * v[j, 6]
        for b in (i, j):
            v[b, 3] -= 2.5 * spin0 * v[b, 6]
            v[b, 4] -= 2.5 * spin1 * v[b, 6]
            v[b, 5] -= 2.5 * spin2 * v[b, 6]
    for k in range(wall.shape[0]):
        i, axis, side = wall[k, 0], wall[k, 1], wall[k, 2]
        p = wall_row[k, 0]
        v[i, axis] -= side * p * v[i, 6]
        box[axis, 0] += p * box[axis, 1]
    for k in range(link.shape[0]):
        i, j = link[k, 0], link[k, 1]
        for a in range(3):
            p = link_row[k, 3] * link_row[k, a]
            v[i, a] -= p * v[i, 6]
            v[j, a] += p * v[j, 6]

    squared = 0.0
    size = 0.0
    worst = 0.0
    closed = 0
    sliding = 0
    overlap = 0.0
    force = 0.0
    work = 0.0  # Σ p·(u⁻+u⁺)/2, the exact change of kinetic energy
    u = np.empty(3)
    w = np.empty(3)
    for k in range(pair.shape[0]):
        i, j = pair[k, 0], pair[k, 1]
        n = contact[k, 0:3]
        p = contact[k, 3:6]
        mu = contact[k, 12]
        s0, s1, s2 = v[i, 3] + v[j, 3], v[i, 4] + v[j, 4], v[i, 5] + v[j, 5]
        u[0] = v[i, 0] - v[j, 0] - (s1 * n[2] - s2 * n[1])
        u[1] = v[i, 1] - v[j, 1] - (s2 * n[0] - s0 * n[2])
        u[2] = v[i, 2] - v[j, 2] - (s0 * n[1] - s1 * n[0])
        s0, s1, s2 = before[i, 3] + before[j, 3], before[i, 4] + before[j, 4], before[i, 5] + before[j, 5]
        w[0] = before[i, 0] - before[j, 0] - (s1 * n[2] - s2 * n[1])
        w[1] = before[i, 1] - before[j, 1] - (s2 * n[0] - s0 * n[2])
        w[2] = before[i, 2] - before[j, 2] - (s0 * n[1] - s1 * n[0])
        un = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
        pn = p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
        law_n = un + contact[k, 9] + cn * pn
        rho = contact[k, 10]
        t0, t1, t2 = p[0] - pn * n[0], p[1] - pn * n[1], p[2] - pn * n[2]
        l0 = u[0] - un * n[0] + ct * (t0 - contact[k, 6])
        l1 = u[1] - un * n[1] + ct * (t1 - contact[k, 7])
        l2 = u[2] - un * n[2] + ct * (t2 - contact[k, 8])
        if mu == 0.0:
            l0 = l1 = l2 = 0.0
        slip = np.sqrt(l0 * l0 + l1 * l1 + l2 * l2)
        # projection of p − ρ û on the cone ‖t‖ ≤ μ n
        a_n = pn - rho * (law_n + mu * slip)
        a0, a1, a2 = t0 - rho * l0, t1 - rho * l1, t2 - rho * l2
        a_t = np.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        if a_n >= 0.0 and a_t <= mu * a_n:
            c_n, c_t = a_n, 1.0
        elif mu * a_t <= -a_n:
            c_n, c_t = 0.0, 0.0
        else:
            c_n = (a_n + mu * a_t) / (1.0 + mu * mu)
            c_t = mu * c_n / a_t
        e = (pn - c_n) ** 2 + (t0 - c_t * a0) ** 2 + (t1 - c_t * a1) ** 2 + (t2 - c_t * a2) ** 2
        squared += e
        worst = max(worst, e)
        tt = t0 * t0 + t1 * t1 + t2 * t2
        size += pn * pn + tt
        out[2] = max(out[2], -contact[k, 13] - step * (un + cn * pn))
        work += p[0] * (u[0] + w[0]) + p[1] * (u[1] + w[1]) + p[2] * (u[2] + w[2])
        out[9] += 0.5 * (cn * pn * pn + ct * tt)
        out[10] -= t0 * l0 + t1 * l1 + t2 * l2
        x0, x1, x2 = t0 - contact[k, 6], t1 - contact[k, 7], t2 - contact[k, 8]
        out[11] += 0.5 * (cn * (pn - contact[k, 14]) ** 2 + ct * (x0 * x0 + x1 * x1 + x2 * x2))
        if contact[k, 9] > 0.0:
            out[11] += pn * contact[k, 9]  # the force acts during the whole step in which the gap closes
        out[12] += 0.5 * (p[0] * (u[0] - w[0]) + p[1] * (u[1] - w[1]) + p[2] * (u[2] - w[2]))
        if pn > 0.0:
            closed += 1
            force += pn
            end = -(contact[k, 13] + step * un)
            overlap += max(0.0, end)
            out[4] = max(out[4], end)
            if mu > 0.0 and np.sqrt(tt) > mu * pn * (1.0 - 1e-6):
                sliding += 1
    for k in range(wall.shape[0]):
        i, axis, side = wall[k, 0], wall[k, 1], wall[k, 2]
        p = wall_row[k, 0]
        un = box[axis, 0] - side * v[i, axis]
        wn = box_before[axis, 0] - side * before[i, axis]
        law_n = un + wall_row[k, 1] + cn * p
        e = p - max(0.0, p - wall_row[k, 2] * law_n)
        squared += e * e
        worst = max(worst, e * e)
        size += p * p
        out[2] = max(out[2], -wall_row[k, 3] - step * (un + cn * p))
        work += p * (un + wn)
        out[9] += 0.5 * cn * p * p
        out[11] += 0.5 * cn * (p - wall_row[k, 4]) ** 2
        if wall_row[k, 1] > 0.0:
            out[11] += p * wall_row[k, 1]
        out[12] += 0.5 * p * (un - wn)
        if driven[axis]:
            out[13] -= p * 0.5 * (box[axis, 0] + box_before[axis, 0])
        if p > 0.0:
            closed += 1
            force += p
            end = -(wall_row[k, 3] + step * un)
            overlap += max(0.0, end)
            out[4] = max(out[4], end)
    for k in range(link.shape[0]):
        i, j = link[k, 0], link[k, 1]
        un = 0.0
        wn = 0.0
        for a in range(3):
            un += (v[i, a] - v[j, a]) * link_row[k, a]
            wn += (before[i, a] - before[j, a]) * link_row[k, a]
        r = link_row[k, 3]
        law_n = un + link_row[k, 4] - link_row[k, 6] * r
        trial = r + link_row[k, 5] * law_n
        e = r - (max(0.0, trial) if unilateral else trial)
        squared += e * e
        worst = max(worst, e * e)
        size += r * r
        work -= r * (un + wn)
        out[9] += 0.5 * link_row[k, 6] * r * r
        out[11] += 0.5 * link_row[k, 6] * (r - link_row[k, 7]) ** 2
        if unilateral and link_row[k, 4] < 0.0:
            out[11] -= r * link_row[k, 4]  # the slack taken up in this step
        out[12] -= 0.5 * r * (un - wn)
    for i in range(bodies):
        change = 0.0
        for a in range(3):
            change += (v[i, a] - before[i, a]) ** 2
        mean_body_force += mass[i] * np.sqrt(change)  # net impulse of the step
        for a in range(3):
            out[14] += 0.5 * mass[i] * (v[i, a] ** 2 + 0.4 * v[i, 3 + a] ** 2)
            # weight: v_free − v⁻ is h g
            out[13] += mass[i] * (free[i, a] - before[i, a]) * 0.5 * (v[i, a] + before[i, a])
    for a in range(3):
        if not driven[a]:
            out[14] += 0.5 * box[a, 0] ** 2 / box[a, 1]
            out[13] += (box_free[a, 0] - box_before[a, 0]) / box[a, 1] * 0.5 * (box[a, 0] + box_before[a, 0])
    out[0] = np.sqrt(squared / size) if size > 0.0 else np.sqrt(squared)
    mean_impulse = force / closed if closed > 0 else 0.0
    out[1] = np.sqrt(worst) / mean_impulse if mean_impulse > 0.0 else np.sqrt(worst)
    out[3] = overlap / closed if closed > 0 else 0.0
    out[5] = mean_impulse / step
    out[6] = mean_body_force / bodies / mean_impulse if mean_impulse > 0.0 and bodies > 0 else 0.0
    out[7] = sliding / closed if closed > 0 else 0.0
    out[8] = closed
    # what the contacts gave to the kinetic energy, not accounted for above; the caller adds the elastic energy before the step
    out[15] = -0.5 * work - out[9] - out[10] - out[11] - out[12]
    return out
