"""Random triaxial scenes of some hundred grains: a function of the seed. What matters to a solver varies over decades."""

from __future__ import annotations

import numpy as np

from fenchel.dem.scene import Grains, Scene, SceneTriaxial, Wires, check_scene


def random_scene(seed: int) -> Scene:
    """Stiffness κ = k_n/(P d) from 100 to 5000, friction 0.2 to 0.8, inertial number 2e-4 to 2e-3, a third of the scenes with wires,
    half of them with a reversal."""
    rng = np.random.default_rng([seed, 11])
    pressure = float(10.0 ** rng.uniform(4.3, 5.3))
    count = int(rng.integers(80, 260))
    small = 1e-3 * float(10.0 ** rng.uniform(-0.3, 0.3))
    large = small * float(rng.uniform(1.2, 2.2))
    kappa = float(10.0 ** rng.uniform(2.0, 3.7))
    grains = Grains(
        count=count,
        radius=(small, large),
        friction=float(rng.uniform(0.2, 0.8)),
        normal_stiffness=kappa * pressure * (small + large),
        stiffness_ratio=float(rng.uniform(0.5, 1.0)),
    )
    wires = None
    if rng.random() < 1.0 / 3.0:
        mean = 0.5 * (small + large)
        beads = int(rng.integers(5, 12))
        wires = Wires(
            count=max(1, int(0.6 * count / beads)),
            beads=beads,
            spacing=mean,
            bead_radius=0.4 * mean,
            stiffness=float(10.0 ** rng.uniform(2.5, 4.0)) * pressure * mean**2,
        )
    largest = float(rng.uniform(0.005, 0.012))
    path = (0.0, -largest) if rng.random() < 0.5 else (0.0, -largest, -0.5 * largest)
    test = SceneTriaxial(pressure=pressure, strain_path=path, inertial_number=float(10.0 ** rng.uniform(-3.7, -2.7)))
    return check_scene(Scene(seed=seed, grains=grains, wires=wires, triaxial=test))
