"""The Gauss–Seidel sweep against the least that it must move: contact-iterations per second, bytes per contact, share of the copy."""

from __future__ import annotations

import numpy as np
import pytest

from fenchel.dem import Assembly, Drive, Simulation, Solver
from fenchel.dem.nlgs import solve
from fenchel.dem.preparation import make_sample, material_of, preparation
from fenchel.dem.scene import Grains, Sample, SceneSolve, Wires

PRESSURE = 5e4
SWEEPS = 50


@pytest.fixture(scope="module")
def problem():
    grains, wires = Grains(count=1000, normal_stiffness=4.3e4), Wires(count=75)
    assembly: Assembly = make_sample(grains, wires, Sample(), 1)
    stage = preparation(grains, wires, Sample(), SceneSolve(), PRESSURE)[0](assembly)
    while stage.steps < 200:
        stage.advance()
    simulation = Simulation(assembly, material_of(grains, wires), Solver())
    step = 0.05 * 2.0 * assembly.grain_radius * np.sqrt(grains.density / PRESSURE)
    _, free, _, box, _, rows = simulation.assemble(step, Drive(pressure=np.full(3, PRESSURE)))
    return free, box, rows


def test_sweeps(benchmark, problem) -> None:
    free, box, rows = problem
    count = len(rows.pair) + len(rows.wall) + len(rows.link)

    def sweep() -> None:
        solve(
            free.copy(), box.copy(), rows.pair, rows.contact.copy(), rows.wall, rows.wall_row.copy(), rows.link, rows.link_row.copy(),
            rows.cn, rows.ct, True, True, 0.0, 1e-30, SWEEPS,
        )  # fmt: skip

    benchmark(sweep)
    benchmark.extra_info["rows"] = count
    benchmark.extra_info["bytes per contact"] = rows.contact.itemsize * rows.contact.shape[1] + rows.pair.itemsize * 2
    if benchmark.stats is not None:
        benchmark.extra_info["million contact-iterations per second"] = round(
            count * SWEEPS / benchmark.stats["median"] / 1e6, 1
        )


def test_copy_of_the_rows(benchmark, problem) -> None:
    """Reading and writing every row once per sweep: the traffic that a sweep cannot avoid."""
    rows = problem[2]
    source, target = rows.contact, np.empty_like(rows.contact)

    def copies() -> None:
        for _ in range(SWEEPS):
            np.copyto(target, source)

    benchmark(copies)
