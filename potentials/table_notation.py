"""The names of Table 1 for one law: forces, rates, stresses and the strain of the split, as text and LaTeX."""

from __future__ import annotations

from typing import Any

from sympy import Expr, Pow, S

from .atoms.eig_max import EigMaxLeaf
from .atoms.eig_min import EigMinLeaf
from .atoms.maximum import Maximum
from .atoms.norm import NormLeaf
from .atoms.positive_part import PositivePart
from .atoms.positive_trace import PositiveTraceLeaf
from .conjugation.laws import dual_of, slots_of
from .conjugation.slots import mentions
from .conjugation.wording import Words, shown
from .law import Law, Variable
from .names import latex_name
from .ranked import Ranked
from .roles import entropy_flux, rates
from .table import Row
from .tensor import TensorSymbol, sym_tensor
from .vector import VectorSymbol

__all__ = ["HeatFlux", "Notation", "bare", "equation", "is_smooth", "numbered"]

KINKS = (NormLeaf, EigMaxLeaf, EigMinLeaf, PositiveTraceLeaf, Maximum, PositivePart)


class HeatFlux(VectorSymbol):
    """−q/T, as the reader knows it."""

    __slots__ = ()

    def _shown(self, printer: Any, latex: bool) -> str:
        return r"\left(-\boldsymbol{q}/T\right)" if latex else "(-q/T)"


class Notation:
    """Names for one law; `irreversible` is None in the total split, else the tensors whose sum is ε^ir."""

    def __init__(self, law: Law, irreversible: tuple[TensorSymbol, ...] | None) -> None:
        self.law = law
        self.reversible = irreversible is not None
        self.irreversible = irreversible or ()
        self.viscous = law.observable in law.forces
        self.strain = sym_tensor(f"{law.observable.name}_r") if self.irreversible else law.observable
        self.rho, self.rho_row = self.density()
        self.duals = {s: self.dual(s) for s in slots_of(law)}

    # -- names -----------------------------------------------------------------------------------------------------------------

    def density(self) -> tuple[Expr, list[Row]]:
        """ρ and its row."""
        rho = self.law.density
        if rho is None:
            return S.One, []
        text, tex = shown(rho)
        text, tex = ("rho", r"\rho") if text == "rho" else (f"rho = {text}", rf"\rho = {tex}")
        return rho, [Row("density", f"{text}, potentials per unit mass", rf"{tex},\ \text{{potentials per unit mass}}")]

    def dual(self, slot: Any) -> Any:
        """The symbol that a slot of φ or φ* is paired with."""
        found = dual_of(slot, self.law)
        return HeatFlux(found.name) if found == self.flux else found

    @property
    def flux(self) -> Any:
        """−q/T as an argument of φ, None for a law without temperature."""
        return None if self.law.temperature is None else entropy_flux(self.law.temperature)

    def pairs(self) -> dict[Any, tuple[Any, Any]]:
        """(rate, force) symbols by variable, for the slots of φ and φ*."""
        found = {}
        for slot, dual in self.duals.items():
            first = HeatFlux(slot.name) if slot == self.flux else slot
            found[slot.variable] = (first, dual) if slot.role == "rate" else (dual, first)
        return found

    def rate(self, variable: Any) -> Words:
        """Rate of a variable, −q/T of the temperature."""
        pair = self.pairs().get(variable)
        return bare(shown(pair[0] if pair is not None else rates(variable)))

    def force(self, variable: Variable) -> Words:
        """Force of a variable by the state law; of a part of ε^ir in the reversible split, A^r with A = σ + A^r."""
        pair = self.pairs().get(variable)
        base = shown(pair[1]) if pair is not None else (f"A_{variable.name}", rf"A_{{{latex_name(variable.name)}}}")
        return (f"{base[0]}_r", rf"{base[1]}^{{r}}") if variable in self.irreversible else base

    def stress(self) -> Words:
        """The stress of the state law."""
        if self.viscous:
            return "sig_r", r"\boldsymbol{\sigma}^{r}"
        return ("sig", r"\boldsymbol{\sigma}")

    def viscous_stress(self) -> Words:
        """σ^ir."""
        return shown(self.pairs()[self.law.observable][1]) if self.viscous else ("sig_ir", r"\boldsymbol{\sigma}^{ir}")

    # -- the observable ---------------------------------------------------------------------------------------------

    def written(self, expression: Any) -> Any:
        """A potential in the observable of the split."""
        if not self.irreversible:
            return expression
        total: Any = self.strain
        for x in self.irreversible:
            total = total + x
        return expression.xreplace({self.law.observable: total})

    def derivative(self, potential: str, symbol: Any, sign: str = "", scaled: bool = True) -> Words:
        """[ρ] ∂potential/∂symbol with a sign."""
        name, tex = shown(symbol)
        letter = {"psi": r"\psi", "psi_star": r"\psi^{*}"}[potential]
        factor = ("rho*", r"\rho\,") if self.rho != 1 and scaled else ("", "")
        return f"{sign}{factor[0]}d{potential}/d{name}", rf"{sign}{factor[1]}\partial_{{{tex}}}{letter}"


def bare(words: Words) -> Words:
    """−q/T without its parentheses."""
    return ("-q/T", r"-\boldsymbol{q}/T") if words[0] == "(-q/T)" else words


def equation(title: str, left: Words, value: Any, middle: Words = ("", "")) -> Row:
    """left = middle = value."""
    text, tex = ("0", "0") if isinstance(value, int) and value == 0 else shown(value)
    between = (f"{middle[0]} = ", f"{middle[1]} = ") if middle[0] else ("", "")
    return Row(title, f"{left[0]} = {between[0]}{text}", f"{left[1]} = {between[1]}{tex}")


def numbered(mark: str) -> str:
    """LaTeX subscript of a numbered surface."""
    return f"_{{{mark}}}" if mark else ""


def is_smooth(expression: Any, symbol: Any) -> bool:
    """True if no node with a kink, other than under a power above one, stands over the symbol."""
    if not mentions(expression, {symbol}):
        return True
    if isinstance(expression, Pow) and isinstance(expression.base, KINKS):
        if expression.exp.is_number and not expression.exp > 1:
            return False
        return not isinstance(expression.base, (PositivePart, Maximum)) or all(
            is_smooth(a, symbol) for a in expression.base.args
        )
    if isinstance(expression, Pow) and expression.exp == S.Half:
        return False
    if isinstance(expression, KINKS):
        return False
    return isinstance(expression, Ranked) or all(is_smooth(a, symbol) for a in expression.args)
