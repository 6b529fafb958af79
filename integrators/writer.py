"""Write expressions and tensors of a law as statements of a generated module.

Whatever depends on parameters alone is computed once per call (`constants_`) and reaches the point loop as `k0_, k1_, …`. Tensors
are loops over their Mandel components. Names of the generator end with an underscore; names of the law stand as declared.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from sympy import Expr, S, Symbol

from ..potentials.atoms.atom import Invariant
from ..potentials.derivative import invariants_of, is_constant
from ..potentials.invariants import InnerLeaf, NormLeaf, PositiveSquareLeaf, TraceLeaf
from ..potentials.printer import number_code
from ..potentials.tensor import Deviator, IdentityTensor, PositiveTensor, SymmetricTensor, TensorSymbol
from .kernels.terms_text import POSITIVE
from .structure import NoReduction

__all__ = ["Writer"]


@dataclass
class Writer:
    """Statements of one function; `constants` is shared by all functions of a module."""

    constants: dict[Expr, str]
    size: int = 6
    indent: str = "    "
    lines: list[str] = field(default_factory=list)
    leaves: dict[Invariant, Symbol] = field(default_factory=dict)
    spectra: dict[SymmetricTensor, int] = field(default_factory=dict)
    uses: set[str] = field(default_factory=set)

    def line(self, text: str, depth: int = 0) -> None:
        """Append one line."""
        self.lines.append(f"{self.indent}{'    ' * depth}{text}")

    # -- scalars -----------------------------------------------------------------------------------------------------------

    def code(self, expression: Expr) -> str:
        """Text of a scalar; its invariants are computed by statements before it."""
        found = invariants_of(expression)
        table = {leaf: self.leaf(leaf) for leaf in found}
        return number_code(self._hoisted(expression.xreplace(table)))

    def constant(self, expression: Expr) -> str:
        """Name of a coefficient that depends on parameters only."""
        return self.constants.setdefault(expression, f"k{len(self.constants)}_")

    def _hoisted(self, expression: Any) -> Any:
        local = set(self.leaves.values())
        if is_constant(expression) and not expression.free_symbols & local:
            if expression.is_Number:
                return expression
            return Symbol(self.constant(expression))
        if not (expression.is_Add or expression.is_Mul):
            return expression if not expression.args else expression.func(*(self._hoisted(a) for a in expression.args))  # type: ignore[arg-type]
        fixed = [a for a in expression.args if is_constant(a) and not a.free_symbols & local]  # type: ignore[arg-type]
        moving = [self._hoisted(a) for a in expression.args if a not in fixed]  # type: ignore[arg-type]
        joined = expression.func(*fixed)
        if not joined.is_Number:
            joined = Symbol(self.constant(joined))
        return expression.func(joined, *moving)

    # -- tensors -----------------------------------------------------------------------------------------------------------

    def split(self, tensor: SymmetricTensor) -> tuple[dict[SymmetricTensor, Expr], Expr]:
        """Tensor as Σ c_k X_k + s I with X_k variables or positive parts; deviators are opened."""
        found: dict[SymmetricTensor, Expr] = {}
        spherical: Expr = S.Zero
        for atom, c in tensor.terms().items():
            if isinstance(atom, IdentityTensor):
                spherical = spherical + c
            elif isinstance(atom, Deviator):
                base = atom.args[0]
                assert isinstance(base, SymmetricTensor)
                found[base] = found.get(base, S.Zero) + c
                spherical = spherical - c * TraceLeaf(base) / 3
            else:
                found[atom] = found.get(atom, S.Zero) + c
        return found, spherical

    def tensor_into(self, target: str, tensor: SymmetricTensor, add: bool = False) -> None:
        """Write `target[:] = tensor` (or += with `add`) as a loop."""
        terms, spherical = self.split(tensor)
        parts = [(self.code(c), self.component(a)) for a, c in terms.items()]
        sphere = "" if spherical == 0 else self.code(spherical)
        text = _joined(parts)
        if parts or not add:
            self.line(f"for i_ in range({self.size}):")
            self.line(f"{target}[i_] {'+=' if add else '='} {text}", 1)
        if sphere:
            self.line(f"sphere_ = {sphere}")
            for i in range(3):
                self.line(f"{target}[{i}] += sphere_")

    def component(self, atom: SymmetricTensor) -> str:
        """Text of component i_ of an atom."""
        if isinstance(atom, PositiveTensor):
            return f"positive{self.spectrum(atom.args[0])}_[i_]"  # type: ignore[arg-type]
        if not isinstance(atom, TensorSymbol):
            raise NoReduction(f"no component code is written for {atom}")
        return f"{atom.name}[i_]"

    def trace(self, tensor: SymmetricTensor) -> str:
        """Text of tr T."""
        terms, spherical = self.split(tensor)
        parts = []
        for atom, c in terms.items():
            name = self.component(atom)[:-4]
            parts.append((self.code(c), f"({name}[0] + {name}[1] + {name}[2])"))
        text = _joined(parts)
        return text if spherical == 0 else f"{text} + 3.0*({self.code(spherical)})"

    def spectrum(self, tensor: SymmetricTensor) -> int:
        """Number of the eigen-decomposition of a tensor; computed by a statement at first use."""
        if tensor not in self.spectra:
            number = self.spectra[tensor] = len(self.spectra)
            self.uses.add(POSITIVE[self.size])
            self.line(f"positive{number}_ = work_[{4 * number + 2}, :{self.size}]")
            self.line(f"eigen{number}_ = work_[{4 * number + 3}]")
            if isinstance(tensor, TensorSymbol):
                source = tensor.name
            else:
                source = f"argument{number}_"
                self.line(f"{source} = work_[{4 * number + 4}, :{self.size}]")
                self.tensor_into(source, tensor)
            self.line(f"square{number}_ = {POSITIVE[self.size]}({source}, eigen{number}_, positive{number}_)")
        return self.spectra[tensor]

    def leaf(self, leaf: Invariant) -> Symbol:
        """Symbol that holds the value of an invariant; computed by statements at first use."""
        if leaf in self.leaves:
            return self.leaves[leaf]
        first = leaf.args[0]
        if not isinstance(first, SymmetricTensor):
            raise NoReduction(f"no code is written for {leaf}")
        if isinstance(leaf, PositiveSquareLeaf):
            return self.leaves.setdefault(leaf, Symbol(f"square{self.spectrum(first)}_"))
        if isinstance(leaf, TraceLeaf):
            text = self.trace(first)
            symbol = self.leaves.setdefault(leaf, Symbol(f"x{len(self.leaves)}_"))
            self.line(f"{symbol} = {text}")
            return symbol
        if isinstance(leaf, NormLeaf):
            self.uses.add("norm_of")
            self.tensor_into("work_[0]", first)
            symbol = self.leaves.setdefault(leaf, Symbol(f"x{len(self.leaves)}_"))
            self.line(f"{symbol} = norm_of(work_[0], {self.size})")
            return symbol
        if not isinstance(leaf, InnerLeaf):
            raise NoReduction(f"no code is written for {leaf}")
        second = leaf.args[1]
        assert isinstance(second, SymmetricTensor)
        self.tensor_into("work_[0]", first)
        right = "work_[0]"
        if second != first:
            self.tensor_into("work_[1]", second)
            right = "work_[1]"
        symbol = self.leaves.setdefault(leaf, Symbol(f"x{len(self.leaves)}_"))
        self.line(f"{symbol} = 0.0")
        self.line(f"for i_ in range({self.size}):")
        self.line(f"{symbol} += work_[0][i_]*{right}[i_]", 1)
        return symbol


def _joined(parts: list[tuple[str, str]]) -> str:
    text = ""
    for factor, body in parts:
        if factor in ("1.0", "-1.0"):
            sign, term = factor[:-3], body
        elif factor.startswith("-") and factor[1:].replace("_", "").isalnum():
            sign, term = "-", f"{factor[1:]}*{body}"
        else:
            sign, term = "", f"{factor if factor.replace('_', '').isalnum() else '(' + factor + ')'}*{body}"
        text += (f" {'-' if sign else '+'} " if text else sign) + term
    return text or "0.0"
