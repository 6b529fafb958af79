"""What every atom of a potential knows about itself.

A potential is a sympy expression in scalar symbols, scalar functions and invariants of tensors. Each kind of node has one record, an
`Atom`, that carries its convexity, monotonicity, sign, degree of homogeneity, domain and smoothness, its derivative as a tensor, an
element of the B-subdifferential of its gradient, its conjugate, its numbers and its conic form. Whoever needs one of these asks the
record; nobody asks what kind of node it is. To add an atom, write one file that defines the node and its `Atom`, and `register` it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sympy import Basic, Expr, S

from ...errors import DeclarationError
from ..operator import Operator
from ..scalars import ScalarVariable
from ..tensor import TensorSymbol, dev, identity

__all__ = ["Atom", "Invariant", "Require"]

Require = Callable[[Expr], None]
"""Receives an expression in parameters that has to be non-negative for what was said to hold."""


class Invariant(Expr):
    """Real scalar function of tensors or vectors, kept whole; its arguments are linear in the variables."""

    __slots__ = ()
    is_commutative = True
    is_real = True
    is_extended_real = True
    is_finite = True
    word = ""

    def _eval_derivative(self, s: Any) -> Expr:
        if s in self.free_symbols:
            raise NotImplementedError(f"derivative of {self} by the parameter {s} inside its tensor argument")
        return S.Zero

    def _sympystr(self, printer: Any) -> str:
        return f"{self.word}({', '.join(printer._print(a) for a in self.args)})"

    _sympyrepr = _sympystr


class Atom:
    """Properties of one kind of node. `node` is its sympy class, `word` how it is written, `smoothness` one of "smooth", "C1"
    (differentiable with a Lipschitz gradient) and "continuous" (kinks)."""

    word = ""
    node: type[Basic] = Basic
    smoothness = "smooth"

    def curvature(self, node: Any, require: Require) -> str:
        """ "affine", "convex", "concave" or "unknown", as a function of the node's own arguments."""
        return "unknown"

    def monotone(self, node: Any, signs: tuple[int, ...]) -> tuple[int, ...]:
        """Per argument +1 (non-decreasing), −1 (non-increasing) or 0, where the arguments have the given signs (+1, −1, 0 unknown)."""
        return (0,) * len(node.args)

    def sign(self, node: Any, signs: tuple[int, ...]) -> int:
        """+1 if the value is never negative, −1 if never positive, 0 if unknown."""
        return 0

    def degree(self, node: Any) -> Expr | None:
        """n if h(t x) = tⁿ h(x) for all t > 0, in all arguments together; None if it is not homogeneous."""
        return None

    def domain(self, node: Any) -> tuple[Expr, ...]:
        """Expressions that are non-negative where the node is defined; none means everywhere."""
        return ()

    def gradient(self, node: Any, variable: Any) -> Any:
        """Derivative of an invariant by a tensor, vector or scalar variable: a quantity of the rank of the variable."""
        raise DeclarationError(f"no derivative is known for {node}")

    def second(self, node: Any, x: Any, y: Any, weight: Expr) -> Operator:
        """weight ∂²h/∂x∂y of an invariant; at a kink an element of the B-subdifferential of the gradient."""
        raise DeclarationError(f"no second derivative is known for {node}")

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        """Numbers: `arguments` are arrays (n,), (n, 3), (n, 6) (Mandel)."""
        raise DeclarationError(f"no numbers are known for {node}")

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        """cvxpy expression of the node; auxiliary constraints are appended. Numbers stand for all parameters in `node`."""
        raise DeclarationError(f"{node} has no conic form")

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]] | None:
        """Legendre–Fenchel conjugate of the node as a function of its own (single) argument, at `dual`: (value, domain as
        expressions ≤ 0); of a concave node, that of its negative; None if no closed form is known."""
        return None

    def examples(self) -> tuple[Any, ...]:
        """Nodes on which whatever the record says can be tried: by default of a tensor, of its deviator and of a shifted one, or of a
        scalar."""
        if not issubclass(self.node, Invariant):
            return (self.node(ScalarVariable("x")),)
        tensor = TensorSymbol("X")
        return tuple(self.node(t) for t in (tensor, dev(tensor), 2 * tensor - identity))
