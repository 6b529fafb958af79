"""Sort the terms of ψ: λ/2 (tr T)² + μ T:T per tensor, squares of positive parts, spectral squares, squares of scalars."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from sympy import Add, Dummy, Expr, Poly, PolynomialError, S

from .atoms.positive_part import PositivePart
from .derivative import invariants_of
from .invariants import InnerLeaf, PositiveSquareLeaf, TraceLeaf
from .law import Law
from .scalars import ScalarVariable
from .tensor import SymmetricTensor

__all__ = ["EnergyTerms", "sort_energy"]


@dataclass
class EnergyTerms:
    """Terms of ψ with their coefficients; `rest` holds what no rule knows."""

    quadratic: dict[SymmetricTensor, tuple[Expr, Expr]] = field(default_factory=dict)  # tensor: (lambda, mu)
    positive: list[tuple[Expr, Expr]] = field(default_factory=list)  # (w, x) of w <x>^2
    spectral: list[tuple[Expr, SymmetricTensor]] = field(default_factory=list)  # (w, T) of w T>=:T>=
    scalars: list[tuple[Expr, ScalarVariable]] = field(default_factory=list)  # (w, s) of w s^2
    rest: list[Expr] = field(default_factory=list)


def sort_energy(law: Law) -> EnergyTerms:
    """Sorted terms of ψ; unknown terms end in `rest`."""
    found = EnergyTerms()
    kinks = sorted(law.energy.atoms(PositivePart), key=str)
    generators: list[Expr] = [*kinks, *invariants_of(law.energy), *sorted(law.energy.atoms(ScalarVariable), key=str)]
    dummies = [Dummy(f"g{i}") for i in range(len(generators))]
    body = law.energy.xreplace(dict(zip(generators[: len(kinks)], dummies, strict=False)))
    body = body.xreplace(dict(zip(generators[len(kinks) :], dummies[len(kinks) :], strict=True)))
    try:
        terms = Poly(body, *dummies).terms() if dummies else [((), body)]
    except PolynomialError:
        found.rest.append(law.energy)
        return found
    for powers, coefficient in terms:
        factors = [g for g, power in zip(generators, powers, strict=True) for _ in range(power)]
        _sort(found, coefficient, factors)
    return found


def _sort(found: EnergyTerms, weight: Any, factors: list[Expr]) -> None:
    if weight == 0:
        return
    first = factors[0] if factors else None
    square = len(factors) == 2 and factors[0] == factors[1]
    if square and isinstance(first, TraceLeaf):
        _quadratic(found, first.args[0], 2 * weight, S.Zero)  # type: ignore[arg-type]
    elif len(factors) == 1 and isinstance(first, InnerLeaf) and first.args[0] == first.args[1]:
        _quadratic(found, first.args[0], S.Zero, weight)  # type: ignore[arg-type]
    elif len(factors) == 1 and isinstance(first, PositiveSquareLeaf):
        found.spectral.append((weight, first.args[0]))  # type: ignore[arg-type]
    elif square and isinstance(first, PositivePart):
        found.positive.append((weight, first.args[0]))  # type: ignore[arg-type]
    elif square and isinstance(first, ScalarVariable):
        found.scalars.append((weight, first))
    elif factors:
        product = weight
        for factor in factors:
            product = product * factor
        found.rest.append(product)
    else:
        found.rest.append(Add(weight)) if weight.free_symbols else None


def _quadratic(found: EnergyTerms, tensor: SymmetricTensor, lam: Expr, mu: Expr) -> None:
    old = found.quadratic.get(tensor, (S.Zero, S.Zero))
    found.quadratic[tensor] = (old[0] + lam, old[1] + mu)
