"""Speed against accuracy of one implicit step of a law: every method, tolerance and precision on the same random points.

Points are loaded twice: from the virgin state along random strains, and again from where that ended; the second step is the one that is
timed. Strains are 0.3 to 30 times the one at which the law begins to flow. The trusted answer is that of the law's own compiled method,
held against the general engine, whose error is bounded by its duality gap (`fenchel.integrators.accuracy`). Where both agree within that
bound the compiled one is taken: it is exact to rounding, while the engine ends at about 1e-9 where there are powers. Errors are the
largest over the points, relative to the largest stress, energy, dissipation and tangent; of the tangent the 99 % quantile, for it jumps
where two regimes meet.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, FenchelError
from ..front import Front, Measured, environment
from ..integrators.accuracy import error_bound
from ..integrators.general_update import GeneralUpdate
from ..potentials import Law
from ..potentials.scalars import ScalarVariable

__all__ = ["MEASURE", "Load", "load_of", "measure_step", "settings_of"]

Array = NDArray[np.float64]
MEASURE = "stress of one step against the exact answer of the step, relative to the largest"
FEW = {"cvxpy": 4, "conic": 200}  # points of methods that are slow
REPEATS, SECONDS = 7, 0.4
Tell = Callable[[float, str], None]


@dataclass(frozen=True)
class Load:
    """Old `state` by name, strains `eps` (n, 6) to step to, time step `dt` [s], `values` with the temperature, flow strain `yielding`."""

    state: Mapping[str, Array]
    eps: Array
    dt: float
    values: Mapping[str, Any]
    yielding: float

    def take(self, count: int) -> Load:
        """The first points."""
        return Load(
            {k: v[:count] for k, v in self.state.items()}, self.eps[:count], self.dt, self.values, self.yielding
        )

    def repeated(self, count: int) -> Load:
        """The points again and again, `count` in all."""
        turn = np.arange(count) % len(self.eps)
        values = {k: np.asarray(v)[turn] if np.ndim(v) else v for k, v in self.values.items()}
        return Load({k: v[turn] for k, v in self.state.items()}, self.eps[turn], self.dt, values, self.yielding)


def settings_of(law: Law) -> list[dict[str, Any]]:
    """Settings to try, the exact one of the law's own method first."""
    solver = law.compile().solver
    found: list[dict[str, Any]] = []
    if solver != "general":
        found += [{"solver": solver}, {"solver": solver, "precision": "float32"}]
        if solver == "closed" and law.surfaces:
            found.append({"solver": "reduced"})
    found += [{"solver": "general", "tolerance": t} for t in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)] + [{"solver": "general"}]
    found += [{"solver": "conic"}]
    return found + [{"solver": "cvxpy", "tolerance": t} for t in (1e-4, 1e-6, 1e-8)]


def load_of(
    law: Law,
    values: Mapping[str, float],
    *,
    points: int = 2000,
    seed: int = 1,
    dt: float = 1.0,
    temperature: float = 300.0,
) -> Load:
    """Random points of a law: states that a first step left, and strains of a second one."""
    rng = np.random.default_rng(seed)
    update = law.compile(tangent=False)
    given = dict(values)
    if law.temperature is not None:
        given.setdefault(law.temperature.name, temperature)
    flow = flow_strain(law, update, given, dt, rng)
    size = flow * 10.0 ** rng.uniform(-0.5, 1.5, (points, 1))
    first = size * _directions(rng, points)
    state = update(first, None, dt, **given).state
    second = first + flow * 10.0 ** rng.uniform(-0.5, 1.5, (points, 1)) * _directions(rng, points)
    return Load(state, second, dt, given, flow)


def _directions(rng: np.random.Generator, points: int) -> Array:
    found = rng.normal(size=(points, 6))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def flow_strain(law: Law, update: Any, values: Mapping[str, Any], dt: float, rng: np.random.Generator) -> float:
    """The strain at which half of the random directions flow, between 1e-12 and 1 (1e-3 where none or all do: elastic or viscous laws)."""
    if not law.internal or not any(v in law.forces for v in law.internal):
        return 1e-3
    directions = _directions(rng, 32)

    def flowing(size: float) -> float:
        try:
            out = update(size * directions, None, dt, **values)
        except ConvergenceError:
            return 1.0
        moved = np.zeros(32, dtype=bool)
        for variable in law.internal:
            value = out.state[variable.name]
            big = np.abs(value) if isinstance(variable, ScalarVariable) else np.abs(value).max(axis=1)
            moved |= big > 1e-9 * size
        return float(moved.mean())

    low, high = 1e-12, 1.0
    if flowing(low) >= 0.5 or flowing(high) < 0.5:
        return 1e-3
    for _ in range(30):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if flowing(middle) >= 0.5 else (middle, high)
    return high


