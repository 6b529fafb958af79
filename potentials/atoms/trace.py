"""tr T, linear."""

from __future__ import annotations

from typing import Any

from sympy import Expr, S

from ...errors import DeclarationError
from ..operator import Operator
from ..ranked import rank_word
from ..tensor import Deviator, IdentityTensor, PositiveTensor, SymmetricTensor, TensorSum, from_terms, identity
from .atom import Atom, Invariant
from .linear import linear_part
from .positive_trace import PositiveTraceLeaf

__all__ = ["Trace", "TraceLeaf", "tr"]


class TraceLeaf(Invariant):
    """tr T."""

    __slots__ = ()
    word = "tr"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        body = rf"\mathrm{{tr}}\left({printer._print(self.args[0])}\right)"
        return body if exp is None else rf"{body}^{{{exp}}}"


class Trace(Atom):
    """Affine, of degree 1; its conjugate is the indicator of {y = I}."""

    word = "tr"
    node = TraceLeaf

    def curvature(self, node: Any, require: Any) -> str:
        return "affine"

    def degree(self, node: Any) -> Expr:
        return S.One

    def gradient(self, node: Any, variable: Any) -> Any:
        return identity * linear_part(node.args[0], variable)[0] if variable.rank == 2 else TensorSum()

    def second(self, node: Any, x: Any, y: Any, weight: Expr) -> Operator:
        return Operator()

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        return arguments[0][..., :3].sum(axis=-1)

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        return arguments[0][0] + arguments[0][1] + arguments[0][2]

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]]:
        from .norm import norm

        return S.Zero, (norm(dual - identity),)


def tr(tensor: SymmetricTensor) -> Expr:
    """Trace; of a positive part tr T^≥ = Σ ⟨t_i⟩."""
    if not isinstance(tensor, SymmetricTensor):
        raise DeclarationError(f"rank mismatch: tr takes a tensor, not a {rank_word(tensor)}")
    terms = tensor.terms()
    rest = from_terms({a: c for a, c in terms.items() if not isinstance(a, (IdentityTensor, Deviator, PositiveTensor))})
    total = 3 * sum((c for a, c in terms.items() if isinstance(a, IdentityTensor)), S.Zero)
    for atom, c in terms.items():
        if isinstance(atom, PositiveTensor):
            total = total + c * PositiveTraceLeaf(atom.args[0])
    return (TraceLeaf(rest) if rest.terms() else S.Zero) + total
