r"""Claim 28: W = Hᵀ M⁻¹ H of a step against mechanics without matrices, and what contact impulses conserve.

Of problems taken from packings: the asymmetry of the assembled W and its smallest eigenvalue; W r for random r against impulses put on
bodies and velocities read at the contacts; the velocities that the step itself left (its sweeps never form W) against W r + q.
Of clusters in free space: momentum and angular momentum before and after a step. Where two contact points lie a gap g apart, the pair of
impulses ±p has the moment g n × p; between touching spheres it is none.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dem import Assembly, Drive, Laws, Material
from ..dem.laws import ElasticWire, SignoriniCoulomb
from ..dem.one_step.scenes import problem_of
from .contact_scenes import LocalRows, cluster, packing, reactions

__all__ = ["GAP", "GRAINS", "conservation", "operator"]

Array = NDArray[np.float64]

GRAINS = 30
GAP = 1e-5  # m, by which places of the disturbed clusters are off


def operator(problems: int, impulses: int) -> dict[str, Any]:
    """Worst errors over `problems` packings, each with `impulses` random impulses; relative to the size of W r."""
    out: dict[str, Any] = {
        "asymmetry": 0.0,
        "least_eigenvalue": 0.0,
        "product": 0.0,
        "step": 0.0,
        "contacts": 0,
        "dependent_rows": 0,
    }
    for seed in range(problems):
        law = Material(friction=0.4, wire_law=("elastic_wire", "rigid_wire")[seed % 2], wire_stiffness=10.0)
        simulation, step, drive = packing(seed, GRAINS, law)
        problem = problem_of(simulation, step, drive)
        simulation.advance(step, drive)
        rows = LocalRows(problem, simulation)
        dense = problem.delassus.toarray()
        eigenvalues = np.linalg.eigvalsh(dense)
        out["asymmetry"] = max(out["asymmetry"], problem.asymmetry)
        out["least_eigenvalue"] = min(out["least_eigenvalue"], float(eigenvalues[0] / eigenvalues[-1]))
        out["contacts"] += len(problem.mu)
        # rows of links have no tangential part
        used = np.ones((len(problem.mu), 3), dtype=bool)
        used[rows.slice("links"), 1:] = False
        out["dependent_rows"] += int(used.sum() - np.sum(eigenvalues > 1e-12 * eigenvalues[-1]))
        rng = np.random.default_rng(seed)
        for _ in range(impulses):
            r = rng.standard_normal(used.shape) * used
            assembled = dense @ r.ravel()
            error = np.max(np.abs(rows.product(r.ravel()) - assembled)) / np.max(np.abs(assembled))
            out["product"] = max(out["product"], float(error))
        out["step"] = max(
            out["step"], _left_by_the_step(problem, rows, simulation.assembly, reactions(rows, simulation))
        )
    return out


def _left_by_the_step(problem: Any, rows: LocalRows, a: Assembly, r: Array) -> float:
    """Relative velocities of the bodies after the step against W r + q without shifts and compliances, relative to the largest."""
    turning = a.spin / a.radius[:, None]
    u = rows.velocities(a.velocity, turning, a.box_velocity).reshape(-1, 3)
    expected = (problem.velocity(r) - problem.bodies.w).reshape(-1, 3)
    links = rows.slice("links")
    expected[links, 0] -= rows.compliance * r.reshape(-1, 3)[links, 0]
    used = np.ones(u.shape, dtype=bool)
    used[links, 1:] = False
    return float(np.max(np.abs(u - expected)[used]) / np.max(np.abs(expected)))


def _momenta(a: Assembly, x: Array) -> tuple[Array, Array]:
    linear = a.mass[:, None] * a.velocity
    spins = (0.4 * a.mass * a.radius)[:, None] * a.spin  # I ω with I = 2/5 m r²
    return linear.sum(axis=0), (np.cross(x, linear) + spins).sum(axis=0)


def conservation(problems: int) -> dict[str, Any]:
    """Largest changes of momentum and angular momentum in a step with friction, relative to Σ m|v| and Σ |x| m|v|.

    "touching": spheres in contact; "apart": gaps of some 10 µm, where the moments of the gaps (`moment_of_gaps`) are taken off.
    """
    laws = Laws(contact=SignoriniCoulomb(friction=0.4), wire=ElasticWire(stiffness=50.0))
    out: dict[str, Any] = {"closed": 0, "sliding": 0.0, "links_pulling": 0}
    for name, gap in (("touching", 0.0), ("apart", GAP)):
        worst = {"momentum": 0.0, "angular": 0.0, "moment_of_gaps": 0.0}
        for seed in range(problems):
            simulation = cluster(seed, laws, gap=gap)
            a = simulation.assembly
            x = a.x.copy()
            moved = a.mass * np.linalg.norm(a.velocity, axis=1)
            size = float(np.sum(np.linalg.norm(x, axis=1) * moved))
            linear, angular = _momenta(a, x)
            measures = simulation.advance(1e-4, Drive())
            contacts = simulation.contacts
            assert contacts is not None
            off = np.cross(contacts.gap[:, None] * contacts.normal, contacts.impulse).sum(axis=0)
            linear_after, angular_after = _momenta(a, x)
            worst["momentum"] = max(worst["momentum"], float(np.linalg.norm(linear_after - linear) / moved.sum()))
            kept = angular_after - angular - (off if gap else 0.0)
            worst["angular"] = max(worst["angular"], float(np.linalg.norm(kept) / size))
            worst["moment_of_gaps"] = max(worst["moment_of_gaps"], float(np.linalg.norm(off) / size))
            out["closed"] += int(measures["closed"])
            out["sliding"] = max(out["sliding"], measures["sliding"])
            out["links_pulling"] += int(np.sum(contacts.tension > 0.0))
        out[name] = worst
    return out
