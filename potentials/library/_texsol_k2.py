"""TexSol, option K2: sand whose kinematic hardening is deviatoric, and a unilateral wire network at equal strain."""

from __future__ import annotations

from .. import Law
from ._entry import Entry, WorkedValue
from ._sand import sand_energy, sand_values
from ._sand_k2 import deviatoric_domain
from ._symbols import alpha, eps, eps_p, p
from ._wire import wire_energy

texsol_k2 = Law(
    "texsol_k2",
    psi=sand_energy + wire_energy(eps),
    phi_star=deviatoric_domain,
    observable=eps,
    internal=(eps_p, alpha, p),
    note="sand with unilateral wires, kinematic hardening deviatoric (option K2)",
)

ENTRY = Entry(
    texsol_k2,
    source="Laniel, Alart and Pagano 2008",
    values=sand_values | dict(lambda_w=5e6 / 3, mu_w=2.5e6),
    worked=WorkedValue(
        eps=(2e-4, 1e-4, -15e-4, 0, 0, 2**0.5 * 3e-4),
        stress=(-4523.375826145201, -5351.6599214677935, -13580.11329501274, 0, 0, 3514.1118033094153),
        source="closed form: the stress of `sand_k2` plus the stress of `wire`, both at this strain",
        state=dict(p=0.0010900302903128528),
    ),
)
