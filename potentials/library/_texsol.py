"""TexSol: sand and a unilateral wire network at equal strain, ψ = ψ_sand + λ_w/2 ⟨tr ε⟩² + μ_w ε^≥:ε^≥."""

from __future__ import annotations

from .. import Law
from ._entry import Entry, WorkedValue
from ._sand import sand_domain, sand_energy, sand_values
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

ENTRY = Entry(
    texsol,
    source="Laniel, Alart and Pagano 2008",
    values=sand_values | dict(lambda_w=5e6 / 3, mu_w=2.5e6),
    worked=WorkedValue(
        eps=(2e-4, 1e-4, -15e-4, 0, 0, 2**0.5 * 3e-4),
        stress=(-4522.10937366983, -5350.572966841211, -13581.898305966792, 0, 0, 3514.873348185941),
        source="closed form: the stress of `sand` plus the stress of `wire`, both at this strain",
        state=dict(p=0.0010896712946152735),
    ),
)
