"""The three models that the study compares, and the stress of their wires.

sand: no wires; reinforced: wires that resist both ways, σ_w = λ_w (tr ε) I + 2μ_w ε; texsol: wires that resist extension only,
σ_w = λ_w ⟨tr ε⟩ I + 2μ_w ε^≥. The strain is shared, the stresses add.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..potentials import Law, inner, pos, tr
from ..potentials.derivative import partial
from ..potentials.evaluate import evaluate
from ..potentials.library import reinforced_sand, sand, texsol

__all__ = ["MODELS", "SETS", "equivalent_stress", "model_values", "wire_stress"]

Array = NDArray[np.float64]

MODELS: dict[str, Law] = {"sand": sand, "reinforced": reinforced_sand, "texsol": texsol}

_COMMON = dict(nu_s=0.2, nu_w=0.2, C_0=2842.0)
_TABLE_3 = _COMMON | dict(E_s=12.167e6, E_w=0.332e6, theta_f=0.079, H_k=0.944e6, H_i=0.472e6)
SETS: dict[str, dict[str, float]] = {
    "table 3": _TABLE_3,  # means over the five pressures of the study
    "frictional": _TABLE_3 | dict(theta_f=0.3),  # friction nearer to that of a sand that fails
    "low cohesion": _TABLE_3 | dict(theta_f=0.3, C_0=500.0),  # flows early, and dilates
    "stiff": _TABLE_3 | dict(E_s=12e6, E_w=6e6),
    "demo_stiff": _COMMON | dict(E_s=12e6, E_w=6e6, theta_f=0.3, H_k=2e6, H_i=0.05e6),
}  # Pa, rad


def model_values(law: Law, values: Mapping[str, float]) -> dict[str, float]:
    """The values that this model has parameters for; E_w and nu_w [Pa, -] are turned into lambda_w and mu_w."""
    found = dict(values)
    if "E_w" in found:
        young, poisson = found.pop("E_w"), found.pop("nu_w", found.get("nu_s", 0.2))
        found["lambda_w"] = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
        found["mu_w"] = young / (2 * (1 + poisson))
    names = {p.name for p in law.parameters}
    return {k: v for k, v in found.items() if k in names}


def wire_stress(model: str, strain: Array, values: Mapping[str, float]) -> Array:
    """Stress of the wires [Pa] (n, 6) of a model at strains (n, 6), Mandel components."""
    law = MODELS[model]
    symbols = {p.name: p for p in law.parameters}
    if model == "sand":
        return np.zeros_like(strain)
    eps = law.observable
    lam, mu = symbols["lambda_w"], symbols["mu_w"]
    if model == "texsol":
        energy = lam / 2 * pos(tr(eps)) ** 2 + mu * inner(pos(eps), pos(eps))
    else:
        energy = lam / 2 * tr(eps) ** 2 + mu * inner(eps, eps)
    found: dict[Any, Any] = {symbols[k]: v for k, v in model_values(law, values).items()}
    return evaluate(partial(energy, eps), {**found, eps: strain})


def equivalent_stress(stress: Array) -> Array:
    """√J₂ = ‖dev σ‖/√2 [Pa], the study's "equivalent stress", (n,)."""
    mean = stress[:, :3].mean(axis=1, keepdims=True)
    deviator = stress - mean * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    return np.sqrt(0.5 * (deviator * deviator).sum(axis=1))
