"""Cost models: exponents of time and memory against points, contacts, grains, beads and threads, and what they foretell.

python benchmarks/cost_models.py measure OUT.json     every kind at its sizes, each in a process of its own
python benchmarks/cost_models.py large OUT.json       the largest runs, beside what the models foretold
python benchmarks/cost_models.py one KIND SIZE THREADS

Time is the least of some repeats, of the processor (of the wall for several threads); memory is the peak of the process less what it had
before the arrays were made. A model is  log y = a + b log n  by least squares over the sizes, with the 95 % interval of b from Student's
t; what it foretells has the interval of a new observation.
"""

from __future__ import annotations

import json
import math
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

SIZES = {
    "step": [10_000, 30_000, 100_000, 300_000, 1_000_000],  # points of a closed step with tangent
    "general": [300, 1000, 3000, 10_000],  # points of the general engine with tangent
    "sweep": [200, 700, 2000, 7000, 20_000],  # contacts, ten sweeps over the stored W of a one-step problem
    "factor": [100, 300, 700, 1500, 3000],  # contacts, one step of the interior point method
    "grains": [1000, 3000, 10_000, 30_000, 100_000],  # a time step of twenty sweeps, detection apart
    "detection": [1000, 3000, 10_000, 30_000, 100_000],  # a list of neighbours
    "sweeps_needed": [100, 300, 1000],  # sweeps of compliant grains from rest to 1e-6, a count
    "beads": [1000, 3000, 10_000, 30_000, 100_000],  # a time step of twenty sweeps of a hung wire
    "beads_needed": [30, 100, 300, 1000],  # sweeps of a hung elastic wire to 1e-6, a count
}
UNIT = {"sweeps_needed": "sweeps", "beads_needed": "sweeps"}
LARGE = {"step": 10_000_000, "grains": 1_000_000}
FORETOLD = {
    "step": [1_000_000, 10_000_000],
    "general": [1_000_000, 10_000_000],
    "grains": [1_000_000],
    "detection": [1_000_000],
    "sweep": [6_000_000],
    "factor": [20_000],
}
G, H = 9.81, 1e-4


def least(run, repeats=5, seconds=4.0, threads=1):
    """The least time of some calls: of the processor, of the wall where several threads work."""
    clock = time.process_time if threads == 1 else time.perf_counter
    best, begin = math.inf, time.perf_counter()
    for _ in range(repeats):
        start = clock()
        run()
        best = min(best, clock() - start)
        if time.perf_counter() - begin > seconds:
            break
    return best


