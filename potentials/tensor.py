"""Symmetric second-order tensors with their own ranked type, beside the scalars of sympy.

A tensor is a sympy `Basic` but not an `Expr`: it can be added to tensors and multiplied by scalars, and nothing else, so that
it never commutes into a product of scalars by accident. Every tensor is kept as a canonical linear combination

    T = Σ c_k a_k,   a_k ∈ {X, dev X, I, X^≥, dev X^≥}

with scalar coefficients c_k; `dev` is linear and distributes over the sum, dev I = 0. The empty sum is the typed zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sympy import Basic, Expr, Integer, S, Tuple, default_sort_key, sympify
from sympy.core.symbol import Str

from ..errors import DeclarationError
from .names import checked_name, latex_name

__all__ = [
    "Deviator",
    "ForceTensor",
    "IdentityTensor",
    "PositiveTensor",
    "SymmetricTensor",
    "TensorSum",
    "TensorSymbol",
    "combine",
    "dev",
    "identity",
    "sym_tensor",
]


def scalar_operand(value: object, action: str) -> Expr:
    """Turn a number or sympy scalar into an `Expr`; strings are refused (they would be evaluated)."""
    if isinstance(value, SymmetricTensor):
        raise DeclarationError(
            f"rank mismatch: {action} two tensors is not defined; use inner(a, b) for the scalar product"
        )
    try:
        number = sympify(value, strict=True)
    except Exception:
        raise DeclarationError(f"rank mismatch: {action} a tensor and {type(value).__name__} is not defined") from None
    if not isinstance(number, Expr):
        raise DeclarationError(f"rank mismatch: {action} a tensor and {type(value).__name__} is not defined")
    if number is S.NaN or number.has(S.NaN, S.ComplexInfinity, S.Infinity, S.NegativeInfinity):
        raise DeclarationError("a coefficient of a tensor must be finite")
    return number


class SymmetricTensor(Basic):
    """Element of 𝕊, the symmetric 3×3 tensors with A:B = tr(AB)."""

    __slots__ = ()
    __array_ufunc__ = None
    rank = 2

    def terms(self) -> dict[SymmetricTensor, Expr]:
        """Atoms and their coefficients."""
        return {self: S.One}

    def __add__(self, other: object) -> SymmetricTensor:
        return combine(self, _tensor_operand(other, "adding"))

    __radd__ = __add__

    def __sub__(self, other: object) -> SymmetricTensor:
        return combine(self, -_tensor_operand(other, "subtracting"))

    def __rsub__(self, other: object) -> SymmetricTensor:
        return combine(_tensor_operand(other, "subtracting"), -self)

    def __neg__(self) -> SymmetricTensor:
        return self * Integer(-1)

    def __mul__(self, other: object) -> SymmetricTensor:
        factor = scalar_operand(other, "multiplying")
        return TensorSum(*(Tuple(atom, factor * c) for atom, c in self.terms().items()))

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> SymmetricTensor:
        divisor = scalar_operand(other, "dividing")
        if divisor.is_zero:
            raise DeclarationError("a tensor cannot be divided by zero")
        return self * (S.One / divisor)

    def __pow__(self, other: object) -> Any:
        raise DeclarationError("rank mismatch: a tensor has no power; write inner(a, a) or norm(a)**n")

    def _sympystr(self, printer: Any) -> str:
        return _printed(self, printer, latex=False)

    def _latex(self, printer: Any) -> str:
        return _printed(self, printer, latex=True)

    _sympyrepr = _sympystr

    def _repr_latex_(self) -> str:
        from sympy import latex

        return f"$\\displaystyle {latex(self)}$"


def _tensor_operand(value: object, action: str) -> SymmetricTensor:
    if isinstance(value, SymmetricTensor):
        return value
    if isinstance(value, (int, Integer)) and value == 0:
        return TensorSum()
    raise DeclarationError(
        f"rank mismatch: {action} a tensor and a scalar; write scalar * identity for a spherical tensor"
    )


class TensorSymbol(SymmetricTensor):
    """A named tensor variable."""

    __slots__ = ()

    def __new__(cls, name: Any) -> TensorSymbol:
        return super().__new__(cls, name if isinstance(name, Str) else Str(checked_name(name, "tensor")))

    @property
    def name(self) -> str:
        return str(self.args[0])


class ForceTensor(TensorSymbol):
    """Thermodynamic force A_m = −∂ψ/∂α_m of a tensor variable."""

    __slots__ = ()

    def __new__(cls, name: Any, variable: TensorSymbol) -> ForceTensor:
        return Basic.__new__(cls, name if isinstance(name, Str) else Str(checked_name(name, "force")), variable)

    @property
    def variable(self) -> TensorSymbol:
        return self.args[1]  # type: ignore[return-value]


class IdentityTensor(SymmetricTensor):
    """I, with tr I = 3."""

    __slots__ = ()


class Deviator(SymmetricTensor):
    """dev X = X − (tr X) I/3. Distributes over sums; dev I = 0; dev dev X = dev X."""

    __slots__ = ()

    def __new__(cls, tensor: SymmetricTensor) -> SymmetricTensor:  # type: ignore[misc]
        if isinstance(tensor, IdentityTensor):
            return TensorSum()
        if isinstance(tensor, Deviator):
            return tensor
        if isinstance(tensor, TensorSum):
            return TensorSum(*(Tuple(Deviator(atom), c) for atom, c in tensor.terms().items()))
        return Basic.__new__(cls, tensor)


class PositiveTensor(SymmetricTensor):
    """Spectral positive part X^≥ = Σ ⟨x_i⟩ n_i⊗n_i, the projection of X on the positive semidefinite tensors."""

    __slots__ = ()

    def __new__(cls, tensor: SymmetricTensor) -> SymmetricTensor:  # type: ignore[misc]
        if isinstance(tensor, PositiveTensor) or not tensor.terms():
            return tensor
        if tensor.has(PositiveTensor):
            raise DeclarationError(
                "pos of a tensor that already contains pos(...) is not available; declare the two energies apart"
            )
        return Basic.__new__(cls, tensor)


class TensorSum(SymmetricTensor):
    """Canonical linear combination; arguments are pairs (tensor, coefficient) in any order, flattened and sorted here."""

    __slots__ = ()

    def __new__(cls, *pairs: Any) -> SymmetricTensor:  # type: ignore[misc]
        found: dict[SymmetricTensor, Expr] = {}
        for tensor, coefficient in pairs:
            for atom, inner_coefficient in tensor.terms().items():
                found[atom] = found.get(atom, S.Zero) + coefficient * inner_coefficient
        kept = {atom: c for atom, c in found.items() if c != 0}
        if len(kept) == 1:
            ((atom, c),) = kept.items()
            if c == 1:
                return atom
        return Basic.__new__(cls, *(Tuple(a, kept[a]) for a in sorted(kept, key=default_sort_key)))

    def terms(self) -> dict[SymmetricTensor, Expr]:
        return {pair.args[0]: pair.args[1] for pair in self.args}  # type: ignore[misc]


def combine(*tensors: SymmetricTensor) -> SymmetricTensor:
    """Sum of tensors in canonical form."""
    return TensorSum(*(Tuple(t, S.One) for t in tensors))


def from_terms(terms: Mapping[SymmetricTensor, Expr]) -> SymmetricTensor:
    """Tensor from atoms and coefficients."""
    return TensorSum(*(Tuple(t, c) for t, c in terms.items()))


def sym_tensor(name: str) -> TensorSymbol:
    """Declare a symmetric second-order tensor variable."""
    return TensorSymbol(name)


def dev(tensor: SymmetricTensor) -> SymmetricTensor:
    """Deviator A − (tr A) I/3."""
    if not isinstance(tensor, SymmetricTensor):
        raise DeclarationError("rank mismatch: dev takes a tensor, not a scalar")
    return Deviator(tensor)


identity = IdentityTensor()


def _printed(tensor: SymmetricTensor, printer: Any, latex: bool) -> str:
    if isinstance(tensor, TensorSymbol):
        return rf"\boldsymbol{{{latex_name(tensor.name)}}}" if latex else tensor.name
    if isinstance(tensor, IdentityTensor):
        return r"\boldsymbol{I}" if latex else "I"
    if isinstance(tensor, Deviator):
        inside = printer._print(tensor.args[0])
        return rf"\mathrm{{dev}}\left({inside}\right)" if latex else f"dev({inside})"
    if isinstance(tensor, PositiveTensor):
        inside = printer._print(tensor.args[0])
        return rf"\left({inside}\right)^{{\geq}}" if latex else f"pos({inside})"
    terms = tensor.terms()
    if not terms:
        return r"\boldsymbol{0}" if latex else "0"
    if all(isinstance(a, Deviator) for a in terms) and (len(set(terms.values())) > 1 or set(terms.values()) == {S.One}):
        inside = printer._print(from_terms({a.args[0]: c for a, c in terms.items()}))  # type: ignore[misc]
        return rf"\mathrm{{dev}}\left({inside}\right)" if latex else f"dev({inside})"
    devs = {a: c for a, c in terms.items() if isinstance(a, Deviator)}
    if len(devs) > 1 and len(set(devs.values())) == 1:
        # one factor for the deviator of the sum, as it was declared
        joined = Deviator(from_terms({a.args[0]: S.One for a in devs}))  # type: ignore[misc]
        inside = printer._print(joined)
        terms = {a: c for a, c in terms.items() if a not in devs}
        text = _term("", next(iter(devs.values())), inside, printer, latex)
    else:
        text = ""
    for atom, c in sorted(
        terms.items(), key=lambda pair: (isinstance(pair[0], IdentityTensor), default_sort_key(pair[0]))
    ):
        text = _term(text, c, printer._print(atom), printer, latex)
    return text


def _term(text: str, c: Expr, body: str, printer: Any, latex: bool) -> str:
    """`text` with the term c·body appended."""
    negative = c.could_extract_minus_sign()
    size = -c if negative else c
    factor = printer._print(size)
    if size.is_Add:
        factor = rf"\left({factor}\right)" if latex else f"({factor})"
    shown = body if size == 1 else f"{factor}{' ' if latex else '*'}{body}"
    return text + (" - " if text else "-") + shown if negative else text + (" + " if text else "") + shown
