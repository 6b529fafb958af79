"""Reinforced sand: sand and a bilateral wire network at equal strain, ψ = ψ_sand + λ_w/2 (tr ε)² + μ_w ε:ε."""

from __future__ import annotations

from ..invariants import inner, tr
from ..law import Law
from ._sand import sand_domain, sand_energy
from ._symbols import alpha, eps, eps_p, lambda_w, mu_w, p

reinforced_sand = Law(
    "reinforced_sand",
    psi=sand_energy + lambda_w / 2 * tr(eps) ** 2 + mu_w * inner(eps, eps),
    phi_star=sand_domain,
    observable=eps,
    internal=(eps_p, alpha, p),
    note="sand with wires that resist extension and compression alike",
)
