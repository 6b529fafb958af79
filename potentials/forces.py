"""Forces of internal variables, and the indicator of the elastic domain.

The indicator I_D of a closed convex set D = {f ≤ 0, g ≤ 0, …} is 0 in D and +∞ outside; its subdifferential is the normal cone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Expr, sympify

from ..errors import DeclarationError
from .names import checked_name
from .scalars import ForceScalar, ScalarVariable
from .tensor import ForceTensor, SymmetricTensor, TensorSymbol

__all__ = ["Indicator", "forces", "indicator"]


@dataclass(frozen=True)
class Indicator:
    """I{f ≤ 0, g ≤ 0, ...}."""

    functions: tuple[Expr, ...]


def forces(*variables: Any, names: str | None = None) -> Any:
    """Force symbols A_m = −∂ψ/∂α_m of the given variables, in order; one variable gives one symbol.

    `names` (apart by spaces) are used in print; without them the force of `x` prints as `A_x`.
    """
    if not variables:
        raise DeclarationError("forces needs at least one variable, for example forces(eps_p, alpha, p)")
    words = [f"A_{getattr(v, 'name', v)}" for v in variables] if names is None else names.split()
    if len(words) != len(variables):
        raise DeclarationError(f"forces: {len(words)} names for {len(variables)} variables")
    found: list[Any] = []
    for variable, word in zip(variables, words, strict=True):
        checked_name(word, "force")
        if isinstance(variable, (ForceTensor, ForceScalar)):
            raise DeclarationError(f"'{variable}' is a force already")
        if isinstance(variable, TensorSymbol):
            found.append(ForceTensor(word, variable))
        elif isinstance(variable, ScalarVariable):
            found.append(ForceScalar(word, variable))
        else:
            raise DeclarationError(f"forces takes variables declared by sym_tensor or scalar, not {variable}")
    return found[0] if len(found) == 1 else tuple(found)


def indicator(*functions: Any) -> Indicator:
    """Indicator of {f ≤ 0, g ≤ 0, ...}; each argument is the left side of one inequality."""
    if not functions:
        raise DeclarationError("indicator needs at least one function f of {f <= 0}")
    found = []
    for function in functions:
        if isinstance(function, SymmetricTensor):
            raise DeclarationError("rank mismatch: indicator takes scalar functions f of {f <= 0}, not a tensor")
        try:
            value = sympify(function, strict=True)
        except Exception:
            value = None
        if not isinstance(value, Expr):
            raise DeclarationError(
                "indicator takes the left side of f <= 0, a scalar expression; write indicator(f), not indicator(f <= 0)"
            )
        found.append(value)
    return Indicator(tuple(found))
