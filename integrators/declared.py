"""A law's step as expressions: ψ, the finite part and the surfaces of its force function, and which data enter them.

State frozen at the start of the step and the temperature are data of a point, not of the law. Every largest subexpression made of
parameters and such data, k(θ), is replaced by a coefficient symbol, so that what varies from point to point is a short list of numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Add, Dummy, Expr, Lambda, Mul, S, Symbol

from ..errors import DeclarationError
from ..potentials import Law
from ..potentials.derivative import variables_of
from ..potentials.evaluate import evaluate
from ..potentials.ranked import Ranked
from ..potentials.scalars import ScalarVariable, Temperature
from ..potentials.tensor import TensorSymbol
from ..potentials.vector import VectorSymbol
from .strain_energy import StrainEnergy, without_strain_terms

__all__ = ["DeclaredStep", "components", "declared_step", "packed_layout", "state_layout", "strain_flows"]

Array = NDArray[np.float64]


def components(variable: Any, size: int = 6) -> int:
    """Number of components of a variable: `size` of a tensor (6, Mandel, unless said), 3 or 1."""
    return {2: size, 1: 3}.get(getattr(variable, "rank", 0), 1)


def state_layout(law: Law, size: int = 6) -> tuple[dict[str, tuple[int, int]], int]:
    """Place (start, length) of every internal variable in a packed state row, as declared, and the number of their components;
    `size` is that of a tensor."""
    layout: dict[str, tuple[int, int]] = {}
    start = 0
    for variable in law.internal:
        layout[variable.name] = (start, components(variable, size))
        start += components(variable, size)
    return layout, start


def packed_layout(law: Law, size: int = 6) -> tuple[dict[str, tuple[int, int]], int]:
    """As `state_layout`; a law with a force (or rate) of its observable keeps the old strain behind, under the observable's own name,
    which is not counted."""
    layout, start = state_layout(law, size)
    if strain_flows(law):
        layout[law.observable.name] = (start, size)
    return layout, start


def strain_flows(law: Law) -> bool:
    """True if the force (or rate) of the observable enters the force function: the step then needs the old strain."""
    return law.observable in law.forces


@dataclass(frozen=True)
class DeclaredStep:
    """Expressions with coefficient symbols, and the terms of ψ in the strain alone; `coefficients` maps each symbol to its expression in
    parameters, T and frozen state; `frozen` lists the frozen tensors and vectors, which stay in the expressions as they are."""

    law: Law
    energy: Expr
    strain_energy: StrainEnergy
    finite: Expr
    surfaces: tuple[Expr, ...]
    word: str
    coefficients: Mapping[Symbol, Expr]
    frozen: tuple[Any, ...]

    @property
    def width(self) -> int:
        """Number of coefficients, tensors counted by component."""
        return len(self.coefficients) + sum(components(f) for f in self.frozen)

    def coefficient_rows(self, parameters: Mapping[Any, float], old: Array, temperature: Array | None) -> Array:
        """Coefficients at every point, shape (n, width), from the packed old state (internal variables, then the old strain)."""
        n = old.shape[0]
        layout, size = packed_layout(self.law)
        known: dict[Any, Any] = dict(parameters)
        if temperature is not None and self.law.temperature is not None:
            known[self.law.temperature] = temperature
        for symbol in self._frozen_symbols():
            variable = symbol.variable
            start, length = (size, 6) if variable == self.law.observable else layout[variable.name]
            known[symbol] = old[:, start] if length == 1 else old[:, start : start + length]
        columns = [
            np.broadcast_to(np.asarray(evaluate(e, known), dtype=float), (n,))[:, None]
            for e in self.coefficients.values()
        ]
        columns += [np.broadcast_to(known[f], (n, components(f))) for f in self.frozen]
        return np.hstack(columns) if columns else np.zeros((n, 0))

    def numbers(self, row: Array) -> dict[Any, Any]:
        """Values of the coefficient symbols and frozen tensors at one row."""
        found: dict[Any, Any] = dict(zip(self.coefficients, map(float, row), strict=False))
        start = len(self.coefficients)
        for symbol in self.frozen:
            found[symbol] = row[start : start + components(symbol)]
            start += components(symbol)
        return found

    def _frozen_symbols(self) -> set[Any]:
        found = set(self.frozen)
        for e in self.coefficients.values():
            found |= _frozen_in(e)
        return found


def declared_step(law: Law, *, whole: bool = False) -> DeclaredStep:
    """Take the law apart; terms of ψ in the strain alone are set aside unless `whole`.

    Raises `DeclarationError` where its energy is not known or ∇T is coupled to other forces.
    """
    potential = law.phi if law.phi is not None else law.phi_star
    word = "phi" if law.phi is not None else "phi_star"
    finite: Expr = S.Zero
    surfaces: list[Expr] = []
    if potential is not None:
        surfaces = [f for f in potential.surfaces if not _thermal(law, word, f)]
        finite = Add(*(t for t in Add.make_args(potential.finite) if not _thermal(law, word, t)))
    gathering = _Gathering()
    energy, alone = (law.energy, S.Zero) if whole else without_strain_terms(law.energy, law.observable)
    energy = gathering.expression(energy)
    finite = gathering.expression(finite)
    found = tuple(gathering.expression(f) for f in surfaces)
    frozen = {s for e in (finite, *found) for s in _frozen_in(e) if isinstance(s, Ranked)}
    names = {symbol: expression for expression, symbol in gathering.found.items()}
    outside = StrainEnergy(alone, law.observable)
    return DeclaredStep(law, energy, outside, finite, found, word, names, tuple(sorted(frozen, key=str)))


class _Gathering:
    """Replaces the largest subexpressions of parameters and point data by symbols, equal ones by the same."""

    def __init__(self) -> None:
        self.found: dict[Expr, Symbol] = {}

    def expression(self, node: Any) -> Any:
        if isinstance(node, Lambda) or not _point_data(node):
            return node
        if isinstance(node, Ranked):
            if node in node.terms():
                symbol = isinstance(node, (TensorSymbol, VectorSymbol))
                return node if symbol else node.func(*(self.expression(a) for a in node.args))
            return node.linear([(a, self.expression(c)) for a, c in node.terms().items()])
        if not _moves(node):
            return self.found.setdefault(node, Dummy(f"k{len(self.found)}", real=True))
        if isinstance(node, (Add, Mul)):
            fixed = [a for a in node.args if not _moves(a)]
            moving = [self.expression(a) for a in node.args if _moves(a)]
            return node.func(self.expression(node.func(*fixed)), *moving) if fixed else node.func(*moving)
        return node.func(*(self.expression(a) for a in node.args))


def _moves(node: Any) -> bool:
    """True if a variable of the step (state, force or rate) is in it."""
    return any(not isinstance(s, Temperature) for s in variables_of(node))


def _frozen_in(node: Any) -> set[Any]:
    return {s for s in node.atoms(ScalarVariable, TensorSymbol, VectorSymbol) if s.role == "frozen"}


def _point_data(node: Any) -> bool:
    return bool(_frozen_in(node)) or any(isinstance(s, Temperature) for s in variables_of(node))


def _thermal(law: Law, word: str, term: Expr) -> bool:
    """True for a term in ∇T (or −q/T) alone; one that mixes it with other forces is refused."""
    thermal = {
        v for v in term.atoms(VectorSymbol) if v.role in ("force", "rate") and isinstance(v.variable, Temperature)
    }
    if not thermal:
        return False
    others = {s for s in law.forces.values() if s not in thermal and term.has(s)}
    if others:
        raise DeclarationError(
            f"law '{law.name}': {word} couples {', '.join(map(str, thermal))} with {', '.join(sorted(map(str, others)))} in {term}; "
            "a step at a point is given no temperature gradient"
        )
    return True
