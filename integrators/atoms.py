"""Numbers of a law's atoms, for the conic program: ψ and φ* taken apart into convex pieces at given parameter values.

ψ = ½ zᵀQz + gᵀz + c + Σ w ⟨r·z + s⟩² + Σ w T^≥:T^≥,  z = (ε, X), T = c ε + S;  f_j = Σ a ‖L A‖ + ℓ·A − k.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from sympy import Add, Dummy, Expr, Float, Mul, Poly, PolynomialError, S, expand

from ..errors import DeclarationError, InputError
from ..potentials import Law, unilateral_energy
from ..potentials.atoms.positive_part import PositivePart
from ..potentials.derivative import invariants_of
from ..potentials.invariants import InnerLeaf, NormLeaf, PositiveSquareLeaf, TraceLeaf
from ..potentials.tensor import Deviator, IdentityTensor, SymmetricTensor
from .closed import state_layout

__all__ = ["ConvexAtoms", "FlowAtoms", "energy_atoms", "flow_atoms"]

I6 = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
DEV = np.eye(6) - np.outer(I6, I6) / 3.0


@dataclass(frozen=True)
class ConvexAtoms:
    """Pieces of ψ in z = (ε, X) [-]; see the module's docstring."""

    hessian: np.ndarray
    linear: np.ndarray
    constant: float
    positive: tuple[tuple[float, np.ndarray, float], ...]
    spectral: tuple[tuple[float, float, np.ndarray], ...]

    def value(self, z: np.ndarray) -> float:
        """ψ [J/m³] at z = (ε, X)."""
        total = 0.5 * z @ self.hessian @ z + self.linear @ z + self.constant
        total += sum(w * max(float(row @ z) + shift, 0.0) ** 2 for w, row, shift in self.positive)
        for weight, scale, shift in self.spectral:
            total += float(unilateral_energy(scale * z[:6] + shift, 0.0, 1.0)) * weight
        return float(total)


@dataclass(frozen=True)
class FlowAtoms:
    """Pieces of every f_j in the packed forces: `linear` ℓ_j, `norms` (a, L), `limits` k_j."""

    linear: tuple[np.ndarray, ...]
    norms: tuple[tuple[tuple[float, np.ndarray], ...], ...]
    limits: tuple[float, ...]


@dataclass(frozen=True)
class _Frame:
    """Where each variable (or force) stands in a packed vector, and the parameter values."""

    places: Mapping[Any, int]
    size: int
    table: Mapping[Any, Any]

    def number(self, expression: Any) -> float:
        return float(expression.xreplace(dict(self.table)).evalf(17))

    def tensor(self, tensor: SymmetricTensor) -> tuple[np.ndarray, np.ndarray]:
        """(M, s) with Mandel components M z + s."""
        matrix, shift = np.zeros((6, self.size)), np.zeros(6)
        for atom, c in tensor.terms().items():
            value = self.number(c)
            if isinstance(atom, IdentityTensor):
                shift += value * I6
                continue
            base = atom.args[0] if isinstance(atom, Deviator) else atom
            start = self.places[base]
            matrix[:, start : start + 6] += value * (DEV if isinstance(atom, Deviator) else np.eye(6))
        return matrix, shift

    def affine(self, expression: Expr, rule: str) -> tuple[np.ndarray, float]:
        """(r, s) with expression = r·z + s, for an expression affine in traces and scalars."""
        row, shift = np.zeros(self.size), 0.0
        for term in Add.make_args(expand(expression)):
            moving = [a for a in Mul.make_args(term) if isinstance(a, TraceLeaf) or a in self.places]
            rest = Mul(*(a for a in Mul.make_args(term) if a not in moving))
            if (
                invariants_of(rest)
                or len(moving) > 1
                or rest.atoms(PositivePart)
                or rest.free_symbols & set(self.places)
            ):
                raise DeclarationError(f"{rule}: {term} is not affine in traces and scalars; it has no conic form here")
            if not moving:
                shift += self.number(rest)
            elif isinstance(moving[0], TraceLeaf):
                matrix, offset = self.tensor(moving[0].args[0])  # type: ignore[arg-type]
                row += self.number(rest) * (I6 @ matrix)
                shift += self.number(rest) * float(I6 @ offset)
            else:
                row[self.places[moving[0]]] += self.number(rest)
        return row, shift


