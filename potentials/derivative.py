"""Derivatives of a potential by its variables, through its invariants.

With F(l_1, l_2, …) a function of invariants l_i, each linear or not in X,

    ∂F/∂X     = Σ_i F_i ∂l_i/∂X,
    ∂²F/∂X∂Y  = Σ_ij F_ij ∂l_i/∂X ⊗ ∂l_j/∂Y + Σ_i F_i ∂²l_i/∂X∂Y,

the second as an `Operator`, a short list, never as 36 entries. The scalar derivatives are taken by sympy with the invariants
replaced by dummies; those of the invariants come from their atoms.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from sympy import Dummy, Expr, S, default_sort_key, sympify

from .atoms import atom_of
from .atoms.atom import Invariant
from .atoms.positive_part import tidy
from .operator import Operator
from .ranked import Ranked
from .scalars import ScalarVariable
from .tensor import IdentityTensor, TensorSymbol, identity
from .vector import VectorSymbol

__all__ = ["Operator", "invariants_of", "is_constant", "partial", "second_derivative", "variables_of"]


def invariants_of(expression: Expr) -> list[Invariant]:
    """Invariants in the expression, in a fixed order."""
    return sorted(expression.atoms(Invariant), key=default_sort_key)


def is_constant(expression: Expr) -> bool:
    """True if the expression depends on parameters (and frozen state, which is data of the step) only."""
    return not variables_of(expression)


def variables_of(expression: Any) -> set[Any]:
    """State, force and rate symbols in an expression, of any rank; frozen values are data."""
    found = expression.atoms(ScalarVariable, TensorSymbol, VectorSymbol)
    paired = {s.variable for s in found if s.role in ("force", "rate", "frozen")}
    # a paired symbol holds its variable as an argument: that alone is no mention of the state
    return {s for s in found if s.role != "frozen" and not (s in paired and not _mentions(expression, s))}


def _mentions(expression: Any, symbol: Any) -> bool:
    """True if `symbol` stands in the expression itself, not only inside a paired symbol."""
    if expression == symbol:
        return True
    if getattr(expression, "role", "state") != "state":
        return False
    return any(_mentions(a, symbol) for a in expression.args)


def _opened(expression: Any) -> tuple[Any, list[Invariant], list[Dummy]]:
    leaves = invariants_of(expression)
    dummies = [
        Dummy(f"l{i}", real=True, nonnegative=True if leaf.is_nonnegative else None) for i, leaf in enumerate(leaves)
    ]
    return expression.xreplace(dict(zip(leaves, dummies, strict=True))), leaves, dummies


def partial(expression: Expr, variable: Any) -> Any:
    """∂F/∂X: a quantity of the rank of the variable; an element of the subdifferential at a kink of a convex F."""
    body, leaves, dummies = _opened(sympify(expression, strict=True))
    back = dict(zip(dummies, leaves, strict=True))
    if isinstance(variable, ScalarVariable):
        found = tidy(body.diff(variable).xreplace(back))
        for dummy, leaf in zip(dummies, leaves, strict=True):
            if variable in leaf.free_symbols:
                found = found + tidy(body.diff(dummy).xreplace(back)) * _through_coefficients(leaf, variable)
        return found
    total: Ranked = variable.linear(())
    for dummy, leaf in zip(dummies, leaves, strict=True):
        weight = body.diff(dummy)
        if weight != 0:
            slope = atom_of(leaf).gradient(leaf, variable)
            if slope.rank == variable.rank and slope.terms():
                total = total + tidy(weight.xreplace(back)) * slope
    return total


def _through_coefficients(leaf: Invariant, variable: ScalarVariable) -> Expr:
    """∂l/∂v of an invariant whose arguments hold v in their coefficients (a thermal strain): Σ ∂l/∂T : ∂T/∂v."""
    from .invariants import inner, tr

    total: Expr = S.Zero
    for place, quantity in enumerate(leaf.args):
        if not isinstance(quantity, Ranked) or variable not in quantity.free_symbols:
            continue
        change = quantity.linear((a, c.diff(variable)) for a, c in quantity.terms().items())
        probe = VectorSymbol("probe") if quantity.rank == 1 else TensorSymbol("probe")
        opened = leaf.func(*(probe if i == place else a for i, a in enumerate(leaf.args)))
        slope = atom_of(leaf).gradient(opened, probe).xreplace({probe: quantity})
        spherical = change.terms().get(identity) if set(change.terms()) == {identity} else None
        total = total + (spherical * tr(slope) if spherical is not None else inner(slope, change))
    return total


def second_derivative(expression: Expr, x: Any, y: Any) -> Operator:
    """∂²F/∂X∂Y of two tensors (or two vectors) as an operator list."""
    body, leaves, dummies = _opened(sympify(expression, strict=True))
    back = dict(zip(dummies, leaves, strict=True))
    total = Operator()
    for i, a in zip(dummies, leaves, strict=True):
        slope = body.diff(i)
        if slope == 0:
            continue
        total = total + atom_of(a).second(a, x, y, tidy(slope.xreplace(back)))
        for j, b in zip(dummies, leaves, strict=True):
            weight = slope.diff(j)
            if weight == 0:
                continue
            g, h = atom_of(a).gradient(a, x), atom_of(b).gradient(b, y)
            total = total + _dyad(tidy(weight.xreplace(back)), g, h)
    return _gathered(total)


def _dyad(weight: Expr, g: Any, h: Any) -> Operator:
    a, b = g.terms(), h.terms()
    if not a or not b:
        return Operator()
    if all(isinstance(t, IdentityTensor) for t in (*a, *b)):
        return Operator(c1=weight * a[identity] * b[identity])
    return Operator(dyads=((weight, g, h),))


def _gathered(operator: Operator) -> Operator:
    return replace(operator, spectral=_sums(operator.spectral), functions=_sums(operator.functions))


def _sums(pairs: Any) -> Any:
    found: dict[Any, Expr] = {}
    for weight, tensor in pairs:
        found[tensor] = found.get(tensor, S.Zero) + weight
    return tuple((found[t], t) for t in sorted(found, key=default_sort_key) if found[t] != 0)
