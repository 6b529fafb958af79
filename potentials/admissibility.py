"""Admissibility of a law by composition rules.

The Clausius–Duhem inequality follows when ψ is convex and φ* is convex, non-negative and zero at zero. A sum of convex atoms with
non-negative coefficients is convex; λ/2 (tr T)² + μ T:T is convex if μ ≥ 0 and 3λ + 2μ ≥ 0. The indicator of {f ≤ 0} has the wanted
properties if f is convex and f(0) ≤ 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sympy import Dummy, Expr, factor, sympify

from .derivative import invariants_of, is_constant
from .energy_terms import sort_energy
from .invariants import NormLeaf, TraceLeaf
from .law import Law
from .scalars import ForceScalar, ScalarVariable

__all__ = ["AdmissibilityReport", "check"]


@dataclass(frozen=True)
class AdmissibilityReport:
    """`admissible`: True (proved, under `conditions` where values are not given), False (refuted), None (undecided); `reasons` in order."""

    admissible: bool | None
    conditions: tuple[str, ...]
    reasons: tuple[str, ...]

    def text(self) -> str:
        """Readable report."""
        word = {True: "admissible", False: "not admissible", None: "undecided"}[self.admissible]
        lines = [word + (" under the conditions:" if self.conditions else "")]
        return "\n".join([*lines, *(f"  {c}" for c in self.conditions), "because:", *(f"  {r}" for r in self.reasons)])


def check(law: Law, values: Mapping[str, Any]) -> AdmissibilityReport:
    """Check the law; with `values` the conditions are decided, without they are listed."""
    conditions: list[tuple[str, Expr]] = []
    reasons: list[str] = []
    open_ends = _energy(law, conditions, reasons) + _flow(law, conditions, reasons)
    still: list[str] = []
    refuted: list[str] = []
    # bounds and unknown names are checked as for an update, but values may be partial
    known = {p.name: p for p in law.parameters}
    table = {known[n]: sympify(float(v)) for n, v in values.items() if n in known}
    missing = [n for n in values if n not in known]
    if missing:
        law.values(values)
    for p, number in table.items():
        if not p.lower <= float(number) <= p.upper:
            refuted.append(f"{p.name} = {float(number):g} lies outside [{p.lower:g}, {p.upper:g}]")
    for text, expression in conditions:
        value: Any = expression.xreplace(table)
        if value.is_number and not (value.is_finite and value.is_real):
            refuted.append(f"{text} is not finite for the values given")
        elif value.is_number:
            if not bool(value >= 0):
                refuted.append(f"{text} fails: the left side is {float(value):g}")
        elif text not in still:
            still.append(text)
    reasons += [f"refuted: {r}" for r in refuted]
    reasons += [f"undecided: {o}" for o in open_ends]
    for variable in law.internal:
        if variable not in law.forces:
            reasons.append(f"note: '{variable}' cannot evolve, phi_star does not mention its force")
    admissible = False if refuted else (None if open_ends else True)
    return AdmissibilityReport(admissible, tuple(still), tuple(reasons))


def _condition(conditions: list[tuple[str, Expr]], expression: Expr) -> None:
    if expression.is_nonnegative is not True:
        conditions.append((f"{factor(expression)} >= 0", expression))


def _energy(law: Law, conditions: list[tuple[str, Expr]], reasons: list[str]) -> list[str]:
    terms = sort_energy(law)
    for tensor, (lam, mu) in terms.quadratic.items():
        _condition(conditions, mu)
        if lam != 0:
            _condition(conditions, 3 * lam + 2 * mu)
        reasons.append(f"psi: isotropic quadratic form in {tensor}, convex under its conditions")
    for weight, argument in terms.positive:
        _condition(conditions, weight)
        reasons.append(f"psi: pos({argument})**2, square of a convex non-negative function of an affine one")
    for weight, tensor in terms.spectral:
        _condition(conditions, weight)
        reasons.append(f"psi: inner(pos(.), pos(.)) of {tensor}, squared distance to the negative semidefinite tensors")
    for weight, variable in terms.scalars:
        _condition(conditions, weight)
        reasons.append(f"psi: {variable}**2, convex")
    open_ends = []
    for term in terms.rest:
        generators = [*invariants_of(term), *term.atoms(ScalarVariable)]
        linear = len(generators) == 1 and isinstance(generators[0], (TraceLeaf, ScalarVariable))
        if linear and is_constant(term / generators[0]):
            reasons.append(f"psi: {term}, linear")
        else:
            open_ends.append(f"psi: no rule for the term {term}")
    return open_ends


def _flow(law: Law, conditions: list[tuple[str, Expr]], reasons: list[str]) -> list[str]:
    open_ends = []
    for j, function in enumerate(law.surfaces, start=1):
        leaves = invariants_of(function)
        forces = sorted(function.atoms(ForceScalar), key=str)
        generators: list[Expr] = [*leaves, *forces]
        dummies = [Dummy(f"g{i}", real=True) for i in range(len(generators))]
        opened: Any = function.xreplace(dict(zip(generators, dummies, strict=True)))
        for dummy, generator in zip(dummies, generators, strict=True):
            slope = opened.diff(dummy)
            if (
                slope.atoms(Dummy)
                or not is_constant(slope)
                or not isinstance(generator, (NormLeaf, TraceLeaf, ForceScalar))
            ):
                open_ends.append(f"phi_star: no rule for {generator} in inequality {j}")
            elif isinstance(generator, NormLeaf):
                _condition(conditions, slope)
        at_zero = -opened.xreplace(dict.fromkeys(dummies, 0))
        conditions.append((f"{factor(at_zero)} >= 0", at_zero))
        reasons.append(
            f"phi_star: inequality {j} is a sum of norms and linear terms, convex; f(0) <= 0 puts zero in the domain"
        )
    if not law.surfaces:
        reasons.append("phi_star: none, the law is elastic")
    return open_ends
