"""Everything about a law: the front of its step, the front of a path, and what threads bring."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..front import Front, keep_front
from ..integrators.accuracy import law_key
from ..integrators.path_file import StrainStressPath
from ..potentials import Law
from .law_path import measure_path
from .law_step import Load, least_time, load_of, measure_step

__all__ = ["LawTradeoff", "measure_law"]

Tell = Callable[[float, str], None]
THREADED = 50_000  # points of the measurement over threads, fewer of slow methods
SLOW = 5_000


@dataclass(frozen=True)
class LawTradeoff:
    """Fronts of the `step` and of a `path`, and seconds per point of the law's own method by number of `threads`."""

    step: Front
    path: Front
    threads: Mapping[int, float]

    def keep(self, law: Law) -> Path:
        """Keep the front of the step in the user's cache, where `law.compile(accuracy=...)` finds it."""
        return keep_front(self.step, law_key(law, "3d"))


def measure_law(
    law: Law,
    values: Mapping[str, float],
    *,
    path: StrainStressPath | None = None,
    points: int = 2000,
    threads: tuple[int, ...] = (1, 2),
    dt: float = 1.0,
    temperature: float = 300.0,
    seed: int = 1,
    progress: Tell | None = None,
) -> LawTradeoff:
    """Measure a law at parameter `values`; `dt` [s] and `temperature` [K] of the random points. Raises `InputError` for bad input,
    `ConvergenceError` where the path cannot be followed."""
    if not isinstance(law, Law):
        raise InputError(f"tradeoff takes a Law, not {type(law).__name__}")
    law.admissible_values(values)
    if not (np.isfinite(dt) and dt > 0.0 and np.isfinite(temperature) and temperature > 0.0):
        raise InputError(f"dt = {dt:g} s, temperature = {temperature:g} K: both must be positive and finite")
    tell = progress or (lambda _share, _what: None)
    tell(0.0, "points")
    load = load_of(law, values, points=points, seed=seed, dt=dt, temperature=temperature)
    step = measure_step(law, values, load=load, progress=lambda share, what: tell(0.6 * share, f"step: {what}"))
    way = measure_path(
        law,
        values,
        path=path,
        dt=dt,
        temperature=temperature,
        seed=seed,
        progress=lambda share, what: tell(0.6 + 0.3 * share, f"path: {what}"),
    )
    tell(0.9, "threads")
    return LawTradeoff(step, way, _threads(law, load, threads))


def _threads(law: Law, load: Load, threads: tuple[int, ...]) -> dict[int, float]:
    found: dict[int, float] = {}
    truth = None
    for count in threads:
        update = law.compile(threads=count)
        many = load.repeated(SLOW if update.solver == "general" else THREADED)
        run = partial(update, many.eps, many.state, many.dt, **many.values)
        stress = run().stress
        truth = stress if truth is None else truth
        if not np.array_equal(stress, truth):
            raise ArithmeticError(f"law '{law.name}': {count} threads change the answer")  # a defect, not a setting
        found[count] = least_time(run) / len(many.eps)
    return found
