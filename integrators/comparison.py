"""One path through every formulation and solver that a law takes: do they agree, how fast, how well determined, and which suits best.

Differences are relative: of stress to the largest stress of the reference, of strain to its largest strain, of an internal variable to the
larger of its own largest value and the largest strain. The reference is the run with the smallest certified duality gap, gaps below 1e-12
counting as equal (then the first of the list). A gap is relative to the energy of its row, but to no less than 1e-3 σ_max ε_max.

Runs agree if the stress differs by no more than the tolerance, and strain and internal variables by the tolerance times the largest
condition number that the unknowns of the formulation are solved with (not at all where it is infinite: the strain is not determined
there), plus what the method itself promises: for cvxpy twice the error √(2 C g) that a gap g of 1e-8 W leaves, at which clarabel stops
(W the energy stored and lost, C the stiffness; residuals of the same size add to it); for the explicit scheme ten times its tolerance and
the error that the steps of implicit Euler have here.

Which formulation suits: (1) one that cannot follow the path, or disagrees, loses; (2) of two that follow, the one with fewer unknowns
per step wins (strain-driven: components of prescribed stress; stress-driven: of prescribed strain), unless its fastest solver takes
more than four times the time of the other's; (3) with as many unknowns, the one whose matrix has less than a tenth of the condition
number, else the faster.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..potentials import Law
from .comparison_runs import CANDIDATES, FORESEEN, SAMPLED, Attempt, attempt, follow_path, sampled_attempt
from .comparison_verdict import FormulationFigures, Verdict, judge
from .history import History, Plan, path_plan, time_steps
from .path_certificate import PathData, gaps_or_none, path_tangents, worst_condition
from .path_file import StrainStressPath, read_path
from .step_order import StepOrder, measure_order
from .summary import as_html, as_text
from .thermal import thermal_input
from .update import build_update

__all__ = ["Comparison", "Run", "compare"]

ROUNDING = 1e-12
FLOOR = 1e-3
CLARABEL = 1e-8
EXPLICIT = 1e-5


@dataclass(frozen=True)
class Run:
    """One formulation and solver on the path; figures are None where it failed. Differences are relative to the reference (see above);
    `rows` compared; `allowed` the largest difference of stress that counts as agreement; `time_per_step` [s] process time of a warm run,
    the call's own overhead shared by the rows; `iterations` linear systems per step, for the unknown components."""

    formulation: str
    solver: str
    why: str
    failure: str = ""
    rows: int = 0
    stress: float | None = None
    strain: float | None = None
    internal: Mapping[str, float] = field(default_factory=dict)
    gap: float | None = None
    time_per_step: float | None = None
    iterations: float | None = None
    allowed: float | None = None
    agrees: bool | None = None


@dataclass(frozen=True)
class Comparison:
    """`runs` in a fixed order, `reference` the place of the one that the others are measured against (None if no run followed the path) and
    `trusted` why; `scale` [Pa] the largest stress; `order` in the step size; `verdict` on the formulations."""

    law: str
    rows: int
    runs: tuple[Run, ...]
    reference: int | None
    trusted: str
    tolerance: float
    scale: float
    order: StepOrder
    verdict: Verdict

    @property
    def agree(self) -> bool:
        """True if a run followed the path and all that did agree."""
        return self.reference is not None and all(run.agrees is not False for run in self.runs)

    def _summary(self) -> tuple[str, list[tuple[str, ...]]]:
        agree = "no run follows the path" if self.reference is None else ("agree" if self.agree else "DISAGREE")
        title = f"{self.law}, {self.rows} rows, {len(self.runs)} runs: {agree}; {self.verdict.headline}"
        return title, [_RUN_HEADS, *(_run_cells(run, k == self.reference) for k, run in enumerate(self.runs))]

    def __repr__(self) -> str:
        return as_text(*self._summary())

    def _repr_html_(self) -> str:
        title, rows = self._summary()
        return as_html(title, rows[1:], _RUN_HEADS)


_RUN_HEADS = ("run", "rows", "stress", "gap", "µs per step", "agrees")


def _run_cells(run: Run, reference: bool) -> tuple[str, ...]:
    """A run in a row: differences relative to the reference (*), or why it failed."""
    name = f"{'* ' if reference else ''}{run.formulation} {run.solver}"
    if run.failure:
        return name, "", "", "", "", run.failure if len(run.failure) < 60 else run.failure[:57] + "..."
    figures = ("" if x is None else f"{x:.1e}" for x in (run.stress, run.gap))
    time = "" if run.time_per_step is None else f"{run.time_per_step * 1e6:.3g}"
    return name, str(run.rows), *figures, time, {True: "yes", False: "NO", None: ""}[run.agrees]