def peak():
    """Peak of the process so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def step(n, threads, solver="auto", warm=1000):
    from fenchel.potentials.library import ENTRIES

    entry = ENTRIES["drucker_prager"]
    update = entry.law.compile(solver=solver, threads=threads)
    rng = np.random.default_rng(1)
    update(np.zeros((warm, 6)), None, **entry.values)
    before = peak()
    eps = 4e-3 * rng.standard_normal((n, 6))
    found = least(lambda: update(eps, None, **entry.values), repeats=3 if n > 5e5 else 7, threads=threads)
    return found, peak() - before


def general(n, threads):
    return step(n, threads, "general", 300)


def packed(n):
    """Touching spheres on a face-centred lattice, disturbed by a thousandth: about six contacts a grain."""
    rng = np.random.default_rng(2)
    side = math.ceil((n / 4) ** (1 / 3))
    cell = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    x = (cell + np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])).reshape(-1, 3)
    x = x[np.lexsort(x.T)][:n] * math.sqrt(2.0) * 2e-3 * 0.9995  # neighbours 2 mm apart, layer by layer
    x[:, 2] += 1e-3
    return x + 1e-7 * rng.standard_normal(x.shape), np.full(n, 1e-3)


def pile(n, threads, *, compliant=False, sweeps=20, tolerance=1e-30):
    from fenchel.dem import Assembly, Laws, Plane, Simulation, Solver
    from fenchel.dem.laws import CompliantSignoriniCoulomb, SignoriniCoulomb

    x, r = packed(n)
    law = SignoriniCoulomb(friction=0.5)
    if compliant:
        law = CompliantSignoriniCoulomb(friction=0.5, k_n=1e5, k_t=8e4)
    solver = Solver(tolerance=tolerance, sweep_limit=sweeps, keep_unconverged=True)
    floor = Plane(normal=(0, 0, 1), point=(0, 0, 0), friction=0.5)
    assembly = Assembly.of_spheres(x, r, 2600.0 * 4.0 / 3.0 * np.pi * r**3)
    return Simulation(assembly, Laws(contact=law), solver, planes=[floor], threads=threads)


def down():
    from fenchel.dem import Drive

    return Drive(gravity=np.array([0.0, 0.0, -G]))


def grains(n, threads):
    pile(200, threads).advance(H, down())
    before = peak()
    simulation = pile(n, threads)
    simulation.advance(H, down())
    return least(lambda: simulation.advance(H, down()), repeats=5, seconds=20.0, threads=threads), peak() - before


def detection(n, threads):
    from fenchel.dem.detection import find_pairs

    def pairs(x, r):
        return find_pairs(x, r, np.full(len(r), -1), np.zeros(len(r), dtype=np.int64), 1, 1.5e-4)

    pairs(*packed(200))
    before = peak()
    x, r = packed(n)
    return least(lambda: pairs(x, r)), peak() - before


def sweeps_needed(n, threads):
    simulation = pile(n, threads, compliant=True, sweeps=100_000, tolerance=1e-6)
    simulation.advance(H, down())
    return float(simulation.sweeps), 0


def hung(n, limit, tolerance):
    from fenchel.dem import Assembly, Laws, Simulation, Solver, chain
    from fenchel.dem.laws import ElasticWire

    x, wire, rank = chain(np.zeros(3), np.array([0.0, 0.0, -1.0]), n, 1e-2)
    mass = np.full(n, 1e-4)
    mass[0] = np.inf
    assembly = Assembly.of_spheres(x, np.full(n, 4e-3), mass, wire=wire, rank=rank)
    solver = Solver(tolerance=tolerance, sweep_limit=limit, keep_unconverged=True)
    return Simulation(assembly, Laws(wire=ElasticWire(stiffness=100.0)), solver)


def beads(n, threads):
    hung(100, 20, 1e-30).advance(H, down())
    before = peak()
    simulation = hung(n, 20, 1e-30)
    simulation.advance(H, down())
    return least(lambda: simulation.advance(H, down()), seconds=10.0), peak() - before


def beads_needed(n, threads):
    simulation = hung(n, 1_000_000, 1e-6)
    simulation.advance(1e-2, down())
    return float(simulation.sweeps), 0


def problem(contacts):
    from fenchel.dem.one_step.scenes import problem_of

    simulation = pile(max(8, contacts // 6), 1, sweeps=5)
    simulation.advance(H, down())
    return problem_of(simulation, H, down())


def sweep(n, threads):
    from fenchel.dem.one_step.blocks import scaled_blocks
    from fenchel.dem.one_step.sweeps import sweep as once

    def ten(b, x):
        for _ in range(10):
            once(b.pointer, b.column, b.value, b.place, b.q, b.mu, x, False)

    small = scaled_blocks(problem(60))
    ten(small, np.zeros_like(small.q))
    before = peak()
    blocks = scaled_blocks(problem(n))
    return least(lambda: ten(blocks, np.zeros_like(blocks.q))), peak() - before, len(blocks.mu)


def factor(n, threads):
    from fenchel.dem.one_step import solve

    solve(problem(60), solver="interior", tolerance=1e-3, keep_unconverged=True)
    before = peak()
    given = problem(n)
    found = solve(given, solver="interior", tolerance=1e-3, time_limit=60.0, keep_unconverged=True)
    return found.seconds / max(found.factorisations, 1), peak() - before, given.contact_count


KINDS = {f.__name__: f for f in (step, general, sweep, factor, grains, detection, sweeps_needed, beads, beads_needed)}


def one(kind, size, threads):
    """One measurement in this process."""
    value, memory, *true = KINDS[kind](size, threads)
    return {"kind": kind, "size": true[0] if true else size, "threads": threads, "value": value, "memory": memory}


def child(kind, size, threads):
    """The same in a process of its own."""
    command = [sys.executable, __file__, "one", kind, str(size), str(threads)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(
            f"{kind} {size}: {done.stderr.strip().splitlines()[-1] if done.stderr.strip() else 'killed'}"
        )
    found = json.loads(done.stdout.splitlines()[-1])
    print(found, flush=True)
    return found


def fitted(sizes, values):
    """log y = a + b log n: (a, b, half-width of the 95 % interval of b, what a new observation needs)."""
    from scipy.stats import linregress, t

    x, y = np.log(np.asarray(sizes, dtype=float)), np.log(np.asarray(values, dtype=float))
    line, total = linregress(x, y), float(np.sum((x - x.mean()) ** 2))
    quantile = float(t.ppf(0.975, len(x) - 2))
    return {
        "a": float(line.intercept), "b": float(line.slope), "half": quantile * float(line.stderr), "mean": float(x.mean()),
        "sum": total, "n": len(x), "spread": float(line.stderr) * math.sqrt(total), "t": quantile,
    }  # fmt: skip


def foretold(model, size):
    """(value, factor of its 95 % interval) of a new observation at a size."""
    x = math.log(size)
    error = model["spread"] * math.sqrt(1.0 + 1.0 / model["n"] + (x - model["mean"]) ** 2 / model["sum"])
    return math.exp(model["a"] + model["b"] * x), math.exp(model["t"] * error)


def models(rows):
    """Models of time (or counts) and of memory, by kind; of memory only above ten MiB, below which it is the allocator's."""
    found = {}
    for kind in dict.fromkeys(row["kind"] for row in rows):
        own = [row for row in rows if row["kind"] == kind and row["threads"] == 1]
        found[kind] = {
            "value": fitted([r["size"] for r in own], [r["value"] for r in own]),
            "unit": UNIT.get(kind, "s"),
        }
        heavy = [r for r in own if r["memory"] > 10 * 2**20]
        if len(heavy) > 2:
            found[kind]["memory"] = fitted([r["size"] for r in heavy], [r["memory"] for r in heavy])
    return found


def measure(out):
    from fenchel.front import environment

    rows = [child(kind, size, 1) for kind, sizes in SIZES.items() for size in sizes]
    for kind, size in (("step", 1_000_000), ("general", 10_000), ("grains", 30_000)):
        rows += [child(kind, size, threads) for threads in (1, 2)]
    found = models(rows)
    told = [
        {"kind": kind, "size": size, "value": foretold(found[kind]["value"], size)[0], "factor": foretold(found[kind]["value"], size)[1],
         "memory": foretold(found[kind]["memory"], size)[0] if "memory" in found[kind] else None}
        for kind, sizes in FORETOLD.items() for size in sizes
    ]  # fmt: skip
    out.write_text(
        json.dumps({"environment": environment(), "rows": rows, "models": found, "foretold": told}, indent=1) + "\n"
    )


def large(out):
    content = json.loads(out.read_text())
    content["large"] = [child(kind, size, 1) for kind, size in LARGE.items()]
    out.write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    if sys.argv[1] == "one":
        print(json.dumps(one(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))))
    else:
        {"measure": measure, "large": large}[sys.argv[1]](Path(sys.argv[2]))
