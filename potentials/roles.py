"""Symbols that belong to a variable: its force, its rate, its value at the start of the step, and the thermal pair (∇T, −q/T)."""

from __future__ import annotations

from typing import Any

from ..errors import DeclarationError
from .names import checked_name
from .scalars import ForceScalar, FrozenScalar, RateScalar, ScalarVariable, Temperature
from .tensor import ForceTensor, FrozenTensor, RateTensor, TensorSymbol
from .vector import ForceVector, FrozenVector, RateVector, VectorSymbol

__all__ = ["entropy_flux", "forces", "frozen", "gradient", "is_variable", "rates"]


def is_variable(value: Any) -> bool:
    """True for a declared state variable of any rank."""
    return isinstance(value, (TensorSymbol, VectorSymbol, ScalarVariable)) and value.role == "state"


def _each(word: str, variables: tuple[Any, ...]) -> None:
    if not variables:
        raise DeclarationError(f"{word} needs at least one variable, for example {word}(eps_p, alpha, p)")
    for variable in variables:
        if isinstance(variable, Temperature):
            raise DeclarationError(
                f"{word} does not take the temperature '{variable}'; its force is gradient({variable}), its flux entropy_flux({variable})"
            )
        if is_variable(variable):
            continue
        role = getattr(variable, "role", None)
        if role in ("force", "rate", "frozen"):
            raise DeclarationError(f"'{variable}' is a {role} already; {word} takes state variables")
        raise DeclarationError(f"{word} takes variables declared by sym_tensor, vector or scalar, not {variable}")


def _paired(kinds: tuple[type, type, type], name: str, variable: Any) -> Any:
    scalar_kind, vector_kind, tensor_kind = kinds
    if isinstance(variable, TensorSymbol):
        return tensor_kind(name, variable)
    return vector_kind(name, variable) if isinstance(variable, VectorSymbol) else scalar_kind(name, variable)


def forces(*variables: Any, names: str | None = None) -> Any:
    """Force symbols A_m = −∂ψ/∂α_m of the given variables, in order; one variable gives one symbol.

    The force of the observable strain is the irreversible stress σ^ir. `names` (apart by spaces) are used in print; without them the
    force of `x` prints as `A_x`.
    """
    _each("forces", variables)
    words = [f"A_{v.name}" for v in variables] if names is None else names.split()
    if len(words) != len(variables):
        raise DeclarationError(f"forces: {len(words)} names for {len(variables)} variables")
    for word in words:
        checked_name(word, "force")
    found = [
        _paired((ForceScalar, ForceVector, ForceTensor), word, variable)
        for variable, word in zip(variables, words, strict=True)
    ]
    return found[0] if len(found) == 1 else tuple(found)


def rates(*variables: Any) -> Any:
    """Rate symbols of the given variables, the arguments of a dissipation potential `phi`; of the observable, the strain rate."""
    _each("rates", variables)
    found = [_paired((RateScalar, RateVector, RateTensor), f"rate_{v.name}", v) for v in variables]
    return found[0] if len(found) == 1 else tuple(found)


def frozen(variable: Any) -> Any:
    """Value of a state variable at the start of the step, as data in φ* or φ: the law is then semi-implicit."""
    if isinstance(variable, Temperature):
        raise DeclarationError(
            f"frozen does not take the temperature '{variable}': it is given during a step; write it as it is"
        )
    _each("frozen", (variable,))
    return _paired((FrozenScalar, FrozenVector, FrozenTensor), f"frozen_{variable.name}", variable)


def _temperature(word: str, variable: Any) -> Temperature:
    if not isinstance(variable, Temperature):
        raise DeclarationError(f"{word} takes a temperature declared by temperature('T'), not {variable}")
    return variable


def gradient(variable: Temperature) -> ForceVector:
    """∇T, the force of the flux −q/T, as an argument of φ*."""
    return ForceVector(f"grad_{_temperature('gradient', variable).name}", variable)


def entropy_flux(variable: Temperature) -> RateVector:
    """j = −q/T, whose force is ∇T, as an argument of φ."""
    return RateVector(f"flux_{_temperature('entropy_flux', variable).name}", variable)
