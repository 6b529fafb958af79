"""Scalar symbols: parameters with unit and bounds, scalar variables and their forces, the positive part and its step.

sympy's `Max` differentiates to `Heaviside` and `DiracDelta`, which take values at the kink that are neither one-sided limit;
`PositivePart` and `Step` are used instead: d⟨x⟩/dx = H(x), dH/dx = 0, H(0) = 0, an element of the generalised derivative.
"""

from __future__ import annotations

import math
from typing import Any

from sympy import Symbol

from ..errors import DeclarationError
from .names import checked_name, latex_name

__all__ = [
    "ForceScalar",
    "FrozenScalar",
    "Parameter",
    "RateScalar",
    "ScalarVariable",
    "Temperature",
    "parameter",
    "parameters",
    "scalar",
    "temperature",
]


class Parameter(Symbol):
    """Real parameter of a law, with unit, closed bounds, an optional default value and one line of description."""

    __slots__ = ("default", "lower", "note", "unit", "upper")
    lower: float
    upper: float
    unit: str
    default: float | None
    note: str

    def __new__(
        cls,
        name: str,
        lower: float = -math.inf,
        upper: float = math.inf,
        unit: str = "",
        default: float | None = None,
        note: str = "",
    ) -> Parameter:
        obj = Symbol.__xnew__(cls, name, real=True)
        obj.lower, obj.upper, obj.unit, obj.default, obj.note = lower, upper, unit, default, note
        return obj

    def __getnewargs_ex__(self) -> Any:
        return ((self.name, self.lower, self.upper, self.unit, self.default, self.note), {})

    def _hashable_content(self) -> Any:
        return (*super()._hashable_content(), self.lower, self.upper, self.unit, str(self.default), self.note)

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        return latex_name(self.name) + ("" if exp is None else f"^{{{exp}}}")


class ScalarVariable(Symbol):
    """Scalar state variable."""

    __slots__ = ()
    role = "state"

    def __new__(cls, name: str) -> ScalarVariable:
        return Symbol.__xnew__(cls, name, real=True)

    def __getnewargs_ex__(self) -> Any:
        return ((self.name,), {})

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        return latex_name(self.name) + ("" if exp is None else f"^{{{exp}}}")


class Temperature(ScalarVariable):
    """Absolute temperature T > 0 [K]: a state variable in which ψ is concave; it is given from outside during a step."""

    __slots__ = ()

    def __new__(cls, name: str) -> Temperature:
        return Symbol.__xnew__(cls, name, positive=True)


class _PairedScalar(ScalarVariable):
    """Scalar symbol that belongs to a scalar variable."""

    __slots__ = ("variable",)
    variable: ScalarVariable

    def __new__(cls, name: str, variable: ScalarVariable) -> Any:
        obj = Symbol.__xnew__(cls, name, real=True)
        obj.variable = variable
        return obj

    def __getnewargs_ex__(self) -> Any:
        return ((self.name, self.variable), {})

    def _hashable_content(self) -> Any:
        return (*super()._hashable_content(), self.variable.name)


class ForceScalar(_PairedScalar):
    """Thermodynamic force R = −∂ψ/∂p of a scalar variable."""

    __slots__ = ()
    role = "force"


class RateScalar(_PairedScalar):
    """Rate of a scalar variable."""

    __slots__ = ()
    role = "rate"

    def _sympystr(self, printer: Any) -> str:
        return f"d{self.variable.name}/dt"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        return rf"\dot{{{latex_name(self.variable.name)}}}" + ("" if exp is None else f"^{{{exp}}}")


class FrozenScalar(_PairedScalar):
    """Value of a scalar variable at the start of the step."""

    __slots__ = ()
    role = "frozen"

    def _sympystr(self, printer: Any) -> str:
        return f"frozen({self.variable.name})"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        body = rf"{latex_name(self.variable.name)}^{{n}}"
        return body if exp is None else rf"\left({body}\right)^{{{exp}}}"


def parameter(
    name: str,
    *,
    lower: float | None = None,
    upper: float | None = None,
    unit: str = "",
    default: float | None = None,
    note: str = "",
) -> Parameter:
    """Declare one parameter. `lower`, `upper` are closed bounds on its value, `default` is used where no value is given."""
    checked_name(name, "parameter")
    for word, value in (("lower", lower), ("upper", upper), ("default", default)):
        if value is not None and (isinstance(value, (str, bytes, bool)) or not hasattr(value, "__float__")):
            raise DeclarationError(f"parameter '{name}': {word} must be a number, not {type(value).__name__}")
    for word, value in (("unit", unit), ("note", note)):
        if not isinstance(value, str):
            raise DeclarationError(f"parameter '{name}': {word} must be text, not {type(value).__name__}")
    low = -math.inf if lower is None else float(lower)
    high = math.inf if upper is None else float(upper)
    if not low <= high:
        raise DeclarationError(f"parameter '{name}': the lower bound {low:g} must not exceed the upper bound {high:g}")
    if default is not None and not low <= float(default) <= high:
        raise DeclarationError(f"parameter '{name}': the default {default:g} lies outside [{low:g}, {high:g}]")
    return Parameter(name, low, high, unit, None if default is None else float(default), note)


def parameters(
    names: str, *, lower: float | None = None, upper: float | None = None, unit: str = "", note: str = ""
) -> Any:
    """Declare several parameters, names apart by spaces or commas; one name gives the symbol, several a tuple. Bounds, unit and note are
    those of `parameter` and hold for all of them; none by default."""
    if not isinstance(names, str) or not names.strip() or len(names) > 4000:
        raise DeclarationError("parameters takes one string of names apart by spaces, for example 'E_s nu_s'")
    more: dict[str, Any] = {"lower": lower, "upper": upper, "unit": unit, "note": note}
    found = tuple(parameter(name, **more) for name in names.replace(",", " ").split(" ") if name)
    return found[0] if len(found) == 1 else found


def scalar(name: str) -> ScalarVariable:
    """Declare a scalar state variable."""
    return ScalarVariable(checked_name(name, "scalar"))


def temperature(name: str = "T") -> Temperature:
    """Declare the absolute temperature [K]; ψ must be concave in it."""
    return Temperature(checked_name(name, "temperature"))
