"""Dense packings under gravity: CPU seconds per simulated second with the overlaps and the residual that were reached, rates, threads.

The start states stand beside the checkout; without them these skip. All times are CPU times of this process, since
others may share the machine; the speed-up of two threads is that of the busier thread.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # a thread that waits must not count as one that works

import numpy as np
import pytest

from fenchel.dem import Assembly, Drive, Laws, Plane, Simulation, Solver
from fenchel.dem.detection import find_pairs, spatial_order
from fenchel.dem.laws import SignoriniCoulomb

PACKING = Path(__file__).parents[2] / "shared" / "packings" / "dense10k.npz"
needs_packing = pytest.mark.skipif(
    not PACKING.exists(), reason="needs the start states of the packing comparison beside the checkout"
)
DIAMETER, STEP, G, FRICTION = 1e-2, 1e-3, 9.81, 0.5
DOWN = Drive(gravity=np.array([0.0, 0.0, -G]))
# thirty sweeps and a tenth of an overlap recovered per step: see the table of the first benchmark for what this reaches
SWEEPS, RECOVERY, SKIN = 30, 0.1, 1.5e-3


def packing(tiles: tuple[int, int] = (1, 1), threads: int = 1) -> Simulation:
    """The packing of ten thousand in its open box, tiled along x and y; bodies in spatial order."""
    data = np.load(PACKING)
    side = float(data["L"])
    shift = side * np.array([(i, j, 0) for i in range(tiles[0]) for j in range(tiles[1])], dtype=float)
    x = (data["x"][None] + shift[:, None]).reshape(-1, 3)
    radius = np.tile(data["r"], len(shift))
    order = spatial_order(x, 1.2 * DIAMETER)
    x, radius = x[order], radius[order]
    high = side * np.array([*tiles, 1.0])
    walls = [
        ((0, 0, 1), (0, 0, 0)),
        ((1, 0, 0), (0, 0, 0)),
        ((-1, 0, 0), high),
        ((0, 1, 0), (0, 0, 0)),
        ((0, -1, 0), high),
    ]
    return Simulation(
        Assembly.of_spheres(x, radius, 2600.0 * 4.0 / 3.0 * np.pi * radius**3),
        Laws(contact=SignoriniCoulomb(friction=FRICTION, recovery=RECOVERY)),
        Solver(tolerance=1e-12, sweep_limit=SWEEPS, keep_unconverged=True),
        planes=[Plane(normal=n, point=tuple(map(float, p)), friction=FRICTION) for n, p in walls],
        skin=SKIN,
        threads=threads,
    )


def overlaps(simulation: Simulation) -> np.ndarray:
    """Of all overlapping pairs and walls, in diameters."""
    a = simulation.assembly
    pair = find_pairs(a.x, a.radius, a.wire, a.rank, 1, 0.0)
    inner = a.radius[pair[:, 0]] + a.radius[pair[:, 1]] - np.linalg.norm(a.x[pair[:, 0]] - a.x[pair[:, 1]], axis=1)
    walls = [a.radius + plane.place - a.x @ plane.direction for plane in simulation.planes]
    every = np.concatenate([inner, *walls])
    return every[every > 0.0] / DIAMETER


def sweeping(simulation: Simulation, sweeps: int) -> float:
    """Million contact-iterations per CPU second of the next step's problem."""
    c = simulation.problem(STEP, DOWN)
    rows = c["contacts"]
    start = time.process_time()
    simulation.sweep(c, tolerance=0.0, sweep_limit=sweeps)
    return (len(rows.pair) + len(rows.touching)) * sweeps / (time.process_time() - start) / 1e6


@needs_packing
def test_a_tenth_of_a_second_of_ten_thousand_grains(benchmark) -> None:
    simulation = packing()
    simulation.advance(STEP, DOWN)
    residual: list[float] = []
    measures: dict[str, float] = {}

    def run() -> None:
        nonlocal measures
        for _ in range(99):
            measures = simulation.advance(STEP, DOWN)
            residual.append(measures["natural_map"])

    start = time.process_time()
    benchmark.pedantic(run, rounds=1)
    seconds = (time.process_time() - start) / (99 * STEP)
    overlap = overlaps(simulation)
    a = simulation.assembly
    kinetic = measures["kinetic"] / len(a.mass) / (a.mass.mean() * G * 0.5 * DIAMETER)
    benchmark.extra_info |= {
        "CPU seconds per simulated second": round(seconds, 1),
        "mean overlap / diameter": float(f"{overlap.mean():.2g}"),
        "largest overlap / diameter": float(f"{overlap.max():.2g}"),
        "kinetic energy of a grain / m g R": float(f"{kinetic:.2g}"),
        "natural map, median and largest": [float(f"{np.median(residual):.2g}"), float(f"{max(residual):.2g}")],
        "bytes per contact": simulation.kernels.bytes_per_contact(),
    }
    assert overlap.mean() <= 1e-4 and overlap.max() <= 3e-3 and kinetic <= 3e-3
    assert all(size < 400 for size in simulation.kernels.bytes_per_contact().values())


@needs_packing
def test_rate_at_ten_and_at_a_hundred_thousand(benchmark) -> None:
    small, large = packing(), packing((2, 5))
    for simulation in (small, large):
        for _ in range(10):
            simulation.advance(STEP, DOWN)
    rates: list[tuple[float, float]] = []
    benchmark.pedantic(lambda: rates.append((sweeping(small, 100), sweeping(large, 10))), rounds=7)
    ten, hundred = np.median(np.array(rates), axis=0)
    benchmark.extra_info |= {
        "million contact-iterations per CPU second at 10k": round(float(ten), 1),
        "the same at 100k": round(float(hundred), 1),
        "cost at 100k / cost at 10k": round(float(np.median([a / b for a, b in rates])), 2),
    }


@needs_packing
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="needs two cores")
def test_two_threads_at_a_hundred_thousand(benchmark) -> None:
    one, two = packing((2, 5)), packing((2, 5), threads=2)
    for simulation in (one, two):
        for _ in range(10):
            simulation.advance(STEP, DOWN)
    ratios: list[float] = []

    def busiest(simulation: Simulation, sweeps: int = 10) -> float:
        c = simulation.problem(STEP, DOWN)
        before = _thread_seconds()
        simulation.sweep(c, tolerance=0.0, sweep_limit=sweeps)
        after = _thread_seconds()
        return max(after[thread] - before.get(thread, 0.0) for thread in after)

    benchmark.pedantic(lambda: ratios.append(busiest(one) / busiest(two)), rounds=7)
    benchmark.extra_info["speed-up of two threads, by the busier one"] = round(float(np.median(ratios)), 2)


def _thread_seconds() -> dict[str, float]:
    """CPU seconds of every thread of this process (Linux)."""
    out = {}
    for thread in Path("/proc/self/task").iterdir():
        out[thread.name] = int((thread / "schedstat").read_text().split()[0]) * 1e-9
    return out
