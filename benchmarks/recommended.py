"""Does what is recommended hold on cases that nobody has seen? Shares that meet the accuracy, and the cost over the best setting's.

python benchmarks/recommended.py law FIRST LAST | contact FIRST LAST | contact FRONTS.json | scene FRONTS.json

Laws: seeds of tests/random_laws.py with states that a step has reached; contact problems: seeds of tests/random_contacts.py; scenes: a
file that `fronts_scene.py` wrote for seeds that are not shipped. Costs are times measured side by side, of contact problems with every
solver given at most a second.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))


def told(accuracy, cases, met, ratios, note=""):
    """One line of the table."""
    r = np.array(ratios or [np.nan])
    print(
        f"accuracy {accuracy:g}: met in {met} of {cases} ({met / max(cases, 1):.1%}); cost over the best: mean {r.mean():.2f}, "
        f"median {np.median(r):.2f}, {np.mean(r <= 1.5):.0%} within 1.5 {note}",
        flush=True,
    )


def laws(first, last, points=100):
    """Every law with its own random states; the best of all settings that meet the accuracy is the yardstick."""
    from random_laws import random_law

    from fenchel.errors import FenchelError
    from fenchel.tradeoff.law_step import load_of, measure_step

    wanted = (1e-3, 1e-6, 1e-8)
    cases, met, ratios, refused = dict.fromkeys(wanted, 0), dict.fromkeys(wanted, 0), {a: [] for a in wanted}, 0
    for seed in range(first, last):
        if seed > first and (seed - first) % 40 == 0:
            print(f"after {seed - first}:", {a: f"{met[a]} of {cases[a]}" for a in wanted}, flush=True)
        drawn = random_law(np.random.default_rng(seed))
        try:
            solver = drawn.law.compile().solver
            tries = [{"solver": "general"}, *({"solver": "general", "tolerance": t} for t in (1e-4, 1e-8))]
            if solver != "general":
                tries = [{"solver": solver}, {"solver": solver, "precision": "float32"}, tries[0]]
            load = load_of(drawn.law, drawn.values, points=points, seed=seed, dt=drawn.dt, temperature=320.0)
            front = measure_step(drawn.law, drawn.values, load=load, settings=tries)
        except FenchelError as problem:
            refused += 1
            print(seed, "refused:", str(problem)[:120], flush=True)
            continue
        for accuracy in wanted:
            update = drawn.law.compile(accuracy=accuracy)
            cases[accuracy] += 1
            try:
                out = update(load.eps, load.state, load.dt, **load.values)
            except FenchelError as problem:
                print(seed, f"accuracy {accuracy:g} not met:", str(problem)[:160], flush=True)
                continue
            setting = dict(update.choice.setting)
            point = next(p for p in front.points if dict(p.setting) == setting)
            good = [p for p in front.points if p.error is not None and p.error <= accuracy]
            bound = update.verify(out, load.state, load.dt, points=points, **load.values)
            met[accuracy] += bool(bound.confirms(accuracy))
            if not bound.confirms(accuracy):
                print(
                    seed, f"accuracy {accuracy:g} not met by {update.solver}: {bound.difference.max():.1e}", flush=True
                )
            if point.error is not None and point.error <= accuracy:
                ratios[accuracy].append(point.cost / min(p.cost for p in good))
    for accuracy in wanted:
        told(accuracy, cases[accuracy], met[accuracy], ratios[accuracy], f"({refused} refused)")


def contacts(first, last, limit=1.0):
    """`solve(problem, accuracy=...)` against the fastest of all solvers."""
    from random_contacts import problem

    from fenchel.dem.one_step import SOLVERS, measure, solve

    names = [name for name in SOLVERS if name not in ("measured", "cone_program", "interior_selective")]
    wanted = (1e-3, 1e-6, 1e-9)
    cases, met, ratios, totals = (
        dict.fromkeys(wanted, 0),
        dict.fromkeys(wanted, 0),
        {a: [] for a in wanted},
        {a: [0.0, 0.0] for a in wanted},
    )
    solve(problem(1)[1], accuracy=1e-3)
    for seed in range(first, last):
        if seed > first and (seed - first) % 40 == 0:
            print(f"after {seed - first}:", {a: f"{met[a]} of {cases[a]}" for a in wanted}, flush=True)
        _, given = problem(seed)
        if not np.any(given.q[0::3] < 0.0):
            continue
        for accuracy in wanted:
            runs = [solve(given, solver=n, tolerance=accuracy, time_limit=limit, keep_unconverged=True) for n in names]
            good = [run.seconds for run in runs if run.converged]
            if not good:
                continue
            own = solve(given, accuracy=accuracy, keep_unconverged=True)
            cases[accuracy] += 1
            if measure(given, own.r).worst <= accuracy:
                met[accuracy] += 1
                ratios[accuracy].append(own.seconds / min(good))
                totals[accuracy][0] += own.seconds
                totals[accuracy][1] += min(good)
    for accuracy in wanted:
        told(
            accuracy,
            cases[accuracy],
            met[accuracy],
            ratios[accuracy],
            f"; of all time {totals[accuracy][0] / totals[accuracy][1]:.2f}",
        )


def contacts_of(file):
    """The solver chosen for each problem of a file that `fronts_contact.py` wrote; where it does not come to its end, `auto` behind it."""
    from fenchel.dem.one_step.choice import choose_solver

    fronts = json.loads(Path(file).read_text())
    for accuracy in (1e-3, 1e-6, 1e-9):
        k = fronts["tolerances"].index(accuracy)
        cases, met, ratios, spent, least = 0, 0, [], 0.0, 0.0
        for row in fronts["rows"]:
            seconds = {s: t[k] for s, t in row["seconds"].items()}
            good = [t for t in seconds.values() if t is not None]
            if not good:
                continue
            cases += 1
            own = seconds[choose_solver(row["features"], accuracy).solver]
            if own is None and seconds["auto"] is not None:
                own = fronts["limit"] + seconds["auto"]
            if own is not None:
                met += 1
                ratios.append(own / min(good))
                spent, least = spent + own, least + min(good)
        told(accuracy, cases, met, ratios, f"; of all time {spent / least:.2f}")


def scenes(file):
    """The setting predicted for each scene of a file of fronts."""
    from fenchel.dem.accuracy import RARE, fit_model, predicted
    from fenchel.front import shipped_front

    shipped = shipped_front("scene")
    model, fronts = fit_model(shipped), json.loads(Path(file).read_text())
    for accuracy in (1e-1, 3e-2, 1e-2, 3e-3):
        met, ratios, able, refused = 0, [], 0, 0
        for row in fronts["scenes"]:
            setting, _, _, share, _ = predicted(shipped, model, row["features"], accuracy)
            good = [k for k, e in enumerate(row["errors"]) if e is not None and e <= accuracy]
            if share < RARE:
                refused += 1
                continue
            if not good:
                continue
            able += 1
            k = fronts["settings"].index(setting)
            if row["errors"][k] is not None and row["errors"][k] <= accuracy:
                met += 1
                ratios.append(row["seconds"][k] / min(row["seconds"][j] for j in good))
        told(
            accuracy,
            able,
            met,
            ratios,
            f"(of {len(fronts['scenes'])} scenes, {refused} refused; the rest can have it by no setting)",
        )


if __name__ == "__main__":
    start = time.time()
    if sys.argv[1] == "scene":
        scenes(sys.argv[2])
    elif len(sys.argv) == 3:
        contacts_of(sys.argv[2])
    else:
        {"law": laws, "contact": contacts}[sys.argv[1]](int(sys.argv[2]), int(sys.argv[3]))
    print(f"{time.time() - start:.0f} s")
