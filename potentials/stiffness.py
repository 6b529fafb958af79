"""Isotropic stiffness 𝕂 = λ I⊗I + 2μ 𝕀 from Young's modulus and Poisson ratio."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Expr

from .extended import scalar_expression
from .invariants import inner, tr
from .tensor import SymmetricTensor, identity

__all__ = ["IsotropicStiffness", "isotropic", "lame"]


@dataclass(frozen=True)
class IsotropicStiffness:
    """𝕂: e ↦ λ (tr e) I + 2μ e; positive definite for E > 0, −1 < ν < 1/2."""

    lam: Expr
    mu: Expr

    @property
    def bulk(self) -> Expr:
        """K = λ + 2μ/3."""
        return self.lam + 2 * self.mu / 3

    def energy(self, strain: SymmetricTensor) -> Expr:
        """½ e:𝕂e = λ/2 (tr e)² + μ e:e."""
        return self.lam / 2 * tr(strain) ** 2 + self.mu * inner(strain, strain)

    def stress(self, strain: SymmetricTensor) -> SymmetricTensor:
        """𝕂e."""
        return identity * (self.lam * tr(strain)) + strain * (2 * self.mu)


def lame(E: Any, nu: Any) -> tuple[Expr, Expr]:
    """(λ, μ) = (Eν/((1+ν)(1−2ν)), E/(2(1+ν)))."""
    remedy = "write a number or an expression in parameters"
    young, poisson = scalar_expression(E, "Young's modulus", remedy), scalar_expression(nu, "Poisson's ratio", remedy)
    return young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)


def isotropic(E: Any, nu: Any) -> IsotropicStiffness:
    """Isotropic stiffness of Young's modulus `E` [Pa] and Poisson ratio `nu` [-]."""
    return IsotropicStiffness(*lame(E, nu))