def compare(
    law: Law,
    path: StrainStressPath | str | Path,
    values: Mapping[str, Any],
    *,
    tolerance: float = 1e-8,
    sampled_rows: int = 10,
    parts: tuple[int, ...] = (1, 2, 4, 8, 16),
    progress: Callable[[float, str], None] | None = None,
) -> Comparison:
    """Follow `path` (a file or what `read_path` returns) by every method, with parameter `values` by name.

    `tolerance` of the relative difference of stress; `sampled_rows` single steps by cvxpy and by the explicit scheme; `parts` into which
    the steps are cut for the order, 1, 2, 4, … (three of them at most for a law without generated step); `progress` is told the share that
    is done and what comes next. Raises `InputError` for bad input; a method that fails is a row of the result.
    """
    plan = path if isinstance(path, StrainStressPath) else read_path(path)
    data = _checked(law, plan, values, tolerance, sampled_rows, parts)
    tell = progress or (lambda _share, _what: None)
    attempts = _attempts(law, plan, values, tell)
    gaps = []
    for k, one in enumerate(attempts):
        tell(0.5 + 0.2 * k / len(attempts), f"duality gap of {one.formulation} {one.solver}")
        gaps.append(None if one.history is None else _largest_gap(data, one.history))
    reference, trusted = _trusted(attempts, gaps)
    order = StepOrder((), (), None, None, "no order: no run followed the path")
    conditions: dict[str, float | None] = {"strain": None, "stress": None}
    promise: dict[str, float] = {}
    if reference is not None:
        history = attempts[reference].history
        assert history is not None  # it is the reference
        tell(0.7, "condition")
        tangents = _tangents(law, data, history)
        conditions = _conditions(plan, tangents)
        tell(0.75, "order of accuracy")
        order = _order(attempts, reference, plan, values, parts, conditions)
        promise = {"cvxpy": _clarabel_error(history, tangents), "explicit": EXPLICIT + 2.0 * (order.error or 0.0)}
        for k, solver in enumerate(SAMPLED):
            tell(0.85 + 0.07 * k, f"single steps by {solver}")
            attempts.append(sampled_attempt(data, solver, history, sampled_rows))
            gaps.append(None)
    runs = tuple(
        _measured(
            law, one, gap, attempts, reference, tolerance + promise.get(one.solver, 0.0), conditions[one.formulation]
        )
        for one, gap in zip(attempts, gaps, strict=True)
    )
    figures = tuple(_figures(formulation, runs, plan, conditions[formulation]) for formulation in ("strain", "stress"))
    scale = 0.0 if reference is None else _largest(attempts[reference].history)[0]
    return Comparison(law.name, len(plan.time), runs, reference, trusted, tolerance, scale, order, judge(*figures))


def _checked(
    law: Law, path: StrainStressPath, values: Mapping[str, Any], tolerance: float, sampled: int, parts: tuple[int, ...]
) -> PathData:
    """Refuse here what would make every run fail alike."""
    if not isinstance(law, Law):
        raise InputError(f"compare takes a Law, not {type(law).__name__}")
    if not 0.0 < tolerance < 1.0:
        raise InputError(f"compare: tolerance {tolerance:g} must lie between 0 and 1")
    if sampled < 1:
        raise InputError(f"compare: {sampled} rows for cvxpy and the explicit scheme; take 1 or more")
    if not parts or any(part != 2**k for k, part in enumerate(parts)):
        raise InputError(f"compare: parts {parts} must be 1, 2, 4, ...")
    count = len(path.time)
    given = dict(values)
    if path.temperature is not None:
        if law.temperature is None:
            raise InputError(f"law '{law.name}' has no temperature; leave the column T out")
        given[law.temperature.name] = path.temperature
    _, rest = thermal_input(law, given, count)
    law.admissible_values(rest)
    path_plan(path.control, path.targets, path.trace, path.trace_targets, False)
    steps = time_steps(path.time, count)
    return PathData(law, values, steps, None if path.temperature is None else np.asarray(path.temperature))


def _attempts(law: Law, path: StrainStressPath, values: Mapping[str, Any], tell: Any) -> list[Attempt]:
    found: list[Attempt] = []
    total = sum(len(solvers) for _, solvers in CANDIDATES)
    for formulation, solvers in CANDIDATES:
        taken: set[str] = set()
        for solver in solvers:
            if solver in taken:
                continue
            tell(0.5 * len(found) / total, f"{formulation} {solver}")
            one = attempt(law, formulation, solver, path, values)
            taken.add(one.solver)
            found.append(one)
    return found


def _largest(history: History | None) -> tuple[float, float]:
    """(largest stress [Pa], largest strain) of a history."""
    assert history is not None
    return float(np.abs(history.sig).max(initial=0.0)), float(np.abs(history.eps).max(initial=0.0))


def _largest_gap(data: PathData, history: History) -> float | None:
    gaps = gaps_or_none(data, history)
    if gaps is None:
        return None
    stress, strain = _largest(history)
    floor = FLOOR * stress * strain
    energies = np.maximum(np.abs(history.psi), floor if floor > 0.0 else 1.0)
    return float((np.abs(gaps) / energies).max(initial=0.0))


