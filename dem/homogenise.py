r"""Stress of each phase in a sphere, and of the whole box, from contact forces and branch vectors (Love–Weber).

The internal moment of body a is M^a = Σ_c f^{c→a} ⊗ (x^c − x^a); summed over bodies it is Σ_c f^c ⊗ ℓ^c exactly, so the split by body is
the split by phase. Tension-positive stress is Σ M / V. In a sphere each segment from a centre to its contact point counts with the
part of its length that lies inside: this is the exact volume average of the stress carried along the branches, with no jump when a
centre crosses the surface. Links carry T d n ⊗ n between bead centres.

Love (1927); Weber (1966); Bagi, Mech. Mater. 22 (1996) 165–177; partial branches: Babic (1997), Goldhirsch (2010).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..cache import njit
from .bodies import Assembly
from .rows import Contacts

__all__ = ["fit_sums", "moments", "wall_stress"]

Array = NDArray[np.float64]


@njit
def _inside(start: Array, end: Array, radius: float) -> tuple[float, int]:
    """Fraction of the segment inside the sphere |x| < radius, and the octant of the middle of that part."""
    aa = bb = cc = 0.0
    for a in range(3):
        d = end[a] - start[a]
        aa += d * d
        bb += start[a] * d
        cc += start[a] * start[a]
    cc -= radius * radius
    if aa == 0.0:
        low, high = 0.0, 1.0 if cc < 0.0 else 0.0
    else:
        disc = bb * bb - aa * cc
        if disc <= 0.0:
            return 0.0, 0
        root = np.sqrt(disc)
        low = max(0.0, (-bb - root) / aa)
        high = min(1.0, (-bb + root) / aa)
        if high <= low:
            return 0.0, 0
    middle = 0.5 * (low + high)
    octant = 0
    for a in range(3):
        if start[a] + middle * (end[a] - start[a]) > 0.0:
            octant += 1 << a
    return high - low, octant


@njit
def _add(out: Array, phase: int, start: Array, end: Array, force: Array, radius: float) -> None:
    """Add f ⊗ (end − start) to the phase, clipped to the sphere by octant, and whole in slot 8."""
    part, octant = _inside(start, end, radius)
    for a in range(3):
        for b in range(3):
            m = force[a] * (end[b] - start[b])
            out[phase, octant, a, b] += part * m
            out[phase, 8, a, b] += m


@njit
def _moments(x, body_radius, is_bead, half, pair, contact, wall, wall_row, link, link_row, step, radius):  # type: ignore[no-untyped-def]
    out = np.zeros((3, 9, 3, 3))
    point = np.empty(3)
    force = np.empty(3)
    for k in range(pair.shape[0]):
        i, j = pair[k, 0], pair[k, 1]
        reach = body_radius[i] + 0.5 * contact[k, 13]
        for a in range(3):
            force[a] = contact[k, 3 + a] / step
            point[a] = x[i, a] - reach * contact[k, a]
        _add(out, 1 if is_bead[i] else 0, x[i], point, force, radius)
        for a in range(3):
            force[a] = -force[a]
        _add(out, 1 if is_bead[j] else 0, x[j], point, force, radius)
    for k in range(wall.shape[0]):
        i, axis, side = wall[k, 0], wall[k, 1], wall[k, 2]
        for a in range(3):
            point[a] = x[i, a]
            force[a] = 0.0
        point[axis] = side * half[axis]
        force[axis] = -side * wall_row[k, 0] / step
        _add(out, 1 if is_bead[i] else 0, x[i], point, force, radius)
    for k in range(link.shape[0]):
        i, j = link[k, 0], link[k, 1]
        for a in range(3):
            force[a] = -link_row[k, 3] * link_row[k, a] / step  # on bead i, towards j
        _add(out, 2, x[i], x[j], force, radius)
    return out


def moments(assembly: Assembly, rows: Contacts, radius: float) -> Array:
    """Internal moments [J] by phase (grains, beads at their grain contacts, links), shape (3, 9, 3, 3).

    Second index: the eight octants of the sphere |x| < `radius` [m] (bit a set where x_a > 0), then the whole box.
    """
    return _moments(
        rows.x, assembly.radius, assembly.is_bead, rows.half, rows.pair, rows.contact, rows.wall, rows.wall_row,
        rows.link, rows.link_row, rows.step, radius,
    )  # fmt: skip


def wall_stress(rows: Contacts) -> Array:
    """Normal stresses on the three pairs of walls [Pa], tension positive, shape (3,): mean over both walls of a pair."""
    area = 4.0 * np.prod(rows.half) / rows.half
    body_force = np.abs(np.sum(rows.wall_impulse, axis=1))  # one component each
    force = np.bincount(rows.touching[:, 1] // 2, weights=body_force, minlength=3) / rows.step
    return -force / (2.0 * area)


def fit_sums(reference: Array, displacement: Array, chosen: NDArray[np.bool_], octant: NDArray[np.int64]) -> Array:
    """Sums for the best-fit strain over the `chosen` bodies by octant, shape (8, 25): count, Σx, Σu, Σx⊗x, Σu⊗x."""
    out = np.zeros((8, 25))
    x, u = reference[chosen], displacement[chosen]
    row = np.concatenate(
        [
            np.ones((len(x), 1)),
            x,
            u,
            (x[:, :, None] * x[:, None, :]).reshape(-1, 9),
            (u[:, :, None] * x[:, None, :]).reshape(-1, 9),
        ],
        axis=1,
    )
    np.add.at(out, octant[chosen], row)
    return out
