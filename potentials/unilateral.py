"""Numbers of the unilateral energy and of its conjugate, at many points at once (numpy, imported when called).

    ψ(ε)  = λ/2 ⟨tr ε⟩² + μ ε^≥:ε^≥,
    ψ*(σ) = I{σ ⪰ 0} + min over 0 ≤ y ≤ σ_min of y²/2λ + ‖σ − y I‖²/4μ,   y* = min(σ_min, λ tr σ/(2μ + 3λ)).

ψ*, the infimal convolution of the conjugates of its two terms, is convex and lower semicontinuous but not differentiable: the strain of
wires that stand alone is not a function of their stress. For λ = 0, y* = 0 and ψ* = σ:σ/4μ on σ ⪰ 0.
"""

from __future__ import annotations

from typing import Any

from ..errors import InputError

__all__ = ["unilateral_conjugate", "unilateral_energy"]


def unilateral_energy(strain: Any, lam: float, mu: float) -> Any:
    """ψ [J/m³] at strains (n, 6) or (6,), Mandel components; shape (n,) or ().

    >>> float(unilateral_energy([-1.0, 0.5, 0.0, 0.0, 0.0, 0.0], 1.0, 0.5))
    0.125
    """
    import numpy as np

    strain, values = _eigenvalues(strain, lam, mu)
    trace = strain[..., :3].sum(axis=-1)
    return 0.5 * lam * np.maximum(trace, 0.0) ** 2 + mu * (np.maximum(values, 0.0) ** 2).sum(axis=-1)


def unilateral_conjugate(stress: Any, lam: float, mu: float, *, rounding: float = 1e-12) -> Any:
    """ψ* [J/m³] at stresses [Pa] (n, 6) or (6,), Mandel components; +∞ where a principal stress is negative.

    A principal stress between −`rounding`·‖σ‖ and 0 counts as zero, so that a computed stress on the boundary of the domain is in it.

    >>> [round(float(unilateral_conjugate([*s, 0, 0, 0], 1.0, 0.5)), 9) for s in ((3, 1, 0.2), (1, 0, 0), (1, 1, -1))]
    [4.26, 0.5, inf]
    """
    import numpy as np

    stress, values = _eigenvalues(stress, lam, mu)
    smallest = values.min(axis=-1)
    outside = smallest < -rounding * np.sqrt((stress * stress).sum(axis=-1))
    values = np.maximum(values, 0.0)
    y = np.minimum(values.min(axis=-1), lam * values.sum(axis=-1) / (2.0 * mu + 3.0 * lam))
    sphere = y * y / (2.0 * lam) if lam > 0.0 else 0.0
    inside = sphere + ((values - y[..., None]) ** 2).sum(axis=-1) / (4.0 * mu)
    return np.where(outside, np.inf, inside)[()]


def _eigenvalues(tensor: Any, lam: float, mu: float) -> tuple[Any, Any]:
    import numpy as np

    from .spectral import eigenvalues

    if not (np.isfinite(lam) and lam >= 0.0 and np.isfinite(mu) and mu > 0.0):
        raise InputError(f"a unilateral energy needs lambda >= 0 and mu > 0, not lambda = {lam:g}, mu = {mu:g}")
    found = np.asarray(tensor, dtype=float)
    if found.ndim not in (1, 2) or found.shape[-1] != 6 or not np.isfinite(found).all():
        raise InputError(f"a tensor has shape {found.shape}; it must be (n, 6) or (6,), finite Mandel components")
    return found, eigenvalues(found)
