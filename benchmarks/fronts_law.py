"""What comes with the package about steps of laws: errors and costs by method -> src/fenchel/fronts/law.json.

python benchmarks/fronts_law.py FIRST LAST OUT.json

The library and seeds FIRST ... LAST of tests/random_laws.py. Of each method (closed, reduced, principal, general) the error of a setting
is the largest over the laws but one in a hundred, its cost the median over the laws of its time over that of the method itself in double
precision.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from statistics import median

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from random_laws import random_law

from fenchel.errors import FenchelError
from fenchel.front import Front, Measured, environment, quantile
from fenchel.potentials.library import ENTRIES
from fenchel.tradeoff.law_step import MEASURE, load_of, measure_step

POINTS = 300
TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
SHARE = 0.99


def cases(first: int, last: int):
    """(name, law, values, dt, temperature)."""
    for name, entry in ENTRIES.items():
        yield name, entry.law, dict(entry.values), entry.worked.dt, 300.0
    for seed in range(first, last):
        drawn = random_law(np.random.default_rng(seed))
        yield f"random {seed}", drawn.law, drawn.values, drawn.dt, next(iter(drawn.heat.values()), 300.0)


def settings(solver: str):
    general = [{"solver": "general"}, *({"solver": "general", "tolerance": t} for t in TOLERANCES)]
    if solver == "general":
        return general
    return [{"solver": solver}, {"solver": solver, "precision": "float32"}, general[0]]


def main(first: int, last: int, out: Path) -> None:
    found: dict[str, dict[str, list]] = {}
    for name, law, values, dt, temperature in cases(first, last):
        try:
            solver = law.compile().solver
            load = load_of(law, values, points=POINTS, dt=dt, temperature=temperature)
            front = measure_step(law, values, load=load, settings=settings(solver))
        except FenchelError as problem:
            print(name, "refused:", problem, flush=True)
            continue
        base = front.points[0].cost
        for point in front.points:
            entry = found.setdefault(solver, {}).setdefault(json.dumps(point.setting), [])
            entry.append((point.cost / base if point.error is not None else None, point.error, name))
        print(
            name, solver, " ".join(f"{p.error:.0e}" if p.error is not None else "-" for p in front.points), flush=True
        )
    # what the engine errs by, where a compiled method tells: its own answer is no judge of itself
    exact = json.dumps({"solver": "general"})
    told = [
        e for solver, table in found.items() if solver != "general" for _, e, _ in table.get(exact, ()) if e is not None
    ]
    floor = max(told, default=0.0)
    methods = {}
    for solver, table in found.items():
        points = []
        for setting, entries in table.items():
            errors = [e for _, e, _ in entries if e is not None]
            costs = [c for c, e, _ in entries if e is not None]
            if len(errors) < len(entries) * SHARE:
                continue
            if solver == "general":
                errors = [max(e, floor) for e in errors]
            figures = {"laws": float(len(errors)), "largest": max(errors), "median": median(errors)}
            points.append(
                Measured(
                    setting=json.loads(setting), cost=median(costs), error=quantile(errors, SHARE), figures=figures
                )
            )
        methods[solver] = Front(
            kind="law",
            subject=f"method '{solver}'",
            measure=MEASURE,
            cost=f"times the time of '{solver}'",
            points=tuple(points),
            environment=environment(),
            note=f"library and random laws, {POINTS} points each; error: {SHARE:.0%} of the laws have less",
        ).as_dict()
    out.write_text(json.dumps({"methods": methods}, indent=1) + "\n")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
