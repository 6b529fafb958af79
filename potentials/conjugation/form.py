"""A conjugate as a minimum: F*(y) = min over unknowns of value(y, unknowns) where the inequalities and equalities hold, else +∞."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from sympy import Expr, S

from ...errors import DeclarationError
from ..ranked import Ranked
from .quadratic import gathered, opened

__all__ = ["MinForm", "NoRule", "Phase", "is_zero", "substituted"]


class NoRule(DeclarationError):
    """No rule gives the conjugate; the message names the term that is in the way."""


@dataclass(frozen=True)
class Phase:
    """One of several functions of the same slots whose conjugates are combined by infimal convolution: its share of the dual (a tensor,
    vector or scalar symbol), its conjugate, where that is finite, and its cases."""

    share: Any
    value: Expr
    inequalities: tuple[Expr, ...] = ()
    equalities: tuple[Any, ...] = ()
    cases: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class MinForm:
    """Value, inequalities (expressions ≤ 0), equalities (scalars or tensors = 0), unknowns; `conditions` on parameters (> 0)."""

    value: Expr = S.Zero
    inequalities: tuple[Expr, ...] = ()
    equalities: tuple[Any, ...] = ()
    unknowns: tuple[Any, ...] = ()
    conditions: tuple[Expr, ...] = ()
    rules: tuple[str, ...] = ()
    cases: tuple[tuple[str, str], ...] = ()
    phases: tuple[Phase, ...] = field(default=())

    def __add__(self, other: MinForm) -> MinForm:
        return MinForm(
            self.value + other.value,
            _once(self.inequalities + other.inequalities),
            self.equalities + other.equalities,
            self.unknowns + other.unknowns,
            _once(self.conditions + other.conditions),
            _once(self.rules + other.rules),
            self.cases + other.cases,
            self.phases + other.phases,
        )

    def with_rule(self, rule: str) -> MinForm:
        """The same with one more rule in the list."""
        return replace(self, rules=_once((*self.rules, rule)))

    def map(self, change: Callable[[Any], Any]) -> MinForm:
        """The same with every expression changed; equalities 0 = 0 and inequalities that numbers decide fall away."""
        equalities = tuple(e for e in (change(e) for e in self.equalities) if not is_zero(e))
        inequalities = tuple(f for f in (change(f) for f in self.inequalities) if not f.is_nonpositive)
        return replace(
            self,
            value=change(self.value),
            inequalities=_once(inequalities),
            equalities=equalities,
            phases=tuple(
                replace(
                    p,
                    value=change(p.value),
                    inequalities=tuple(change(f) for f in p.inequalities),
                    equalities=tuple(change(e) for e in p.equalities),
                )
                for p in self.phases
            ),
        )


def is_zero(thing: Any) -> bool:
    """True for the number zero and the typed zero of tensors and vectors."""
    return not thing.terms() if isinstance(thing, Ranked) else thing == 0


def substituted(thing: Any, table: dict[Any, Any]) -> Any:
    """`thing` with symbols replaced, traces and products with I written out again."""
    found = thing.xreplace(table)
    return found if isinstance(found, Ranked) else gathered(opened(found))


def _once(items: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(dict.fromkeys(items))
