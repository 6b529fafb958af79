"""One path by one formulation and solver: followed, timed, and measured against a reference.

A method that cannot follow says why in one line. cvxpy and the explicit scheme have no tangent and are slow: they make single steps, from
the reference's state and strain, at some rows spread over the path.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, FenchelError
from ..potentials import Law
from .explicit import ExplicitUpdate
from .history import History, drive_arrays
from .packing import StatePacking
from .path_certificate import PathData
from .path_file import StrainStressPath
from .update import build_update

__all__ = ["CANDIDATES", "SAMPLED", "Attempt", "attempt", "follow_path", "sampled_attempt", "spread"]

Array = NDArray[np.float64]
CANDIDATES = (
    ("strain", ("auto", "closed", "reduced", "principal", "general", "conic")),
    ("stress", ("auto", "closed", "reduced", "principal", "general", "conic")),
)
SAMPLED = ("cvxpy", "explicit")
REPEATS = 5
TIME_FOR_REPEATS = 0.5  # s
TIME_FOR_SAMPLES = 10.0  # s
SUB_STEPS = 500  # beyond that it is too slow to be compared, and the reason says so
FORESEEN = (FenchelError, ArithmeticError, np.linalg.LinAlgError)


@dataclass(frozen=True)
class Attempt:
    """What one method made of the path: `history` (None where it failed, and `failure` says why), at `rows`, process time per step [s],
    mean number of linear systems per step for the unknown components."""

    formulation: str
    solver: str
    why: str
    update: Any = field(repr=False, compare=False)
    history: History | None = field(default=None, repr=False, compare=False)
    failure: str = ""
    rows: NDArray[np.intp] | None = field(default=None, repr=False, compare=False)
    time_per_step: float | None = None
    iterations: float | None = None


def follow_path(update: Any, path: StrainStressPath, values: Any) -> History:
    """The path by a compiled update."""
    return drive_arrays(
        update,
        path.control,
        path.targets,
        values,
        trace=path.trace,
        trace_targets=path.trace_targets,
        times=path.time,
        temperatures=path.temperature,
    )


def attempt(law: Law, formulation: str, solver: str, path: StrainStressPath, values: Any) -> Attempt:
    """Compile and follow, once to warm up and some times for the clock; `solver` "auto" is replaced by the one that it chose."""
    try:
        update = build_update(law, formulation=formulation, solver=solver)
    except FORESEEN as problem:
        return Attempt(formulation, solver, "", None, failure=one_line(problem))
    found = Attempt(formulation, update.solver, update.why, update)
    try:
        history = follow_path(update, path, values)
    except FORESEEN as problem:
        return _failed(found, problem)
    rows = np.arange(len(history.eps))
    took = _process_time(lambda: follow_path(update, path, values), REPEATS, TIME_FOR_REPEATS)
    turns = None if history.iterations is None else float(history.iterations.mean())
    return Attempt(formulation, update.solver, update.why, update, history, "", rows, took / max(len(rows), 1), turns)


def sampled_attempt(data: PathData, solver: str, reference: History, count: int) -> Attempt:
    """Single steps by "cvxpy" or "explicit" at `count` rows spread over the path; fewer where the time is over."""
    found = Attempt("strain", solver, "", None)
    try:
        update: Any = (
            ExplicitUpdate(data.law, limit=SUB_STEPS) if solver == "explicit" else build_update(data.law, solver=solver)
        )
        found = Attempt("strain", solver, update.why, update)
        return _sampled(data, found, reference, spread(len(reference.eps), count))
    except FORESEEN as problem:
        return _failed(found, problem)


def spread(rows: int, count: int) -> NDArray[np.intp]:
    """At most `count` of the rows, evenly spread, the last one among them.

    >>> spread(7, 3).tolist(), spread(2, 5).tolist()
    ([1, 4, 6], [0, 1])
    """
    return np.unique(np.arange(rows, 0, -max(rows / count, 1.0)).round().astype(np.intp) - 1)[-count:]


def _sampled(data: PathData, found: Attempt, reference: History, rows: NDArray[np.intp]) -> Attempt:
    old, _ = data.packed(reference)
    packing, names = StatePacking.of(data.law), found.update.layout
    eps_before = np.concatenate([np.zeros((1, 6)), reference.eps[:-1]])
    outs, done, times = [], [], []
    begin = time.process_time()
    for row in rows:
        state = packing.unpack(old[row : row + 1])
        if data.law.observable.name in names:
            state = {**state, data.law.observable.name: eps_before[row : row + 1]}
        start = time.process_time()
        out = found.update(reference.eps[row : row + 1], state, float(data.steps[row]), **_scalars(data, row))
        times.append(time.process_time() - start)
        outs.append(out)
        done.append(row)
        if time.process_time() - begin > TIME_FOR_SAMPLES:
            break
    at = np.array(done)
    history = History(
        reference.eps[at],
        np.concatenate([out.stress for out in outs]),
        {name: np.concatenate([out.state[name] for out in outs]) for name in outs[0].state},
        np.zeros(len(at)),
        np.zeros(len(at)),
        np.zeros(len(at), dtype=np.int64),
    )
    took = float(np.median(times))
    return Attempt("strain", found.solver, found.why, found.update, history, "", at, took)


def _scalars(data: PathData, row: int) -> dict[str, Any]:
    return {name: float(value) if np.ndim(value) == 0 else value for name, value in data.given(row).items()}


def _failed(found: Attempt, problem: BaseException) -> Attempt:
    word = "" if isinstance(problem, (ConvergenceError, FenchelError)) else f"{type(problem).__name__}: "
    return Attempt(found.formulation, found.solver, found.why, found.update, failure=word + one_line(problem))


def one_line(problem: BaseException) -> str:
    """Text of a failure without line breaks."""
    return " ".join(str(problem).split())


def _process_time(call: Callable[[], Any], repeats: int, limit: float) -> float:
    """Median process time [s]; at least one call, no more after `limit` seconds."""
    found: list[float] = []
    begin = time.process_time()
    while len(found) < repeats and (not found or time.process_time() - begin < limit):
        start = time.process_time()
        call()
        found.append(time.process_time() - start)
    return float(np.median(found))
