"""The moduli of −ψ*(σ, X), ψ* the conjugate in the strain alone, from those of ψ: the strain is eliminated by a Schur complement.

With ψ = ½ ε:C:ε + ε:(Σ M_k X_k + s₀ I) + ½ Σ X_k:H_kl:X_l − Σ a_k tr X_k + ψ_s, C positive definite,

    −ψ*(σ, X) = −½ τ:C⁻¹:τ + ½ Σ X_k:H_kl:X_l − Σ a_k tr X_k + ψ_s,    τ = σ − Σ M_k X_k − s₀ I,

concave in σ and convex in X, of the same form as ψ: its blocks are −C⁻¹, C⁻¹M_k and H_kl − M_k C⁻¹ M_l. Since forces are the same
derivatives, −∂ψ/∂X = ∂ψ*/∂X (envelope theorem), the steps take these numbers as they take those of ψ and return −ε where they return σ.
Isotropic blocks commute, so deviatoric and spherical parts are numbers. The last block is written H + M − M (C + M)/C: of an energy of
ε − X it vanishes term by term, exactly, and what is left beside it keeps all digits.
"""

from __future__ import annotations

from dataclasses import replace

from sympy import Expr, S, expand

from .structure import Moduli, NoReduction, Pair

__all__ = ["conjugate_moduli"]


def conjugate_moduli(moduli: Moduli, name: str) -> Moduli:
    """Moduli of −ψ*; `NoReduction`, with the reason, where ψ has an energy of the strain alone or no stiffness in the strain."""
    if moduli.alone:
        raise NoReduction(f"law '{name}': psi has an energy of the strain alone that is not quadratic")
    C = _parts(moduli.strain)
    if any(_vanishes(c) for c in C):
        raise NoReduction(f"law '{name}': psi has no stiffness in the strain, its conjugate psi* is not finite")
    n = range(len(moduli.tensors))
    mixed = [_parts(m) for m in moduli.mixed]
    ratios = [(_ratio(m[0], C[0]), _ratio(m[1], C[1])) for m in mixed]
    blocks = [[_pair(*_complements(moduli, k, l)) for l in n] for k in n]
    return replace(
        moduli,
        strain=_pair(-1 / C[0], -1 / C[1]),
        mixed=tuple(_pair(*r) for r in ratios),
        tensors=tuple(tuple(row) for row in blocks),
        stress_0=moduli.stress_0 / C[1],
        force_0=tuple(_tidy(f + r[1] * moduli.stress_0) for f, r in zip(moduli.force_0, ratios, strict=True)),
    )


def _parts(pair: Pair) -> Pair:
    """Deviatoric and spherical part of c₀ 𝕀 + c₁ I⊗I."""
    return pair[0], pair[0] + 3 * pair[1]


def _pair(deviatoric: Expr, spherical: Expr) -> Pair:
    return deviatoric, (spherical - deviatoric) / 3


def _sum(first: Pair, second: Pair, sign: int) -> Pair:
    return first[0] + sign * second[0], first[1] + sign * second[1]


def _complements(moduli: Moduli, k: int, l: int) -> Pair:
    """H − M_k C⁻¹ M_l in both parts."""
    M, H = moduli.mixed[k], moduli.tensors[k][l]
    # the sign with which X_k stands beside ε
    sign = -1 if all(_vanishes(e) for e in _parts(_sum(H, M, -1))) else 1
    left = _parts(_sum(H, M, sign))
    rest = _parts(_sum(moduli.strain, moduli.mixed[l], sign))
    found = []
    for part in range(2):
        m, c = _parts(M)[part], _parts(moduli.strain)[part]
        found.append(_tidy(left[part]) - sign * m * _tidy(rest[part]) / c)
    return found[0], found[1]


def _ratio(m: Expr, c: Expr) -> Expr:
    if _vanishes(m + c):
        return S.NegativeOne
    return S.One if _vanishes(m - c) else m / c


def _tidy(expression: Expr) -> Expr:
    return S.Zero if _vanishes(expression) else expression


def _vanishes(expression: Expr) -> bool:
    return bool(expression == 0 or expand(expression) == 0)
