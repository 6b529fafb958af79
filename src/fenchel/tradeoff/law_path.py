"""Speed against accuracy along a path: into how many steps it is cut, by the implicit step or by the explicit scheme.

The truth is the limit of many steps: implicit Euler with twice 256 parts and with 256, extrapolated to none by its first order (Richardson
1911). The two differ by about the error of the finer one, which bounds what the truth is worth. Without a path of the user's, 256 points
(16 where the general engine is needed) follow random paths of three straight strains, each of one to five flow strains.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DeclarationError, FenchelError
from ..front import Front, Measured, environment
from ..integrators.comparison_runs import follow_path
from ..integrators.path_file import StrainStressPath
from ..integrators.step_order import cut_path
from ..potentials import Law
from .law_step import _directions, energy_scales, flow_strain

__all__ = ["MEASURE", "measure_path"]

Array = NDArray[np.float64]
MEASURE = "stress at the rows of the path against the limit of many steps, relative to the largest"
PARTS = (1, 2, 4, 8, 16, 32, 64)
FINE = 256
POINTS = {"general": 16}  # of methods that are slow
MANY, LEGS, FEW = 256, 3, 2
EXPLICIT = (1e-2, 1e-3, 1e-4)
Tell = Callable[[float, str], None]


@dataclass(frozen=True)
class _Followed:
    """Stresses (rows, ..., 6), energies and dissipation at the last row, seconds per path."""

    stress: Array
    energy: Array
    dissipation: Array
    seconds: float


def measure_path(
    law: Law,
    values: Mapping[str, Any],
    *,
    path: StrainStressPath | None = None,
    dt: float = 1.0,
    temperature: float = 300.0,
    seed: int = 1,
    progress: Tell | None = None,
) -> Front:
    """The front of a path, `path` (mixed control) or random ones; cost is the time of the wall per path [s].

    `dt` [s] is the time of a leg of a random path. Raises `ConvergenceError` where the path cannot be followed in many steps.
    """
    tell = progress or (lambda _share, _what: None)
    follow = _own(law, values, path) if path is not None else _random(law, values, dt, temperature, seed)
    tell(0.0, "limit of many steps")
    coarse, fine = follow(FINE, None), follow(2 * FINE, None)
    truth = _Followed(
        2.0 * fine.stress - coarse.stress,
        2.0 * fine.energy - coarse.energy,
        2.0 * fine.dissipation - coarse.dissipation,
        0.0,
    )
    scale = max(float(np.abs(truth.stress).max(initial=0.0)), np.finfo(float).tiny)
    worth = float(np.abs(truth.stress - fine.stress).max(initial=0.0)) / scale
    tries: list[dict[str, Any]] = [{"solver": "auto", "parts": parts} for parts in PARTS]
    if _explicit(law, path):
        tries += [{"solver": "explicit", "tolerance": t} for t in EXPLICIT]
    found = []
    for k, setting in enumerate(tries):
        tell((k + 1) / (len(tries) + 1), ", ".join(f"{name} {value}" for name, value in setting.items()))
        try:
            took = follow(setting.get("parts", 1), setting.get("tolerance"))
        except (FenchelError, ArithmeticError, np.linalg.LinAlgError) as problem:
            found.append(
                Measured(setting=setting, cost=float("inf"), error=None, failure=" ".join(str(problem).split()))
            )
            continue
        found.append(_measured(setting, took, truth, scale))
    return Front(
        kind="path",
        subject=law.name,
        measure=MEASURE,
        cost="s per path",
        points=tuple(found),
        environment=environment(),
        note=f"the limit is known to {worth:.1e}",
    )


def _explicit(law: Law, path: StrainStressPath | None) -> bool:
    """Whether the explicit scheme takes the law, and the path is one of strains."""
    if path is not None and bool(np.any(path.control)):
        return False
    try:
        law.compile(solver="explicit")
    except DeclarationError:
        return False
    return bool(law.internal)


def _measured(setting: dict[str, Any], took: _Followed, truth: _Followed, scale: float) -> Measured:
    # the explicit scheme follows the first of the random paths only
    count = len(took.energy)
    true, energy, dissipation = truth.stress, truth.energy[:count], truth.dissipation[:count]
    if true.ndim == 3:
        true = true[:, :count]
    size, lost = energy_scales(truth.energy, truth.dissipation)
    return Measured(
        setting=setting,
        cost=took.seconds,
        error=float(np.abs(took.stress - true).max(initial=0.0)) / scale,
        figures={
            "energy": float(np.abs(took.energy - energy).max(initial=0.0)) / size,
            "dissipation": float(np.abs(took.dissipation - dissipation).max(initial=0.0)) / lost,
        },
    )


def _own(law: Law, values: Mapping[str, Any], path: StrainStressPath) -> Callable[[int, float | None], _Followed]:
    updates: dict[Any, Any] = {}

    def follow(parts: int, tolerance: float | None) -> _Followed:
        if tolerance not in updates:
            updates[tolerance] = (
                law.compile() if tolerance is None else law.compile(solver="explicit", tolerance=tolerance)
            )
            follow_path(updates[tolerance], path, values)  # compiled before the clock runs
        cut = cut_path(path, parts)
        start = time.perf_counter()
        history = follow_path(updates[tolerance], cut, values)
        seconds = time.perf_counter() - start
        rows = slice(parts - 1, None, parts)
        return _Followed(history.sig[rows], history.psi[-1:], history.dissipation[-1:], seconds)

    return follow


def _random(
    law: Law, values: Mapping[str, Any], dt: float, temperature: float, seed: int
) -> Callable[[int, float | None], _Followed]:
    rng = np.random.default_rng(seed)
    given = dict(values)
    if law.temperature is not None:
        given.setdefault(law.temperature.name, temperature)
    exact = law.compile(tangent=False)
    flow = flow_strain(law, exact, given, dt, rng)
    points = POINTS.get(exact.solver, MANY)
    legs = np.stack([flow * rng.uniform(1.0, 5.0, (points, 1)) * _directions(rng, points) for _ in range(LEGS)])

    def follow(parts: int, tolerance: float | None) -> _Followed:
        update = exact if tolerance is None else law.compile(solver="explicit", tolerance=tolerance)
        count = points if tolerance is None else FEW
        best = np.inf
        stress, energy, lost = np.zeros((LEGS, count, 6)), np.zeros(count), np.zeros(count)
        for _ in range(3 if parts <= 64 and tolerance is None else 1):
            eps = np.zeros((count, 6))
            state, lost = update.initial_state(count), np.zeros(count)
            start = time.perf_counter()
            for k, leg in enumerate(legs[:, :count]):
                for _part in range(parts):
                    eps = eps + leg / parts
                    out = update(eps, state, dt / parts, **given)
                    state, lost = out.state, lost + out.dissipation
                stress[k] = out.stress
            best = min(best, time.perf_counter() - start)
        if hasattr(update, "energy"):
            energy = update.energy(eps, state, **given)
        else:
            energy = exact.energy(eps, {v.name: state[v.name] for v in law.internal}, **given)
        return _Followed(stress, energy, lost, best / count)

    return follow
