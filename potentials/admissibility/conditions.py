"""Conditions on parameters under which something is proved: what they say, whether declared bounds imply them, whether values keep them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from sympy import Abs, Add, Expr, Float, Mul, Pow, Rational, S, factor, fraction, together

from ..atoms.atom import Invariant
from ..enforce import ROUNDING
from ..ranked import Ranked
from ..scalars import FrozenScalar, Parameter, ScalarVariable, Temperature
from .bounds import EVERYWHERE, interval, natural_range, sharp_interval

__all__ = ["Condition", "Need", "as_conditions", "exact_values", "holds", "only_at_zero_of", "softens"]


def exact_values(values: Mapping[Any, float], expressions: Iterable[Expr]) -> dict[Any, Expr]:
    """Values as rational numbers; but an exponent of many digits as a decimal one of thirty, since sympy would write a rational power of a
    rational number as roots of integers that fill the memory."""
    raised = {s for e in expressions for power in e.atoms(Pow) for s in power.exp.free_symbols}
    found: dict[Any, Expr] = {}
    for symbol, value in values.items():
        number = Rational(repr(float(value)))
        found[symbol] = Float(repr(float(value)), 30) if symbol in raised and number.q > 100 else number
    return found


@dataclass(frozen=True)
class Need:
    """`expression` ≥ 0 (> 0 if `strict`), for the sake of `about` ("modulus", "weight", "zero", "exponent", …) of `variables`."""

    expression: Expr
    about: str = "weight"
    variables: tuple[Any, ...] = ()
    strict: bool = False


class Condition(str):
    """Text of one condition, with the expression that must not be negative, and whether the declared bounds imply it.

    `symbols` are the parameters in it; `on_state` names the temperature and the frozen state in it, which values of parameters do not fix.
    """

    __slots__ = ("about", "expression", "implied", "on_state", "potential", "strict", "symbols", "variables")
    expression: Expr
    implied: bool
    strict: bool
    about: str
    potential: str
    symbols: tuple[Parameter, ...]
    variables: tuple[str, ...]
    on_state: tuple[str, ...]

    def __new__(cls, need: Need, potential: str) -> Condition:
        low, _ = sharp_interval(need.expression)
        base = only_at_zero_of(need.expression)
        relation = "=" if base is not None else (">" if need.strict else ">=")
        self = str.__new__(cls, f"{_shown(need.expression if base is None else base)} {relation} 0")
        self.expression, self.strict, self.about, self.potential = (need.expression, need.strict, need.about, potential)
        self.implied = low > 0.0 or (low == 0.0 and not need.strict)
        free = need.expression.free_symbols | need.expression.atoms(ScalarVariable)
        self.symbols = tuple(sorted((s for s in free if isinstance(s, Parameter)), key=str))
        data = {s for s in free if isinstance(s, (Temperature, FrozenScalar))}
        data |= {s for s in need.expression.atoms(Ranked) if getattr(s, "role", "") == "frozen"}
        self.on_state = tuple(sorted(map(str, data)))
        self.variables = tuple(dict.fromkeys(_name(v) for v in need.variables))
        return self

    def value(self, values: Mapping[Any, float]) -> tuple[float, float] | None:
        """(value, size of its largest part), or None while a symbol in it has no value. NaN where it is not defined."""
        expression: Any = self.expression
        if self.on_state or expression.has(Invariant):
            return None
        exact = exact_values(values, [expression])
        if any(s not in values for s in self.symbols):
            bottom = fraction(expression)[1].xreplace(exact)
            return (math.nan, 1.0) if bottom.is_zero else None
        parts = [_number(part.xreplace(exact)) for part in Add.make_args(expression)]
        return math.fsum(parts), max(map(abs, parts))


def _number(value: Any) -> float:
    """The number as a float, NaN if it is not finite and real."""
    found = value.evalf(30) if value.is_number else value
    return float(found) if found.is_Float or found.is_Rational else math.nan


def only_at_zero_of(expression: Any) -> Expr | None:
    """b if the expression is −c b², c > 0, which is not negative at b = 0 only, where b may be of either sign."""
    weight, body = expression.as_coeff_Mul()
    base, exponent = body.as_base_exp()
    if not (weight.is_negative and exponent == 2):
        return None
    low, high = sharp_interval(base)
    return base if low < 0.0 < high else None


def holds(condition: Condition, values: Mapping[Any, float]) -> bool | None:
    """True, False, or None while a value is missing. Exactly singular forms pass in spite of rounding."""
    found = condition.value(values)
    if found is None:
        return None
    value, size = found
    if not math.isfinite(value):
        return False
    return value > 0.0 if condition.strict else value >= -ROUNDING * size


def softens(condition: Condition, observable: str) -> bool:
    """True if the condition keeps an internal variable from softening: it is about the modulus of internal variables."""
    return condition.about == "modulus" and bool(condition.variables) and observable not in condition.variables


def as_conditions(needs: Iterable[Need], potential: str) -> list[Condition]:
    """Conditions without repetition, in order; what holds for all values of the parameters is dropped."""
    found: dict[str, Condition] = {}
    for need in needs:
        reduced = _reduced(need)
        bottom = fraction(reduced.expression)[1]
        low = interval(reduced.expression, _anything)[0]
        trivial = low > 0.0 or (low == 0.0 and not need.strict)
        if trivial and bottom.is_number:
            continue
        if trivial or (reduced.expression * bottom).is_positive:
            # what remains to be said is that the denominator is positive, not zero
            reduced = Need(bottom, need.about, need.variables, True)
        condition = Condition(reduced, potential)
        found.setdefault(str(condition), condition)
    return list(found.values())


def _anything(symbol: Any) -> Any:
    return EVERYWHERE if isinstance(symbol, Parameter) else natural_range(symbol)


def _reduced(need: Need) -> Need:
    """The same without factors that are positive numbers or a temperature."""
    absolute = {a: a.args[0] for a in need.expression.atoms(Abs) if sharp_interval(a.args[0])[0] >= 0.0}
    tidy: Any = factor(together(need.expression.xreplace(absolute)))
    sign, kept = S.One, []
    for part in Mul.make_args(tidy):
        if part.is_number and part.is_real and part.is_nonzero:
            sign = sign if part.is_positive else -sign
        elif not isinstance(part.as_base_exp()[0], Temperature):
            kept.append(part)
    for k, part in enumerate(kept):
        base, exponent = part.as_base_exp()
        if base.is_Add and exponent.is_Integer and _leads_with_minus(base):
            sign, kept[k] = sign * (-1) ** exponent, (-base) ** exponent
    return Need(Mul(sign, *kept), need.about, need.variables, need.strict)


def _leads_with_minus(base: Any) -> bool:
    """True for 2*nu - 1: its constant part is negative, or, without one, its first term."""
    constant = base.as_coeff_Add()[0]
    return bool(constant.is_negative) if constant != 0 else bool(base.could_extract_minus_sign())


def _shown(expression: Any) -> str:
    """Text as one fraction."""
    top, bottom = fraction(expression)
    if bottom == 1:
        return str(top)
    shown_top = f"({top})" if top.is_Add else str(top)
    return f"{shown_top}/({bottom})" if bottom.is_Add or bottom.is_Mul else f"{shown_top}/{bottom}"


def _name(variable: Any) -> str:
    """Name of a coordinate of a form: of the state variable that it belongs to."""
    while getattr(variable, "args", ()) and not hasattr(variable, "name"):
        variable = variable.args[0]
    owner = getattr(variable, "variable", None)
    return str(getattr(owner if owner is not None else variable, "name", variable))
