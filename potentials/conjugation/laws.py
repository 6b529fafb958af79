"""Conjugates of the potentials of a law, and of an expression in named variables.

ψ*(σ, α, T) = sup over ε of σ:ε − ψ(ε, α, T)             partial: one slot, concave in the others, ∂ψ*/∂α = −∂ψ/∂α
φ*(σ^ir, A, ∇T) = sup over all rates of σ^ir:ε̇ + A·α̇ + ∇T·(−q/T) − φ       total: all slots, α̇ ∈ ∂φ*/∂A with a plus sign
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from sympy import Add, Mul, S, Symbol, expand_mul

from ...errors import DeclarationError, InputError
from ..extended import Extended, as_extended
from ..invariants import InnerLeaf
from ..law import Law
from ..names import checked_name
from ..ranked import Ranked
from ..roles import entropy_flux, forces, gradient, is_variable, rates
from ..scalars import ForceScalar, RateScalar, ScalarVariable, Temperature
from ..tensor import ForceTensor, RateTensor, TensorSymbol, sym_tensor
from ..vector import ForceVector, RateVector, VectorSymbol, vector
from .conjugate import Conjugate, conjugate
from .slots import mentions

__all__ = [
    "conjugate_of_stress_potential",
    "dissipation_pair",
    "dual_of",
    "energy_from_conjugate",
    "force_potential_from_rates",
    "partial_conjugate",
    "slots_of",
    "total_conjugate",
]

POTENTIALS = ("energy", "dissipation")


def partial_conjugate(thing: Any, *variables: Any, names: str | None = None, potential: str = "energy") -> Conjugate:
    """Supremum in the given variables of an expression or `indicator(...)`; every other symbol is data.

    Of a `Law`, in the first slot alone: of ρψ in the observable (`potential="energy"`), or of the dissipation potential φ in the first
    rate (`potential="dissipation"`). `names` are those of the duals, apart by spaces. F* is concave in a slot α that is not exchanged,
    with ∂F*/∂α = −∂F/∂α. Source: Rockafellar 1970, §12 and §33.

    >>> from fenchel.potentials import inner, sym_tensor
    >>> eps, x = sym_tensor("eps"), sym_tensor("x")
    >>> print(partial_conjugate(inner(eps - x, eps - x) / 2, eps, names="s").words()[0])
    inner(s, s)/2 + inner(s, x)
    """
    if not isinstance(thing, Law):
        if not variables:
            raise InputError("partial_conjugate takes an expression and the variables of the supremum, or a Law")
        return conjugate(_potential(thing), _duals(variables, names))
    if variables:
        raise InputError(
            "the partial conjugate of a law is taken in its first slot; give the variables for an expression only"
        )
    if _checked(potential) == "energy":
        dual = sym_tensor(names or ("sig_r" if thing.observable in thing.forces else "sig"))
        return conjugate(Extended(thing.energy), {thing.observable: dual})
    phi, duals = dissipation_pair(thing)[0], _rate_slots(thing)
    first = next(iter(duals))
    return conjugate(phi, {first: duals[first]})


def total_conjugate(thing: Any, *variables: Any, names: str | None = None, potential: str = "dissipation") -> Conjugate:
    """Supremum in all slots: of an expression in the given variables; of a `Law`, of its force function.

    With `potential="dissipation"`: φ from φ* (or φ* from φ, whichever was declared) over every slot; with `potential="energy"`: of ρψ in
    the observable and all internal variables. y ∈ ∂F(x) is x ∈ ∂F*(y) in every slot, with the same sign. Source: Rockafellar 1970, §23.

    >>> from fenchel.potentials import dev, forces, indicator, norm, parameter, sym_tensor
    >>> A, c = forces(sym_tensor("x"), names="A"), parameter("c", lower=0)
    >>> print(total_conjugate(indicator(norm(dev(A)) - c), A).words()[0])
    c*norm(dev(dx/dt)) if tr(dx/dt) = 0, else +oo
    """
    if not isinstance(thing, Law):
        if not variables:
            raise InputError("total_conjugate takes an expression and its variables, or a Law")
        return conjugate(_potential(thing), _duals(variables, names))
    if _checked(potential) == "energy":
        return conjugate(Extended(thing.energy), _duals((thing.observable, *thing.internal), names))
    declared = thing.phi if thing.phi is not None else thing.phi_star
    if declared is None:
        raise DeclarationError(f"law '{thing.name}' has no force function; it is elastic")
    return conjugate(declared, {s: dual_of(s, thing) for s in slots_of(thing)})


def _checked(potential: str) -> str:
    if potential not in POTENTIALS:
        raise InputError(f"potential {potential!r} is not known; it is one of {', '.join(POTENTIALS)}")
    return potential


def _potential(thing: Any) -> Extended:
    return as_extended(thing, "the function to be conjugated")


def slots_of(law: Law) -> tuple[Any, ...]:
    """Arguments of the declared φ* (or φ), in the order observable, internal variables, temperature."""
    order = (law.observable, *law.internal, *((law.temperature,) if law.temperature is not None else ()))
    return tuple(law.forces[v] for v in order if v in law.forces)


def _rate_slots(law: Law) -> dict[Any, Any]:
    """Rate of each slot and the force that is its dual."""
    return {s if s.role == "rate" else dual_of(s): dual_of(s, law) if s.role == "rate" else s for s in slots_of(law)}


def dissipation_pair(law: Law) -> tuple[Extended, Extended]:
    """(φ, φ*): one declared, the other by rule; `DeclarationError` where it has no closed form."""
    other = total_conjugate(law).extended()
    return (law.phi, other) if law.phi is not None else (other, law.phi_star)


def dual_of(slot: Any, law: Law | None = None) -> Any:
    """The symbol that a slot of φ or φ* is paired with; the force of the observable of a law is called sig_ir."""
    variable = slot.variable
    if law is not None and variable == law.observable and slot.role == "rate":
        return forces(variable, names="sig_ir")
    if isinstance(variable, Temperature):
        return entropy_flux(variable) if slot.role == "force" else gradient(variable)
    return rates(variable) if slot.role == "force" else forces(variable)


def _duals(variables: Iterable[Any], names: str | None) -> dict[Any, Any]:
    order = tuple(variables)
    words: list[str | None] = [None] * len(order) if names is None else list(names.split())
    if len(words) != len(order):
        raise InputError(f"{len(words)} names for {len(order)} variables")
    found = {}
    for variable, word in zip(order, words, strict=True):
        paired = isinstance(variable, (ForceTensor, ForceVector, ForceScalar, RateTensor, RateVector, RateScalar))
        if word is None and paired:
            found[variable] = dual_of(variable)
            continue
        if not paired and not is_variable(variable) and not isinstance(variable, (Ranked, Symbol)):
            raise DeclarationError(f"a conjugate is taken in variables, forces or rates, not in {variable}")
        name = checked_name(word or f"{variable.name}_star", "dual")
        if isinstance(variable, TensorSymbol):
            found[variable] = sym_tensor(name)
        elif isinstance(variable, VectorSymbol):
            found[variable] = vector(name)
        elif isinstance(variable, ScalarVariable):
            found[variable] = ScalarVariable(name)
        else:
            raise DeclarationError(f"a conjugate is taken in variables, forces or rates, not in {variable}")
    return found


# -- what a law asks for -------------------------------------------------------------------------------------------------------------


def conjugate_of_stress_potential(law: Law) -> tuple[Conjugate, dict[Any, Any]]:
    """Conjugate of ρψ*(σ) at ε, without the terms σ:x of internal tensors, and the table that puts ε − Σ x in the place of ε."""
    stress, declared = law.stress_symbol, law.psi_star
    assert stress is not None and declared is not None
    kept, strain = [], law.observable
    for term in Add.make_args(expand_mul(declared if law.density is None else law.density * declared, deep=False)):
        leaf = next((f for f in Mul.make_args(term) if isinstance(f, InnerLeaf) and stress in f.args), None)
        other = None if leaf is None else leaf.args[leaf.args[0] == stress]
        weight = term / leaf if leaf is not None else S.One
        if other is None or mentions(other, {stress}) or mentions(weight, (stress, *law.internal)):
            kept.append(term)
        else:
            strain = strain - other * weight
    return conjugate(Extended(Add(*kept)), {stress: law.observable}), {law.observable: strain}


def energy_from_conjugate(law: Law) -> Any:
    """ρψ [J/m³] of a law declared by ψ*: sup over σ of σ:ε − ρψ*(σ), at fixed internal variables and temperature."""
    found, table = conjugate_of_stress_potential(law)
    if not found.closed:
        raise DeclarationError(
            f"law '{law.name}': no closed conjugate is known for psi_star ({found.missing or 'it is a minimum'}); declare psi instead"
        )
    if found.domain or found.equalities or not found.has_gradient:
        raise DeclarationError(
            f"law '{law.name}': the psi of this psi_star is infinite outside {found.words()[0].partition(' if ')[2] or 'a set'}; "
            "a free energy is finite, add a compliance to psi_star or declare psi"
        )
    return found.expression.xreplace(table)


def force_potential_from_rates(law: Law) -> Extended | None:
    """φ* of a law declared by φ, over its forces; None where no closed form is known."""
    if law.phi is None:
        return law.phi_star
    found = total_conjugate(law)
    if not found.closed or not found.has_gradient:
        return None
    return found.extended()
