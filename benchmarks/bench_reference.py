"""The generated step of Drucker–Prager with combined hardening beside a copy of its arrays, a kernel written by hand and the cvxpy loop.

NUMBA_NUM_THREADS=1 python benchmarks/bench_reference.py

1e5 points, about half of them plastic and none at the apex, stress + state + tangent, one thread; ratios of one run. Then two threads, by
the wall clock, beside a copy in two threads.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from bench_step import COUNT, copied, seconds
from handwritten import drucker_prager_by_hand

from fenchel.integrators.compiled_step import packed_values
from fenchel.potentials.library import ENTRIES, sand

ROUNDS = 9


def states(update, values):
    """Strains with about half of the points plastic, none at the apex: mostly deviatoric."""
    rng = np.random.default_rng(0)
    eps = rng.normal(size=(COUNT, 6))
    eps[:, :3] -= eps[:, :3].mean(axis=1, keepdims=True) + 0.3
    low, high = 1e-9, 1e-1
    for _ in range(40):
        scale = float(np.sqrt(low * high))
        share = (update(scale * eps[:4000], None, **values).dissipation > 0).mean()
        low, high = (scale, high) if share < 0.5 else (low, scale)
    return scale * eps


def wall(run):
    """Median of the wall clock."""
    found = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        run()
        found.append(time.perf_counter() - start)
    return float(np.median(found))


def cvxpy_loop(eps, K, G, t, C_0, H_k, H_i):
    """Seconds of processor time per point of the same step as a cvxpy problem with the strain as a parameter, declared once."""
    import cvxpy as cp

    third = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]) / 3.0
    dev = np.eye(6) - 3.0 * np.outer(third, third)
    strain, flow, p = cp.Parameter(6), cp.Variable(6), cp.Variable()
    elastic = strain - flow
    energy = K / 2 * cp.square(3 * third @ elastic) + G * cp.sum_squares(dev @ elastic)
    energy += H_k / 2 * cp.sum_squares(flow) + H_i / 2 * cp.square(p) + C_0 * p
    conditions = [3 * third @ flow == t * p, cp.SOC(p, np.sqrt(2) * (dev @ flow))]
    problem = cp.Problem(cp.Minimize(energy / C_0), conditions)
    strain.value = eps[0]
    problem.solve(solver=cp.CLARABEL)
    start = time.process_time()
    for row in eps:
        strain.value = row
        problem.solve(solver=cp.CLARABEL)
    return (time.process_time() - start) / len(eps)


def main() -> None:
    """Print the ratios."""
    update, values = sand.compile(), dict(ENTRIES["sand"].values)
    eps, old = states(update, values), update.pack(None, COUNT)
    rows = update.pointers.coefficients(packed_values(update, values), 1.0, np.ones(1))
    E, nu = values["E_s"], values["nu_s"]
    numbers = (
        E / (3 - 6 * nu),
        E / (2 + 2 * nu),
        np.tan(values["theta_f"]),
        values["C_0"],
        values["H_k"],
        values["H_i"],
    )
    arrays = (
        np.empty_like(old),
        np.empty((COUNT, 6)),
        np.empty((COUNT, 36)),
        np.empty(COUNT),
        np.empty(COUNT, dtype=np.int64),
    )
    hand = [a.copy() for a in arrays]
    new, stress, tangent, loss, status = arrays
    drucker_prager_by_hand(eps, old, *hand, *numbers)
    update.pointers.run(eps, old, new, stress, tangent, True, loss, status, rows)
    worst = max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in zip(hand[:4], arrays[:4], strict=True))
    print(f"plastic {(loss > 0).mean():.2f}; generated and hand-written differ by {worst:.1e} of the largest entry")
    runs = {
        "copy": copied(eps, old),
        "generated": lambda: update.pointers.run(eps, old, new, stress, tangent, True, loss, status, rows),
        "by hand": lambda: drucker_prager_by_hand(eps, old, *hand, *numbers),
        "call": lambda: update(eps, None, **values),
    }
    found = {name: [] for name in runs}
    for _ in range(3):  # in turns, so that a slow moment of the machine meets all
        for name, run in runs.items():
            found[name].append(seconds(run))
    best = {name: min(times) for name, times in found.items()}
    for name, value in best.items():
        print(f"{name:10s} {COUNT / value / 1e6:6.2f} M/s  {value / best['copy']:5.2f} times the copy")
    loop = cvxpy_loop(eps[:200], *numbers)
    print(f"cvxpy loop {1 / loop:6.0f} /s  generated is {loop / (best['generated'] / COUNT):.0f} times as fast")
    two = sand.compile(threads=2)
    half = COUNT // 2
    left, right = copied(eps[:half], old[:half]), copied(eps[half:], old[half:])
    with ThreadPoolExecutor(1) as pool:

        def shared_copy():
            waiting = pool.submit(right)
            left()
            waiting.result()

        copies = wall(runs["copy"]) / wall(shared_copy)

    def once(found):
        found.run(eps, old, rows, True)

    steps = wall(lambda: once(update)) / wall(lambda: once(two))
    print(
        f"two threads: copy {copies:.2f}, step {steps:.2f} times one thread: the step scales {steps / copies:.2f} times as well"
    )


if __name__ == "__main__":
    main()
