"""Partial Legendre–Fenchel conjugate of ψ in its observable, by rule.

    ½ e:𝕂e, e = ε − x             ↦  ½ σ:𝕂⁻¹σ + σ:x
    ψ(ε) + h(X)                    ↦  ψ*(σ) − h(X)
    λ/2 ⟨tr ε⟩² + μ ε^≥:ε^≥         ↦  y*²/2λ + ‖σ − y* I‖²/4μ on σ ⪰ 0, y* = min(σ_min, λ tr σ/(2μ+3λ))
    ψ_s(ε) + ψ_w(ε)  (in parallel)  ↦  min over σ_s + σ_w = σ of ψ_s* + ψ_w*

What no rule covers is refused with the term that is in the way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Expr, S, factor, latex, sstr

from ..errors import DeclarationError
from .energy_terms import sort_energy
from .invariants import inner, tr
from .law import Law
from .tensor import SymmetricTensor, TensorSymbol, sym_tensor
from .unilateral import unilateral_conjugate

__all__ = ["Phase", "StressPotential", "partial_conjugate"]


@dataclass(frozen=True)
class Phase:
    """One phase of a parallel assembly: its stress, its conjugate where closed as an expression, else as text and LaTeX with its domain."""

    stress: TensorSymbol
    energy: Expr | None
    text: str
    tex: str
    shift: SymmetricTensor | None = None
    moduli: tuple[Expr, Expr] = (S.Zero, S.Zero)

    def value(self, stress: Any, **values: float) -> Any:
        """ψ* of this phase [J/m³] at the stresses [Pa] (n, 6), Mandel components, in its own strain (without σ:x); `values` by name."""
        import numpy as np

        table = {s: float(values[s.name]) for e in self.moduli for s in e.free_symbols}  # type: ignore[attr-defined]
        lam, mu = (float(e.xreplace(table)) for e in self.moduli)
        if self.energy is None:
            return unilateral_conjugate(stress, lam, mu)
        sig = np.asarray(stress, dtype=float)
        trace = sig[..., :3].sum(axis=-1)
        return (sig * sig).sum(axis=-1) / (4 * mu) - lam * trace**2 / (4 * mu * (2 * mu + 3 * lam))


@dataclass(frozen=True)
class StressPotential:
    """ψ* = min over phases − `internal`; with one phase, its stress is the whole stress."""

    phases: tuple[Phase, ...]
    internal: Expr


def partial_conjugate(law: Law) -> StressPotential:
    """ψ*(σ, X) at fixed internal variables; `DeclarationError` says which term has no rule."""
    terms = sort_energy(law)
    rule = f"law '{law.name}': the stress formulation is not available"
    if terms.rest:
        raise DeclarationError(f"{rule}: no conjugate is known for the term {terms.rest[0]}")
    eps = law.observable
    internal: Expr = S.Zero
    shifted: list[tuple[SymmetricTensor, Expr, Expr]] = []
    own: tuple[Expr, Expr] | None = None
    for tensor, (lam, mu) in terms.quadratic.items():
        if not tensor.has(eps):
            internal += lam / 2 * tr(tensor) ** 2 + mu * inner(tensor, tensor)
        elif tensor == eps:
            own = (lam, mu)
        elif tensor.terms().get(eps) == 1 and mu != 0:
            shifted.append((eps - tensor, lam, mu))
        else:
            raise DeclarationError(
                f"{rule}: the quadratic term in {tensor} is neither of eps - x nor of internal variables alone"
            )
    for weight, variable in terms.scalars:
        internal += weight * variable**2
    if len(shifted) > 1:
        raise DeclarationError(f"{rule}: psi holds {len(shifted)} energies of the kind eps - x; one is known")
    wires = _unilateral(terms.positive, terms.spectral, eps, rule)
    found: list[tuple[str, tuple[Expr, Expr], SymmetricTensor | None, bool]] = []
    if shifted:
        found.append(("s", shifted[0][1:], shifted[0][0], False))
    if own is not None:
        found.append(("w" if shifted else "s", own, None, False))
    if wires is not None:
        found.append(("w" if own is None else "u", wires, None, True))
    if not found:
        raise DeclarationError(f"{rule}: psi does not depend on {eps}")
    phases = []
    for suffix, (lam, mu), shift, unilateral in found:
        stress = sym_tensor("sig" if len(found) == 1 else f"sig_{suffix}")
        phases.append(_wire_phase(stress, lam, mu) if unilateral else _hooke_phase(stress, lam, mu, shift))
    return StressPotential(tuple(phases), internal)


def _unilateral(
    positive: list[tuple[Expr, Expr]], spectral: list[tuple[Expr, SymmetricTensor]], eps: TensorSymbol, rule: str
) -> tuple[Expr, Expr] | None:
    if not positive and not spectral:
        return None
    if len(spectral) != 1 or len(positive) > 1 or spectral[0][1] != eps or (positive and positive[0][1] != tr(eps)):
        raise DeclarationError(
            f"{rule}: the conjugate of a unilateral energy is known for λ/2 pos(tr(eps))**2 + μ inner(pos(eps), pos(eps))"
        )
    return (2 * positive[0][0] if positive else S.Zero), spectral[0][0]


def _hooke_phase(stress: TensorSymbol, lam: Expr, mu: Expr, shift: SymmetricTensor | None) -> Phase:
    energy = (
        factor(1 / (4 * mu)) * inner(stress, stress) - factor(lam / (4 * mu * (2 * mu + 3 * lam))) * tr(stress) ** 2
    )
    if shift is not None:
        energy = energy + inner(stress, shift)
    return Phase(stress, energy, sstr(energy), latex(energy), shift, (lam, mu))


def _wire_phase(stress: TensorSymbol, lam: Expr, mu: Expr) -> Phase:
    s, tex = sstr(stress), latex(stress)
    l, m, lt, mt = sstr(lam), sstr(mu), latex(lam), latex(mu)
    if lam == 0:
        return Phase(
            stress,
            None,
            f"inner({s}, {s})/(4*{m}) if {s} >= 0 (semidefinite), else +oo",
            rf"\frac{{{tex}:{tex}}}{{4{mt}}} + I_{{\mathbb{{S}}_+}}({tex})",
            moduli=(lam, mu),
        )
    text = (
        f"y**2/(2*{l}) + inner({s} - y*I, {s} - y*I)/(4*{m}), y = min(smallest eigenvalue of {s}, {l}*tr({s})/(2*{m} + 3*{l})), "
        f"if {s} >= 0 (semidefinite), else +oo; for {l} = 0, y = 0 and its term is absent"
    )
    formula = (
        rf"I_{{\mathbb{{S}}_+}}({tex}) + \frac{{y^2}}{{2{lt}}} + \frac{{\|{tex} - y \boldsymbol{{I}}\|^2}}{{4{mt}}},\quad "
        rf"y = \min\left(\lambda_{{min}}({tex}), \frac{{{lt}\,\mathrm{{tr}}\,{tex}}}{{2{mt} + 3{lt}}}\right)"
    )
    return Phase(stress, None, text, formula, moduli=(lam, mu))
