"""Elastic moduli of the two phases at one common Poisson ratio.

With differences Δσ from the start of the test, the phases obey

    Δσ_s = E_s C(ν) ε,     C(ν) ε = (λ tr ε I + 2μ ε)/E,
    Δσ_w = E_w (λ ⟨tr ε⟩ I + 2μ ε^≥)/E      (unilateral; bilateral: Δσ_w = E_w C(ν) ε),

λ/E = ν/((1+ν)(1−2ν)), 2μ/E = 1/(1+ν). For fixed ν each modulus is a least-squares quotient E(ν) = ⟨m, Δσ⟩/⟨m, m⟩ with m the
unit-modulus response, and ν minimises the sum of the *relative* misfits Σ‖Δσ − E m‖²/Σ‖Δσ‖² of the phases: each residual
is divided by the stress of its own phase, else the wires, a hundred times softer, would not count.

Source: Laniel, Alart and Pagano (c. 2008), section on identification; the shared strain is their assumption.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .curves import Curves, by_pressure
from .options import IdentifyOptions

__all__ = ["ElasticFit", "elastic_moduli", "unit_hooke", "unit_wire"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ElasticFit:
    """Moduli [Pa] at a common Poisson ratio [-]; misfits are rms residual / rms stress of the phase in its window."""

    strain: str
    nu: float
    E_s: float
    E_w: float
    E_w_bilateral: float
    misfit_sand: float
    misfit_wire: float
    misfit_wire_bilateral: float
    nu_sand_alone: float
    nu_at_bound: bool
    E_s_by_pressure: dict[float, float]
    E_w_by_pressure: dict[float, float]
    frames_sand: int
    frames_wire: int


def unit_hooke(strain: Array, nu: float) -> Array:
    """Stress of an isotropic solid of Young modulus one; Mandel, shape (..., 6)."""
    out = strain / (1.0 + nu)
    out[..., :3] += nu / ((1.0 + nu) * (1.0 - 2.0 * nu)) * strain[..., :3].sum(axis=-1, keepdims=True)
    return out


def unit_wire(strain: Array, nu: float) -> Array:
    """Stress of the unilateral wire of modulus one, λ⟨tr ε⟩I + 2μ ε^≥ with the spectral positive part; Mandel, (..., 6)."""
    r = np.sqrt(0.5)
    e = strain
    rows = [
        [e[..., 0], r * e[..., 5], r * e[..., 4]],
        [r * e[..., 5], e[..., 1], r * e[..., 3]],
        [r * e[..., 4], r * e[..., 3], e[..., 2]],
    ]
    values, vectors = np.linalg.eigh(np.stack([np.stack(row, axis=-1) for row in rows], axis=-2))
    positive = np.einsum("...ik,...k,...jk->...ij", vectors, np.maximum(values, 0.0), vectors) / (1.0 + nu)
    trace = np.maximum(strain[..., :3].sum(axis=-1), 0.0) * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    out = np.stack([positive[..., i, j] for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))], axis=-1)
    out[..., 3:] *= np.sqrt(2.0)
    out[..., :3] += trace[..., None]
    return out


def _quotient(model: Array, data: Array) -> tuple[float, float]:
    """Best factor E ≥ 0 of `model` to `data` and the relative squared misfit; (0, 1) if the model vanishes, (0, 0)
    without data."""
    square = float(np.sum(data * data))
    norm = float(np.sum(model * model))
    if square == 0.0:
        return 0.0, 0.0
    if norm == 0.0:
        return 0.0, 1.0
    factor = max(float(np.sum(model * data)) / norm, 0.0)
    return factor, float(np.sum((data - factor * model) ** 2)) / square


def _window(tests: Sequence[Curves], window: float, phase: str, own: bool) -> tuple[Array, Array, int]:
    """Strain and stress increment of a phase on the first leg up to `window`, stacked; shape (n, 6) each."""
    strains, stresses = [], []
    for test in tests:
        inside = (test.leg == 0) & (np.abs(test.box_strain - test.box_strain[0]) <= window * (1.0 + 1e-9))
        inside[0] = False  # the reference state itself
        if phase == "sand" and not inside.any():
            raise InputError(
                f"the test at {test.pressure:g} Pa has no frame below an axial strain of {window:g}: "
                "record more frames or widen the elastic window"
            )
        strain = test.strain_wire if (own and phase == "wire") else test.strain
        stress = test.sand if phase == "sand" else test.wire
        strains.append(strain[inside])
        stresses.append((stress - stress[0])[inside])
    return np.concatenate(strains), np.concatenate(stresses), sum(map(len, strains))


def _minimise(function, low: float, high: float) -> tuple[float, bool]:
    """Minimiser on [low, high] of a smooth function (grid, then golden section); whether it sits at an end."""
    from scipy.optimize import minimize_scalar

    grid = np.linspace(low, high, 50)
    best = int(np.argmin([function(float(x)) for x in grid]))
    a, b = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    result: Any = minimize_scalar(function, bounds=(a, b), method="bounded", options={"xatol": 1e-9})
    found = float(result.x)
    at_end = min(found - low, high - found) < 1e-5
    if at_end:
        found = low if found - low < high - found else high
    return found, at_end


def elastic_moduli(tests: Sequence[Curves], options: IdentifyOptions, *, strain: str | None = None) -> ElasticFit:
    """E_s, E_w and the common ν from the starts of the tests; per pressure and pooled.

    `strain`: "shared" or "own", default `options.strain`. A control without wire stress gives E_w = 0 and ν from the sand.
    Raises `InputError` when a test has no frame in the elastic window.
    """
    choice = strain or options.strain
    own = choice == "own"
    eps_s, sig_s, count_s = _window(tests, options.window_sand, "sand", own)
    eps_w, sig_w, count_w = _window(tests, options.window_wire, "wire", own)

    def misfit(nu: float) -> float:
        return _quotient(unit_hooke(eps_s, nu), sig_s)[1] + _quotient(unit_wire(eps_w, nu), sig_w)[1]

    nu, at_bound = _minimise(misfit, *options.poisson_bounds)
    alone, _ = _minimise(lambda x: _quotient(unit_hooke(eps_s, x), sig_s)[1], *options.poisson_bounds)
    E_s, relative_s = _quotient(unit_hooke(eps_s, nu), sig_s)
    E_w, relative_w = _quotient(unit_wire(eps_w, nu), sig_w)
    bilateral, relative_b = _quotient(unit_hooke(eps_w, nu), sig_w)
    if not E_s > 0.0:
        raise InputError(
            "the sand shows no stiffness in the elastic window: check the signs and the window of the test"
        )
    sand, wire = {}, {}
    for level, group in by_pressure(tests).items():
        e, s, _ = _window(group, options.window_sand, "sand", own)
        sand[level] = _quotient(unit_hooke(e, nu), s)[0]
        e, s, _ = _window(group, options.window_wire, "wire", own)
        wire[level] = _quotient(unit_wire(e, nu), s)[0]
    return ElasticFit(
        strain=choice,
        nu=nu,
        E_s=E_s,
        E_w=E_w,
        E_w_bilateral=bilateral,
        misfit_sand=relative_s**0.5,
        misfit_wire=relative_w**0.5,
        misfit_wire_bilateral=relative_b**0.5,
        nu_sand_alone=alone,
        nu_at_bound=at_bound,
        E_s_by_pressure=sand,
        E_w_by_pressure=wire,
        frames_sand=count_s,
        frames_wire=count_w,
    )
