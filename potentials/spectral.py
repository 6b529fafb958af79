"""Functions of the eigenvalues of a tensor: g(T) = Σ g(t_i) n_i⊗n_i, and the dyad n⊗n of an extreme eigenvalue.

At repeated eigenvalues g(T) is well defined; the dyad is then one of several, an element of the subdifferential of the eigenvalue.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sympy import Basic, Dummy, Expr, Integer, Lambda, sympify

from ..errors import DeclarationError
from .tensor import SymmetricTensor, TensorSum

__all__ = [
    "EigenDyad",
    "SpectralTensor",
    "as_function",
    "as_matrix",
    "decompose",
    "eigenvalues",
    "from_matrix",
    "spectral_tensor",
    "to_matrix",
]


class SpectralTensor(SymmetricTensor):
    """g(T) for a scalar function g, kept as a sympy `Lambda`."""

    __slots__ = ()

    def __new__(cls, function: Lambda, tensor: SymmetricTensor) -> SymmetricTensor:  # type: ignore[misc]
        return Basic.__new__(cls, function, tensor)

    def _shown(self, printer: Any, latex: bool) -> str:
        function, tensor = self.args
        symbol = function.variables[0]  # type: ignore[attr-defined]
        body = printer._print(function.expr)  # type: ignore[attr-defined]
        if latex:
            return rf"\left[{printer._print(symbol)} \mapsto {body}\right]\left({printer._print(tensor)}\right)"
        return f"spectral({symbol} -> {body}, {printer._print(tensor)})"


class EigenDyad(SymmetricTensor):
    """n⊗n of the largest (which = 1) or smallest (which = −1) eigenvalue of T."""

    __slots__ = ()

    def __new__(cls, tensor: SymmetricTensor, which: Any) -> SymmetricTensor:  # type: ignore[misc]
        return Basic.__new__(cls, tensor, Integer(which))

    def _shown(self, printer: Any, latex: bool) -> str:
        word = "max" if self.args[1] == 1 else "min"
        inside = printer._print(self.args[0])
        return (
            rf"\boldsymbol{{n}}\otimes\boldsymbol{{n}}_{{{word}}}\left({inside}\right)"
            if latex
            else f"dyad_{word}({inside})"
        )


def as_function(function: Callable[[Any], Any] | Lambda, word: str) -> Lambda:
    """A scalar function of one real argument as a canonical `Lambda` of a symbol x."""
    from sympy import Symbol

    x = Symbol("x", real=True)
    if isinstance(function, Lambda):
        body: Any = function(x)
    else:
        probe = Dummy("x", real=True)
        try:
            body = sympify(function(probe), strict=True)
        except DeclarationError:
            raise
        except Exception as error:
            raise DeclarationError(
                f"{word}: the function of an eigenvalue cannot be written: {type(error).__name__}; "
                "give a function of one scalar, for example lambda x: pos(x)**2"
            ) from None
        if not isinstance(body, Expr):
            raise DeclarationError(f"{word}: the function of an eigenvalue must return a scalar expression")
        body = body.xreplace({probe: x})
    return Lambda(x, body)


def spectral_tensor(function: Any, tensor: SymmetricTensor) -> SymmetricTensor:
    """g(T); zero and constant functions are simplified."""
    found = as_function(function, "spectral_tensor")
    return TensorSum() if found.expr == 0 else SpectralTensor(found, tensor)


# -- numbers ----------------------------------------------------------------------------------------------------------------------


def to_matrix(tensor: Any) -> Any:
    """Matrices (..., 3, 3) of Mandel components (..., 6)."""
    import numpy as np

    found = np.asarray(tensor, dtype=float)
    matrix = np.empty((*found.shape[:-1], 3, 3))
    for i in range(3):
        matrix[..., i, i] = found[..., i]
    for place, (i, j) in zip((3, 4, 5), ((1, 2), (0, 2), (0, 1)), strict=True):
        matrix[..., i, j] = matrix[..., j, i] = np.sqrt(0.5) * found[..., place]
    return matrix


def from_matrix(matrix: Any) -> Any:
    """Mandel components (..., 6) of symmetric matrices (..., 3, 3)."""
    import numpy as np

    root = np.sqrt(2.0)
    parts = [matrix[..., i, i] for i in range(3)]
    parts += [root * matrix[..., i, j] for i, j in ((1, 2), (0, 2), (0, 1))]
    return np.stack(parts, axis=-1)


def eigenvalues(tensor: Any) -> Any:
    """Eigenvalues (..., 3), ascending, of Mandel components (..., 6)."""
    import numpy as np

    return np.linalg.eigvalsh(to_matrix(tensor))


def decompose(tensor: Any) -> tuple[Any, Any]:
    """Eigenvalues (..., 3), ascending, and eigenvectors (..., 3, 3) in columns."""
    import numpy as np

    return np.linalg.eigh(to_matrix(tensor))


def as_matrix(tensor: Any) -> Any:
    """cvxpy matrix (3, 3) of a cvxpy vector of Mandel components (6,)."""
    import cvxpy

    half = 0.5**0.5
    a, b, c, d, e, f = (tensor[i] for i in range(6))
    rows = [[a, half * f, half * e], [half * f, b, half * d], [half * e, half * d, c]]
    return cvxpy.bmat(rows)
