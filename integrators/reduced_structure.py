"""Find whether the step of a law is a projection of a few numbers, and which (detection reads derived operators, never names).

With isotropic constant moduli in the internal tensors, deviators, traces and scalars are orthogonal in the metric of the step. So if all
tensor forces enter φ* through

* one deviator norm q = ‖dev Σ a_k A_k‖ and traces T_i = Σ b_ik tr A_k (`norm`), or
* the principal values b_1 ≥ b_2 ≥ b_3 of one combination Σ a_k A_k (`principal`),

besides scalar forces R_j = −∂ψ/∂s_j, the step is the projection of z = (q, T, R) or z = (b, R) on {f ≤ 0}, regularised by the finite part
of φ*, in the metric W: z = z^tr − W e, e the increments conjugate to z. Frozen scalars are data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from sympy import Add, Dummy, Expr, Mul, Pow, S, Symbol, expand, sqrt

from ..potentials import Law
from ..potentials.atoms.eig_max import EigMaxLeaf
from ..potentials.atoms.eig_min import EigMinLeaf
from ..potentials.atoms.eig_sum import EigSumLeaf
from ..potentials.atoms.inner import InnerLeaf
from ..potentials.atoms.maximum import Maximum
from ..potentials.atoms.norm import NormLeaf
from ..potentials.atoms.positive_part import PositivePart
from ..potentials.atoms.positive_square import PositiveSquareLeaf
from ..potentials.atoms.positive_trace import PositiveTraceLeaf
from ..potentials.atoms.trace import TraceLeaf
from ..potentials.derivative import invariants_of
from ..potentials.scalars import FrozenScalar, ScalarVariable
from ..potentials.tensor import Deviator, IdentityTensor, TensorSymbol
from ..potentials.vector import VectorSymbol
from .structure import Moduli, NoReduction, find_moduli, internal_scalars, internal_tensors, is_data

__all__ = ["Q", "Reduction", "find_reduction", "is_curved"]

_PRINCIPAL = (EigMaxLeaf, EigMinLeaf, EigSumLeaf, PositiveSquareLeaf, PositiveTraceLeaf)


@dataclass(frozen=True)
class Soft:
    """Power terms C (k ⟨g⟩)^p of φ* in one function g of the reduced forces: flow γ ∇g with γ = dt Σ C p k^p g^(p−1)."""

    function: Expr
    terms: tuple[tuple[Expr, Expr, Expr], ...]  # (C, k, p)


@dataclass(frozen=True)
class Reduction:
    """Reduced step; weights are expressions in parameters, functions in the symbols `unknowns` (and frozen scalars, T)."""

    law: Law
    moduli: Moduli
    kind: str
    weights: tuple[Expr, ...]
    traces: tuple[tuple[Expr, ...], ...]
    scalars: tuple[ScalarVariable, ...]
    unknowns: tuple[Symbol, ...]
    surfaces: tuple[Expr, ...]
    finite: Expr
    soft: Soft | None
    thermal: Expr = S.Zero
    frozen_scalars: tuple[FrozenScalar, ...] = field(default=())
    norm_weights: tuple[Expr, ...] = field(default=())

    @property
    def first_scalar(self) -> int:
        """Place of the first scalar force in the unknowns."""
        return len(self.unknowns) - len(self.scalars)

    @property
    def order_rows(self) -> tuple[tuple[int, ...], ...]:
        """Rows O of the constraints O z ≤ 0 that the reduction itself brings: q ≥ 0, or b_1 ≥ b_2 ≥ b_3."""
        n = len(self.unknowns)
        if self.kind == "principal":
            return ((-1, 1, 0) + (0,) * (n - 3), (0, -1, 1) + (0,) * (n - 3))
        return ((-1,) + (0,) * (n - 1),) if self.has_norm else ()

    @property
    def has_norm(self) -> bool:
        """True if the first unknown is a deviator norm."""
        return self.kind == "norm" and self.unknowns[:1] == (Q,)

    @cached_property
    def functions(self) -> tuple[Expr, ...]:
        """The function of the power terms, if any, then the surfaces; of a law with neither, one that is never met."""
        found = ((self.soft.function,) if self.soft is not None else ()) + self.surfaces
        return found or (S.NegativeOne,)

    @cached_property
    def affine(self) -> bool:
        """True if all surfaces are affine in the unknowns with coefficients in parameters, nothing is viscous and ψ is quadratic."""
        if self.finite != 0 or self.soft is not None or not self.moduli.quadratic:
            return False
        data = {*self.unknowns, *self.frozen_scalars}
        for f in self.surfaces:
            slopes = [f.diff(z) for z in self.unknowns]
            rest = f.xreplace(dict.fromkeys(self.unknowns, S.Zero))
            if any(e.free_symbols & data for e in (*slopes, rest)):
                return False
        return True


Q = Symbol("q_", real=True, nonnegative=True)
B = tuple(Symbol(f"b{i}_", real=True) for i in range(3))


class _Leaves:
    """Replaces invariants of forces by functions of the reduced unknowns."""

    def __init__(self, law: Law, kind: str) -> None:
        self.law = law
        self.kind = kind
        self.tensors = internal_tensors(law)
        self.base: tuple[Expr, ...] | None = None
        self.traces: list[tuple[Expr, ...]] = []

    def refuse(self, why: str) -> NoReduction:
        return NoReduction(f"law '{self.law.name}': {why}")

    def split(self, tensor: Any) -> tuple[tuple[Expr, ...], tuple[Expr, ...], Expr]:
        """Weights of the forces in dev T and in tr T, and the multiple of I."""
        place = {self.law.forces[x]: k for k, x in enumerate(self.tensors) if x in self.law.forces}
        n = len(self.tensors)
        deviatoric, spherical = [S.Zero] * n, [S.Zero] * n
        shift: Expr = S.Zero
        for atom, coefficient in tensor.terms().items():
            if coefficient.atoms(FrozenScalar):
                raise self.refuse(f"phi_star holds {tensor}, whose coefficients depend on frozen scalars")
            if isinstance(atom, IdentityTensor):
                shift = shift + coefficient
                continue
            base = atom.args[0] if isinstance(atom, Deviator) else atom
            if base not in place:
                raise self.refuse(f"phi_star holds {base}, which is not a force of an internal tensor")
            k = place[base]
            deviatoric[k] += coefficient
            if not isinstance(atom, Deviator):
                spherical[k] += coefficient
        return tuple(deviatoric), tuple(spherical), shift

    def ratio(self, weights: Sequence[Expr], what: Any) -> Expr:
        """κ with weights = κ · shared combination; the first combination met is the shared one."""
        if not any(w != 0 for w in weights):
            return S.Zero
        if self.base is None:
            self.base = tuple(weights)
            return S.One
        found = _multiple(weights, self.base)
        if found is None:
            raise self.refuse(f"phi_star holds {what} and another combination of forces; one combination is taken")
        return found

    def trace(self, weights: tuple[Expr, ...], what: Any) -> Expr:
        """Σ weights_k tr A_k in the unknowns."""
        if not any(w != 0 for w in weights):
            return S.Zero
        if self.kind == "principal":
            return self.ratio(weights, what) * Add(*B)
        for i, known in enumerate(self.traces):
            found = _multiple(weights, known)
            if found is not None:
                return found * trace_symbol(i)
        self.traces.append(weights)
        return trace_symbol(len(self.traces) - 1)

    def of(self, leaf: Any) -> Expr:
        """The leaf in the unknowns."""
        if isinstance(leaf, TraceLeaf):
            _, spherical, shift = self.split(leaf.args[0])
            return self.trace(spherical, leaf) + 3 * shift
        if isinstance(leaf, NormLeaf):
            return self.norm(leaf)
        if isinstance(leaf, InnerLeaf):
            parts = [self.split(t) for t in leaf.args]
            kappa = [self.ratio(d, leaf) for d, _, _ in parts]
            sphere = [self.trace(s, leaf) + 3 * shift for _, s, shift in parts]
            return kappa[0] * kappa[1] * self.square() + sphere[0] * sphere[1] / 3
        if isinstance(leaf, _PRINCIPAL):
            return self.principal(leaf)
        raise self.refuse(f"phi_star holds {leaf}")

    def square(self) -> Expr:
        if self.kind == "norm":
            return Q**2
        x, y, z = B
        return ((x - y) ** 2 + (y - z) ** 2 + (x - z) ** 2) / 3

    def norm(self, leaf: Any) -> Expr:
        deviatoric, spherical, shift = self.split(leaf.args[0])
        kappa = self.ratio(deviatoric, leaf)
        sphere = self.trace(spherical, leaf) + 3 * shift
        if sphere == 0:
            size = kappa if kappa.is_nonnegative else sqrt(kappa**2)
            return size * (Q if self.kind == "norm" else sqrt(self.square()))
        return sqrt(kappa**2 * self.square() + sphere**2 / 3)

    def principal(self, leaf: Any) -> Expr:
        tensor = leaf.args[-1]
        deviatoric, spherical, shift = self.split(tensor)
        kappa, sphere = self.ratio(deviatoric, leaf), self.ratio(spherical, leaf)
        if not (kappa.is_positive or kappa.is_negative):
            raise self.refuse(f"phi_star holds {leaf}, whose sign depends on a parameter")
        values = [kappa * b + (sphere - kappa) * Add(*B) / 3 + shift for b in B]
        if kappa.is_negative:
            values.reverse()
        if isinstance(leaf, EigMaxLeaf):
            return values[0]
        if isinstance(leaf, EigMinLeaf):
            return values[2]
        if isinstance(leaf, PositiveTraceLeaf):
            return Add(*(PositivePart(v) for v in values))
        if isinstance(leaf, PositiveSquareLeaf):
            return Add(*(PositivePart(v) ** 2 for v in values))
        function: Any = leaf.args[0]
        return Add(*(function.expr.xreplace({function.variables[0]: v}) for v in values))


def trace_symbol(i: int) -> Symbol:
    """Symbol of the i-th trace among the unknowns."""
    return Symbol(f"t{i}_", real=True)


def _multiple(weights: Sequence[Expr], base: Sequence[Expr]) -> Expr | None:
    pivot = next(i for i, b in enumerate(base) if b != 0)
    factor = weights[pivot] / base[pivot]
    same = all(expand(w - factor * b) == 0 for w, b in zip(weights, base, strict=True))
    return factor if same and factor != 0 else None


def find_reduction(law: Law) -> Reduction:
    """The reduction, or `NoReduction` with the reason."""
    law.check_evolution()
    potential = law.force_potential
    if law.phi is not None and potential is None:
        raise NoReduction(f"law '{law.name}': the force function of its phi is not known in closed form")
    if law.observable in law.forces:
        raise NoReduction(f"law '{law.name}': phi_star mentions the force of the observable")
    if law.phi is not None:
        raise NoReduction(f"law '{law.name}': it is declared by phi")
    if any(isinstance(v, VectorSymbol) for v in law.internal):
        raise NoReduction(f"law '{law.name}': an internal variable is a vector")
    moduli = find_moduli(law)
    finite, surfaces, thermal = S.Zero, (), S.Zero
    if potential is not None:
        surfaces = tuple(p for f in potential.surfaces for p in _pieces(f))
        for term in Add.make_args(potential.finite):
            if term.atoms(VectorSymbol):
                thermal = thermal + term
            else:
                finite = finite + term
    if any(f.atoms(VectorSymbol) for f in surfaces):
        raise NoReduction(f"law '{law.name}': phi_star holds the gradient of temperature in an inequality")
    if thermal != 0 and any(s.role == "force" for s in thermal.atoms(TensorSymbol, ScalarVariable)):
        raise NoReduction(f"law '{law.name}': phi_star mixes the gradient of temperature with other forces")
    weights = tuple(w for f in surfaces for w in _norm_weights(f))
    kind = "principal" if any(e.atoms(*_PRINCIPAL) for e in (finite, *surfaces)) else "norm"
    leaves = _Leaves(law, kind)
    table = {leaf: leaves.of(leaf) for e in (*surfaces, finite) for leaf in invariants_of(e)}
    surfaces = tuple(f.xreplace(table) for f in surfaces)
    finite = finite.xreplace(table)
    scalars = tuple(s for s in internal_scalars(law) if s in law.forces)
    head: tuple[Symbol, ...] = B
    if kind == "norm":
        head = ((Q,) if leaves.base is not None else ()) + tuple(trace_symbol(i) for i in range(len(leaves.traces)))
    unknowns = (*head, *(law.forces[s] for s in scalars))
    surfaces = tuple(p for f in surfaces for p in _pieces(f))
    soft, smooth = _powers(law, finite, unknowns)
    for expression in (*surfaces, smooth, *((soft.function,) if soft is not None else ())):
        _check_smooth(law, expression)
    frozen = {s for e in (*surfaces, finite) for s in e.atoms(FrozenScalar)}
    return Reduction(
        law,
        moduli,
        kind,
        leaves.base or (S.Zero,) * len(leaves.tensors),
        tuple(leaves.traces),
        scalars,
        unknowns,
        surfaces,
        smooth,
        soft,
        thermal,
        tuple(sorted(frozen, key=str)),
        weights,
    )


def _norm_weights(function: Expr) -> list[Expr]:
    """Constant weights of norms in a surface: a negative one would make it non-convex."""
    found = []
    for leaf in sorted(function.atoms(NormLeaf), key=str):
        dummy = Dummy(nonnegative=True)
        weight = function.xreplace({leaf: dummy}).diff(dummy)
        if is_data(weight):
            found.append(weight)
    return found


def is_curved(reduction: Reduction) -> bool:
    """True if the gradient of a surface, or of the function of the power terms, is no constant."""
    unknowns = set(reduction.unknowns)
    return any(f.diff(z).free_symbols & unknowns for f in reduction.functions for z in reduction.unknowns)


def _pieces(function: Expr) -> tuple[Expr, ...]:
    """Functions whose maximum is the given one: positive multiples of max and ⟨·⟩ in a sum are taken apart."""
    for term in Add.make_args(function):
        for factor in Mul.make_args(term):
            if isinstance(factor, (Maximum, PositivePart)) and (term / factor).is_nonnegative:
                choices = factor.args if isinstance(factor, Maximum) else (factor.args[0], S.Zero)
                rest, weight = function - term, term / factor
                return tuple(p for c in choices for p in _pieces(rest + weight * c))
    return (function,)


def _check_smooth(law: Law, expression: Expr) -> None:
    """Kinks of functions other than the norm make the projection a different one; they are left to the general method."""

    def walk(node: Any, inside_power: bool) -> None:
        if isinstance(node, Maximum) or (isinstance(node, PositivePart) and not inside_power):
            raise NoReduction(f"law '{law.name}': phi_star has a kink in {node}")
        exponent = node.args[1] if isinstance(node, Pow) else None
        for argument in node.args:
            walk(argument, exponent is not None and _above_one(exponent))

    walk(expression, False)


def _above_one(exponent: Any) -> bool:
    return not exponent.is_number or bool(exponent > 1)


def _powers(law: Law, finite: Expr, unknowns: tuple[Symbol, ...]) -> tuple[Soft | None, Expr]:
    """Terms C (k ⟨g⟩)^p, all of one g, and the smooth rest of the finite part of φ*."""
    found: list[tuple[Expr, Expr, Expr, Expr]] = []
    smooth: Expr = S.Zero
    for term in Add.make_args(finite):
        if term.is_constant(*unknowns) and not term.free_symbols & set(unknowns):
            continue
        power = [p for p in Mul.make_args(term) if isinstance(p, Pow) and _base(p.args[0], unknowns) is not None]
        factor = Mul(*(p for p in Mul.make_args(term) if p not in power))
        if len(power) != 1 or factor.free_symbols & set(unknowns) or not _above_one(power[0].args[1]):
            smooth = smooth + term
            continue
        k, g, kinked = _base(power[0].args[0], unknowns)  # type: ignore[misc]
        if power[0].args[1].free_symbols & set(unknowns):
            raise NoReduction(f"law '{law.name}': phi_star holds a power whose exponent is a force")
        if power[0].args[1] == 2 and not kinked:
            smooth = smooth + term  # a quadratic term needs no care
        else:
            found.append((factor, k, g, power[0].args[1]))  # type: ignore[arg-type]
    if not found:
        return None, smooth
    functions = {g for _, _, g, _ in found}
    if len(functions) > 1:
        raise NoReduction(f"law '{law.name}': phi_star holds powers of several functions of the forces")
    return Soft(functions.pop(), tuple((c, k, p) for c, k, _, p in found)), smooth


def _base(base: Any, unknowns: tuple[Symbol, ...]) -> tuple[Expr, Expr, bool] | None:
    """(k, g, True) of k ⟨g⟩, or (k, q, False) of k q."""
    moving = [a for a in Mul.make_args(base) if a.free_symbols & set(unknowns)]
    if len(moving) != 1:
        return None
    weight = base / moving[0]
    if isinstance(moving[0], PositivePart):
        inside = moving[0].args[0]
        # ⟨g/s⟩ with a positive scale s is left as it is: g/s is the function
        return weight, inside, True
    if moving[0] == Q:
        return weight, Q, False
    return None