def measure_step(
    law: Law,
    values: Mapping[str, float],
    *,
    load: Load | None = None,
    tangent: bool = True,
    threads: int = 1,
    settings: list[dict[str, Any]] | None = None,
    progress: Tell | None = None,
) -> Front:
    """The front of a law's step in three dimensions under strain; cost is the time of the wall per point [s], the least of some repeats.

    Raises `InputError` where the law has no cone program to be measured against.
    """
    tell = progress or (lambda _share, _what: None)
    load = load or load_of(law, values)
    trusted = GeneralUpdate.of(law, False)
    tries = settings_of(law) if settings is None else settings
    reference = _reference(law, load, tangent)
    found = []
    for k, setting in enumerate(tries):
        tell(k / len(tries), ", ".join(f"{name} {value}" for name, value in setting.items()))
        found.append(_measured(law, setting, load, reference, trusted, tangent, threads))
    note = (
        f"{len(load.eps)} points, flow strain {load.yielding:.2e}, dt {load.dt:g} s, tangent {'yes' if tangent else 'no'}, "
        f"{threads} thread{'s' if threads > 1 else ''}; the trusted answer is that of {reference.name}; "
        f"its error is bounded by a duality gap to {reference.bound:.1e}"
    )
    return Front(
        kind="law",
        subject=law.name,
        measure=MEASURE,
        cost="s per point",
        points=tuple(found),
        environment=environment() | {"threads": str(threads)},
        note=note,
    )


@dataclass(frozen=True)
class _Reference:
    out: Any
    energy: Array
    bound: float
    name: str


def _reference(law: Law, load: Load, tangent: bool) -> _Reference:
    """The answer of the law's own compiled method if it lies within what the engine's gap allows, else that of the engine."""
    engine = law.compile(solver="general", tangent=tangent)
    program = GeneralUpdate.of(law, False)
    found = engine(load.eps, load.state, load.dt, **load.values)
    bound = error_bound(program, engine, found, load.state, load.dt, **load.values)
    gap = float(bound.gap[np.isfinite(bound.gap)].max(initial=0.0))
    energy = engine.energy(load.eps, found.state, **load.values)
    own = law.compile(tangent=tangent)
    if own.solver == "general":
        return _Reference(found, energy, gap, "the engine")
    out = own(load.eps, load.state, load.dt, **load.values)
    apart = _longest(out.stress - found.stress) / max(_longest(found.stress), np.finfo(float).tiny)
    if apart > max(gap, 1e-8):
        return _Reference(found, energy, gap, f"the engine, {apart:.1e} from '{own.solver}'")
    energy = own.energy(load.eps, out.state, **load.values)
    return _Reference(out, energy, gap + apart, f"'{own.solver}', {apart:.1e} from the engine")


def _measured(
    law: Law,
    setting: dict[str, Any],
    load: Load,
    reference: _Reference,
    trusted: GeneralUpdate,
    tangent: bool,
    threads: int,
) -> Measured:
    try:
        update = law.compile(tangent=tangent, threads=threads, **setting)
        count = min(FEW.get(setting["solver"], len(load.eps)), len(load.eps))
        own = load.take(count)

        def run() -> Any:
            return update(own.eps, own.state, own.dt, **own.values)

        out = run()
        cost = least_time(run) / count
    except (FenchelError, ArithmeticError, np.linalg.LinAlgError) as problem:
        return Measured(setting=setting, cost=float("inf"), error=None, failure=" ".join(str(problem).split()))
    true = reference.out
    scale = max(_longest(true.stress), np.finfo(float).tiny)
    error = _longest(out.stress - true.stress[:count]) / scale
    energy = update.energy(own.eps, out.state, **own.values) if hasattr(update, "energy") else reference.energy[:count]
    size, lost = energy_scales(reference.energy, true.dissipation)
    figures: dict[str, float | None] = {
        "energy": _largest(energy - reference.energy[:count]) / size,
        "dissipation": _largest(out.dissipation - true.dissipation[:count]) / lost,
        "tangent": _tangent_error(out.tangent, true.tangent, count),
        "bytes": float(_bytes(own, out) / count),
        "points": float(count),
    }
    bound = error_bound(trusted, update, out, own.state, own.dt, points=200, **own.values)
    figures["bound"] = float((bound.difference + bound.gap).max(initial=0.0))
    return Measured(setting=setting, cost=cost, error=error, figures=figures)


def energy_scales(energy: Array, dissipation: Array) -> tuple[float, float]:
    """What errors of energy and of dissipation are relative to: the largest of each, of dissipation at least a thousandth of the energy."""
    size = max(_largest(energy), np.finfo(float).tiny)
    return size, max(_largest(dissipation), 1e-3 * size)


def _largest(difference: Array) -> float:
    return float(np.abs(difference).max(initial=0.0))


def _longest(tensors: Array) -> float:
    """The largest Frobenius norm."""
    return float(np.sqrt((np.asarray(tensors, dtype=float) ** 2).sum(axis=1)).max(initial=0.0))


def _tangent_error(found: Array | None, true: Array | None, count: int) -> float | None:
    if found is None or true is None:
        return None
    size = float(np.abs(true).max(initial=0.0)) or 1.0
    return float(np.quantile(np.abs(found - true[:count]).max(axis=(1, 2)), 0.99)) / size


def _bytes(load: Load, out: Any) -> int:
    """Of the arrays that a call reads and makes."""
    single = out.stress.dtype.itemsize
    read = load.eps.size * single + sum(v.size * single for v in load.state.values())
    made = [out.stress, out.dissipation, *out.state.values()] + ([] if out.tangent is None else [out.tangent])
    return read + sum(a.nbytes for a in made) + out.status.nbytes


def least_time(run: Callable[[], Any], repeats: int = REPEATS, seconds: float = SECONDS) -> float:
    """The least time of the wall [s] of some calls; no more are made after `seconds`."""
    best, begin = float("inf"), time.perf_counter()
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        best = min(best, time.perf_counter() - start)
        if time.perf_counter() - begin > seconds:
            break
    return best
