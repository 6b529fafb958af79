"""Rows of Table 1 for a law: dissipation inequality, state laws, complementary laws, in the strain or the stress formulation.

`split="total"`: the observable is the total strain, σ = σ^r + σ^ir. `split="reversible"`: it is the reversible strain
ε^r = ε − ε^ir, with ε^ir the sum of the `irreversible` tensors of the law. A row that does not exist for a law is left out: without
temperature there is no entropy, without ∇T in φ* no heat flux. With a density the potentials are per unit mass, else per unit volume.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from ..errors import DeclarationError, InputError
from ..notebook import math_table
from .derivative import invariants_of
from .invariants import InnerLeaf
from .law import Law
from .ranked import Ranked
from .tensor import Deviator, TensorSymbol

__all__ = ["Row", "Table", "build_table", "irreversible_of"]


@dataclass(frozen=True)
class Row:
    """One row: what it is, as text, as LaTeX."""

    title: str
    text: str
    tex: str


@dataclass(frozen=True)
class Table:
    """A block of Table 1."""

    law: str
    formulation: str
    split: str
    rows: tuple[Row, ...]

    def text(self) -> str:
        """Plain text, one row per line."""
        width = max(len(r.title) for r in self.rows)
        head = f"{self.law}: {self.formulation} formulation, {self.split} split"
        return "\n".join([head, *(f"{r.title:<{width}}  {r.text}" for r in self.rows)])

    def latex(self) -> str:
        """LaTeX, one aligned row per law."""
        rows = [rf"\text{{{r.title}}} & {r.tex} \\" for r in self.rows]
        return "\n".join([r"\begin{array}{ll}", *rows, r"\end{array}"])

    def __str__(self) -> str:
        return self.text()

    def _repr_markdown_(self) -> str:
        return math_table([(r.title, r.tex) for r in self.rows])

    def json(self) -> str:
        """JSON with the same rows."""
        rows = [{"title": r.title, "text": r.text, "latex": r.tex} for r in self.rows]
        return json.dumps(
            {"law": self.law, "formulation": self.formulation, "split": self.split, "rows": rows}, indent=2
        )


def build_table(law: Law, formulation: str, split: str) -> Table:
    """Table of the law; `InputError` for a formulation or split that does not exist, `DeclarationError` if ε^ir is not clear."""
    if formulation not in ("strain", "stress"):
        raise InputError(f"formulation {formulation!r} is not known; it is 'strain' or 'stress'")
    if split not in ("total", "reversible"):
        raise InputError(f"split {split!r} is not known; it is 'total' or 'reversible'")
    from .table_flow import FlowRows
    from .table_frame import FrameRows
    from .table_notation import Notation
    from .table_state import StateRows

    notation = Notation(law, irreversible_of(law) if split == "reversible" else None)
    frame, state, flow = FrameRows(notation), StateRows(notation), FlowRows(notation)
    laws = state.strain_form() if formulation == "strain" else state.stress_form()
    rows = (
        *frame.opening(),
        *notation.rho_row,
        *laws,
        *flow.rate_form(),
        *flow.force_form(),
        *frame.notes(formulation),
    )
    return Table(law.name, formulation, split, rows)


def irreversible_of(law: Law) -> tuple[TensorSymbol, ...]:
    """Internal tensors whose sum is ε^ir: those declared, else the x of ε − x in ψ, else none; two answers are refused."""
    if law.irreversible is not None:
        return law.irreversible
    sets = [_coupled_to_stress(law)] if law.psi is None else _subtracted(law)
    found = {s for s in sets if s}
    if len(found) > 1:
        shown = "; ".join(sorted(" + ".join(sorted(v.name for v in s)) for s in found))
        raise DeclarationError(
            f"law '{law.name}': the irreversible strain is not clear, psi holds {law.observable} less {shown}; "
            "say which with irreversible=(...)"
        )
    members = next(iter(found), frozenset())
    return tuple(v for v in law.internal if v in members)  # type: ignore[misc]


def _subtracted(law: Law) -> list[frozenset[Any]]:
    """Per tensor ε − x₁ − x₂ in an invariant of ψ, the set of x."""
    found = []
    for quantity in (a for leaf in invariants_of(law.energy) for a in leaf.args if isinstance(a, Ranked)):
        terms = {(a.args[0] if isinstance(a, Deviator) else a): c for a, c in quantity.terms().items()}
        if (c := terms.get(law.observable)) is not None:
            found.append(frozenset(a for a, d in terms.items() if a in law.internal and d == -c))
    return found


def _coupled_to_stress(law: Law) -> frozenset[Any]:
    """The x of terms σ:x in ψ*."""
    pairs = [leaf.args for leaf in invariants_of(law.psi_star) if isinstance(leaf, InnerLeaf)]
    coupled = [a for args in pairs if law.stress_symbol in args for a in args if isinstance(a, Ranked)]
    return frozenset(v for a in coupled for v in a.terms() if v in law.internal)
