"""Vectors with their own ranked type: the gradient of temperature, the heat flux, a flux or a direction of the user.

A vector is a canonical linear combination Σ c_k v_k of symbols; inner(u, v) = u·v and norm(v) = √(v·v) are its invariants.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from sympy import Basic, Expr, Tuple, default_sort_key
from sympy.core.symbol import Str

from .names import checked_name, latex_name
from .ranked import Ranked, shown_term, sorted_terms
from .scalars import ScalarVariable

__all__ = ["ForceVector", "FrozenVector", "RateVector", "Vector", "VectorSum", "VectorSymbol", "vector"]


class Vector(Ranked):
    """Element of ℝ³."""

    __slots__ = ()
    rank = 1
    kind = "vector"

    @classmethod
    def linear(cls, pairs: Iterable[tuple[Any, Any]]) -> Vector:
        return VectorSum(*(Tuple(v, c) for v, c in pairs))


class VectorSymbol(Vector):
    """A named vector variable."""

    __slots__ = ()
    role = "state"

    def __new__(cls, name: Any) -> VectorSymbol:
        return super().__new__(cls, name if isinstance(name, Str) else Str(checked_name(name, "vector")))

    @property
    def name(self) -> str:
        return str(self.args[0])

    def _shown(self, printer: Any, latex: bool) -> str:
        return rf"\boldsymbol{{{latex_name(self.name)}}}" if latex else self.name


class _PairedVector(VectorSymbol):
    """Vector symbol that belongs to a variable: a vector, or the temperature."""

    __slots__ = ()

    def __new__(cls, name: Any, variable: VectorSymbol | ScalarVariable) -> Any:
        return Basic.__new__(cls, name if isinstance(name, Str) else Str(checked_name(name, cls.role)), variable)

    @property
    def variable(self) -> Any:
        return self.args[1]


class ForceVector(_PairedVector):
    """Force of a vector variable; of the temperature it is ∇T, the force of −q/T."""

    __slots__ = ()
    role = "force"

    def _shown(self, printer: Any, latex: bool) -> str:
        if isinstance(self.variable, ScalarVariable):
            return rf"\nabla {printer._print(self.variable)}" if latex else self.name
        return super()._shown(printer, latex)


class RateVector(_PairedVector):
    """Rate of a vector variable; of the temperature it is the flux j = −q/T."""

    __slots__ = ()
    role = "rate"

    def _shown(self, printer: Any, latex: bool) -> str:
        if isinstance(self.variable, ScalarVariable):
            return rf"\boldsymbol{{{latex_name(self.name)}}}" if latex else self.name
        name = self.variable.name
        return rf"\dot{{\boldsymbol{{{latex_name(name)}}}}}" if latex else f"d{name}/dt"


class FrozenVector(_PairedVector):
    """Value of a vector variable at the start of the step."""

    __slots__ = ()
    role = "frozen"

    @property
    def name(self) -> str:
        return f"{self.variable.name}_frozen_"

    def _shown(self, printer: Any, latex: bool) -> str:
        name = self.variable.name
        return rf"\boldsymbol{{{latex_name(name)}}}^{{n}}" if latex else f"frozen({name})"


class VectorSum(Vector):
    """Canonical linear combination; arguments are pairs (vector, coefficient) in any order, gathered and sorted here."""

    __slots__ = ()

    def __new__(cls, *pairs: Any) -> Vector:  # type: ignore[misc]
        kept = sorted_terms((p.args[0], p.args[1]) for p in pairs)
        if len(kept) == 1 and kept[0].args[1] == 1:
            return kept[0].args[0]  # type: ignore[return-value]
        return Basic.__new__(cls, *kept)

    def terms(self) -> dict[Any, Expr]:
        return {pair.args[0]: pair.args[1] for pair in self.args}  # type: ignore[misc]

    def _shown(self, printer: Any, latex: bool) -> str:
        terms = sorted(self.terms().items(), key=lambda pair: default_sort_key(pair[0]))
        if not terms:
            return r"\boldsymbol{0}" if latex else "0"
        text = ""
        for atom, c in terms:
            text = shown_term(text, c, printer._print(atom), printer, latex)
        return text


def vector(name: str) -> VectorSymbol:
    """Declare a vector variable."""
    return VectorSymbol(name)
