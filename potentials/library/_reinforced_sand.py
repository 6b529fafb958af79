"""Reinforced sand: sand and a bilateral wire network at equal strain, ψ = ψ_sand + λ_w/2 (tr ε)² + μ_w ε:ε."""

from __future__ import annotations

from .. import Law, inner, tr
from ._entry import Entry, WorkedValue
from ._sand import sand_domain, sand_energy, sand_values
from ._symbols import alpha, eps, eps_p, lambda_w, mu_w, p

reinforced_sand = Law(
    "reinforced_sand",
    psi=sand_energy + lambda_w / 2 * tr(eps) ** 2 + mu_w * inner(eps, eps),
    phi_star=sand_domain,
    observable=eps,
    internal=(eps_p, alpha, p),
    note="sand with wires that resist extension and compression alike",
)

ENTRY = Entry(
    reinforced_sand,
    source="Laniel, Alart and Pagano 2008",
    values=sand_values | dict(lambda_w=5e6 / 3, mu_w=2.5e6),
    worked=WorkedValue(
        eps=(2e-4, 1e-4, -15e-4, 0, 0, 2**0.5 * 3e-4),
        stress=(-6844.104310196617, -7799.2686628889805, -23081.89830596679, 0, 0, 4052.4191456185745),
        source="closed form: the stress of `sand` at this strain plus λ_w (tr ε) I + 2μ_w ε",
        state=dict(p=0.0010896712946152735),
    ),
)
