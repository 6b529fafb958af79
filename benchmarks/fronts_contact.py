"""The measured times that come with the package: every solver on random contact problems -> src/fenchel/fronts/contact.json.

python benchmarks/fronts_contact.py FIRST LAST OUT.json [LIMIT]

Seeds FIRST ... LAST of tests/random_contacts.py. A solver runs once, to 1e-10 or LIMIT seconds of the processor, and what it had reached
when is written down; `auto` chooses by the tolerance and runs once for each. Times are ratios to the time of a probe of 30 sweeps measured
beside them, so that the processor matters less.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from random_contacts import problem

from fenchel.dem.one_step import solve as solve_function
from fenchel.dem.one_step.choice import TOLERANCES, features
from fenchel.front import environment

AUTO = (1e-3, 1e-6, 1e-9)
SINGLE = ("nlgs", "anderson", "newton", "interior", "homotopy", "admm")


def traced(given, solver: str, tolerance: float, limit: float):
    """[(seconds, error)] of a run, each error less than the ones before."""
    module = sys.modules["fenchel.dem.one_step.solve"]
    plain, trace = module.Monitor, []
    began = time.thread_time()

    class Tracing(plain):
        def __call__(self, x):
            before = self.error
            stop = super().__call__(x)
            if self.error < before:
                trace.append((time.thread_time() - began, self.error))
            return stop

    module.Monitor = Tracing
    try:
        began = time.thread_time()
        found = solve_function(given, solver=solver, tolerance=tolerance, time_limit=limit, keep_unconverged=True)
    finally:
        module.Monitor = plain
    if found.converged:
        trace.append((found.seconds, found.errors.worst))
    return trace


def reached(trace, tolerance):
    """Seconds until the error was at most `tolerance`; None: never."""
    return next((seconds for seconds, error in trace if error <= tolerance), None)


def rounded(thing):
    """Three digits: more would be noise."""
    if isinstance(thing, dict):
        return {k: rounded(v) for k, v in thing.items()}
    if isinstance(thing, list):
        return [rounded(v) for v in thing]
    return float(f"{thing:.3g}") if isinstance(thing, float) else thing


def main(first: int, last: int, out: Path, limit: float) -> None:
    rows = []
    sys.modules["fenchel.dem.one_step.solve"]._warm_up()
    for solver in (*SINGLE, "auto"):
        solve_function(problem(1)[1], solver=solver, time_limit=60.0)
    features(problem(1)[1])
    for seed in range(first, last):
        what, given = problem(seed)
        if not np.any(given.q[0::3] < 0.0):
            continue
        row = {"seed": seed, "features": features(given), "seconds": {}}
        for solver in SINGLE:
            trace = traced(given, solver, 1e-10, limit)
            row["seconds"][solver] = [reached(trace, t) for t in TOLERANCES]
        row["seconds"]["auto"] = []
        for t in TOLERANCES:  # it chooses by the tolerance: one run for each, but not for all
            row["seconds"]["auto"].append(reached(traced(given, "auto", t, 2 * limit), t) if t in AUTO else None)
        rows.append(row)
        print(seed, what, flush=True)
        out.write_text(
            json.dumps({"limit": limit, "tolerances": TOLERANCES, "environment": environment(), "rows": rows})
        )


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]), float(sys.argv[4]) if len(sys.argv) > 4 else 2.0)
