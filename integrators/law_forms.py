"""Canonical forms of a law at given numbers: ψ over (ε, X), φ* over the forces or φ over the rates.

The thermal pair (∇T, −q/T) is not part of the step, whose temperature is given: terms of φ* in ∇T alone are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from sympy import Add, Expr

from ..errors import DeclarationError, InputError
from ..potentials import Law
from ..potentials.conic_form import Frame, conic_expression, split, weighted_term
from ..potentials.evaluate import evaluate
from ..potentials.scalars import Temperature
from ..potentials.vector import VectorSymbol
from .canonical import CanonicalForm, canonical_form, empty_form
from .convexity import worst_direction

__all__ = ["LawForms", "law_forms", "packed_layout", "strain_flows"]


@dataclass(frozen=True)
class LawForms:
    """`energy` over (ε, X, aux); `flow` over (Y, aux) if `dual`, else over (rates, aux), on the places `moved` of (ε, X); None if elastic."""

    energy: CanonicalForm
    flow: CanonicalForm | None
    dual: bool
    moved: tuple[int, ...]


def packed_layout(law: Law) -> tuple[dict[str, tuple[int, int]], int]:
    """Place (start, length) of each internal variable in a packed state row, and its length."""
    layout: dict[str, tuple[int, int]] = {}
    start = 0
    for variable in law.internal:
        length = {2: 6, 1: 3}.get(getattr(variable, "rank", 0), 1)
        layout[variable.name] = (start, length)
        start += length
    return layout, start


def strain_flows(law: Law) -> bool:
    """True if the force (or rate) of the observable enters the force function: the step then needs the old strain."""
    return law.observable in law.forces


def law_forms(law: Law, numbers: Mapping[Any, Any]) -> LawForms:
    """Forms at `numbers`, which map parameters, the temperature and frozen symbols to values.

    Raises `DeclarationError` for a term without conic form and `InputError` for values at which ψ or φ* is not convex or f(0) > 0.
    """
    layout, size = packed_layout(law)
    places = {law.observable: 0, **{v: 6 + layout[v.name][0] for v in law.internal}}
    energy = _canonical(law, "psi", law.energy, (), places, 6 + size, numbers)
    potential = law.phi if law.phi is not None else law.phi_star
    if potential is None:
        return LawForms(energy, None, True, ())
    word = "phi" if law.phi is not None else "phi_star"
    force_places: dict[Any, int] = {}
    moved: list[int] = []
    for variable in (law.observable, *law.internal):
        symbol = law.forces.get(variable)
        if symbol is not None:
            force_places[symbol] = len(moved)
            start = places[variable]
            length = {2: 6, 1: 3}.get(getattr(variable, "rank", 0), 1)
            moved += range(start, start + length)
    surfaces = tuple(f for f in potential.surfaces if not _thermal(law, word, f))
    finite = Add(*(t for t in Add.make_args(potential.finite) if not _thermal(law, word, t)))
    _check_surfaces(law, word, surfaces, force_places, numbers)
    flow = _canonical(law, word, finite, surfaces, force_places, len(moved), numbers)
    return LawForms(energy, flow, law.phi is None, tuple(moved))


def _thermal(law: Law, word: str, term: Expr) -> bool:
    """True for a term in ∇T (or −q/T) alone; one that mixes it with other forces is refused."""
    thermal = {v for v in term.atoms(VectorSymbol) if v.role in ("force", "rate") and isinstance(v.variable, Temperature)}
    if not thermal:
        return False
    others = {s for s in law.forces.values() if s not in thermal and term.has(s)}
    if others:
        raise DeclarationError(
            f"law '{law.name}': {word} couples {', '.join(map(str, thermal))} with {', '.join(sorted(map(str, others)))} in {term}; "
            "a step at a point is given no temperature gradient"
        )
    return True


def _check_surfaces(law: Law, word: str, surfaces: tuple[Expr, ...], places: Mapping[Any, int], numbers: Any) -> None:
    zero = {s: np.zeros({2: 6, 1: 3}.get(getattr(s, "rank", 0), ())) for s in places}  # type: ignore[call-overload]
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
            objective = objective + weighted_term(weight, term, frame, z, constraints)
            if marked and not objective.is_convex():
                raise DeclarationError(f"{where}: the term {weight:g} * ({term}) is not convex by the rules of its atoms")
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
    return CanonicalForm(P, q, form.E, form.e, form.G, form.h, form.cones, size)


def _part(vector: Any, variable: Any, start: int) -> Any:
    length = {2: 6, 1: 3}.get(getattr(variable, "rank", 0), 1)
    return vector[start : start + length]
