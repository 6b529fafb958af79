"""Statistics that take minutes (`make validate`): edge effects against the number of grains, scatter of samples."""

from __future__ import annotations

import numpy as np
import pytest

from fenchel.dem.homogenise import moments
from fenchel.dem.preparation import make_sample, preparation
from fenchel.dem.scene import Grains, Sample, SceneSolve

pytestmark = pytest.mark.validate


def sphere_over_wall(count: int, seed: int) -> tuple[float, float]:
    """Mean stress of the sphere of 0.8 half widths, and of the box, over the pressure of the walls."""
    grains = Grains(count=count, normal_stiffness=4.3e4)
    assembly = make_sample(grains, None, Sample(), seed)
    rows = None
    for make in preparation(grains, None, Sample(), SceneSolve(), 5e4):
        stage = make(assembly)
        while not stage.done:
            stage.advance()
        rows = stage.simulation.contacts
    assert rows is not None
    radius = 0.8 * float(assembly.half.min())
    m = moments(assembly, rows, radius)
    sphere = -np.trace(m[:, :8].sum(axis=(0, 1))) / 3.0 / (4.0 / 3.0 * np.pi * radius**3)
    box = -np.trace(m[:, 8].sum(axis=0)) / 3.0 / (8.0 * float(np.prod(rows.half)))
    return sphere / 5e4, box / 5e4


def test_the_edge_effect_fades_with_the_number_of_grains() -> None:
    found = {count: np.mean([sphere_over_wall(count, seed) for seed in (1, 2)], axis=0) for count in (500, 4000)}
    for _, box in found.values():
        assert box == pytest.approx(1.0, abs=0.01)
    assert 1.08 < found[500][0] < 1.25
    assert found[4000][0] < 1.05
