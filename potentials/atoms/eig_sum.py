"""Σ g(t_i) over the eigenvalues of a tensor: convex if g is (Davis 1957), with gradient g′(T)."""

from __future__ import annotations

from typing import Any

from sympy import Expr, S, exp

from ..operator import Operator
from ..spectral import as_function, eigenvalues, spectral_tensor
from ..tensor import SymmetricTensor, TensorSymbol, dev
from .atom import Atom, Invariant
from .eig_max import checked_tensor
from .linear import adjoint, linear_part
from .positive_part import PositivePart

__all__ = ["EigSum", "EigSumLeaf", "eig_sum"]


class EigSumLeaf(Invariant):
    """Σ g(t_i); arguments are g as a `Lambda` and T."""

    __slots__ = ()

    def _sympystr(self, printer: Any) -> str:
        function, tensor = self.args
        symbol = function.variables[0]  # type: ignore[attr-defined]
        return f"eig_sum({symbol} -> {printer._print(function.expr)}, {printer._print(tensor)})"  # type: ignore[attr-defined]

    _sympyrepr = _sympystr

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        function, tensor = self.args
        symbol = printer._print(function.variables[0])  # type: ignore[attr-defined]
        body = printer._print(function.expr)  # type: ignore[attr-defined]
        shown = (
            rf"\sum_i \left[{symbol} \mapsto {body}\right]\!\left(\lambda_i\left({printer._print(tensor)}\right)\right)"
        )
        return shown if exp is None else rf"\left({shown}\right)^{{{exp}}}"


class EigSum(Atom):
    """As convex and as smooth as g; gradient and Hessian by g′ and the divided differences of g′. (Σ g)* is Σ g* (Lewis 1996)."""

    word = "eig_sum"
    node = EigSumLeaf
    smoothness = "C1"

    def curvature(self, node: Any, require: Any) -> str:
        from ..admissibility.convexity import one_variable

        function = node.args[0]
        return one_variable(function.expr, function.variables[0], require)

    def sign(self, node: Any, signs: tuple[int, ...]) -> int:
        from ..admissibility.bounds import interval

        low, high = interval(node.args[0].expr)
        return 1 if low >= 0.0 else (-1 if high <= 0.0 else 0)

    def degree(self, node: Any) -> Expr | None:
        """n of g = c xⁿ and of g = c ⟨x⟩ⁿ."""
        function = node.args[0]
        base, exponent = function.expr.as_coeff_Mul()[1].as_base_exp()
        symbol = function.variables[0]
        return exponent if base in (symbol, PositivePart(symbol)) else None

    def gradient(self, node: Any, variable: Any) -> Any:
        function, tensor = node.args
        if variable.rank != 2:
            return variable.linear(())
        symbol = function.variables[0]
        slope = spectral_tensor(lambda x: function.expr.diff(symbol).xreplace({symbol: x}), tensor)
        return adjoint(linear_part(tensor, variable), slope)

    def second(self, node: Any, x: Any, y: Any, weight: Expr) -> Operator:
        function, tensor = node.args
        if x.rank != 2 or y.rank != 2:
            return Operator()
        symbol = function.variables[0]
        slope = spectral_tensor(lambda t: function.expr.diff(symbol).xreplace({symbol: t}), tensor)
        if not slope.terms():
            return Operator()
        return Operator(functions=((weight, slope),)).between(linear_part(tensor, x), linear_part(tensor, y))

    def value(self, node: Any, arguments: tuple[Any, ...]) -> Any:
        function, values = arguments[0], eigenvalues(arguments[1])  # the function with its parameters bound
        return function(values).sum(axis=-1)

    def conic(self, node: Any, arguments: tuple[Any, ...], constraints: list[Any]) -> Any:
        """Σ g(μ_i) with the eigenvalues of T majorised by μ₁ ≥ μ₂ ≥ μ₃ (Ben-Tal & Nemirovski 2001, §4.2): μ₃ I ⪯ T ⪯ μ₁ I, Σ μ_i = tr T."""
        import cvxpy
        import numpy as np

        from ..conic_form import Frame, conic_expression
        from ..spectral import as_matrix

        function, matrix = node.args[0], as_matrix(arguments[1])
        mu = cvxpy.Variable(3)
        constraints += [mu[0] >= mu[1], mu[1] >= mu[2], cvxpy.sum(mu) == cvxpy.trace(matrix)]
        constraints += [mu[0] * np.eye(3) - matrix >> 0, matrix - mu[2] * np.eye(3) >> 0]
        total: Any = 0.0
        for i in range(3):
            frame = Frame({function.variables[0]: i}, 3, {})
            total = total + conic_expression(function.expr, frame, mu, constraints)
        return total

    def conjugate(self, node: Any, dual: Any) -> tuple[Expr, tuple[Expr, ...]] | None:
        from ..conjugation.form import NoRule
        from ..conjugation.groups import conjugate_of_eigenvalues

        function = node.args[0]
        try:
            found = conjugate_of_eigenvalues(function.expr, function.variables[0], dual)
        except NoRule:
            return None
        return found.value, found.inequalities

    def examples(self) -> tuple[Any, ...]:
        x = TensorSymbol("X")
        functions = (lambda t: t**2, lambda t: PositivePart(t) ** 3, lambda t: exp(t / 2))
        return (*(eig_sum(g, x) for g in functions), eig_sum(functions[1], dev(x)))


def eig_sum(function: Any, tensor: SymmetricTensor) -> Expr:
    """Σ g(t_i) over the eigenvalues of `tensor`; `function` maps a scalar to a scalar, for example `lambda x: pos(x)**3`."""
    value = checked_tensor(tensor, "eig_sum")
    found = as_function(function, "eig_sum")
    if not value.terms():
        return 3 * found.expr.xreplace({found.variables[0]: S.Zero})
    return EigSumLeaf(found, value)
