"""One-step contact solvers on problems of their own: times within one run, and counts that no machine changes.

The FCLIB files of other codes are timed too where they lie beside the checkout; the last column of the table in their README is the
time of the best peer, on another machine.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fenchel.dem.one_step import OneStepProblem, read_fclib, solve
from fenchel.dem.one_step.blocks import scaled_blocks
from fenchel.dem.one_step.linear import BlockSystem
from fenchel.dem.one_step.scenes import problem_of
from fenchel.dem.one_step.sweeps import sweep
from fenchel.dem.packing import densify
from fenchel.dem.stepping import Drive, Material, Simulation, Solver

FILES = Path(__file__).parents[2] / "shared" / "fclib" / "selection"
NAMES = sorted(file.stem for file in FILES.glob("*.hdf5")) if FILES.is_dir() else []
HARD = ("packing1k", "RockPile")


@pytest.fixture(scope="module")
def problem() -> OneStepProblem:
    """A rigid frictional step of 200 grains in their box under pressure."""
    radius = np.random.default_rng(0).uniform(0.75e-3, 1.39e-3, 200)
    assembly = densify(np.random.default_rng(1), radius, solid_fraction=0.5)
    simulation = Simulation(assembly, Material(friction=0.4), Solver(tolerance=1e-4, sweep_limit=100_000))
    drive = Drive(pressure=np.full(3, 5e4))
    step = 0.05 * 2.0 * assembly.grain_radius * np.sqrt(2600.0 / 5e4)
    for _ in range(150):
        simulation.advance(step, drive)
    return problem_of(simulation, step, drive)


@pytest.mark.parametrize("solver", ["auto", "nlgs", "anderson", "interior", "homotopy"])
def test_solver(benchmark, problem: OneStepProblem, solver: str) -> None:
    tolerance = 1e-8 if solver in ("auto", "interior", "homotopy") else 1e-4
    solution = benchmark(solve, problem, solver=solver, tolerance=tolerance, time_limit=10.0, keep_unconverged=True)
    benchmark.extra_info |= {
        "contacts": problem.contact_count,
        "converged": solution.converged,
        "tolerance": tolerance,
        "sweeps": solution.sweeps,
        "factorisations": solution.factorisations,
        "natural_map_q": solution.errors.natural_map_q,
        "natural_map_scaled": solution.errors.natural_map_scaled,
    }


def test_sweep_on_stored_blocks(benchmark, problem: OneStepProblem) -> None:
    b = scaled_blocks(problem)
    x = np.zeros_like(b.q)
    benchmark(sweep, b.pointer, b.column, b.value, b.place, b.q, b.mu, x, False)
    benchmark.extra_info["bytes per contact"] = round((b.value.nbytes + b.column.nbytes) / len(b.mu))
    if benchmark.stats is not None:
        benchmark.extra_info["million contact-iterations per second"] = round(
            len(b.mu) / benchmark.stats["median"] / 1e6, 2
        )


def test_factorisation(benchmark, problem: OneStepProblem) -> None:
    b = scaled_blocks(problem)
    value = b.value.copy()
    value[b.place] += 0.1 * np.eye(3)
    system = BlockSystem(b)
    benchmark(system.factorise, value)


@pytest.mark.parametrize("name", [name for name in NAMES if not name.startswith(HARD)])
def test_file(benchmark, name: str) -> None:
    given = read_fclib(FILES / f"{name}.hdf5")
    solution = benchmark.pedantic(solve, (given,), rounds=3, warmup_rounds=1)
    benchmark.extra_info |= {
        "contacts": given.contact_count,
        "sweeps": solution.sweeps,
        "factorisations": solution.factorisations,
        "natural_map_q": solution.errors.natural_map_q,
    }


@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith(HARD)])
def test_hard_file(benchmark, name: str) -> None:
    """What 60 processor seconds reach."""
    given = read_fclib(FILES / f"{name}.hdf5")
    solution = benchmark.pedantic(solve, (given,), {"keep_unconverged": True}, rounds=1)
    benchmark.extra_info |= {
        "converged": solution.converged,
        "factorisations": solution.factorisations,
        "natural_map_q": solution.errors.natural_map_q,
        "natural_map_scaled": solution.errors.natural_map_scaled,
        "seconds": solution.seconds,
    }
