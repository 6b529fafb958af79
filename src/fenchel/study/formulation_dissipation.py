"""Claim 6: the dissipation of a step is the product of its fluxes and forces, in both splits and in the strain and the stress form.

    total strain:       D = σ^ir:Δε + Σ A·Δα,              A = −∂ψ/∂α at fixed ε      = +∂ψ*/∂α at fixed σ^r,
    reversible strain:  D = σ^ir:Δε + σ^r:Δε^ir + Σ Â·Δα,  Â = −∂ψ̂/∂α at fixed ε^r   = +∂ψ̂*/∂α at fixed σ^r,

with ψ̂(ε^r, α) = ψ(ε^r + ε^ir, α), declared anew. The forces of the strain form are state laws; the stress form takes
differences of suprema. The same number comes from the compiled step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..potentials import Law, sym_tensor
from ..potentials.library import ENTRIES, Entry
from ..potentials.table import irreversible_of
from .formulation_states import (
    Array,
    Numbers,
    corners,
    difference,
    dot,
    from_kinks,
    is_one_sided,
    magnitude,
    size_of,
    supremum,
    warmth,
)

__all__ = ["dissipations", "reversible_law"]


def reversible_law(law: Law) -> Law:
    """The same energy with the reversible strain ε^r = ε − ε^ir as its observable; the internal variables keep their names."""
    eps_r = sym_tensor("eps_r")
    whole = eps_r
    for variable in irreversible_of(law):
        whole = whole + variable
    psi = law.energy.xreplace({law.observable: whole}).doit()
    return Law(f"{law.name}_reversible", psi=psi, observable=eps_r, internal=law.internal)


class _Steps:
    """Rows of converged steps of a law: states before and after, strains, stresses, dissipation."""

    def __init__(self, entry: Entry, rng: np.random.Generator, paths: int, steps: int) -> None:
        law, dt = entry.law, entry.worked.dt
        strains = np.stack([corners(entry, rng, 3, steps) for _ in range(paths)], axis=1)
        update = law.compile()
        state, before, rows = update.initial_state(paths), np.zeros((paths, 6)), []
        for strain in strains:
            out = update(strain, state, dt, **entry.values, **warmth(law))
            rows.append((strain, strain - before, state, out))
            state, before = out.state, strain
        self.entry, self.law, self.numbers = entry, law, Numbers(law, entry.values)
        self.rates = {law.observable.name: np.concatenate([r[1] for r in rows])}
        self.state = {law.observable.name: np.concatenate([r[0] for r in rows])}
        self.state |= {k: np.full(len(strains) * paths, v) for k, v in warmth(law).items()}
        for v in law.internal:
            self.state[v.name] = np.concatenate([r[3].state[v.name] for r in rows])
            self.rates[v.name] = self.state[v.name] - np.concatenate([r[2][v.name] for r in rows])
        self.stress = np.concatenate([r[3].stress for r in rows])
        self.lost = np.concatenate([r[3].dissipation for r in rows])
        self.strain, self.reversible = self.state[law.observable.name], self.numbers.stress(self.state)
        forces = [np.abs(dot(self.numbers.force(v, self.state), self.state[v.name])) for v in law.internal]
        self.scale = size_of(self.stress) * size_of(self.strain) + sum(forces, 0.0 * self.lost)

    def viscous(self) -> Array:
        """σ^ir:Δε."""
        return dot(self.stress - self.reversible, self.rates[self.law.observable.name])

    def products(self, numbers: Numbers, state: Mapping[str, Array]) -> Array:
        """Σ A·Δα of a declaration of the energy."""
        return sum((dot(numbers.force(v, state), self.rates[v.name]) for v in self.law.internal), 0.0 * self.lost)

    def differences(self, numbers: Numbers, state: Mapping[str, Array], rows: Any) -> Array:
        """Slope of ψ* along the change of the internal variables, at fixed stress."""
        here, stress = {k: v[rows] for k, v in state.items()}, self.reversible[rows]
        change = {v.name: self.rates[v.name][rows] for v in self.law.internal}
        size = np.sqrt(sum(size_of(d) ** 2 for d in change.values())) + 1e-300
        unit = 4e-3 * magnitude(self.entry)

        def along(t: float) -> Array:
            moved = {k: here[k] + unit * t * (d.T / size).T for k, d in change.items()}
            return supremum(numbers, stress, {**here, **moved}, here[numbers.law.observable.name])[0]

        return difference(along, 0.25) * size / unit


def _law(entry: Entry, rng: np.random.Generator, paths: int, steps: int) -> dict[str, float]:
    found = _Steps(entry, rng, paths, steps)
    law = entry.law
    second = Numbers(reversible_law(law), entry.values)
    irreversible = sum((found.state[v.name] for v in irreversible_of(law)), 0.0 * found.strain)
    flow = sum((found.rates[v.name] for v in irreversible_of(law)), 0.0 * found.strain)
    other = {**found.state, "eps_r": found.strain - irreversible}
    viscous, work = found.viscous(), dot(second.stress(other), flow)
    total = viscous + found.products(found.numbers, found.state)
    reversible = viscous + work + found.products(second, other)
    scale = found.scale + 1e-300

    def worst(a: Array, b: Array, among: Any = slice(None)) -> float:
        return float(np.nan_to_num(np.abs(a - b) / scale[among], nan=np.inf).max(initial=0.0))

    rows = np.arange(len(scale))[steps - 1 :: steps] if law.internal else np.arange(0)
    if is_one_sided(found.numbers, found.state):
        rows = rows[(from_kinks(found.strain) > 0.02 * magnitude(entry))[rows]]
    by_stress = (
        [
            viscous[rows] + found.differences(found.numbers, found.state, rows),
            (viscous + work)[rows] + found.differences(second, other, rows),
        ]
        if rows.size
        else []
    )
    return {
        "blocks": worst(total, reversible),
        "step": worst(total, found.lost),
        "stress form": max((worst(total[rows], d, rows) for d in by_stress), default=0.0),
        "least": float((np.minimum(np.minimum(total, reversible), found.lost) / scale).min()),
        "dissipating": float((found.lost > 1e-6 * scale).mean()),
        "expects": float(bool(law.internal) or law.observable in law.forces),
        "rows": len(scale),
    }


def dissipations(seed: int, paths: int, steps: int) -> dict[str, Any]:
    """Claim 6 for every law of the library, along `paths` random paths of 3 straight pieces of `steps` steps."""
    rng = np.random.default_rng(seed)
    found = {name: _law(entry, rng, paths, steps) for name, entry in ENTRIES.items()}
    flowing = [f for f in found.values() if f["expects"]]
    numbers = {key: max(f[key] for f in found.values()) for key in ("blocks", "step", "stress form")}
    numbers |= {
        "negative": -min(f["least"] for f in found.values()),
        "idle": max(f["dissipating"] for f in found.values() if not f["expects"]),
        "flowing": min(f["dissipating"] for f in flowing),
        "laws": len(found),
        "steps": int(sum(f["rows"] for f in found.values())),
    }
    return {"numbers": numbers, "by law": found}
