"""Material-point paths under mixed control.

Per component the strain or the stress is prescribed. The unknown strains solve σ_i(ε) = σ̄_i by damped semismooth Newton with the
consistent tangent; for pure strain and stress control that system is the gradient of the convex incremental energy W_n(ε) − σ̄:ε, and
the line search uses its slope. A condition on the trace (volume strain, or mean pressure) ties the normal components that have no
prescription of their own: they share one stress. An update that is driven by the stress follows the same path with the roles turned:
the unknown stresses solve ε_i(σ) = ε̄_i, see `stress_path`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError, InputError
from .accuracy import AccurateUpdate
from .compiled_step import packed_values
from .dimension import require_space
from .explicit import ExplicitUpdate
from .general_path import follow
from .general_update import GeneralUpdate
from .path_loop import path_loop
from .prescribed_path import follow_prescribed, has_tangent
from .stress_path import stress_plan
from .stress_update import StressUpdate
from .summary import array_rows, as_html, as_text, status_words
from .thermal import thermal_input, thermal_results
from .update import Update

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["History", "Plan", "drive_arrays", "path_plan", "time_steps"]

Array = NDArray[np.float64]
TOLERANCE = 1e-12
_ARRAYS = ("eps", "sig", "psi", "status", "temperature", "entropy")
TURNS = 60


@dataclass(frozen=True)
class History:
    """Path of one material point, one row per step.

    `eps` [-] and `sig` [Pa] (n, 6), Mandel; `state` by name; `psi` [J/m³] (n,); `dissipation` accumulated [J/m³] (n,); `status` (n,); of a
    law with a temperature also `temperature` [K] (n,) and `entropy` [J/(m³ K)] (n,); `iterations` (n,) the linear systems solved for the
    unknown components of a step, None where none can be solved.
    """

    eps: Array
    sig: Array
    state: dict[str, Array]
    psi: Array
    dissipation: Array
    status: NDArray[np.int64]
    temperature: Array | None = None
    entropy: Array | None = None
    iterations: Array | None = None

    def _joined(self, rest: History) -> History:
        """The last row of this history, and the rows of another that went on from there."""

        def join(one: Array | None, other: Array | None) -> Array | None:
            return None if one is None or other is None else np.concatenate([one[-1:], other])

        arrays: dict[str, Any] = {name: join(getattr(self, name), getattr(rest, name)) for name in _ARRAYS}
        arrays["dissipation"] = np.concatenate([self.dissipation[-1:], self.dissipation[-1] + rest.dissipation])
        arrays["iterations"] = None if rest.iterations is None else np.concatenate([[0.0], rest.iterations])
        return History(
            state={name: np.concatenate([self.state[name][-1:], v]) for name, v in rest.state.items()}, **arrays
        )

    def plot(
        self,
        *,
        component: str | None = None,
        measure: str = "q",
        signs: str = "tension-positive",
        title: str = "",
    ) -> Figure:
        """A figure of the path; `history.plot().savefig("path.svg")`, and a notebook shows it.

        Four panels: stress against strain of one `component` ("11" … "12", of the tensor: shear neither doubled nor Mandel; by default the
        one that moves most), the equivalent stress against the mean stress, the volume strain, and the free energy and what was dissipated
        [J/m³] against the length of the strain path. `measure` is "q" for q = √(3 J₂) or "sqrt_J2" for √J₂; `signs` turns the axes
        ("compression-positive"). The first row is an open circle, the last a filled one. Raises `InputError` for a word that is none of
        these.
        """
        from .history_figure import history_figure

        return history_figure(self, component=component, measure=measure, signs=signs, title=title)

    def _summary(self) -> tuple[str, list[tuple[str, ...]]]:
        names = ("eps", "sig", "psi", "dissipation", "temperature", "entropy", "iterations")
        rows = array_rows({name: getattr(self, name) for name in names}, self.state)
        return f"path of {len(self.eps)} rows: {status_words(self.status)}", rows

    def __repr__(self) -> str:
        return as_text(*self._summary())

    def _repr_html_(self) -> str:
        return as_html(*self._summary())


def drive_arrays(
    update: Update | GeneralUpdate | StressUpdate | ExplicitUpdate | AccurateUpdate,
    control: Any,
    targets: Any,
    values: Mapping[str, Any],
    *,
    trace: str | None = None,
    trace_targets: Any = None,
    initial_strain: Any = None,
    initial_state: Mapping[str, Any] | None = None,
    tolerance: float = TOLERANCE,
    times: Any = None,
    temperatures: Any = None,
) -> History:
    """Follow a path, one step per row of `targets`.

    `control` (6,): True where the stress [Pa] is prescribed, False where the strain [-] is; `targets` (n, 6) the prescribed values,
    Mandel components. With `trace="eps_v"` or `"p"`, the normal components whose target is NaN share one stress, and their trace
    condition is tr ε = `trace_targets` or −tr σ/3 = `trace_targets` (n,). `tolerance` is relative to the scale of the stress (of the
    strain for an update driven by the stress). An update without tangent (cvxpy, explicit) follows a path that leaves no component unknown.
    `times` [s] (n,) give the time steps of a viscous law (1 s without them; the first row takes the first difference; (n + 1,) begin with
    the time of the initial state) and are named in messages beside the row; `temperatures` [K], one value or (n,), are for a law that has
    a temperature.
    An update for a wanted accuracy is checked in sampled rows.
    Raises `InputError`, or `ConvergenceError` with the row.
    """
    if isinstance(update, AccurateUpdate):
        more: dict[str, Any] = {"trace": trace, "trace_targets": trace_targets, "initial_strain": initial_strain}
        more |= {"initial_state": initial_state, "tolerance": tolerance, "times": times, "temperatures": temperatures}
        named = dict(values)
        if temperatures is not None and update.law.temperature is not None:
            named[update.law.temperature.name] = temperatures
        found: History = update.follow(
            lambda one: drive_arrays(one, control, targets, values, **more),
            initial_state,
            time_steps(times, len(np.array(targets, ndmin=2))),
            **named,
        )
        return found
    require_space(update, "drive")
    turned = _turned(update)
    plan = path_plan(control, targets, trace, trace_targets, turned)
    try:
        start = np.zeros(6) if initial_strain is None else np.array(initial_strain, dtype=float).reshape(6)
    except (TypeError, ValueError):
        start = np.full(6, np.nan)
    if not np.isfinite(start).all():
        raise InputError("drive: initial_strain must be six finite Mandel components")
    if turned:
        start = np.zeros(6)  # only where the search begins: the stress there is not known
    if not has_tangent(update):
        return follow_prescribed(update, plan, values, initial_state, time_steps(times, len(plan.base)), temperatures)
    if isinstance(update, GeneralUpdate) or (isinstance(update, StressUpdate) and not update.compiled_path):
        return _run_general(update, plan, values, start, initial_state, times, temperatures)
    given = dict(values)
    if temperatures is not None:
        if update.law.temperature is None:
            raise InputError(f"law '{update.law.name}' has no temperature; leave the temperatures out")
        given[update.law.temperature.name] = temperatures
    assert isinstance(update, (Update, StressUpdate))  # what has no tangent went another way
    return _run(update, plan, given, start, initial_state, tolerance, times)


@dataclass(frozen=True)
class Plan:
    """V a(base + Z y) = goal, a the answer of the update: base (n, 6), goal (n, k), Z (6, k), V (k, 6); `symmetric` if it is a gradient."""

    base: Array
    goal: Array
    z: Array
    v: Array
    symmetric: bool

    @property
    def unknowns(self) -> int:
        """Number k of unknowns of a step."""
        return self.z.shape[1]


def path_plan(control: Any, targets: Any, trace: str | None, trace_targets: Any, turned: bool) -> Plan:
    """What `drive_arrays` solves for, from its arguments; `turned` if the stress drives the update. `InputError` for what is ill-formed."""
    mask = np.asarray(control, dtype=bool)
    goals = np.array(targets, dtype=float, ndmin=2)
    if mask.shape != (6,) or goals.ndim != 2 or goals.shape[1] != 6:
        raise InputError(
            f"drive: control has shape {mask.shape} and targets {goals.shape}; they must be (6,) and (n, 6)"
        )
    free = np.zeros(6, dtype=bool)
    if trace is not None:
        if trace not in ("eps_v", "p"):
            raise InputError(f"drive: trace {trace!r} is not known; it is 'eps_v' or 'p'")
        free[:3] = np.isnan(goals[:, :3]).all(axis=0)
        if not free.any():
            raise InputError(
                f"drive: '{trace}' replaces a normal component; leave one of xx, yy, zz without prescription (NaN)"
            )
        condition = np.asarray(trace_targets, dtype=float)
        if condition.shape != (goals.shape[0],) or not np.isfinite(condition).all():
            raise InputError("drive: trace_targets must hold one finite value per row")
        goals[:, free] = 0.0
    else:
        condition = np.zeros(goals.shape[0])
    if not np.isfinite(goals).all():
        raise InputError(
            f"drive: targets hold a value that is not finite (row {int(np.argmax(~np.isfinite(goals).all(axis=1)))})"
        )
    if turned:
        return Plan(*stress_plan(mask, free, goals, trace, condition))
    return _plan(mask, free, goals, trace, condition)


def _plan(mask: NDArray[np.bool_], free: NDArray[np.bool_], goals: Array, trace: str | None, condition: Array) -> Plan:
    strain = ~mask & ~free
    base = np.where(strain, goals, 0.0)
    stressed = np.flatnonzero(mask & ~free)
    places = np.flatnonzero(free)
    unit = np.eye(6)
    columns, rows = [unit[i] for i in stressed], [unit[i] for i in stressed]
    goal = [goals[:, i] for i in stressed]
    symmetric = True
    if trace is not None:
        first = places[0]
        if trace == "eps_v":
            base[:, first] = condition - base[:, :3].sum(axis=1)
            for k, i in enumerate(stressed):
                if i < 3:
                    columns[k] = unit[i] - unit[first]
                    symmetric = False
            columns += [unit[i] - unit[first] for i in places[1:]]
        else:
            columns += [unit[i] for i in places]
            rows.append(-np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]) / 3.0)
            goal.append(condition)
            symmetric = False
        rows += [unit[i] - unit[first] for i in places[1:]]
        goal += [np.zeros(len(goals)) for _ in places[1:]]
    count = len(columns)
    z = np.array(columns).T.reshape(6, count)
    v = np.array(rows).reshape(count, 6)
    goal_rows = np.array(goal).T.reshape(len(goals), count)
    arrays = [np.ascontiguousarray(a) for a in (base, goal_rows, z, v)]
    return Plan(arrays[0], arrays[1], arrays[2], arrays[3], symmetric)


def _run(
    update: Update | StressUpdate,
    plan: Plan,
    given: Mapping[str, Any],
    start: Array,
    initial_state: Mapping[str, Any] | None,
    tolerance: float,
    times: Any,
) -> History:
    n = len(plan.base)
    heat, values = thermal_input(update.law, given, n)
    parameters = packed_values(update, values)
    pointers: Any = update.pointers
    turned = _turned(update)
    # a law that is not viscous has one row of coefficients for all steps
    steps = time_steps(times, n) if update.module.VISCOUS and times is not None else 1.0
    found = update if isinstance(update, StressUpdate) else pointers
    coefficients = found.coefficients(parameters, steps, heat.temperature)
    eps, sig, state = np.zeros((n, 6)), np.zeros((n, 6)), np.zeros((n, update.state_size))
    dissipation, turns = np.zeros(n), np.zeros(n)
    old = update.pack(initial_state, 1)[0]
    failed, residual, scale = path_loop()(
        pointers.step,
        pointers.method,
        pointers.law,
        pointers.rest,
        pointers.plan,
        coefficients,
        plan.base,
        plan.goal,
        plan.z,
        plan.v,
        plan.symmetric,
        start,
        old,
        sig if turned else eps,
        eps if turned else sig,
        state,
        dissipation,
        turns,
        tolerance,
        TURNS,
    )
    _raise_failure(update, failed, residual, scale, times, n)
    psi = update.energies(eps, state, heat.temperature, parameters)
    named = update.unpack(state)
    entropy, _ = thermal_results(update.law, heat, eps, named, values)
    temperature = None if update.law.temperature is None else np.broadcast_to(heat.temperature, (n,)).copy()
    return History(eps, sig, named, psi, dissipation, np.zeros(n, dtype=np.int64), temperature, entropy, turns)


def _run_general(
    update: GeneralUpdate | StressUpdate,
    plan: Plan,
    values: Mapping[str, Any],
    start: Array,
    initial_state: Mapping[str, Any] | None,
    times: Any,
    temperatures: Any,
) -> History:
    n = len(plan.base)
    given = None if initial_state is None else {k: np.asarray(v, dtype=float) for k, v in initial_state.items()}
    packed = update.packing.pack(given, 1)
    if temperatures is not None:
        temperatures = np.broadcast_to(np.asarray(temperatures, dtype=float), (n,))
    failed, residual, scale, found = follow(
        update, plan.base, plan.goal, plan.z, plan.v, start, packed, values, time_steps(times, n), temperatures
    )
    _raise_failure(update, failed, residual, scale, times, n)
    unpacked = update.packing.unpack(found["state"])
    status, turns = np.zeros(n, dtype=np.int64), found["iterations"]
    return History(found["eps"], found["sig"], unpacked, found["psi"], found["dissipation"], status, iterations=turns)


def _turned(update: Any) -> bool:
    """True if the update is driven by the stress."""
    return isinstance(update, StressUpdate) or (isinstance(update, GeneralUpdate) and update.turned)


def time_steps(times: Any, count: int) -> Array:
    """Differences of the times; the first row, the start of the path, and rows without times count as one unit. With one time more than
    rows the first is that of the state before the first row."""
    if times is None:
        return np.ones(count)
    steps = np.diff(np.asarray(times, dtype=float))
    if not (np.isfinite(steps).all() and (steps > 0.0).all()):
        raise InputError("drive: the times must increase from row to row")
    if len(steps) == count > 0:
        return steps
    return np.concatenate([[float(steps[0]) if steps.size else 1.0], steps])


def _raise_failure(update: Any, failed: int, residual: float, scale: float, times: Any, rows: int) -> None:
    if failed < 0:
        return
    when = (
        "" if times is None else f" (t = {float(times[failed - rows]):g})"
    )  # from the end: the first may be that of the state before
    if _turned(update):
        what = f"residual {residual:.3g} at strain scale {scale:.3g}"
        remedy = "take smaller steps, or use the strain formulation: stresses at a limit do not tell their strains"
    else:
        what = f"residual {residual:.3g} Pa at stress scale {scale:.3g} Pa"
        remedy = "take smaller steps, or the prescribed stress cannot be carried"
    raise ConvergenceError(f"law '{update.law.name}': the path fails at row {failed}{when}: {what}; {remedy}")
