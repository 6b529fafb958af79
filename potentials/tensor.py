"""Symmetric second-order tensors with their own ranked type, beside the scalars of sympy.

Every tensor is kept as a canonical linear combination

    T = Σ c_k a_k,   a_k ∈ {X, dev X, I, X^≥, dev X^≥}

with scalar coefficients c_k; `dev` is linear and distributes over the sum, dev I = 0. The empty sum is the typed zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from sympy import Basic, Expr, S, Tuple, default_sort_key
from sympy.core.symbol import Str

from ..errors import DeclarationError
from .names import checked_name, latex_name
from .ranked import Ranked, rank_word, shown_term, sorted_terms

__all__ = [
    "Deviator",
    "ForceTensor",
    "FrozenTensor",
    "IdentityTensor",
    "PositiveTensor",
    "RateTensor",
    "SymmetricTensor",
    "TensorSum",
    "TensorSymbol",
    "combine",
    "dev",
    "identity",
    "sym_tensor",
]


class SymmetricTensor(Ranked):
    """Element of 𝕊, the symmetric 3×3 tensors with A:B = tr(AB)."""

    __slots__ = ()
    rank = 2
    kind = "tensor"

    @classmethod
    def linear(cls, pairs: Iterable[tuple[Any, Any]]) -> SymmetricTensor:
        return TensorSum(*(Tuple(t, c) for t, c in pairs))


class TensorSymbol(SymmetricTensor):
    """A named tensor variable."""

    __slots__ = ()
    role = "state"

    def __new__(cls, name: Any) -> TensorSymbol:
        return super().__new__(cls, name if isinstance(name, Str) else Str(checked_name(name, "tensor")))

    @property
    def name(self) -> str:
        return str(self.args[0])

    def _shown(self, printer: Any, latex: bool) -> str:
        return rf"\boldsymbol{{{latex_name(self.name)}}}" if latex else self.name


class _PairedTensor(TensorSymbol):
    """Tensor symbol that belongs to a tensor variable."""

    __slots__ = ()

    def __new__(cls, name: Any, variable: TensorSymbol) -> Any:
        return Basic.__new__(cls, name if isinstance(name, Str) else Str(checked_name(name, cls.role)), variable)

    @property
    def variable(self) -> TensorSymbol:
        return self.args[1]  # type: ignore[return-value]


class ForceTensor(_PairedTensor):
    """Thermodynamic force A_m = −∂ψ/∂α_m of a tensor variable; of the observable, the irreversible stress."""

    __slots__ = ()
    role = "force"


class RateTensor(_PairedTensor):
    """Rate of a tensor variable."""

    __slots__ = ()
    role = "rate"

    def _shown(self, printer: Any, latex: bool) -> str:
        name = self.variable.name
        return rf"\dot{{\boldsymbol{{{latex_name(name)}}}}}" if latex else f"d{name}/dt"


class FrozenTensor(_PairedTensor):
    """Value of a tensor variable at the start of the step."""

    __slots__ = ()
    role = "frozen"

    @property
    def name(self) -> str:
        return f"{self.variable.name}_frozen_"

    def _shown(self, printer: Any, latex: bool) -> str:
        name = self.variable.name
        return rf"\boldsymbol{{{latex_name(name)}}}^{{n}}" if latex else f"frozen({name})"


class IdentityTensor(SymmetricTensor):
    """I, with tr I = 3."""

    __slots__ = ()

    def _shown(self, printer: Any, latex: bool) -> str:
        return r"\boldsymbol{I}" if latex else "I"


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

    def _shown(self, printer: Any, latex: bool) -> str:
        inside = printer._print(self.args[0])
        return rf"\mathrm{{dev}}\left({inside}\right)" if latex else f"dev({inside})"


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

    def _shown(self, printer: Any, latex: bool) -> str:
        inside = printer._print(self.args[0])
        return rf"\left({inside}\right)^{{\geq}}" if latex else f"pos({inside})"


class TensorSum(SymmetricTensor):
    """Canonical linear combination; arguments are pairs (tensor, coefficient) in any order, flattened and sorted here."""

    __slots__ = ()

    def __new__(cls, *pairs: Any) -> SymmetricTensor:  # type: ignore[misc]
        kept = sorted_terms((p.args[0], p.args[1]) for p in pairs)
        if len(kept) == 1 and kept[0].args[1] == 1:
            return kept[0].args[0]  # type: ignore[return-value]
        return Basic.__new__(cls, *kept)

    def terms(self) -> dict[SymmetricTensor, Expr]:
        return {pair.args[0]: pair.args[1] for pair in self.args}  # type: ignore[misc]

    def _shown(self, printer: Any, latex: bool) -> str:
        terms = self.terms()
        if not terms:
            return r"\boldsymbol{0}" if latex else "0"
        everywhere = all(isinstance(a, Deviator) for a in terms)
        if everywhere and (len(set(terms.values())) > 1 or set(terms.values()) == {S.One}):
            inside = printer._print(from_terms({a.args[0]: c for a, c in terms.items()}))  # type: ignore[misc]
            return rf"\mathrm{{dev}}\left({inside}\right)" if latex else f"dev({inside})"
        devs = {a: c for a, c in terms.items() if isinstance(a, Deviator)}
        text = ""
        if len(devs) > 1 and len(set(devs.values())) == 1:
            # one factor for the deviator of the sum, as it was declared
            joined = Deviator(from_terms({a.args[0]: S.One for a in devs}))  # type: ignore[misc]
            terms = {a: c for a, c in terms.items() if a not in devs}
            text = shown_term("", next(iter(devs.values())), printer._print(joined), printer, latex)
        order = sorted(terms.items(), key=lambda pair: (isinstance(pair[0], IdentityTensor), default_sort_key(pair[0])))
        for atom, c in order:
            text = shown_term(text, c, printer._print(atom), printer, latex)
        return text


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
        raise DeclarationError(f"rank mismatch: dev takes a tensor, not a {rank_word(tensor)}")
    return Deviator(tensor)


identity = IdentityTensor()
