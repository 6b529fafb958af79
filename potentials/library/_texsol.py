"""TexSol: sand and a unilateral wire network at equal strain, ψ = ψ_sand + λ_w/2 ⟨tr ε⟩² + μ_w ε^≥:ε^≥."""

from __future__ import annotations

from ..law import Law
from ._sand import sand_domain, sand_energy
from ._symbols import alpha, eps, eps_p, p
from ._wire import wire_energy

texsol = Law(
    "texsol",
    psi=sand_energy + wire_energy(eps),
    phi_star=sand_domain,
    observable=eps,
    internal=(eps_p, alpha, p),
    note="sand with wires that resist extension only",
)
