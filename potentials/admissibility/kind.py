"""How a law dissipates: elastic, rate-independent, viscous; associated or semi-implicit; which variables cannot evolve."""

from __future__ import annotations

from typing import Any

from sympy import Add, Expr

from ..extended import Extended
from ..law import Law
from ..scalars import Temperature
from .convexity import Prover
from .powers import degree_of_homogeneity

__all__ = ["cannot_evolve", "kind_of"]


def cannot_evolve(law: Law) -> tuple[str, ...]:
    """Internal variables whose force (rate) the force function does not mention."""
    return tuple(v.name for v in law.internal if v not in law.forces)


def kind_of(law: Law) -> tuple[str, list[str]]:
    """(elastic | rate-independent | viscous | rate-independent and viscous [, with heat conduction]; notes for the report)."""
    potential, name = (law.phi, "phi") if law.phi is not None else (law.phi_star, "phi_star")
    notes: list[str] = []
    if potential is None:
        kind = "elastic"
    else:
        thermal = {law.forces[v] for v in law.forces if isinstance(v, Temperature)}
        mechanical = [
            t for t in Add.make_args(potential.finite) if t.free_symbols and not (thermal and t.has(*thermal))
        ]
        moved = [v for v in law.forces if not isinstance(v, Temperature)]
        kind = _mechanical(potential, mechanical, [law.forces[v] for v in moved], name == "phi") if moved else "elastic"
        kind += ", with heat conduction" if thermal else ""
    notes.append(f"the law is {kind}")
    if law.frozen:
        shown = ", ".join(v.name for v in law.frozen)
        notes.append(
            f"semi-implicit: {name} depends on the state {shown} frozen at the start of the step; not generalised standard"
        )
    elif potential is not None:
        notes.append("associated: generalised standard, the same potential gives the domain and the flow")
    for variable in cannot_evolve(law):
        what = "its force" if name == "phi_star" else "its rate"
        if law.phi is None and law.phi_star is None:
            notes.append(f"note: '{variable}' cannot evolve, the law has no phi_star")
        else:
            notes.append(f"note: '{variable}' cannot evolve, {name} does not mention {what}")
    return kind, notes


def _mechanical(potential: Extended, finite: list[Expr], symbols: list[Any], rates: bool) -> str:
    if not rates:
        if not potential.surfaces:
            return "viscous"
        return "rate-independent and viscous" if finite else "rate-independent"
    prover = Prover(symbols)
    degrees = {degree_of_homogeneity(prover, t) == 1 for t in finite}
    if degrees <= {True}:
        return "rate-independent"
    return "rate-independent and viscous" if True in degrees or potential.surfaces else "viscous"
