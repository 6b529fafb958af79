"""Contact problems of any origin, scale and rank, by every solver: a claim of convergence is held against maps written in plain Python.

Judged: answers finite, the natural maps recomputed from r alone within the tolerance of a claimed convergence, a claim that no solution
exists against a cone program that looks for reactions with open or resting contacts, and the time against the limit that was given.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from contact_families import boxes, natural_maps, spheres, wedge

from fenchel.dem.one_step import OneStepProblem, measure, solve
from fenchel.errors import ConvergenceError, FenchelError, Status

from .case import Failure, digest_of, foreseen

PLAIN = False
TIME_LIMIT = 2.0
ALLOWANCE = 3.0  # s; an iteration of a problem of this size, and what numba compiles for a shape that is new
# as they were when the first lines were kept: a solver that comes later would change what every seed means
NAMES = ("auto", "nlgs", "anderson", "admm", "interior", "interior_selective", "newton", "homotopy", "cone_program")
KINDS = ("spheres", "boxes", "wedge", "squeezed", "dense", "dense", "skew", "local", "still", "none")


def random_problem(rng: np.random.Generator) -> tuple[str, np.ndarray, np.ndarray, np.ndarray]:
    """(kind, W (3n, 3n), q (3n,), μ (n,)) of a random problem of at most some forty contacts."""
    kind = str(rng.choice(KINDS))
    mu = float(rng.choice([0.0, 0.1, 0.5, 1.0, 10.0, 100.0, rng.uniform(0.0, 1.5)]))
    if kind in ("spheres", "boxes", "wedge", "squeezed"):
        ratio = float(10.0 ** rng.uniform(-8, 8)) if rng.random() < 0.4 else 1.0
        if kind == "spheres":
            side, seed = int(rng.integers(1, 4)), int(rng.integers(1 << 30))
            family = spheres(seed, side, mu=mu, mass_ratio=ratio, gravity=float(10.0 ** rng.uniform(-4, 1)))
        elif kind == "boxes":
            family = boxes(int(rng.integers(1, 8)), mu=mu, push=float(rng.normal()), mass_ratio=ratio)
        else:
            family = wedge(mu, float(10.0 ** rng.uniform(-6, 1)) if kind == "squeezed" else 0.0)
        problem = OneStepProblem.of_bodies(**family)
        W, q, friction = problem.delassus.toarray(), problem.q, problem.mu.copy()
    else:
        n = 0 if kind == "none" else int(rng.integers(1, 13))
        rank = int(rng.integers(1, 3 * n + 1)) if n else 0
        B = rng.normal(size=(3 * n, rank))
        if rng.random() < 0.3:
            B = B * 10.0 ** rng.uniform(-4, 4, (3 * n, 1))
        W, q, friction = B @ B.T, rng.normal(size=3 * n), np.full(n, mu)
        if kind == "dense" and rng.random() < 0.5 and n:
            q = B @ rng.normal(size=rank)  # in the range: then there are velocities that open every contact or none
        if kind == "skew" and n:
            S = rng.normal(size=W.shape)
            W = W + 10.0 ** rng.uniform(-10, -2) * np.abs(W).max() * (S - S.T)
        if kind == "local" and n:
            W = np.kron(np.eye(n), np.ones((3, 3))) * W + 1e-3 * np.eye(3 * n) * np.abs(W).max()
        if kind == "still":
            q = np.zeros(3 * n)
    if len(friction) and rng.random() < 0.3:
        friction = rng.choice([0.0, 0.2, 1.0, 30.0], len(friction))
    if rng.random() < 0.35:
        W, q = W * 10.0 ** rng.uniform(-12, 12), q * 10.0 ** rng.uniform(-12, 12)
    return kind, np.asarray(W), np.asarray(q), friction


def draw(seed: int) -> dict[str, Any]:
    """A problem, a solver, a tolerance and how it is called."""
    rng = np.random.default_rng([seed, 4])
    kind, W, q, mu = random_problem(rng)
    start = None
    if rng.random() < 0.2:
        start = rng.normal(size=len(q)) * 10.0 ** rng.uniform(-3, 3)
    return {
        "kind": kind, "W": W, "q": q, "mu": mu, "solver": str(rng.choice(NAMES)), "start": start,
        "tolerance": float(10.0 ** rng.uniform(-13, -3)), "keep": bool(rng.random() < 0.6),
    }  # fmt: skip


def digest(case: dict[str, Any]) -> str:
    """Of matrix, vector, friction and solver."""
    parts = [np.asarray(case[k], dtype=float).tobytes() for k in ("W", "q", "mu")]
    return digest_of(*parts, case["solver"])


def judge(case: dict[str, Any]) -> str:
    """See the module."""
    problem = OneStepProblem.local(case["W"], case["q"], case["mu"])
    try:
        found = solve(
            problem, solver=case["solver"], tolerance=case["tolerance"], time_limit=TIME_LIMIT, start=case["start"],
            keep_unconverged=case["keep"],
        )  # fmt: skip
    except ConvergenceError as error:
        return foreseen(error)
    except FenchelError as error:
        if case["solver"] == "cone_program" and not problem.symmetric:
            return foreseen(error)
        # the drawn problems are problems: an operator that is semidefinite up to rounding, finite numbers
        raise Failure(f"{type(error).__name__} for a valid problem: {error}") from None
    r, q = found.r, problem.q
    if not (np.isfinite(r).all() and np.isfinite(found.u).all()):
        raise Failure(f"{case['solver']} returned reactions that are not finite, status {found.status.name}")
    if found.seconds > TIME_LIMIT + ALLOWANCE:
        raise Failure(f"{case['solver']} took {found.seconds:.1f} s where {TIME_LIMIT:g} s were allowed")
    if found.errors != measure(problem, r):
        raise Failure("the errors of a solution are not those of its reactions")
    if found.converged:
        judged(case, r, q)
    elif found.status is Status.INFEASIBLE:
        refuted(case)
    return f"{found.status.name.lower()}"


def judged(case: dict[str, Any], r: np.ndarray, q: np.ndarray) -> None:
    """The natural maps of a claimed convergence, from the numbers alone."""
    W, mu = case["W"], case["mu"]
    if not len(mu):
        return
    if not q.any():
        # r = 0 is the solution; no relative map exists
        if r.any():
            raise Failure("q = 0 is answered by reactions that are not zero")
        return
    diagonal = np.diag(W)[0::3]
    # both maps are differences of numbers of this size: what rounding leaves of two codes
    velocity = np.abs(W) @ np.abs(r) + np.abs(q)
    rounding = 1e-15 * len(q) * (np.linalg.norm(velocity) + np.linalg.norm(r)) / np.linalg.norm(q)
    with np.errstate(all="ignore"):
        plain, scaled = natural_maps(W, q, mu, r)
    if not plain <= case["tolerance"] * (1 + 1e-9) + rounding:
        raise Failure(f"{case['solver']} claims {case['tolerance']:.1e}; natural_map_q is {plain:.3e}")
    if r.any() and (diagonal > 0).all():
        slack = 1e-15 * len(q) * (np.linalg.norm(velocity / np.repeat(diagonal, 3)) / np.linalg.norm(r) + 1.0)
        if not scaled <= case["tolerance"] * (1 + 1e-9) + slack:
            raise Failure(f"{case['solver']} claims {case['tolerance']:.1e}; natural_map_scaled is {scaled:.3e}")
    if not r.any() and (q[0::3] < 0).any() and case["tolerance"] < 1e-12:
        raise Failure(f"{case['solver']} claims convergence with no reactions where a contact closes")


def refuted(case: dict[str, Any]) -> None:
    """A claim of infeasibility is false if some reactions in the cones leave every contact opening: (W r + q)_N > 0."""
    import cvxpy as cp

    W, q, mu = np.asarray(case["W"]), np.asarray(case["q"]), case["mu"]
    n = len(mu)
    # in units in which W has a diagonal of ones, contact by contact
    size = np.sqrt(np.maximum(np.diag(W).reshape(n, 3).max(axis=1), 1e-300)).repeat(3)
    W, q = W / size[:, None] / size[None, :], q / size
    q = q / np.abs(q).max()
    r, t = cp.Variable(3 * n), cp.Variable()
    rows = [cp.norm2(r[3 * k + 1 : 3 * k + 3]) <= mu[k] * r[3 * k] for k in range(n)]
    rows += [(W @ r + q)[0::3] >= t, r[0::3] >= 0.0, t <= 1.0, cp.norm(r, "inf") <= 1e4]
    program = cp.Problem(cp.Maximize(t), rows)
    try:
        program.solve(solver=cp.CLARABEL)
    except cp.SolverError:
        return
    if program.status != "optimal":
        return
    value = r.value
    for k in range(n):  # into the cone, so that rounding proves nothing
        value[3 * k] = max(value[3 * k], 0.0)
        tangent = np.linalg.norm(value[3 * k + 1 : 3 * k + 3])
        value[3 * k + 1 : 3 * k + 3] *= min(1.0, mu[k] * value[3 * k] / tangent) if tangent > 0.0 else 0.0
    opening = (W @ value + q)[0::3].min()
    symmetric = np.abs(W - W.T).max() <= 1e-12 * np.abs(W).max()
    if opening > 1e-6 and symmetric:
        raise Failure(f"claimed to have no solution, but reactions exist that open every contact by {opening:.1e}")
