"""Unilateral wire network: it resists extension only.

ψ_w = λ_w/2 ⟨tr ε⟩² + μ_w ε^≥:ε^≥, convex, C^{1,1}, positively homogeneous of degree 2. Source: the reference study's unilateral wire
energy.
"""

from __future__ import annotations

from sympy import Expr

from ..invariants import inner, pos, tr
from ..law import Law
from ..tensor import SymmetricTensor
from ._symbols import eps, lambda_w, mu_w


def wire_energy(strain: SymmetricTensor) -> Expr:
    """Unilateral energy of the wires at the given strain."""
    return lambda_w / 2 * pos(tr(strain)) ** 2 + mu_w * inner(pos(strain), pos(strain))


wire = Law("wire", psi=wire_energy(eps), observable=eps, note="unilateral wire network, stress in extension only")