def energy_atoms(law: Law, values: Mapping[str, float]) -> ConvexAtoms:
    """ψ taken apart; `DeclarationError` names the term that has no conic form."""
    rule = f"law '{law.name}', psi"
    layout, size = state_layout(law)
    places: dict[Any, int] = {law.observable: 0, **{v: 6 + layout[v.name][0] for v in law.internal}}
    frame = _Frame(places, size + 6, {p: Float(values[p.name]) for p in law.parameters})
    n = size + 6
    hessian, linear, constant = np.zeros((n, n)), np.zeros(n), 0.0
    positive, spectral = [], []
    kinks = sorted(law.energy.atoms(PositivePart), key=str)
    leaves = invariants_of(law.energy)
    scalars = [v for v in law.internal if v not in layout or layout[v.name][1] == 1]
    generators: list[Any] = [*kinks, *leaves, *scalars]
    dummies = {g: Dummy(f"g{i}") for i, g in enumerate(generators)}
    body = law.energy.xreplace({k: dummies[k] for k in kinks}).xreplace({g: dummies[g] for g in (*leaves, *scalars)})
    try:
        terms = Poly(body, *dummies.values()).terms() if dummies else [((), body)]
    except PolynomialError:
        raise DeclarationError(f"{rule}: not a polynomial of its invariants; it has no conic form here") from None
    for powers, coefficient in terms:
        weight = frame.number(coefficient)
        factors = [g for g, power in zip(generators, powers, strict=True) for _ in range(power)]
        kind = [type(g) for g in factors]
        if len(factors) == 2 and factors[0] == factors[1] and kind[0] is PositivePart:
            row, shift = frame.affine(factors[0].args[0], rule)
            positive.append((weight, row, shift))
        elif kind == [PositiveSquareLeaf]:
            matrix, shift6 = frame.tensor(factors[0].args[0])
            scale = float(matrix[0, 0])
            if matrix[:, 6:].any() or not np.allclose(matrix[:, :6], scale * np.eye(6), atol=0.0):
                raise DeclarationError(
                    f"{rule}: {factors[0]} must be taken of the observable (times a number, plus a spherical tensor)"
                )
            spectral.append((weight, scale, shift6))
        elif kind == [InnerLeaf]:
            (m1, s1), (m2, s2) = (frame.tensor(a) for a in factors[0].args)
            hessian += weight * (m1.T @ m2 + m2.T @ m1)
            linear += weight * (m1.T @ s2 + m2.T @ s1)
            constant += weight * float(s1 @ s2)
        elif len(factors) <= 2 and not any(
            issubclass(k, (PositivePart, NormLeaf, InnerLeaf, PositiveSquareLeaf)) for k in kind
        ):
            rows = [frame.affine(g, rule) for g in factors]
            if len(rows) == 2:
                (r1, t1), (r2, t2) = rows
                hessian += weight * (np.outer(r1, r2) + np.outer(r2, r1))
                linear += weight * (t2 * r1 + t1 * r2)
                constant += weight * t1 * t2
            elif len(rows) == 1:
                linear += weight * rows[0][0]
                constant += weight * rows[0][1]
            else:
                constant += weight
        else:
            shown = " * ".join(str(g) for g in factors)
            raise DeclarationError(f"{rule}: the term in {shown} has no conic form here")
    return ConvexAtoms(hessian, linear, constant, tuple(positive), tuple(spectral))


def flow_atoms(law: Law, values: Mapping[str, float]) -> FlowAtoms:
    """Every f_j taken apart; `DeclarationError` names the term that has no conic form."""
    layout, size = state_layout(law)
    places = {force: layout[v.name][0] for v, force in law.forces.items()}
    frame = _Frame(places, size, {p: Float(values[p.name]) for p in law.parameters})
    linear, norms, limits = [], [], []
    for j, function in enumerate(law.surfaces):
        rule = f"law '{law.name}', inequality {j + 1} of phi_star"
        cones: list[tuple[float, np.ndarray]] = []
        rest: list[Expr] = []
        weights: dict[NormLeaf, Expr] = {}
        for term in Add.make_args(expand(function)):
            found = [a for a in Mul.make_args(term) if isinstance(a, NormLeaf)]
            if not found:
                rest.append(term)
                continue
            weight = Mul(*(a for a in Mul.make_args(term) if a not in found))
            if len(found) > 1 or invariants_of(weight) or weight.free_symbols & set(places):
                raise DeclarationError(f"{rule}: {term} is not affine in norms of forces")
            weights[found[0]] = weights.get(found[0], S.Zero) + weight
        for leaf, weight in weights.items():
            value = frame.number(weight)
            matrix, shift = frame.tensor(leaf.args[0])  # type: ignore[arg-type]
            if shift.any():
                raise DeclarationError(f"{rule}: a constant tensor inside a norm has no conic form here")
            if value < 0:
                raise InputError(f"{rule}: {leaf} has the negative weight {weight} = {value:g}; f is not convex")
            cones.append((value, matrix))
        row, shift0 = frame.affine(Add(*rest), rule)
        linear.append(row)
        norms.append(tuple(cones))
        limits.append(-shift0)
    return FlowAtoms(tuple(linear), tuple(norms), tuple(limits))
