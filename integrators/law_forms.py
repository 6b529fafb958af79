"""Canonical forms of a law at given numbers: ψ over (ε, X), φ* over the forces or φ over the rates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from sympy import Expr

from ..errors import DeclarationError, InputError
from ..potentials import Law
from ..potentials.conic_form import Frame, conic_expression, split, weighted_term
from ..potentials.evaluate import evaluate
from .canonical import CanonicalForm, canonical_form, empty_form
from .convexity import worst_direction
from .declared import DeclaredStep, components, packed_layout

__all__ = ["LawForms", "law_forms"]


@dataclass(frozen=True)
class LawForms:
    """`energy` over (ε, X, aux); `flow` (None if elastic) over (Y, aux) if `dual`, else (rates, aux), on the places `moved` of (ε, X)."""

    energy: CanonicalForm
    flow: CanonicalForm | None
    dual: bool
    moved: tuple[int, ...]


def law_forms(step: DeclaredStep, numbers: Mapping[Any, Any]) -> LawForms:
    """Forms at `numbers`, which map parameters and the coefficients of `step` to values.

    Raises `DeclarationError` for a term without conic form and `InputError` for values at which ψ or φ* is not convex or f(0) > 0.
    """
    law = step.law
    layout, size = packed_layout(law)
    places = {law.observable: 0, **{v: 6 + layout[v.name][0] for v in law.internal}}
    energy = _canonical(law, "psi", step.energy, (), places, 6 + size, numbers)
    if step.finite == 0 and not step.surfaces:
        return LawForms(energy, None, True, ())
    force_places: dict[Any, int] = {}
    moved: list[int] = []
    for variable in (law.observable, *law.internal):
        symbol = law.forces.get(variable)
        if symbol is not None:
            force_places[symbol] = len(moved)
            moved += range(places[variable], places[variable] + components(variable))
    _check_surfaces(law, step.word, step.surfaces, force_places, numbers)
    flow = _canonical(law, step.word, step.finite, step.surfaces, force_places, len(moved), numbers)
    return LawForms(energy, flow, law.phi is None, tuple(moved))


def _check_surfaces(law: Law, word: str, surfaces: tuple[Expr, ...], places: Mapping[Any, int], numbers: Any) -> None:
    zero = {s: np.zeros(components(s)) if components(s) > 1 else 0.0 for s in places}
    for f in surfaces:
        value = float(evaluate(f, {**numbers, **zero}))
        if not value <= 0.0:
            raise InputError(
                f"law '{law.name}': f = {value:g} at zero force in {word}; zero force would lie outside the elastic domain {f} <= 0"
            )


def _canonical(
    law: Law, word: str, finite: Expr, surfaces: tuple[Expr, ...], places: Mapping[Any, int], size: int, numbers: Any
) -> CanonicalForm:
    """`finite` + indicator of {surfaces ≤ 0} over the packed vector."""
    import cvxpy

    where = f"law '{law.name}', {word}"
    frame = Frame(places, size, numbers)
    quadratic, rest = split(finite, frame)
    if not (np.isfinite(quadratic.Q).all() and np.isfinite(quadratic.g).all()):
        raise InputError(
            f"law '{law.name}': these values make {word} infinite; Poisson ratios lie strictly between -1 and 1/2"
        )
    worst = worst_direction(quadratic.Q)
    if worst is not None:
        names = [str(v) for v, start in places.items() if np.abs(_part(worst[1], v, start)).max() > 1e-6]
        tail = "; softening is not modelled" if word == "psi" else ""
        raise InputError(f"law '{law.name}': {word} is not convex in {', '.join(names)} for these values{tail}")
    z = cvxpy.Variable(size)
    form = None
    for marked in (True, False):
        frame = Frame(places, size, numbers, marked)
        constraints: list[Any] = []
        objective: Any = cvxpy.Constant(0.0)
        for weight, term in rest:
            objective = objective + weighted_term(weight, term, frame, z, constraints, inside=word != "phi_star")
            if marked and not objective.is_convex():
                raise DeclarationError(
                    f"{where}: the term {weight:g} * ({term}) is not convex by the rules of its atoms"
                )
        for f in surfaces:
            function = conic_expression(frame.substituted(f), frame, z, constraints)
            if marked and not (isinstance(function, float) or function.is_convex()):
                raise DeclarationError(f"{where}: the function f = {f} is not convex by the rules of its atoms")
            if not isinstance(function, float):
                constraints.append(function <= 0.0)
        if marked:
            continue
        form = canonical_form(objective, constraints, [z], where) if constraints or rest else empty_form(size)
    assert form is not None
    P, q = form.P.copy(), form.q.copy()
    P[:size, :size] += 0.5 * (quadratic.Q + quadratic.Q.T)
    q[:size] += quadratic.g
    return CanonicalForm(P, q, form.E, form.e, form.G, form.h, form.cones, size, quadratic.c)


def _part(vector: Any, variable: Any, start: int) -> Any:
    return vector[start : start + components(variable)]
