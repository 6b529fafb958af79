"""A step for a wanted accuracy: the cheapest setting that is known to meet it, and the check that it did.

The accuracy is the error of the stress against the exact answer of the implicit step, relative to the largest stress of the call. (What
the length of the step costs is another error, see `fenchel tradeoff law`.) Settings come from the front that `fenchel tradeoff law` kept
for this law on this machine, else from those shipped for its method. With E the answer of the general engine, δ its duality gap and L the
largest eigenvalue of ∂²ψ/∂ε²,

    |σ − σ_exact| ≤ |σ − E| + √(2 L δ),

since ½ (X − X*)·ψ_XX (X − X*) ≤ δ and ψ_εX ψ_XX⁻¹ ψ_Xε ≤ ψ_εε for convex ψ. In double precision the root ends at about 1e-8 of the stress;
finer accuracies are confirmed by the residual of E's optimality conditions instead (`certificate.natural_map`).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cache import content_hash
from ..errors import ConvergenceError, FenchelError, InputError
from ..front import Front, Measured, checked_accuracy, kept_front, shipped_front
from ..potentials import Law
from ..potentials.derivative import second_derivative
from .certificate import natural_map, solution_gap
from .dimension import SPACE
from .general_update import GeneralUpdate
from .packing import StatePacking
from .step_result import StepResult
from .strain_energy import operator_matrices
from .thermal import thermal_input

__all__ = ["AccurateUpdate", "Bound", "Choice", "UncheckedWarning", "choose", "error_bound", "law_key", "path_bound"]

Array = NDArray[np.float64]
SAMPLE = 8  # points of a call that are checked
RESIDUAL = 1e-11  # of the trusted answer, where its gap is below what double precision can show


class UncheckedWarning(UserWarning):
    """An answer that its own method calls converged could not be checked by the cone program."""


@dataclass(frozen=True)
class Choice:
    """The `setting` (solver, and tolerance or precision where it has one), the `expected` error, and in words where both come from."""

    accuracy: float
    setting: Mapping[str, Any]
    expected: float
    source: str
    why: str

    def __str__(self) -> str:
        return self.why


@dataclass(frozen=True)
class Bound:
    """Errors of the stress at checked points, relative: `difference` to the trusted answer, `gap` bound of the latter's own error (n,),
    `residual` of its optimality conditions; `unanswered` more points, of which the trusted engine has no answer."""

    difference: Array
    gap: Array
    residual: float
    unanswered: int = 0

    def confirms(self, accuracy: float) -> bool:
        """True if no checked point errs more."""
        total = float((self.difference + self.gap).max(initial=0.0))
        if total <= accuracy:
            return True
        return self.residual <= RESIDUAL and float(self.difference.max(initial=0.0)) <= accuracy


def law_key(law: Law, dimension: str, formulation: str = "strain") -> str:
    """Key of a law's front in the user's cache."""
    return content_hash(law.text, dimension, formulation)


def choose(law: Law, solver: str, dimension: str, formulation: str, accuracy: float) -> Choice:
    """The cheapest known setting; `solver` is the method that the law's structure gives. `InputError` where none is known to be so
    accurate."""
    accuracy = checked_accuracy(accuracy)
    kept = kept_front("law", law_key(law, dimension, formulation))
    if kept is not None:
        front, source = kept, "the front measured on this machine for this law"
    else:
        front, source = _shipped(solver), f"the front shipped for method '{solver}'"
    front = _usable(front, dimension, formulation)
    point = front.cheapest(accuracy)
    if point is None:
        raise InputError(
            f"law '{law.name}': accuracy = {accuracy:g}: the finest that is known for it is {front.finest:.1e} ({source}); ask for that"
        )
    return Choice(
        accuracy, dict(point.setting), float(point.error or 0.0), source, _words(point, front, accuracy, source)
    )


def _shipped(solver: str) -> Front:
    fronts = shipped_front("law")["methods"]
    return Front.from_dict(fronts[solver if solver in fronts else "general"])


def _usable(front: Front, dimension: str, formulation: str) -> Front:
    """Without what cannot be compiled here, or has no tangent: nobody who asks for an accuracy means to lose it."""

    def takes(setting: Mapping[str, Any]) -> bool:
        if setting.get("precision") == "float32" and (formulation != "strain" or dimension != "3d"):
            return False
        return setting["solver"] not in ("cvxpy", "explicit")

    return replace(front, points=tuple(p for p in front.points if takes(p.setting)))


def _words(point: Measured, front: Front, accuracy: float, source: str) -> str:
    others = [p for p in front.points if p is not point and p.error is not None and p.error <= accuracy]
    beside = min(others, key=lambda p: p.cost, default=None)
    text = f"{point.name}: error up to {point.error or 0.0:.0e}, asked {accuracy:g}; from {source}"
    if beside is not None:
        text += f"; next is {beside.name} at {beside.cost / point.cost:.2f} times its time"
    return text


# -- the check -----------------------------------------------------------------------------------------------------------------


@dataclass
class AccurateUpdate:
    """A compiled step with the setting that was chosen for an accuracy; the same call as the step, and everything else that it has.

    Calls 1, 2, 4, 8, … are checked at up to eight of their points, so that the checks of a long run cost next to nothing, a path that
    `drive` follows at up to eight of its rows; `verify` checks a call at will. Where a check fails the call is done again by the exact
    setting, and from then on so is every call: `.fallbacks` counts them. `ConvergenceError` if that does not meet the accuracy either,
    `UncheckedWarning` where the cone program has no answer to check by.
    """

    inner: Any
    choice: Choice
    exact: Any
    calls: int = 0
    checks: int = 0
    fallbacks: int = 0
    worst: float = 0.0  # largest error met in a check, relative
    unchecked: str = ""  # why calls cannot be checked, if so
    last: Bound | None = field(default=None, repr=False)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "inner":
            raise AttributeError(name)
        return getattr(self.inner, name)

    @cached_property
    def _trusted(self) -> GeneralUpdate | None:
        try:
            return GeneralUpdate.of(self.inner.law, False)
        except FenchelError as problem:
            self.unchecked = f"the step has no cone program to check it by: {problem}"
            return None

    def __call__(
        self,
        driven: Any,
        state: Mapping[str, Any] | None = None,
        dt: float = 1.0,
        *,
        certify: bool = False,
        **values: Any,
    ) -> StepResult:
        """See `Update.__call__`."""

        def step(update: Any) -> StepResult:
            found: StepResult = update(driven, state, dt, certify=certify, **values)
            return found

        self.calls += 1
        if self.calls & (self.calls - 1):
            return step(self.inner)
        return self._confirmed(step, lambda out: self.verify(out, state, dt, **values), lambda out: len(out.status))

    def follow(
        self,
        drive: Callable[[Any], Any],
        initial_state: Mapping[str, Any] | None,
        steps: Array,
        **values: Any,
    ) -> Any:
        """`drive(update)`, the history of a path, checked in the steps of up to eight of its rows, evenly spread."""

        def bound(history: Any) -> Bound:
            assert self._trusted is not None
            return path_bound(self._trusted, history, initial_state, steps, points=SAMPLE, **values)

        return self._confirmed(drive, bound, lambda history: len(history.eps))

    def _confirmed(self, run: Callable[[Any], Any], bound: Callable[[Any], Bound], size: Callable[[Any], int]) -> Any:
        """What `run` gives of the chosen setting if its check confirms it, else of the exact one."""
        out = run(self.inner)
        if self._trusted is None or size(out) == 0:
            return out
        try:
            accepted = self._accepts(bound(out))
        except ConvergenceError as problem:
            # the step has converged by its own method; that nobody could check it must not go unsaid
            self.unchecked = str(problem)
            warnings.warn(f"{problem}: this answer is not checked", UncheckedWarning, stacklevel=3)
            return out
        if accepted:
            return out
        self.fallbacks += 1
        out = run(self.exact)
        if not self._accepts(bound(out)):
            raise ConvergenceError(
                f"law '{self.inner.law.name}': accuracy {self.choice.accuracy:g} asked, error {self.worst:.1e} found, and the exact "
                "setting is no better: the data are too ill-conditioned for it; ask for less"
            )
        self.inner = self.exact
        return out

    def _accepts(self, bound: Bound) -> bool:
        self.checks += 1
        self.last = bound
        self.worst = max(self.worst, float(bound.difference.max(initial=0.0)))
        return bound.confirms(self.choice.accuracy)

    def verify(
        self,
        out: StepResult,
        state: Mapping[str, Any] | None = None,
        dt: float = 1.0,
        *,
        points: int = SAMPLE,
        **values: Any,
    ) -> Bound:
        """The error of a step that was made from `state`, at up to `points` of its points, evenly spread."""
        if self._trusted is None:
            raise InputError(self.unchecked)
        return error_bound(self._trusted, self.inner, out, state, dt, points=points, partial=True, **values)


def error_bound(
    trusted: GeneralUpdate,
    update: Any,
    out: StepResult,
    state: Mapping[str, Any] | None,
    dt: float = 1.0,
    *,
    points: int | None = None,
    partial: bool = False,
    **values: Any,
) -> Bound:
    """The error of the stress of a step of any method, formulation and dimension, bounded by the cone program's answer and its gap.

    `trusted` is `GeneralUpdate.of(law, False)`; `out` is the answer of `update` from the old `state`. Raises `ConvergenceError` where the
    program finds no answer, if `partial` only where it finds none at all.
    """
    shape = getattr(update, "dimension", SPACE)
    count = len(out.status)
    rows = _sample(count, points)
    heat, rest = thermal_input(trusted.law, values, count)
    temperature = None
    if trusted.law.temperature is not None:
        temperature = np.broadcast_to(heat.temperature, (count,))[rows]
    assert out.strain is not None
    eps = shape.embedded(np.asarray(out.strain, dtype=float))[rows]
    old = _old_rows(trusted.law, shape, state, count)[rows]
    stress = np.asarray(out.stress, dtype=float)
    return _bound(trusted, shape, eps, stress[rows], old, dt, rest, temperature, _largest(stress), partial)


def path_bound(
    trusted: GeneralUpdate,
    history: Any,
    initial_state: Mapping[str, Any] | None,
    steps: Array,
    *,
    points: int | None = None,
    **values: Any,
) -> Bound:
    """The largest errors of the stress in steps of a path: of sampled rows of a `History`, each from the state of the row before.

    `steps` [s] (n,) are the time steps; what an error of one row does to the rows after it is not in the bound. Raises `ConvergenceError`
    where the program finds an answer at none of them.
    """
    law, packing = trusted.law, StatePacking.of(trusted.law)
    count = len(history.eps)
    named = {**history.state, law.observable.name: history.eps}
    after = packing.pack({name: named[name] for name in packing.layout}, count)
    before = np.vstack([packing.pack(initial_state, 1), after[:-1]])
    heat, rest = thermal_input(law, values, count)
    rows = _sample(count, points)
    temperature = None if law.temperature is None else np.broadcast_to(heat.temperature, (count,))
    scale = _largest(history.sig)
    found, failed = [], None
    for row in rows:
        heat_here = None if temperature is None else temperature[[row]]
        at = history.eps[[row]], history.sig[[row]], before[[row]], float(steps[row]), rest, heat_here
        try:
            found.append(_bound(trusted, SPACE, *at, scale, False))
        except ConvergenceError as problem:
            failed = problem
    if failed is not None and not found:
        raise failed
    return Bound(
        np.concatenate([b.difference for b in found]),
        np.concatenate([b.gap for b in found]),
        max((b.residual for b in found), default=0.0),
        len(rows) - len(found),
    )


def _sample(count: int, points: int | None) -> NDArray[np.intp]:
    if points is None or points >= count:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, points).astype(np.intp))


def _largest(stress: Array) -> float:
    return max(
        float(np.sqrt((np.asarray(stress, dtype=float) ** 2).sum(axis=1)).max(initial=0.0)), np.finfo(float).tiny
    )


def _bound(
    trusted: GeneralUpdate,
    shape: Any,
    eps: Array,
    stress: Array,
    old: Array,
    dt: float,
    values: Mapping[str, Any],
    temperature: Array | None,
    scale: float,
    partial: bool,
) -> Bound:
    """Errors of `stress` at points with the embedded strains `eps` and the packed old states `old`, relative to `scale` [Pa]; if
    `partial`, of those of which the program has an answer."""
    law = trusted.law
    numbers = law.admissible_values(values)
    found = trusted.solve(eps, old, dt, numbers, temperature, tangent=False)
    answered = found.status == 0
    if not (answered.any() if partial else answered.all()):
        raise ConvergenceError(
            f"law '{law.name}': the cone program that checks the step finds no answer at {(~answered).sum()} of {len(eps)} points"
        )
    best = found.slopes[:, list(shape.places)]
    if stress.shape[1] < best.shape[1]:  # of a relaxed dimension the given components
        best = best[:, list(shape.given)]
    known: dict[Any, Any] = {p: numbers[p.name] for p in law.parameters} | {law.observable: eps}
    stiffness = _stiffness(law, known, old, temperature)
    difference = np.sqrt(((stress - best) ** 2).sum(axis=1)) / scale
    gap = np.sqrt(2.0 * stiffness * np.maximum(solution_gap(found, len(eps)), 0.0)) / scale
    residual = max(
        (float(natural_map(part)[answered[part.points]].max(initial=0.0)) for part in found.parts), default=0.0
    )
    return Bound(difference[answered], gap[answered], residual, int((~answered).sum()))


def _old_rows(law: Law, shape: Any, state: Mapping[str, Any] | None, count: int) -> Array:
    """Old states in packed rows of three dimensions."""
    packing = StatePacking.of(law)
    if state is None:
        return packing.pack(None, count)
    size = shape.size
    named = {}
    for name, (_, length) in packing.layout.items():
        value = np.asarray(state[name], dtype=float)
        named[name] = shape.embedded(np.broadcast_to(value, (count, size))) if length == 6 else value
    return packing.pack(named, count)


def _stiffness(law: Law, known: Mapping[Any, Any], old: Array, temperature: Array | None) -> float:
    """Largest eigenvalue of ∂²ψ/∂ε² at the points [Pa]."""
    here = dict(known)
    for variable, (start, length) in zip(law.internal, StatePacking.of(law).layout.values(), strict=False):
        here[variable] = old[:, start] if length == 1 else old[:, start : start + length]
    if temperature is not None:
        here[law.temperature] = temperature
    operator = second_derivative(law.energy, law.observable, law.observable)
    if operator.extremes or operator.sandwiched:
        return np.inf  # not written as matrices: the residual has to confirm the answer
    matrices = operator_matrices(operator, here, len(old))
    return float(np.linalg.eigvalsh(matrices).max(initial=0.0))
