"""Unilateral wire network: it resists extension only.

ψ_w = λ_w/2 ⟨tr ε⟩² + μ_w ε^≥:ε^≥, convex, C^{1,1}, positively homogeneous of degree 2.
"""

from __future__ import annotations

from sympy import Expr

from .. import Law, inner, pos, tr
from ..tensor import SymmetricTensor
from ._entry import Entry, WorkedValue
from ._symbols import eps, lambda_w, mu_w


def wire_energy(strain: SymmetricTensor) -> Expr:
    """Unilateral energy of the wires at the given strain."""
    return lambda_w / 2 * pos(tr(strain)) ** 2 + mu_w * inner(pos(strain), pos(strain))


wire = Law("wire", psi=wire_energy(eps), observable=eps, note="unilateral wire network, stress in extension only")

ENTRY = Entry(
    wire,
    source="Laniel, Alart and Pagano 2008",
    values=dict(lambda_w=5e6 / 3, mu_w=2.5e6),
    worked=WorkedValue(
        eps=(2e-4, 1e-4, -15e-4, 0, 0, 2**0.5 * 3e-4),
        stress=(1321.9949365267864, 948.6956960477687, 0, 0, 0, 1583.7745461270085),
        source="closed form: 2μ_w times the positive part of a 2×2 block with eigenvalues (3 ± √37)/2·1e-4",
    ),
)
