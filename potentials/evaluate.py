"""Numbers of declared expressions, at many points at once (numpy, imported when called).

At a kink the number of a gradient is that of an element of the subdifferential: the gradient of a norm at zero is zero, H(0) = 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sympy import Expr, Float, Lambda

from ..errors import DeclarationError
from .atoms import ATOMS, atom_of
from .ranked import Ranked
from .spectral import EigenDyad, SpectralTensor, decompose, from_matrix
from .tensor import Deviator, IdentityTensor, PositiveTensor

__all__ = ["evaluate"]


def evaluate(thing: Any, values: Mapping[Any, Any]) -> Any:
    """Value of a scalar expression, (n,) or (), or of a tensor (n, 6) or vector (n, 3).

    `values` maps symbols (variables, forces, rates, frozen values, parameters) to arrays (n,), (n, 6), (n, 3) or numbers. A symbol without
    a value is an error that names it.
    """
    return _Evaluation(values).of(thing)


class _Evaluation:
    def __init__(self, values: Mapping[Any, Any]) -> None:
        import numpy as np

        self.np = np
        self.values = {key: np.asarray(value, dtype=float) for key, value in values.items()}
        self.known: dict[Any, Any] = {}

    def of(self, thing: Any) -> Any:
        if thing in self.known:
            return self.known[thing]
        found = self._ranked(thing) if isinstance(thing, Ranked) else self._scalar(thing)
        self.known[thing] = found
        return found

    def _symbol(self, symbol: Any) -> Any:
        try:
            return self.values[symbol]
        except KeyError:
            raise DeclarationError(f"no value is given for '{symbol}'") from None

    def _ranked(self, thing: Ranked) -> Any:
        np = self.np
        if thing in self.values:
            return self.values[thing]
        if isinstance(thing, IdentityTensor):
            return np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        if isinstance(thing, Deviator):
            inside = self.of(thing.args[0])
            mean = inside[..., :3].sum(axis=-1, keepdims=True) / 3.0
            return inside - mean * self._ranked(_IDENTITY)
        if isinstance(thing, PositiveTensor):
            return self._spectral(thing.args[0], lambda e: np.maximum(e, 0.0))
        if isinstance(thing, SpectralTensor):
            function: Any = thing.args[0]
            return self._spectral(
                thing.args[1],
                lambda e: np.broadcast_to(
                    _Evaluation({**self.values, function.variables[0]: e}).of(function.expr), e.shape
                ),
            )
        if isinstance(thing, EigenDyad):
            _, vectors = decompose(self.of(thing.args[0]))
            n = vectors[..., :, 2 if thing.args[1] == 1 else 0]
            return from_matrix(n[..., :, None] * n[..., None, :])
        terms = thing.terms()
        if thing in terms:
            return self._symbol(thing)
        total: Any = np.zeros(6 if thing.rank == 2 else 3)
        for atom, coefficient in terms.items():
            total = total + np.asarray(self.of(coefficient))[..., None] * self.of(atom)
        return total

    def _spectral(self, tensor: Any, function: Any) -> Any:
        values, vectors = decompose(self.of(tensor))
        return from_matrix(self.np.einsum("...ik,...k,...jk->...ij", vectors, function(values), vectors))

    def _scalar(self, thing: Any) -> Any:
        np = self.np
        if thing in self.values:
            return self.values[thing]
        if thing.is_number:
            return np.asarray(float(thing))
        if thing.is_Symbol:
            return self._symbol(thing)
        if thing.is_Add:
            return sum((self.of(a) for a in thing.args), np.asarray(0.0))
        if thing.is_Mul:
            return self._product(thing)
        arguments = tuple(self._bound(a) if isinstance(a, Lambda) else self.of(a) for a in thing.args)
        if type(thing) in ATOMS:
            return atom_of(thing).value(thing, arguments)
        name = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "Abs": "abs"}.get(
            thing.func.__name__, thing.func.__name__
        )
        function = getattr(np, name, None)
        if not isinstance(thing, Expr) or function is None:
            raise DeclarationError(f"no numbers are known for {thing}")
        return function(*arguments)

    def _bound(self, function: Any) -> Lambda:
        """A function of an eigenvalue with numbers for its parameters."""
        free = function.expr.free_symbols - set(function.variables)
        numbers = {s: Float(float(self._symbol(s)), 17) for s in free}
        return Lambda(function.variables[0], function.expr.xreplace(numbers))

    def _product(self, thing: Any) -> Any:
        found: Any = self.np.asarray(1.0)
        for factor in thing.args:
            found = found * self.of(factor)
        return found


_IDENTITY = IdentityTensor()
