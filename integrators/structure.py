"""Find the structure of a law's implicit step (detection reads the derived operators, never names).

A law has the cone structure if

* the blocks ∂²ψ/∂X_k∂X_l of the internal tensors, and ∂²ψ/∂ε∂X_k, are isotropic pairs (c₀, c₁) of parameters, the block of the
  internal scalars is constant, and tensors and scalars do not couple;
* φ* is the indicator of one f = a ‖dev Σ a_k A_k‖ + Σ b_k tr A_k + Σ r_j R_j − k, affine in one deviator norm, in traces and
  in scalar forces.

Deviatoric and spherical parts are orthogonal in an isotropic metric, so that the projection of the trial forces on {f ≤ 0} is the
projection of three numbers, q = ‖dev Σ a_k A_k‖, Σ b_k tr A_k and Σ r_j R_j, with the weights

    w_q = Σ a_k a_l c₀,   w_T = 3 Σ b_k b_l (c₀ + 3c₁),   w_R = Σ r_i r_j H_ij,
    g_q = −Σ a_k c₀(ε, k),   g_T = −Σ b_k (c₀ + 3c₁)(ε, k).

The rest of the energy, a function of ε alone, may be anything with a gradient and a generalised Hessian.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Dummy, Expr, S

from ..errors import DeclarationError
from ..potentials import Law
from ..potentials.derivative import Operator, invariants_of, is_constant, partial, second_derivative
from ..potentials.invariants import NormLeaf, TraceLeaf
from ..potentials.scalars import ScalarVariable
from ..potentials.tensor import Deviator, SymmetricTensor, TensorSymbol

__all__ = [
    "ConeStructure",
    "Moduli",
    "NoConeStructure",
    "find_cone",
    "find_moduli",
    "internal_scalars",
    "internal_tensors",
]


class NoConeStructure(DeclarationError):
    """The step has no closed form in (q, m, R); the text says why."""


@dataclass(frozen=True)
class Moduli:
    """Blocks of D²ψ: ε–ε, ε–X_k, X_k–X_l (operators) and s_i–s_j (scalars)."""

    strain: Operator
    mixed: tuple[Operator, ...]
    tensors: tuple[tuple[Operator, ...], ...]
    scalars: tuple[tuple[Expr, ...], ...]


@dataclass(frozen=True)
class ConeStructure:
    """Coefficients of the step; every entry is an expression in parameters (names as in the module's docstring)."""

    a: Expr
    dev_weights: tuple[Expr, ...]
    trace_weights: tuple[Expr, ...]
    scalar_weights: tuple[Expr, ...]
    w_q: Expr
    w_t: Expr
    w_r: Expr
    g_q: Expr
    g_t: Expr


def internal_tensors(law: Law) -> tuple[TensorSymbol, ...]:
    """Tensor internal variables, in declared order."""
    return tuple(v for v in law.internal if isinstance(v, TensorSymbol))


def internal_scalars(law: Law) -> tuple[ScalarVariable, ...]:
    """Scalar internal variables, in declared order."""
    return tuple(v for v in law.internal if isinstance(v, ScalarVariable))


def find_moduli(law: Law) -> Moduli:
    """Blocks of the second derivative of ψ; refuses couplings that the step does not know."""
    tensors, scalars = internal_tensors(law), internal_scalars(law)
    mixed = tuple(second_derivative(law.energy, law.observable, x) for x in tensors)
    blocks = tuple(tuple(second_derivative(law.energy, x, y) for y in tensors) for x in tensors)
    for name, operator in [
        *((f"{law.observable}–{x}", o) for x, o in zip(tensors, mixed, strict=True)),
        *((f"{x}–{y}", o) for x, row in zip(tensors, blocks, strict=True) for y, o in zip(tensors, row, strict=True)),
    ]:
        if not (operator.is_isotropic and is_constant(operator.c0) and is_constant(operator.c1)):
            raise NoConeStructure(
                f"law '{law.name}': the block {name} of the second derivative of psi is not constant and isotropic"
            )
    slopes = [partial(law.energy, s) for s in scalars]
    rows = tuple(tuple(slope.diff(s) for s in scalars) for slope in slopes)  # type: ignore[union-attr]
    for s, slope, row in zip(scalars, slopes, rows, strict=True):
        assert isinstance(slope, Expr)
        if invariants_of(slope):
            raise NoConeStructure(f"law '{law.name}': psi couples the scalar '{s}' with a tensor")
        if not all(is_constant(entry) for entry in row):
            raise NoConeStructure(f"law '{law.name}': psi is not quadratic in the scalar '{s}'")
    return Moduli(second_derivative(law.energy, law.observable, law.observable), mixed, blocks, rows)


def find_cone(law: Law, moduli: Moduli) -> ConeStructure:
    """Coefficients of the closed form, or `NoConeStructure` with the reason."""
    law.check_evolution()
    if len(law.surfaces) != 1:
        raise NoConeStructure(f"law '{law.name}': phi_star has {len(law.surfaces)} surfaces; the closed form takes one")
    tensors, scalars = internal_tensors(law), internal_scalars(law)
    function = law.surfaces[0]
    leaves = invariants_of(function)
    dummies = [Dummy(f"l{i}", real=True) for i in range(len(leaves))]
    opened: Any = function.xreplace(dict(zip(leaves, dummies, strict=True)))
    dev_weights: list[Expr] = [S.Zero] * len(tensors)
    trace_weights: list[Expr] = [S.Zero] * len(tensors)
    a: Expr = S.Zero
    for dummy, leaf in zip(dummies, leaves, strict=True):
        slope = opened.diff(dummy)
        if slope.atoms(Dummy) or not is_constant(slope):
            raise NoConeStructure(f"law '{law.name}': phi_star is not affine in {leaf}")
        weights = _force_weights(law, leaf.args[0], tensors, deviatoric=isinstance(leaf, NormLeaf))  # type: ignore[arg-type]
        if isinstance(leaf, TraceLeaf):
            trace_weights = [old + slope * w for old, w in zip(trace_weights, weights, strict=True)]
        elif isinstance(leaf, NormLeaf):
            if a != 0:
                raise NoConeStructure(
                    f"law '{law.name}': phi_star holds two different norms; the closed form takes one"
                )
            dev_weights, a = weights, slope
        else:
            raise NoConeStructure(
                f"law '{law.name}': phi_star holds {leaf}; the closed form takes norm(dev(...)) and tr(...)"
            )
    scalar_weights = []
    for s in scalars:
        slope = opened.diff(law.forces[s]) if s in law.forces else S.Zero
        if slope.atoms(Dummy) or not is_constant(slope):
            raise NoConeStructure(f"law '{law.name}': phi_star is not affine in the force of '{s}'")
        scalar_weights.append(slope)
    return _weights(moduli, a, dev_weights, trace_weights, scalar_weights)


def _force_weights(
    law: Law, tensor: SymmetricTensor, tensors: tuple[TensorSymbol, ...], deviatoric: bool
) -> list[Expr]:
    weights: list[Expr] = [S.Zero] * len(tensors)
    place = {law.forces[x]: k for k, x in enumerate(tensors) if x in law.forces}
    for atom, coefficient in tensor.terms().items():
        base = atom.args[0] if isinstance(atom, Deviator) else atom
        if base not in place or (deviatoric and not isinstance(atom, Deviator)):
            raise NoConeStructure(
                f"law '{law.name}': phi_star holds {tensor} inside a norm or trace; write norm(dev(...)) of forces"
            )
        weights[place[base]] += coefficient  # type: ignore[index]
    return weights


def _weights(moduli: Moduli, a: Expr, dev_w: list[Expr], trace_w: list[Expr], scalar_w: list[Expr]) -> ConeStructure:
    def mean(o: Operator) -> Expr:
        return o.c0 + 3 * o.c1

    pairs = [(k, l) for k in range(len(dev_w)) for l in range(len(dev_w))]
    w_q = sum((dev_w[k] * dev_w[l] * moduli.tensors[k][l].c0 for k, l in pairs), S.Zero)
    w_t = 3 * sum((trace_w[k] * trace_w[l] * mean(moduli.tensors[k][l]) for k, l in pairs), S.Zero)
    n = range(len(scalar_w))
    w_r = sum((scalar_w[i] * scalar_w[j] * moduli.scalars[i][j] for i in n for j in n), S.Zero)
    g_q = -sum((w * o.c0 for w, o in zip(dev_w, moduli.mixed, strict=True)), S.Zero)
    g_t = -sum((w * mean(o) for w, o in zip(trace_w, moduli.mixed, strict=True)), S.Zero)
    return ConeStructure(a, tuple(dev_w), tuple(trace_w), tuple(scalar_w), w_q, w_t, w_r, g_q, g_t)
