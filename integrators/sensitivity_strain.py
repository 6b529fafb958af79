"""Derivatives of the stress of an energy of the strain alone, ∂ψ_0/∂ε, by strain and parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Lambda

from ..errors import DeclarationError
from ..potentials import Law
from ..potentials.derivative import partial, second_derivative
from ..potentials.evaluate import evaluate
from ..potentials.scalars import ScalarVariable
from .sensitivity_answer import positive_parts
from .sensitivity_faces import times
from .strain_energy import operator_matrices

__all__ = ["add_declared_energy", "add_unilateral_energies"]

Array = NDArray[np.float64]


def add_unilateral_energies(
    stress: Array, eps: Array, d_eps: Array, c: Array, dc: Array, start: int, traces: int, spectral: int
) -> None:
    """Add to dσ (p, 6, K) those of w⟨a tr ε + s⟩² and w tr⟨a ε + s I⟩², coefficients from place `start`."""
    place = start + 2
    trace = eps[:, :3].sum(axis=1)
    d_trace = d_eps[:, :3].sum(axis=1)
    for _ in range(traces):
        w, a, s = c[:, place], c[:, place + 1], c[:, place + 2]
        dw, da, ds = dc[:, place], dc[:, place + 1], dc[:, place + 2]
        place += 3
        value = a * trace + s
        moved = a[:, None] * d_trace + da * trace[:, None] + ds
        size = (dw * a[:, None] + w[:, None] * da) * value[:, None] + (w * a)[:, None] * moved
        stress[:, :3] += np.where(value > 0.0, 2.0, 0.0)[:, None, None] * size[:, None, :]
    for _ in range(spectral):
        w, a, s = c[:, place], c[:, place + 1], c[:, place + 2]
        dw, da, ds = dc[:, place], dc[:, place + 1], dc[:, place + 2]
        place += 3
        tensor = a[:, None] * eps
        tensor[:, :3] += s[:, None]
        positive, slope = positive_parts(tensor)
        moved = a[:, None, None] * d_eps
        if da.any():
            moved += eps[:, :, None] * da[:, None, :]
        if ds.any():
            moved[:, :3] += ds[:, None, :]
        stress += 2.0 * (w * a)[:, None, None] * np.matmul(slope, moved)
        stress += times(positive[:, :, None], 2.0 * (dw * a[:, None] + w[:, None] * da)[:, None, :])


def add_declared_energy(stress: Array, law: Law, energy: Any, known: Any, d_eps: Array, columns: list[Any]) -> None:
    """Add to dσ that of any other `energy`; `columns` are the symbols of θ for the first columns.

    ∂/∂θ ∂ψ_0/∂ε is taken as ∂/∂ε ∂ψ_0/∂θ, so that tensors that hold a parameter need no rule of their own.
    """
    count = len(stress)
    matrices = operator_matrices(second_derivative(energy, law.observable, law.observable), known, count)
    stress += np.matmul(matrices, d_eps)
    for k, symbol in enumerate(columns):
        if symbol is None or symbol not in energy.free_symbols:
            continue
        if any(symbol in f.free_symbols for f in energy.atoms(Lambda)):
            raise DeclarationError(
                f"law '{law.name}': psi holds a function of eigenvalues with the parameter '{symbol}'"
            )
        probe: Any = ScalarVariable(f"{symbol.name}_probe_")
        slope = partial(energy.xreplace({symbol: probe}), probe).xreplace({probe: symbol})
        stress[:, :, k] += evaluate(partial(slope, law.observable), known)
