"""The parts of a free energy that the implicit step needs, sorted by what they do to it (detection reads derived operators, never names).

    ρψ = ½ (ε, X):ℍ:(ε, X) + linear terms + ψ_s(s) + ψ_0(ε) + terms in T alone,

ℍ blocks of constant isotropic pairs (c₀, c₁): c₀ 𝕀 + c₁ I⊗I in the tensors, ψ_s any function of the internal scalars, ψ_0 what is not
quadratic and depends on the strain alone: it may be anything with a gradient and a generalised Hessian. "Constant" means parameters
and the temperature, which is given during a step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Add, Expr, S, expand

from ..errors import DeclarationError
from ..potentials import Law
from ..potentials.atoms.positive_part import PositivePart
from ..potentials.atoms.positive_square import PositiveSquareLeaf
from ..potentials.atoms.trace import TraceLeaf
from ..potentials.derivative import invariants_of, partial, second_derivative, variables_of
from ..potentials.scalars import ScalarVariable, Temperature
from ..potentials.tensor import TensorSymbol, identity

__all__ = ["Moduli", "NoReduction", "find_moduli", "internal_scalars", "internal_tensors", "is_data"]

Pair = tuple[Expr, Expr]


class NoReduction(DeclarationError):
    """The step is not a projection of a few numbers; the text says why."""


@dataclass(frozen=True)
class Moduli:
    """Pairs (c₀, c₁) of D²ψ between ε and X_k; `stress_0`, `force_0` the multiples of I in σ and A_k at zero state; scalars by `slopes`
    R_j = −∂ψ_s/∂s_j and `scalar_block` ∂²ψ_s/∂s_i∂s_j; `traces` (w, a, s) of w⟨a tr ε + s⟩² and `spectral` (w, a, s) of
    w tr⟨a ε + s I⟩² if ψ_0 is made of such, else `rest` is ψ_0."""

    strain: Pair
    mixed: tuple[Pair, ...]
    tensors: tuple[tuple[Pair, ...], ...]
    stress_0: Expr
    force_0: tuple[Expr, ...]
    slopes: tuple[Expr, ...]
    scalar_block: tuple[tuple[Expr, ...], ...]
    scalar_energy: Expr
    traces: tuple[tuple[Expr, Expr, Expr], ...]
    spectral: tuple[tuple[Expr, Expr, Expr], ...]
    rest: Expr

    @property
    def alone(self) -> bool:
        """True if there is an energy ψ_0 of the strain alone."""
        return bool(self.traces or self.spectral or self.rest != 0)

    @property
    def quadratic(self) -> bool:
        """True if ψ_s is quadratic."""
        return all(is_data(e) for row in self.scalar_block for e in row)


def is_data(expression: Any) -> bool:
    """True if the expression holds parameters, the temperature and frozen state only."""
    return all(isinstance(v, Temperature) for v in variables_of(expression))


def internal_tensors(law: Law) -> tuple[TensorSymbol, ...]:
    """Tensor internal variables, in declared order."""
    return tuple(v for v in law.internal if isinstance(v, TensorSymbol))


def internal_scalars(law: Law) -> tuple[ScalarVariable, ...]:
    """Scalar internal variables, in declared order."""
    return tuple(v for v in law.internal if isinstance(v, ScalarVariable))


def find_moduli(law: Law) -> Moduli:
    """Sorted parts of ψ; `NoReduction` names the coupling that a reduced step does not know."""
    quadratic, alone = _split(law)
    tensors, scalars = internal_tensors(law), internal_scalars(law)

    def pair(x: TensorSymbol, y: TensorSymbol) -> Pair:
        operator = second_derivative(quadratic, x, y)
        if not operator.is_isotropic or not is_data(operator.c0) or not is_data(operator.c1):
            raise NoReduction(
                f"law '{law.name}': the block {x}–{y} of the second derivative of psi is not constant and isotropic"
            )
        return operator.c0, operator.c1

    blocks: dict[tuple[int, int], Pair] = {}
    for k, x in enumerate(tensors):
        for l, y in enumerate(tensors[: k + 1]):
            blocks[k, l] = blocks[l, k] = pair(x, y)
    slopes = []
    for s in scalars:
        slope = -partial(quadratic, s)
        if invariants_of(slope):
            raise NoReduction(f"law '{law.name}': psi couples the scalar '{s}' with a tensor")
        slopes.append(slope)
    n = range(len(tensors))
    traces, spectral, rest = _unilateral(law, alone)
    return Moduli(
        pair(law.observable, law.observable),
        tuple(pair(law.observable, x) for x in tensors),
        tuple(tuple(blocks[k, l] for l in n) for k in n),
        _sphere_at_zero(law, quadratic, law.observable),
        tuple(-_sphere_at_zero(law, quadratic, x) for x in tensors),
        tuple(slopes),
        tuple(tuple(-slope.diff(s) for s in scalars) for slope in slopes),
        Add(*(t for t in Add.make_args(quadratic) if t.atoms(ScalarVariable) & set(scalars))),
        traces,
        spectral,
        rest,
    )


def _split(law: Law) -> tuple[Expr, list[Expr]]:
    """Terms of ψ that the blocks describe, and the others, which depend on ε alone."""
    energy = law.energy
    if energy.is_Mul:
        energy = expand(energy, deep=False)
    quadratic, alone = [], []
    for term in Add.make_args(energy):
        variables = {v for v in variables_of(term) if not isinstance(v, Temperature)}
        if variables == {law.observable}:
            operator = second_derivative(term, law.observable, law.observable)
            if not (operator.is_isotropic and is_data(operator.c0) and is_data(operator.c1)):
                alone.append(term)
                continue
        quadratic.append(term)
    return Add(*quadratic), alone


def _sphere_at_zero(law: Law, energy: Expr, tensor: TensorSymbol) -> Expr:
    """Multiple of I in ∂ψ/∂X where all variables are zero."""
    found: Expr = S.Zero
    for atom, coefficient in partial(energy, tensor).terms().items():
        value: Any = coefficient.xreplace(dict.fromkeys(invariants_of(coefficient), S.Zero))
        if atom == identity:
            found = found + value
        if not is_data(value):
            raise NoReduction(f"law '{law.name}': psi couples '{tensor}' with a scalar variable")
    return found


def _unilateral(law: Law, terms: list[Expr]) -> tuple[Any, Any, Expr]:
    traces, spectral, rest = [], [], []
    for term in terms:
        found = _square_of_trace(law, term)
        if found is not None:
            traces.append(found)
            continue
        leaves = invariants_of(term)
        weight = term / leaves[0] if len(leaves) == 1 else term
        shape = _scaled_strain(law, leaves[0].args[0]) if len(leaves) == 1 else None
        if shape is not None and isinstance(leaves[0], PositiveSquareLeaf) and is_data(weight):
            spectral.append((weight, *shape))
        else:
            rest.append(term)
    if rest:
        return (), (), Add(*terms)  # one generated function takes them all
    return tuple(traces), tuple(spectral), S.Zero


def _square_of_trace(law: Law, term: Expr) -> tuple[Expr, Expr, Expr] | None:
    """(w, a, s) of w⟨a tr ε + s⟩²."""
    parts = sorted(term.atoms(PositivePart), key=str)
    if len(parts) != 1 or not is_data(term / parts[0] ** 2):
        return None
    leaf = TraceLeaf(law.observable)
    body: Any = expand(parts[0].args[0])
    weight: Expr = S.Zero
    for summand in Add.make_args(body):
        if summand.has(TraceLeaf):
            if not is_data(summand / leaf):
                return None
            weight = weight + summand / leaf
    shift = expand(body - weight * leaf)
    return (term / parts[0] ** 2, weight, shift) if is_data(shift) else None


def _scaled_strain(law: Law, tensor: Any) -> tuple[Expr, Expr] | None:
    """(a, s) of a ε + s I."""
    terms = tensor.terms() if hasattr(tensor, "terms") else {}
    if not terms or set(terms) - {law.observable, identity} or not all(is_data(c) for c in terms.values()):
        return None
    return terms.get(law.observable, S.Zero), terms.get(identity, S.Zero)
