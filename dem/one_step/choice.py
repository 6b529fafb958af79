"""`measured`: the solver that was the fastest on problems like this one.

A problem is described by numbers that cost little: its size, its friction, and its errors after ten
and after thirty sweeps of Gauss–Seidel (the probe, from which the chosen solver goes on), which tell well and ill conditioned problems
apart. The seconds that every solver took on random problems are shipped (`fronts/contact.json`); each counts by its likeness to the
problem at hand, and that solver is taken whose mean logarithm of time over the fastest is least. A solver that takes ten times what the
others suggest is given up for `auto`, so that a wrong choice costs time and never the answer.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...front import shipped_front
from .blocks import Blocks, scaled_blocks
from .gauss_seidel import solve_nlgs
from .monitor import Monitor
from .problem import OneStepProblem

__all__ = ["TOLERANCES", "SolverChoice", "choose_solver", "features", "probe"]

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
EARLY, LATE = 10, 30  # sweeps of the probe
# decades (of the friction: its own size) at which likeness fades; from leaving out one of the shipped problems at a time
WIDTHS = {"contacts": 0.13, "friction": 0.19, "early": 0.7, "late": 0.9, "rough": 0.5}
PATIENCE, LEAST = 10.0, 0.05  # times the expected seconds, and seconds, before `auto` takes over


@dataclass(frozen=True)
class SolverChoice:
    """`solver`, the `seconds` it took on problems alike at their like size (median), and in words why."""

    solver: str
    seconds: float
    why: str


def probe(blocks: Blocks, monitor: Monitor) -> tuple[float, float]:
    """Thirty sweeps from the best iterate: the errors after ten and after all."""
    solve_nlgs(blocks, monitor, limit=EARLY)
    early = monitor.error
    if not monitor.converged:
        solve_nlgs(blocks, monitor, limit=LATE - EARLY)
    return float(early), float(monitor.error)


def described(blocks: Blocks, friction: Any, early: float, late: float) -> dict[str, float]:
    """The numbers that describe a problem."""
    n = len(blocks.mu)
    return {
        "contacts": float(n),
        "friction": float(np.median(friction)),
        "early": early,
        "late": late,
    }


def features(problem: OneStepProblem) -> dict[str, float]:
    """`described` of a problem, by a probe from rest; the probe's processor time [s] among them."""
    blocks = scaled_blocks(problem)
    began = time.thread_time()
    early, late = probe(blocks, Monitor(problem, blocks, 0.0, 60.0))
    return described(blocks, problem.mu, early, late) | {"probe": time.thread_time() - began}


def _coordinates(row: Mapping[str, float]) -> np.ndarray:
    early, late = max(row["early"], 1e-14), max(row["late"], 1e-15)
    found = {
        "contacts": math.log10(row["contacts"]),
        "friction": min(row["friction"], 1.5),
        "early": math.log10(early),
        "late": math.log10(late),
        "rough": float(row["friction"] > 0.0),  # contacts without friction are another kind of problem, not a limit
    }
    return np.array([found[name] / width for name, width in WIDTHS.items()])


@functools.cache
def _shipped() -> tuple[Sequence[str], np.ndarray, np.ndarray]:
    """(solvers, coordinates (rows, features), seconds (rows, solvers, tolerances), nan where the tolerance was not reached)."""
    content = shipped_front("contact")
    seconds = np.array(
        [
            [[np.nan if t is None else t for t in row["seconds"][s]] for s in content["solvers"]]
            for row in content["rows"]
        ]
    )
    return content["solvers"], np.array([_coordinates(row["features"]) for row in content["rows"]]), seconds


def choose_solver(described: Mapping[str, float], tolerance: float) -> SolverChoice:
    """The solver that suits problems alike best at a tolerance."""
    solvers, places, seconds = _shipped()
    at = next((k for k, t in enumerate(TOLERANCES) if t <= tolerance * (1.0 + 1e-9)), len(TOLERANCES) - 1)
    here = seconds[:, :, at].copy()
    # `auto` was timed at some tolerances only: the next finer one, else the next coarser
    auto = list(solvers).index("auto")
    there = seconds[:, auto, :]
    finer = [k for k in range(len(TOLERANCES)) if not np.all(np.isnan(there[:, k]))]
    here[:, auto] = there[:, next((k for k in finer if k >= at), finer[-1])]
    known = ~np.all(np.isnan(here), axis=1)
    likeness = np.exp(-0.5 * np.sum((places - _coordinates(described)) ** 2, axis=1)) + 1e-12
    weights = np.where(known, likeness, 0.0)
    fastest = np.nanmin(np.where(known[:, None], here, 1.0), axis=1)
    missed = np.maximum(30.0, 5.0 / fastest)[:, None]
    ratio = np.where(np.isnan(here), missed, here / fastest[:, None])
    score = weights @ np.log(ratio) / weights.sum()
    best = int(np.argmin(score))
    took = here[:, best]
    order = np.argsort(-np.where(np.isnan(took), 0.0, weights))[:7]
    expected = float(np.nanmedian(took[order])) if np.isfinite(took[order]).any() else LEAST
    like = int(np.sum(likeness > 0.1))
    return SolverChoice(
        str(solvers[best]),
        expected,
        f"{solvers[best]}: {math.exp(score[best]):.2f} times the fastest on the mean of problems like it ({like} of {len(places)} are "
        "very much so)",
    )
