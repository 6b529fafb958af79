r"""Claims 29 and 30: steps without and with friction against programs that share nothing with the sweeps.

Without friction the normal rows are 0 ≤ r ⊥ W r + q ≥ 0. Taken from packings of rigid and compliant grains and of grains with wires, such
steps are solved five times: by the sweeps of the step, by the solver of `one_step`, by Lemke's pivots, and as Gauss's least constraint by
active sets and by an interior point. Velocities are unique and are compared (relative to max|q|), of the interior point the optimum;
reactions of rigid packings are not unique. Where sweeps do not end within a limit this is counted, not hidden.

With friction every solution must pass the natural map, the law in words (stick inside the cone, slide against the impulse on it), and
solve the cone program of its own slip s = ‖u_T‖, whose velocities are unique. The fixed point s ← ‖u_T(s)‖ started from rest is a third
way; where a step has several solutions it need not find the same one, and such problems are counted.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dem import Drive, Material, Simulation, Solver
from ..dem.one_step import OneStepProblem, solve
from ..dem.one_step.scenes import problem_of
from .contact_scenes import STIFF, LocalRows, cold, packing, reactions
from .contact_truth import ConeStep, LeastConstraint, cone_fixed_point, lemke, natural_map

__all__ = ["COMPARED", "SMOOTH", "SWEEPS", "complementarity", "friction", "residuals"]

Array = NDArray[np.float64]

_NONE: dict[str, Any] = dict(friction=0.0, bead_friction=0.0)
SMOOTH: dict[str, tuple[int, Material]] = {
    "rigid grains": (30, Material(**_NONE, links=False)),
    "compliant grains": (30, Material(**_NONE, wire_stiffness=10.0, **STIFF)),
    "elastic wires": (30, Material(**_NONE, wire_stiffness=10.0)),
    "rigid wires": (12, Material(**_NONE, wire_law="rigid_wire")),
}
SWEEPS = 200_000
APART = 1e-5  # in the energy norm: solutions further apart are two
COMPARED = ("active_sets", "solver", "sweeps", "optimum", "certificate", "pivots_certificate")


def _swept(
    simulation: Simulation, problem: OneStepProblem, step: float, drive: Drive, tolerance: float
) -> tuple[Array, bool]:
    """Reactions (3n,) after sweeps from the warm start, and whether they stopped by themselves."""
    simulation.solver = Solver(tolerance=tolerance, sweep_limit=SWEEPS, keep_unconverged=True)
    simulation.advance(step, drive)
    return reactions(LocalRows(problem, simulation), simulation), simulation.change <= tolerance


def complementarity(problems: int) -> dict[str, Any]:
    """By family: the largest differences of normal velocities from those of the pivots, relative to max|q|, and certificates."""
    return {name: _family(problems, grains, law) for name, (grains, law) in SMOOTH.items()}


def _family(problems: int, grains: int, law: Material) -> dict[str, Any]:
    out: dict[str, Any] = dict.fromkeys((*COMPARED, "sweeps_of_unfinished"), 0.0)
    out |= {"rows": 0, "closed": 0, "problems": problems, "unfinished": 0, "longest": 0}
    for seed in range(problems):
        simulation, step, drive = packing(seed, grains, law)
        problem = problem_of(simulation, step, drive)
        bodies = problem.bodies
        assert bodies is not None
        normal = slice(0, None, 3)
        w, q = problem.delassus.toarray()[normal, normal], problem.q[normal]
        inverse = 1.0 / bodies.mass.diagonal()
        gauss = LeastConstraint.of(bodies.h[:, normal].toarray(), inverse, inverse * bodies.f, bodies.w[normal])
        x = lemke(w, q)
        r, finished = _swept(simulation, problem, step, drive, 1e-14)
        r = r[normal]
        velocities = {
            "active_sets": gauss.velocities(),
            "solver": w @ solve(problem, tolerance=1e-11).r[normal] + q,
            "sweeps" if finished else "sweeps_of_unfinished": w @ r + q,
        }
        for name, u in velocities.items():
            out[name] = max(out[name], float(np.max(np.abs(u - w @ x - q)) / np.max(np.abs(q))))
        out["pivots_certificate"] = max(out["pivots_certificate"], _certificate(w, q, x))
        if finished:  # ½ r·W r is the kinetic energy that the constraints take
            out["certificate"] = max(out["certificate"], _certificate(w, q, r))
            out["optimum"] = max(out["optimum"], abs(0.5 * float(r @ w @ r) / gauss.optimum() - 1.0))
        out["rows"] += len(q)
        out["closed"] += int(np.sum(x > 0.0))
        out["unfinished"] += int(not finished)
        out["longest"] = max(out["longest"], simulation.sweeps)
    return out


def _certificate(w: Array, q: Array, r: Array) -> float:
    """Largest of: a pull relative to the largest push, an approach relative to max|q|, the product r·u relative to r·|q|."""
    u = w @ r + q
    return float(max(-r.min() / r.max(), -u.min() / np.max(np.abs(q)), abs(r @ u) / (r @ np.abs(q))))


def _law_in_words(u: Array, r: Array, mu: Array) -> float:
    """Worst of: an impulse outside the cone, slip while it is inside, slip that is not against it; sizes relative to the largest."""
    u, r = u.reshape(-1, 3)[mu > 0.0], r.reshape(-1, 3)[mu > 0.0]
    m, size_r, size_u = mu[mu > 0.0], np.max(np.abs(r)), np.max(np.abs(u))
    tangential, slip = np.linalg.norm(r[:, 1:], axis=1), np.linalg.norm(u[:, 1:], axis=1)
    room = m * r[:, 0] - tangential
    outside = np.max(np.maximum(-room, 0.0)) / size_r
    inside = np.max(slip * np.maximum(room, 0.0)) / (size_r * size_u)
    against = np.max(np.abs(np.sum(u[:, 1:] * r[:, 1:], axis=1) + slip * tangential)) / (size_r * size_u)
    return float(max(outside, inside, against))


def _maps(problem: OneStepProblem, r: Array) -> float:
    """The larger of ‖F‖/‖q‖ with ρ = 1 and ‖F‖/‖r‖ with ρ = 1/W_NN."""
    u, mobility = problem.delassus @ r + problem.q, problem.delassus.diagonal()[0::3]
    plain = np.linalg.norm(natural_map(u, r, problem.mu, np.ones(len(mobility)))) / np.linalg.norm(problem.q)
    return float(max(plain, np.linalg.norm(natural_map(u, r, problem.mu, 1.0 / mobility)) / np.linalg.norm(r)))


def friction(problems: int, turns: int = 80) -> dict[str, Any]:
    """Natural maps, laws in words and distances from the cone programs (energy norm) of small packings, over four kinds and three μ."""
    names = ("map", "words", "cone", "swept_map", "swept_words", "swept_cone", "arrived_map", "arrived_apart")
    out: dict[str, Any] = dict.fromkeys(names, 0.0)
    out |= dict.fromkeys(("problems", "contacts", "sliding", "swept", "arrived", "elsewhere", "several"), 0)
    for mu in (0.2, 0.4, 0.8):
        both: dict[str, Any] = dict(friction=mu, bead_friction=mu)
        kinds = (
            Material(**both, links=False), Material(**both, wire_law="rigid_wire"), Material(**both, wire_stiffness=10.0),
            Material(**both, **STIFF),
        )  # fmt: skip
        for law in kinds:
            for seed in range(problems):
                simulation, step, drive = packing(seed, 6, law, wires=1, beads=4)
                _one_frictional(out, simulation, step, drive, turns)
    return out


def _one_frictional(out: dict[str, Any], simulation: Simulation, step: float, drive: Drive, turns: int) -> None:
    problem = problem_of(simulation, step, drive)
    w, mu = problem.delassus.toarray(), problem.mu
    program = ConeStep(w, problem.q, mu)

    def energy(r: Array) -> float:
        return float(np.sqrt(max(r @ (w @ r), 0.0)))

    def judge(r: Array, prefix: str) -> None:
        u = w @ r + problem.q
        found = {"map": _maps(problem, r), "words": _law_in_words(u, r, mu)}
        found["cone"] = energy(program.solve(program.slip(r)) - r) / energy(r)
        for name, value in found.items():
            out[prefix + name] = max(out[prefix + name], value)

    solved = solve(problem, tolerance=1e-10).r
    judge(solved, "")
    swept, finished = _swept(simulation, problem, step, drive, 1e-13)
    known = [solved]
    if finished:
        judge(swept, "swept_")
        known.append(swept)
        out["several"] += int(energy(swept - solved) > APART * energy(solved))
    r, used = cone_fixed_point(program, limit=turns, tolerance=1e-8)
    if used < turns:
        out["arrived_map"] = max(out["arrived_map"], _maps(problem, r))
        apart = min(energy(r - other) for other in known) / energy(solved)
        if apart > APART:
            out["elsewhere"] += 1
        else:
            out["arrived_apart"] = max(out["arrived_apart"], apart)
    out["arrived"] += int(used < turns)
    out["swept"] += int(finished)
    out["problems"] += 1
    out["contacts"] += int(np.sum((mu > 0.0) & (solved[0::3] > 0.0)))
    tangential = np.hypot(solved[1::3], solved[2::3])
    out["sliding"] += int(np.sum((mu > 0.0) & (solved[0::3] > 0.0) & (tangential > (1.0 - 1e-9) * mu * solved[0::3])))


def residuals(grains: int, tolerances: list[float], seed: int = 0) -> dict[str, Any]:
    """Natural map per contact, relative to the mean normal impulse, of one step of a packing solved to each tolerance from no impulses.

    Rows of `rigid` and `compliant`: 50 %, 90 %, 99 % quantiles, largest; `total_*`: ‖F‖/‖r‖.
    """
    soft = Material(friction=0.4, wire_stiffness=10.0, **STIFF)
    simulation, step, drive = packing(seed, grains, soft, wires=max(1, grains // 15), tolerance=1e-3)
    out: dict[str, Any] = {"tolerances": np.array(tolerances), "contacts": 0}
    for name, law in (("compliant", soft), ("rigid", Material(friction=0.4, wire_stiffness=10.0))):
        quantiles, total, sweeps = [], [], []
        for tolerance in tolerances:
            probe = cold(simulation.assembly, law, tolerance)
            problem = problem_of(probe, step, drive)
            probe.advance(step, drive)
            r = reactions(LocalRows(problem, probe), probe)
            error = natural_map(problem.velocity(r), r, problem.mu, 1.0 / problem.delassus.diagonal()[0::3])
            normal = r[0::3]
            quantiles.append(np.quantile(error, (0.5, 0.9, 0.99, 1.0)) / normal[normal > 0.0].mean())
            total.append(np.linalg.norm(error) / np.linalg.norm(r))
            sweeps.append(probe.sweeps)
            out["contacts"] = int(np.sum(normal > 0.0))
        out |= {name: np.array(quantiles), f"total_{name}": np.array(total), f"sweeps_{name}": np.array(sweeps)}
    return out
