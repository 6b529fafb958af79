"""The Gauss–Seidel sweep against the least that it must move: contact-iterations per second, bytes per contact, share of the copy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fenchel.dem import Assembly, Drive, Simulation, Solver
from fenchel.dem.preparation import make_sample, material_of, preparation
from fenchel.dem.scene import Grains, Sample, SceneSolve, Wires

PRESSURE = 5e4
SWEEPS = 50


@pytest.fixture(scope="module")
def problem() -> tuple[Simulation, dict[str, Any]]:
    grains, wires = Grains(count=1000, normal_stiffness=4.3e4), Wires(count=75)
    assembly: Assembly = make_sample(grains, wires, Sample(), 1)
    stage = preparation(grains, wires, Sample(), SceneSolve(), PRESSURE)[0](assembly)
    while stage.steps < 200:
        stage.advance()
    simulation = Simulation(assembly, material_of(grains, wires), Solver())
    step = 0.05 * 2.0 * assembly.grain_radius * np.sqrt(grains.density / PRESSURE)
    return simulation, simulation.problem(step, Drive(pressure=np.full(3, PRESSURE)))


def test_sweeps(benchmark, problem) -> None:
    simulation, arguments = problem
    rows = arguments["contacts"]
    count = len(rows.pair) + len(rows.touching) + len(rows.link)
    start = rows.row.copy()

    def sweep() -> None:
        rows.row[:] = start
        simulation.sweep(arguments, tolerance=0.0, sweep_limit=SWEEPS)

    benchmark(sweep)
    benchmark.extra_info["rows"] = count
    benchmark.extra_info["bytes per row"] = simulation.kernels.bytes_per_contact()
    if benchmark.stats is not None:
        rate = count * SWEEPS / benchmark.stats["median"] / 1e6
        benchmark.extra_info["million contact-iterations per second"] = round(rate, 1)


def test_copy_of_the_rows(benchmark, problem) -> None:
    """Reading and writing every row once per sweep: the traffic that a sweep cannot avoid."""
    source = problem[1]["contacts"].row
    target = np.empty_like(source)

    def copies() -> None:
        for _ in range(SWEEPS):
            np.copyto(target, source)

    benchmark(copies)