def _trusted(attempts: list[Attempt], gaps: list[float | None]) -> tuple[int | None, str]:
    certified = [(max(gap, ROUNDING), k) for k, gap in enumerate(gaps) if gap is not None]
    if certified:
        _, best = min(certified)
        text = f"its largest duality gap, {gaps[best]:.1e} of the energy, is the smallest of {len(certified)} certified runs"
        return best, text + (" (below 1e-12 they count as equal)" if gaps[best] < ROUNDING else "")  # type: ignore[operator]
    followed = [k for k, one in enumerate(attempts) if one.history is not None]
    if followed:
        return followed[0], "it is the first that followed the path; no run could be certified"
    return None, "no run followed the path"


def _order(
    attempts: list[Attempt],
    reference: int,
    path: StrainStressPath,
    values: Any,
    parts: tuple[int, ...],
    conditions: Mapping[str, float | None],
) -> StepOrder:
    """By the reference if its steps are generated, else by another run that is: the steps are many."""
    generated = [one for one in attempts if one.history is not None and one.solver not in ("general", "conic")]
    same = [one for one in generated if one.formulation == attempts[reference].formulation]
    fast = attempts[reference] if attempts[reference] in generated else next(iter(same or generated), None)
    chosen = fast or attempts[reference]
    count = len(parts) if fast is not None else 3
    determined = conditions["strain"] is None or bool(np.isfinite(conditions["strain"]))
    return measure_order(
        lambda cut: follow_path(chosen.update, cut, values), path, tuple(parts[:count]), strains=determined
    )


def _tangents(law: Law, data: PathData, history: History) -> Any:
    """Consistent tangents along the reference, None where they are not to be had."""
    try:
        return path_tangents(data, build_update(law), history)
    except FORESEEN:
        return None


def _conditions(path: StrainStressPath, tangents: Any) -> dict[str, float | None]:
    if tangents is None or not np.isfinite(tangents).all():
        return {"strain": None, "stress": None}
    return {name: worst_condition(_planned(path, name), tangents, name == "stress") for name in ("strain", "stress")}


def _planned(path: StrainStressPath, formulation: str) -> Plan:
    return path_plan(path.control, path.targets, path.trace, path.trace_targets, formulation == "stress")


def _clarabel_error(history: History, tangents: Any) -> float:
    """2 √(2 C g) over the largest stress, g = 1e-8 W."""
    stress, strain = _largest(history)
    if not stress > 0.0:
        return 0.0
    stiffness = stress / max(strain, 1e-300)
    if tangents is not None and np.isfinite(tangents).all():
        stiffness = float(np.linalg.norm(tangents, ord=2, axis=(1, 2)).max())
    work = np.abs(np.diff(history.eps, axis=0, prepend=0.0) * history.sig).sum(axis=1)
    energy = float((np.abs(history.psi) + work).max())
    return 2.0 * float(np.sqrt(2.0 * stiffness * CLARABEL * energy)) / stress


def _measured(
    law: Law,
    one: Attempt,
    gap: float | None,
    attempts: list[Attempt],
    reference: int | None,
    allowed: float,
    condition: float | None,
) -> Run:
    if one.history is None or reference is None:
        return Run(one.formulation, one.solver, one.why, one.failure)
    truth = attempts[reference].history
    assert truth is not None and one.rows is not None
    stress, strain = _largest(truth)
    d_stress = _apart(one.history.sig, truth.sig[one.rows], stress)
    d_strain = _apart(one.history.eps, truth.eps[one.rows], strain)
    internal = {}
    for variable in law.internal:
        known = truth.state[variable.name]
        own = max(float(np.abs(known).max(initial=0.0)), strain)
        internal[variable.name] = _apart(one.history.state[variable.name], known[one.rows], own)
    loose = allowed * (condition or 1.0)
    agrees = bool(d_stress <= allowed and max(d_strain, *internal.values(), 0.0) <= loose)
    return Run(
        one.formulation, one.solver, one.why, "", len(one.rows), d_stress, d_strain, internal, gap, one.time_per_step,
        one.iterations, allowed, agrees,
    )  # fmt: skip


def _apart(found: Any, truth: Any, scale: float) -> float:
    difference = float(np.abs(found - truth).max(initial=0.0))
    return difference / scale if scale > 0.0 else difference


def _figures(formulation: str, runs: tuple[Run, ...], path: StrainStressPath, condition: float | None) -> Any:
    unknowns = _planned(path, formulation).unknowns
    mine = [run for run in runs if run.formulation == formulation and run.solver not in SAMPLED]
    good = [run for run in mine if run.agrees]
    if good:
        best = min(good, key=lambda run: run.time_per_step or 0.0)
        return FormulationFigures(
            formulation, unknowns, condition, best.solver, best.time_per_step, best.iterations, best.stress, best.gap
        )
    failed = next((run.failure for run in mine if run.failure), "")
    apart = [run.stress for run in mine if run.stress is not None]
    reason = f"disagrees by {max(apart):.1e} of the stress" if apart else f"fails: {failed}"
    return FormulationFigures(formulation, unknowns, condition, failure=reason)
