"""Derivatives of the stacked cone program of a step by parameters: differences of its data, which are closed-form functions of them.

Central differences of order eight, or forward ones of order six at a bound. What a square root leaves open, a rotation, is turned to that
of the program at the parameters themselves, so that the data are smooth functions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, S, Symbol

from ..errors import InputError
from ..potentials.tensor import TensorSymbol
from ..potentials.vector import VectorSymbol
from .canonical import CanonicalForm
from .cone_projection import SECOND_ORDER
from .declared import DeclaredStep, strain_flows
from .general_step import GeneralStep
from .law_forms import LawForms, law_forms
from .step_program import Stacked, flow_of_dual, flow_of_rates, stacked

__all__ = ["SPACING", "ProgramSlopes", "central_difference"]

Array = NDArray[np.float64]
CENTRAL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
FORWARD = ((0, -49 / 20), (1, 6.0), (2, -15 / 2), (3, 20 / 3), (4, -15 / 4), (5, 6 / 5), (6, -1 / 6))
SPACING = 1e-2
KEPT = 1024
_ARRAYS = ("full", "E", "G", "H", "X")
_FORMS: dict[Any, LawForms] = {}


def central_difference(function: Callable[[float], Any], h: float) -> Any:
    """Derivative at zero of a smooth function, order eight."""
    return sum(w * (function(k * h) - function(-k * h)) for k, w in CENTRAL) / h


class ProgramSlopes:
    """Derivatives of the stacked program by parameters (names) and by coefficients of a row (numbers)."""

    def __init__(self, step: GeneralStep, row: Array) -> None:
        self.step, self.law, self.row = step, step.law, row
        self.forms: LawForms | None = None
        self.base = self._stacked({}, row)
        self.forms = self._forms({}, row)

    def _forms(self, shift: Mapping[str, float], row: Array) -> LawForms:
        """Canonical forms of ψ and φ*, each made anew only where its own numbers change; cones turned to those of the base."""
        declared = self.step.declared
        numbers = {p: v + shift.get(p.name, 0.0) for p, v in self.step.parameters.items()}
        numbers |= declared.numbers(row)
        found = replace(
            _part_forms(replace(declared, finite=S.Zero, surfaces=()), (declared.energy,), numbers),
            **{
                name: getattr(
                    _part_forms(replace(declared, energy=S.Zero), (declared.finite, *declared.surfaces), numbers), name
                )
                for name in ("flow", "dual", "moved")
            },
        )
        if self.forms is None:
            return found
        law = self.law.name
        flow = found.flow
        if flow is not None and self.forms.flow is not None:
            flow = _cones_aligned(law, flow, self.forms.flow)
        return replace(found, energy=_cones_aligned(law, found.energy, self.forms.energy), flow=flow)

    def _stacked(self, shift: Mapping[str, float], row: Array) -> Stacked:
        forms = self._forms(shift, row)
        flow, roots = None, 0
        if forms.flow is not None:
            flow = (flow_of_dual if forms.dual else flow_of_rates)(forms.flow, self.step.dt)
            roots = flow.q.size - forms.flow.G.shape[0] - forms.flow.E.shape[0] if forms.dual else 0
        size = self.step.program_size
        found = stacked(forms.energy, flow, forms.moved, size, strain_flows(self.law))
        return found if self.forms is None else _roots_aligned(self.law.name, found, self.base, roots)

    def by(self, what: Any) -> dict[str, Array]:
        """Derivative of each array."""
        if isinstance(what, str):
            value = next(v for p, v in self.step.parameters.items() if p.name == what)

            def at(shift: float) -> Stacked:
                return self._stacked({what: shift}, self.row)
        else:
            value = float(self.row[what])

            def at(shift: float) -> Stacked:
                row = self.row.copy()
                row[what] += shift
                return self._stacked({}, row)

        h = SPACING * (abs(value) or 1.0)
        try:
            parts = [(w, at(k * h), at(-k * h)) for k, w in CENTRAL]
            return {a: np.sum([w * (getattr(p, a) - getattr(m, a)) for w, p, m in parts], axis=0) / h for a in _ARRAYS}
        except InputError:
            # a value at the end of what is admissible: differences to the inside
            for sign in (1.0, -1.0):
                try:
                    sides = [(w, at(sign * k * h)) for k, w in FORWARD]
                except InputError:
                    continue
                return {a: np.sum([w * getattr(s, a) for w, s in sides], axis=0) / (sign * h) for a in _ARRAYS}
            raise


def _part_forms(declared: DeclaredStep, parts: tuple[Expr, ...], numbers: Mapping[Any, Any]) -> LawForms:
    """Forms of `declared`, of which only `parts` stand, kept by what these read."""
    names = {x for e in parts for x in e.atoms(Symbol, TensorSymbol, VectorSymbol)}
    read = sorted((str(x), np.asarray(v, dtype=float).tobytes()) for x, v in numbers.items() if x in names)
    key = (declared.law, parts, tuple(read))
    if key not in _FORMS:
        while len(_FORMS) >= KEPT:
            _FORMS.pop(next(iter(_FORMS)))
        _FORMS[key] = law_forms(declared, numbers)
    return _FORMS[key]


def _check(name: str, same: bool) -> None:
    if not same:
        raise InputError(
            f"law '{name}': the step changes its structure at these values, as where a modulus vanishes; move them slightly"
        )


def _cones_aligned(name: str, found: CanonicalForm, like: CanonicalForm) -> CanonicalForm:
    """`found` with the vectors of its second-order cones turned to those of `like`: a square root of a form leaves them a rotation."""
    _check(name, [c.kind for c in found.cones] == [c.kind for c in like.cones] and found.G.shape == like.G.shape)
    _check(name, found.E.shape == like.E.shape)
    G, h = found.G.copy(), found.h.copy()
    start = 0
    for cone in found.cones:
        if cone.kind == SECOND_ORDER:
            rows = slice(start + 1, start + cone.size)
            old, new = np.hstack([like.G[rows], like.h[rows, None]]), np.hstack([G[rows], h[rows, None]])
            turn = _rotation(old, new)
            G[rows], h[rows] = turn @ G[rows], turn @ h[rows]
        start += cone.size
    return replace(found, G=G, h=h)


def _rotation(old: Array, new: Array) -> Array:
    """The orthogonal Q that brings Q `new` closest to `old`."""
    size = np.abs(old).max(axis=0, initial=0.0)
    scale = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)
    u, _, vt = np.linalg.svd((old * scale) @ (new * scale).T)
    return u @ vt


def _roots_aligned(name: str, found: Stacked, like: Stacked, roots: int) -> Stacked:
    """`found` with the square root of the quadratic part of φ* turned to that of `like`: P = FᵀF leaves F a rotation.

    The last `roots` unknowns carry F.
    """
    _check(name, all(getattr(found, a).shape == getattr(like, a).shape for a in _ARRAYS))
    if not roots:
        return found
    parts = [(s.E[:, -roots:], s.X[:, -roots:], s.full[:-roots, -roots:]) for s in (like, found)]
    old, new = (np.vstack(p).T for p in parts)
    turn = _rotation(old, new).T
    wide = np.eye(found.full.shape[0])
    wide[-roots:, -roots:] = turn
    return Stacked(
        wide.T @ found.full @ wide, found.E @ wide, found.G @ wide[-found.G.shape[1] :, -found.G.shape[1] :],
        found.H, found.cones, found.X @ wide,
    )  # fmt: skip
