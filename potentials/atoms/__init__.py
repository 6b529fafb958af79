"""Atoms of potentials, one file each, and the table that finds them.

`atom_of(node)` gives the record of a node; `register(atom)` adds one. A user's atom is one file: a subclass of `Invariant` (or of
sympy's `Function`), a subclass of `Atom` that names it as its `node`, and `register(MyAtom())`.
"""

from __future__ import annotations

from typing import Any

from ...errors import DeclarationError
from .atom import Atom, Invariant
from .eig_max import EigMax
from .eig_min import EigMin
from .eig_sum import EigSum
from .exponential import Exponential
from .inner import Inner
from .logarithm import Logarithm
from .maximum import MaximumAtom
from .norm import Norm
from .positive_part import Positive, StepAtom
from .positive_square import PositiveSquare
from .positive_trace import PositiveTrace
from .power import Power
from .trace import Trace

__all__ = ["ATOMS", "Atom", "Invariant", "atom_of", "register"]

ATOMS: dict[type, Atom] = {}


def register(atom: Atom) -> Atom:
    """Add the record of a new kind of node; its node must not be known already."""
    if not isinstance(atom, Atom) or not isinstance(atom.node, type):
        raise DeclarationError("register takes an Atom whose `node` is a sympy class")
    if ATOMS.setdefault(atom.node, atom) is not atom:
        raise DeclarationError(
            f"an atom for {atom.node.__name__} is registered already: {type(ATOMS[atom.node]).__name__}"
        )
    return atom


for _atom in (
    Trace(),
    Inner(),
    Norm(),
    PositiveSquare(),
    PositiveTrace(),
    EigMax(),
    EigMin(),
    EigSum(),
    Positive(),
    StepAtom(),
    MaximumAtom(),
    Power(),
    Exponential(),
    Logarithm(),
):
    register(_atom)


def atom_of(node: Any) -> Atom:
    """Record of a node; `DeclarationError` names a node that no atom describes."""
    found = ATOMS.get(type(node)) or ATOMS.get(getattr(node, "func", type(node)))
    if found is None:
        raise DeclarationError(
            f"'{node}' is not an atom that potentials know; they know: {', '.join(sorted(a.word for a in ATOMS.values()))}"
        )
    return found
