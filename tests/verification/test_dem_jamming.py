"""Where packings jam (`make validate`): frictionless ones are isostatic at random close packing, frictional ones are looser.

Isostatic: as many contacts as degrees of freedom, 3 a grain and one a pair of walls, so that Z = 2 (contacts)/(grains that bear) = 6 up
to 6/N (Moukarzel 1998; O'Hern et al. 2003, Phys. Rev. E 68, 011306, who also give 0.639 ± 0.001 for the density of monodisperse spheres).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from fenchel.dem import Assembly, Material, Solver
from fenchel.dem.packing import densify
from fenchel.dem.preparation import IsotropicStage

pytestmark = pytest.mark.validate
PRESSURE, RADIUS = 1e4, 1e-3


def jammed(friction: float, seed: int, count: int = 1500) -> tuple[Assembly, float, float, float]:
    """A packing at rest under the pressure of six walls: (assembly, contacts over degrees of freedom, Z, solid fraction inside).

    Grains are nearly rigid, k_n/(P d) = 3e4: the overlap of 1e-5 d moves Z by some 1e-2.
    """
    rng = np.random.default_rng(seed)
    a = densify(rng, RADIUS * rng.uniform(0.95, 1.05, count), solid_fraction=0.58)
    law = Material(friction=friction, bead_friction=friction, links=False)
    for stiffness, least in ((4e2, 60.0), (3e4, 100.0)):
        k = stiffness * PRESSURE * 2.0 * RADIUS
        stage = IsotropicStage(
            a, replace(law, normal_stiffness=k, tangential_stiffness=0.8 * k), Solver(tolerance=1e-6, sweep_limit=20_000),
            name="jamming", pressure=PRESSURE, density=2600.0, least=least, step_fraction=0.05, quench=10.0, most=2000.0,
        )  # fmt: skip
        while not stage.done:
            stage.advance()
    rows = stage.simulation.contacts
    assert rows is not None
    force = np.sum(rows.impulse * rows.normal, axis=1)
    wall = np.abs(rows.wall_impulse.sum(axis=1))
    least_force = 1e-3 * force[force > 0.0].mean()
    pair, body = rows.pair[force > least_force], rows.touching[wall > least_force, 0]
    # without friction a grain needs four contacts to bear anything, with friction two; without it others may lose theirs
    needed = 4 if friction == 0.0 else 2
    bearing = np.ones(count, dtype=bool)
    while True:
        held = bearing[pair].all(axis=1)
        contacts = np.bincount(pair[held].ravel(), minlength=count) + np.bincount(body[bearing[body]], minlength=count)
        loose = bearing & (contacts < needed)
        if not loose.any():
            break
        bearing &= ~loose
    total = int(held.sum() + bearing[body].sum())
    # solid fraction three diameters away from the walls, by points
    inner = a.half - 6.0 * RADIUS
    points = rng.uniform(-inner, inner, (200_000, 3))
    near = cKDTree(a.x).query(points, k=8)[1]
    covered = np.any(np.sum((points[:, None, :] - a.x[near]) ** 2, axis=2) < a.radius[near] ** 2, axis=1)
    bears = int(bearing.sum())
    return a, total / (3 * bears + 3), 2.0 * total / bears, float(covered.mean())


def test_frictionless_packings_are_isostatic_at_random_close_packing() -> None:
    for seed in (1, 2):
        _, share, coordination, fraction = jammed(0.0, seed)
        assert share == pytest.approx(1.0, abs=0.0165)
        assert coordination == pytest.approx(6.0, abs=0.1)
        assert fraction == pytest.approx(0.64, abs=0.01)


def test_frictional_packings_are_looser() -> None:
    _, _, smooth, dense = jammed(0.0, 1)
    _, _, coordination, fraction = jammed(0.5, 1)
    assert fraction < dense - 0.02
    assert 4.0 <= coordination < smooth - 0.7
